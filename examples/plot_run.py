#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Draws a run of one of the short programs: the flow at a few times, and curves.

usage: plot_run.py DIR

Reads DIR/summary.json and, if they are there, DIR/sections.csv and DIR/energy.csv; writes DIR/PROGRAM.png. In the summary,
"picture" may hold a "title", "facts" (a list of texts), "panels": lists of curves, each with "kind"
(line, dashed or points), "label", "x" and "y", on axes labelled "x" and "y", logarithmic if "log" is true.
Exits with 1 and a message if something is missing or cannot be used.
"""
import json
import math

import matplotlib

matplotlib.use("Agg")
import matplotlib.colors
import matplotlib.ticker
import matplotlib.pyplot as plt
import numpy as np

from plotting import (SectionPicture, at_time, choose_times, energy_panel, read_energy, read_sections,
                      round_ticks, run)

COLOURS = ["#0072B2", "#D55E00", "#009E73", "black"]  # of Okabe and Ito
WIDTH = 12.0  # inches, at 100 dots each
LEFT, RIGHT, GAP = 1.0, 1.25, 0.75


class Picture:
    """One figure, filled from the top with axes placed in inches."""

    def __init__(self, directory):
        with open(directory / "summary.json") as file:
            self.summary = json.load(file)
        self.picture = self.summary.get("picture", {})
        self.energy = read_energy(directory)
        self.images = []
        if (directory / "sections.csv").is_file():
            table = read_sections(directory / "sections.csv")
            times = choose_times(np.unique(table["time_s"]), None, 4)
            self.images = [(t, SectionPicture(at_time(table, t))) for t in times]
            if self.ratio() > 8:  # a column one cell wide shows nothing
                self.images = []

    def axes(self, left, top, width, height):
        return self.figure.add_axes([left / WIDTH, 1 - (top + height) / self.height,
                                     width / WIDTH, height / self.height])

    def ratio(self):
        """Of height and width of the sections."""
        _, image = self.images[0]
        return np.ptp(image.z) / np.ptp(image.x)

    def snapshot_size(self):
        """Columns of the array of snapshots, and width and height of one, inches."""
        ratio = self.ratio()
        room = WIDTH - LEFT - RIGHT
        columns = 1 if ratio < 0.35 else 2 if ratio < 1 else 4
        columns = min(columns, len(self.images))
        width = (room - GAP * (columns - 1)) / columns
        if ratio * width > 5:
            width = 5 / ratio
        return columns, width, ratio * width

    def snapshots(self, top):
        columns, width, height = self.snapshot_size()
        rows = math.ceil(len(self.images) / columns)
        speeds = np.concatenate([image.speed.compressed() for _, image in self.images])
        fastest = max(np.percentile(speeds, 99.8) if speeds.size else 0, 1e-3)
        # A square-root scale: slow creep shows, too.
        norm = matplotlib.colors.PowerNorm(0.5, vmin=0, vmax=fastest, clip=True)
        for k, (time, image) in enumerate(self.images):
            row, column = divmod(k, columns)
            axes = self.axes(LEFT + column * (width + GAP), top + row * (height + 0.6), width, height)
            mesh = image.draw(axes, norm)
            axes.set_title(f"t = {time:.2f} s", fontsize=12)
            axes.xaxis.set_major_locator(matplotlib.ticker.MaxNLocator(4 if columns < 4 else 3))
            axes.yaxis.set_major_locator(matplotlib.ticker.MaxNLocator(5))
            axes.tick_params(labelleft=column == 0)
            if column == 0:
                axes.set_ylabel("z (m)")
            if k + columns >= len(self.images):
                axes.set_xlabel("x (m)")
            else:
                axes.tick_params(labelbottom=False)
        right = LEFT + columns * (width + GAP) - GAP
        bar = self.figure.colorbar(mesh, extend="max",
                                   cax=self.axes(right + 0.2, top, 0.18, min(height, 3.5)))
        bar.set_label("speed (m/s)")
        bar.set_ticks(round_ticks(fastest))
        bar.ax.yaxis.set_major_formatter("{x:g}")
        bar.minorticks_off()

    def panel(self, axes, panel):
        styles = {"line": {"ls": "-", "lw": 2}, "dashed": {"ls": "--", "lw": 1.6},
                  "points": {"ls": "none", "marker": "o", "ms": 7}}
        for curve, colour in zip(panel["curves"], COLOURS):
            axes.plot(curve["x"], curve["y"], color=colour, label=curve["label"],
                      **styles[curve["kind"]])
        if panel.get("log"):
            axes.set(xscale="log", yscale="log")
            for axis in (axes.xaxis, axes.yaxis):
                axis.set_major_locator(matplotlib.ticker.LogLocator(subs=(1, 1.5, 2, 3, 5, 7)))
                axis.set_major_formatter("{x:g}")
                axis.set_minor_formatter(matplotlib.ticker.NullFormatter())
        else:
            axes.set(ylim=(min(0, axes.get_ylim()[0]), None))
        axes.set(xlabel=panel["x"], ylabel=panel["y"])
        axes.grid(color="0.9")
        axes.set_axisbelow(True)
        axes.legend(frameon=False)

    def draw(self):
        panels = self.picture.get("panels", [])
        top = 1.25 if self.picture.get("facts") else 0.8
        panel_height = 3.4
        if self.images:
            top = 1.25  # room for their titles
        below = top
        if self.images:
            columns, _, height = self.snapshot_size()
            below += math.ceil(len(self.images) / columns) * (height + 0.6) + 0.5
        rows = math.ceil(len(panels) / 2)
        energy_top = below + rows * (panel_height + 0.8)
        self.height = energy_top + (0.15 if rows else 0) + (4.2 if self.energy else 0)
        self.figure = plt.figure(figsize=(WIDTH, self.height))
        self.figure.text(0.5, 1 - 0.35 / self.height,
                         self.picture.get("title", self.summary["program"]), ha="center",
                         va="center", fontsize=17, weight="bold")
        self.figure.text(0.5, 1 - 0.70 / self.height,
                         "   ·   ".join(self.picture.get("facts", [])), ha="center", va="center",
                         fontsize=12)
        if self.images:
            self.snapshots(top)
        for k, panel in enumerate(panels):
            row, column = divmod(k, 2)
            alone = len(panels) == 1
            width = (WIDTH - LEFT - 0.4 - (0 if alone else 1.0)) / (1 if alone else 2)
            self.panel(self.axes(LEFT + column * (width + 1.0), below + row * (panel_height + 0.8),
                                 width, panel_height), panel)
        if self.energy:
            energy_panel(self.axes(LEFT, energy_top, WIDTH - LEFT - 4.2, panel_height), self.energy,
                         "J" if self.summary["inputs"]["dimension"] == 3 else "J/m")
        return self.figure


def draw(folder):
    picture = Picture(folder)
    return picture.draw(), picture.summary["program"] + ".png"


if __name__ == "__main__":
    run(__doc__, "summary.json", draw, font_size=12)
