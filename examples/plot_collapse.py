#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Draws a run of the program `collapse`: snapshots, run-out against time, final profile.

usage: plot_collapse.py DIR

Reads summary.json, front.csv, profiles.csv and sections.csv in DIR; writes DIR/collapse.png.
Exits with 1 and a message if one of them is missing or cannot be used.
"""
import json
import math

import matplotlib

matplotlib.use("Agg")
import matplotlib.colors
import matplotlib.lines
import matplotlib.patches
import matplotlib.patheffects
import matplotlib.ticker
import matplotlib.pyplot as plt
import numpy as np

from plotting import SPEED, at_time, choose_times, number, read_sections, read_table, round_ticks, run, section_image

# Colours of Okabe and Ito: told apart by colour-blind readers.
RUN, EXPERIMENT, SIMULATION = "black", "#D55E00", "#0072B2"
SOURCES = [("exp", "experiment", EXPERIMENT, "o"), ("sim", "authors' simulation", SIMULATION, "s")]
GATE = "#333333"
WIDTH = 16.0  # inches, at 100 dots each
CASED = [matplotlib.patheffects.withStroke(linewidth=3.6, foreground="black")]


class Picture:
    """One figure, filled from the top with axes placed in inches."""

    def __init__(self, directory):
        with open(directory / "summary.json") as file:
            try:
                summary = json.load(file)
            except ValueError as error:
                raise ValueError(f"{file.name}: {error}") from error
        self.inputs = summary["inputs"]
        self.measured = summary.get("measured") or {}
        self.published = summary.get("published") or {}
        self.length = self.inputs["column_length_m"]
        self.bed = self.inputs["bed_depth_m"]
        self.top = self.bed + self.inputs["column_height_m"]
        self.front = read_table(directory / "front.csv",
                                ["time_s", "front_m", "runout_m", "gate_height_m"])
        self.profiles = read_table(directory / "profiles.csv",
                                   ["time_s", "x_m", "height_m", "static_height_m"])
        self.sections = read_sections(directory / "sections.csv", number(self.inputs, "profile_y_m"))

        # Show what the flow reached, not the empty rest of the channel.
        domain = self.inputs["domain_m"]
        reached = [self.length, np.nanmax(self.front["front_m"], initial=0)]
        for source, *_ in SOURCES:
            runout = number(self.published, f"runout_{source}_m")
            margin = number(self.published, f"runout_{source}_pm_m") or 0
            if runout is not None:
                reached.append(self.length + runout + margin)
        self.x_max = min(domain[0], 1.06 * max(reached))
        self.z_max = min(domain[-1], 1.15 * max(self.top, np.nanmax(self.profiles["height_m"])))

    def axes(self, left, top, width, height):
        return self.figure.add_axes([left / WIDTH, 1 - (top + height) / self.height,
                                     width / WIDTH, height / self.height])

    def column_outline(self, axes, **style):
        axes.plot([0, self.length, self.length], [self.top, self.top, self.bed], **style)

    def channel_axes(self, axes):
        axes.set(xlim=(0, self.x_max), ylim=(0, self.z_max), aspect="equal")
        axes.yaxis.set_major_locator(matplotlib.ticker.MaxNLocator(3))

    def snapshot(self, axes, time, image, norm):
        fine_x, fine_z, speed = image
        mesh = axes.pcolormesh(fine_x, fine_z, speed, norm=norm, cmap=SPEED, shading="nearest")
        profile = at_time(self.profiles, time)
        axes.plot(profile["x_m"], profile["height_m"], color="black", lw=1.6)
        axes.plot(profile["x_m"], profile["static_height_m"], color="white", lw=1.8,
                  path_effects=CASED)
        self.column_outline(axes, color="0.35", lw=1.3, ls=":")
        gate = at_time(self.front, time)["gate_height_m"][0]
        if gate < self.z_max:
            axes.add_patch(matplotlib.patches.Rectangle(
                (self.length, gate), 0.006 * self.x_max, self.z_max - gate, color=GATE, lw=0,
                zorder=3))
        self.channel_axes(axes)
        axes.text(0.985, 0.92, f"t = {time:.2f} s", transform=axes.transAxes, ha="right",
                  va="top", fontsize=14, weight="bold")
        return mesh

    def gravity(self, axes):
        """An arrow along gravity: the picture's axes are those of the channel, not of the room."""
        tilt = math.radians(number(self.inputs, "inclination_deg") or 0)
        size = 0.3 * self.z_max
        x, z = 0.72 * self.x_max, 0.9 * self.z_max
        axes.annotate("", (x + size * math.sin(tilt), z - size * math.cos(tilt)), (x, z),
                      arrowprops={"arrowstyle": "-|>", "color": "black", "lw": 1.6,
                                  "shrinkA": 0, "shrinkB": 0})
        axes.text(x - 0.01 * self.x_max, z, "g", ha="right", va="top", style="italic", fontsize=14)

    def titles(self):
        i, m = self.inputs, self.measured
        self.figure.text(
            0.5, 1 - 0.33 / self.height,
            f"{i.get('case', '?')}: {i.get('preset', '?')} preset, {i.get('resolution', '?')} "
            f"resolution, {i.get('dimension', '?')}-D, {i.get('rheology', '?')} law",
            ha="center", va="center", fontsize=20, weight="bold")
        facts = [f"slope {number(i, 'inclination_deg') or 0:g}°",
                 f"column {i['column_length_m']:g} m × {i['column_height_m']:g} m "
                 f"on a bed of {i['bed_depth_m']:g} m"]
        for key, text in [("runout_m", "run-out {:.3f} m"),
                          ("height_final_m", "$H_f$ {:.3f} m"),
                          ("rest_time_s", "at rest after {:.2f} s")]:
            if number(m, key) is not None:
                facts.append(text.format(m[key]))
        self.figure.text(0.5, 1 - 0.70 / self.height, "   ·   ".join(facts), ha="center",
                         va="center", fontsize=14)

    def snapshots(self, top, images, columns, width, height, step):
        speeds = np.concatenate([image[2].compressed() for _, image in images])
        # A square-root scale, and not the fastest grain, sets the colours: slow creep shows too.
        fastest = max(np.percentile(speeds, 99.8) if speeds.size else 0, 1e-3)
        norm = matplotlib.colors.PowerNorm(0.5, vmin=0, vmax=fastest, clip=True)
        rows = math.ceil(len(images) / columns)
        for k, (time, image) in enumerate(images):
            column, row = divmod(k, rows)  # time runs down the columns
            axes = self.axes(1.0 + column * (width + 0.75), top + row * step, width, height)
            mesh = self.snapshot(axes, time, image, norm)
            if row == rows - 1 or k == len(images) - 1:
                axes.set_xlabel("x, down the slope (m)")
            else:
                axes.tick_params(labelbottom=False)
            if column == 0:
                axes.set_ylabel("z (m)")
            if k == 0:
                self.gravity(axes)

        below = top + rows * step + 0.50
        bar = self.figure.colorbar(mesh, cax=self.axes(10.2, below, 5.4, 0.2),
                                   orientation="horizontal", extend="max")
        bar.set_label("speed (m/s)")
        bar.set_ticks(round_ticks(fastest))
        bar.ax.xaxis.set_major_formatter("{x:g}")
        bar.minorticks_off()
        line = matplotlib.lines.Line2D
        self.figure.legend(
            handles=[line([], [], color="black", lw=1.6, label="free surface"),
                     line([], [], color="white", lw=1.8, path_effects=CASED,
                          label="static–flowing line"),
                     line([], [], color="0.35", lw=1.3, ls=":", label="initial column"),
                     line([], [], color=GATE, lw=5, label="gate")],
            loc="center left", bbox_to_anchor=(0.95 / WIDTH, 1 - (below + 0.15) / self.height),
            ncol=4, frameon=False, columnspacing=1.6)

    def runout(self, axes):
        time = self.front["time_s"]
        for source, label, colour, marker in SOURCES:
            runout = number(self.published, f"runout_{source}_m")
            if runout is None:
                continue
            margin = number(self.published, f"runout_{source}_pm_m") or 0
            rest = number(self.published, f"rest_time_{source}_s")
            axes.axhspan(runout - margin, runout + margin, color=colour, alpha=0.16, lw=0)
            axes.axhline(runout, color=colour, lw=1.2, ls="--" if rest is not None else "-",
                         label=None if rest is not None else label)
            if rest is not None:
                axes.errorbar(rest, runout, margin,
                              number(self.published, f"rest_time_{source}_pm_s") or 0,
                              color=colour, marker=marker, ms=8, capsize=5, lw=2, ls="none",
                              label=f"{label}: run-out and rest time")
        axes.plot(time, self.front["runout_m"], color=RUN, lw=2.4, label="this run")
        rest = number(self.measured, "rest_time_s")
        if rest is not None and rest <= time[-1]:
            axes.plot(rest, np.interp(rest, time, self.front["runout_m"]), color=RUN, marker="D",
                      ms=9, mfc="white", mew=2, ls="none", label="this run comes to rest")
        highest = max(axes.get_ylim()[1], 1e-3)
        axes.set(xlim=(time[0], max(time[-1], axes.get_xlim()[1], time[0] + 1e-6)),
                 ylim=(0, 1.04 * highest), xlabel="time (s)", ylabel="run-out from the gate (m)")
        axes.grid(color="0.9")
        axes.set_axisbelow(True)
        axes.legend(loc="best", framealpha=0.95)

    def final_profile(self, axes):
        last = at_time(self.profiles, self.profiles["time_s"].max())
        axes.fill_between(last["x_m"], last["height_m"], color="0.88", lw=0)
        axes.axhline(self.bed, color="0.55", lw=1)
        self.column_outline(axes, color="0.35", lw=1.6, ls=":", label="initial column")
        axes.plot(last["x_m"], last["height_m"], color=RUN, lw=2.4,
                  label=f"this run at {last['time_s'][0]:.2f} s")
        for k, (source, label, colour, marker) in enumerate(SOURCES):
            style = {"color": colour, "marker": marker, "ms": 7, "capsize": 5, "lw": 2,
                     "ls": "none", "zorder": 4}
            height = number(self.published, f"height_final_{source}_m")
            runout = number(self.published, f"runout_{source}_m")
            if height is not None:  # beside the wall, where H_f is measured
                axes.errorbar((0.012 + 0.014 * k) * self.x_max, self.bed + height,
                              number(self.published, "height_final_pm_m") or 0, **style,
                              label=None if runout is not None else f"{label}: $H_f$")
            if runout is not None:  # one above the other: they often coincide
                axes.errorbar(self.length + runout, self.bed + (0.06 + 0.08 * k) * self.z_max,
                              xerr=number(self.published, f"runout_{source}_pm_m") or 0, **style,
                              label=label + (": $H_f$ and run-out" if height is not None
                                             else ": run-out"))
        self.channel_axes(axes)
        axes.set(xlabel="x, down the slope (m)", ylabel="z (m)")
        axes.legend(loc="lower right", bbox_to_anchor=(1, 1), ncol=4, frameon=False,
                    borderaxespad=0.2)

    def draw(self):
        ratio = self.z_max / self.x_max
        columns = 2 if ratio > 0.1 else 1
        width = (14.6 - 0.75 * (columns - 1)) / columns
        height, step = ratio * width, ratio * width + 0.22
        times = choose_times(np.unique(self.sections["time_s"]),
                             number(self.measured, "rest_time_s"))
        images = [(t, section_image(at_time(self.sections, t))) for t in times]

        top = 1.05
        front_top = top + math.ceil(len(images) / columns) * step + 1.6
        profile_top = front_top + 3.4 + 1.2
        self.height = profile_top + 14.6 * ratio + 0.8
        self.figure = plt.figure(figsize=(WIDTH, self.height))
        self.titles()
        self.snapshots(top, images, columns, width, height, step)
        self.runout(self.axes(1.0, front_top, 14.6, 3.4))
        self.final_profile(self.axes(1.0, profile_top, 14.6, 14.6 * ratio))
        return self.figure


if __name__ == "__main__":
    run(__doc__, "summary.json", lambda folder: (Picture(folder).draw(), "collapse.png"))
