#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Draws the picture that a study describes.

usage: plot_study.py DIR

Reads DIR/picture.json (written by examples/support/picture.hpp), writes DIR/NAME.png.
Exits with 1 and a message if it is missing or cannot be used.
"""
import json

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import matplotlib.ticker
import numpy as np

from plotting import run

# Colours of Okabe and Ito: told apart by colour-blind readers. Black is for what is published.
COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#999999"]
MARKERS = "os^Dv<>"
WIDTH = 14.0  # inches, at 100 dots each


def numbers(values):
    """A list as an array; what is not finite comes as null."""
    return np.array([np.nan if v is None else v for v in values or []], dtype=float)


def draw_curve(axes, curve, colour, marker):
    x, y = numbers(curve["x"]), numbers(curve["y"])
    label = curve["label"]
    if not label or label.endswith(":"):  # not in the legend
        label = None
    kind = curve["kind"]
    if kind == "band":
        axes.fill_between(x, y, numbers(curve["high"]), color=colour, alpha=0.18, lw=0,
                          label=label)
    elif kind == "published":
        axes.errorbar(x, y, numbers(curve["y_error"]), numbers(curve["x_error"]), color="black",
                      marker=marker, mfc="white", ms=8, mew=2, capsize=5, lw=2, ls="none",
                      zorder=5, label=label)
    elif kind == "points":
        error = numbers(curve["y_error"])
        axes.errorbar(x, y, error if error.size else None, color=colour, marker=marker, ms=7,
                      capsize=4, ls="none", label=label)
    else:
        axes.plot(x, y, color="black" if kind == "reference" else colour, lw=2,
                  ls="-" if kind == "line" else "--", label=label)


def draw_panel(axes, panel):
    used = {}  # curves of one name share a colour
    for curve in panel["curves"]:
        name = curve["label"].split(":")[0]
        index = used.setdefault(name, len(used))
        draw_curve(axes, curve, COLOURS[index % len(COLOURS)], MARKERS[index % len(MARKERS)])
    axes.set_title(panel["title"], loc="left", fontsize=13)
    axes.set(xlabel=panel["x"], ylabel=panel["y"])
    if panel["log"]:
        axes.set(xscale="log", yscale="log")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(matplotlib.ticker.LogLocator(subs=(1, 2, 5)))
            axis.set_major_formatter("{x:g}")
            axis.set_minor_formatter(matplotlib.ticker.NullFormatter())
    elif panel["log_y"]:
        axes.set(yscale="log")
    axes.grid(color="0.9")
    axes.set_axisbelow(True)
    handles = dict(zip(*reversed(axes.get_legend_handles_labels())))  # one for each name
    axes.legend(handles.values(), handles.keys(), loc="best", framealpha=0.95, fontsize=11)


def draw(picture):
    panels = picture["panels"]
    columns = min(2, len(panels))
    rows = -(-len(panels) // columns)
    figure, grid = plt.subplots(rows, columns, figsize=(WIDTH, 4.6 * rows + 0.5), squeeze=False,
                                layout="constrained")
    figure.suptitle(picture["title"], fontsize=17, weight="bold")
    for axes in grid.flat[len(panels):]:
        axes.remove()
    for axes, panel in zip(grid.flat, panels):
        draw_panel(axes, panel)
    return figure


def draw_folder(folder):
    picture = json.loads((folder / "picture.json").read_text())
    return draw(picture), picture["name"] + ".png"


if __name__ == "__main__":
    run(__doc__, "picture.json", draw_folder)
