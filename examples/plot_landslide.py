#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Draws a run of landslide: the depth on a map of the terrain at four times, and the front.

usage: plot_landslide.py DIR

Reads DIR/summary.json, terrain.asc, maps.csv and front.csv; writes DIR/landslide.png. Exits with 1 and
a message if something is missing or cannot be used.
"""
import json
import math

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from plotting import GroundMap, choose_times, colour_bar, read_table, run

WIDTH = 13.0  # inches, at 100 dots each
LEFT, RIGHT, GAP = 1.1, 1.2, 0.5


def draw(folder):
    with open(folder / "summary.json") as file:
        picture = json.load(file)["picture"]
    ground = GroundMap(folder)
    front = read_table(folder / "front.csv", ["time_s", "front_m", "speed_m_s", "speed_max_m_s"])
    times = choose_times(ground.times, None, 4)
    columns = 1 if ground.ratio < 0.2 else 2 if ground.ratio < 1.2 else 4
    rows = math.ceil(len(times) / columns)
    width = (WIDTH - LEFT - RIGHT - GAP * (columns - 1)) / columns
    map_height, panel = ground.ratio * width, 3.0
    height = 1.25 + rows * (map_height + 0.75) + 0.4 + panel + 0.7
    figure = plt.figure(figsize=(WIDTH, height))

    def axes(left, top, wide, high):
        return figure.add_axes([left / WIDTH, 1 - (top + high) / height, wide / WIDTH, high / height])

    for k, text in enumerate((picture["title"], "   ·   ".join(picture["facts"]))):
        figure.text(0.5, 1 - (0.35 + 0.35 * k) / height, text, ha="center", va="center",
                    fontsize=12 if k else 17, weight="normal" if k else "bold")
    for k, time in enumerate(times):
        row, column = divmod(k, columns)
        place = axes(LEFT + column * (width + GAP), 1.25 + row * (map_height + 0.75), width, map_height)
        image = ground.draw(place, time)
        place.tick_params(labelsize=9, labelleft=column == 0, labelbottom=k + columns >= len(times))
        if column == 0:
            place.set_ylabel("y (m)")
        if k + columns >= len(times):
            place.set_xlabel("x (m)")
    colour_bar(figure, axes(WIDTH - RIGHT + 0.15, 1.25, 0.18, map_height), image, "depth (m)")
    top = 1.25 + rows * (map_height + 0.75) + 0.4
    half = (WIDTH - LEFT - 0.4 - 1.0) / 2
    for k, (curves, label) in enumerate((
            ([("front_m", "99 % of the volume is nearer")], "distance from the start (m)"),
            ([("speed_m_s", "front"), ("speed_max_m_s", "fastest particle")], "speed (m/s)"))):
        place = axes(LEFT + k * (half + 1.0), top, half, panel)
        for (name, text), style in zip(curves, ("-", ":")):
            place.plot(front["time_s"], front[name], style, color="#0072B2", lw=2, label=text)
        place.set(xlabel="time (s)", ylabel=label, ylim=(0, None), xlim=(0, None))
        place.grid(color="0.9")
        place.set_axisbelow(True)
        place.legend(frameon=False)
    return figure, "landslide.png"


if __name__ == "__main__":
    run(__doc__, "summary.json", draw, font_size=12)
