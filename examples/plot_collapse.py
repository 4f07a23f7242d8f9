#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Draws a run of the program `collapse`: snapshots, run-out and speed of the front against time,
final profile, and where the energy went if there is a budget.

usage: plot_collapse.py DIR [MEASURED.csv...]

Reads summary.json, front.csv, profiles.csv, sections.csv and, if it is there, energy.csv in DIR; writes
DIR/collapse.png. The other files are drawn beside the run, as those of its option --compare: profiles
(x_m, height_m; at choice time_s, else the deposit, and static_height_m) or the front (time_s; front_m or
runout_m). Exits with 1 and a message if something is missing or cannot be used.
"""
import csv
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

from plotting import (SPEED, at_time, choose_times, energy_panel, number, read_energy, read_sections,
                      read_table, round_ticks, run, section_image)

# Colours of Okabe and Ito: told apart by colour-blind readers.
RUN, EXPERIMENT, SIMULATION = "black", "#D55E00", "#0072B2"
SOURCES = [("exp", "experiment", EXPERIMENT, "o"), ("sim", "authors' simulation", SIMULATION, "s")]
GATE = "#333333"
MEASURED = ["#CC79A7", "#009E73", "#E69F00", "#56B4E9"]
WIDTH = 16.0  # inches, at 100 dots each
CASED = [matplotlib.patheffects.withStroke(linewidth=3.6, foreground="black")]


def read_measured(path):
    """A file of profiles or of the front that the user measured, as summary.json holds it."""
    with open(path, newline="", encoding="utf-8-sig") as file:
        names = next(csv.reader(file), [])
    for columns in (["x_m", "height_m"], ["time_s", "front_m"], ["time_s", "runout_m"]):
        if all(c in names for c in columns):
            table = read_table(path, columns, ["time_s", "static_height_m", "front_m", "runout_m"])
            return {"file": path.name, **table}
    raise ValueError(f"{path}: it has neither the columns x_m and height_m nor time_s and front_m or runout_m")


class Picture:
    """One figure, filled from the top with axes placed in inches."""

    def __init__(self, directory, *measured):
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
                                   ["time_s", "x_m", "height_m", "static_height_m"],
                                   ["height_wall_m", "height_middle_m", "height_mean_m"])
        self.energy = read_energy(directory)
        kept = [{k: v if k == "file" else np.array(v, dtype=float) for k, v in table.items()}
                for table in summary.get("compare") or []]
        self.measured_tables = kept + [read_measured(path) for path in measured]
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
        for table, colour in self.profiles_measured():
            if "time_s" in table:
                now = self.shown_with(table["time_s"]) == profile["time_s"][0]
                axes.plot(table["x_m"][now], table["height_m"][now], ls="none", marker="o", ms=4,
                          color=colour, mec="white", mew=0.5)
                if "static_height_m" in table:
                    axes.plot(table["x_m"][now], table["static_height_m"][now], ls="none", marker="v",
                              ms=4, color=colour, mec="white", mew=0.5)
        gate = at_time(self.front, time)["gate_height_m"][0]
        if gate < self.z_max:
            axes.add_patch(matplotlib.patches.Rectangle(
                (self.length, gate), 0.006 * self.x_max, self.z_max - gate, color=GATE, lw=0,
                zorder=3))
        self.channel_axes(axes)
        axes.text(0.985, 0.92, f"t = {time:.2f} s", transform=axes.transAxes, ha="right",
                  va="top", fontsize=14, weight="bold")
        return mesh

    def profiles_measured(self):
        """The user's tables of profiles, each with its colour."""
        tables = zip(self.measured_tables, MEASURED * len(self.measured_tables))
        return [(table, colour) for table, colour in tables if "x_m" in table]

    def shown_with(self, times):
        """The time of the run's profiles that is nearest to each of `times`."""
        run_times = np.unique(self.profiles["time_s"])
        return run_times[np.argmin(np.abs(run_times[:, None] - times), axis=0)]

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
        for table, colour in zip(self.measured_tables, MEASURED * len(self.measured_tables)):
            if "x_m" not in table:
                runout = table["runout_m"] if "runout_m" in table else table["front_m"] - self.length
                axes.plot(table["time_s"], runout, ls="none", marker="o", ms=5, color=colour,
                          label=table["file"])
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

    def front_speed(self, axes):
        """The slope of the front's position, over four samples: nodes make single ones jump."""
        time, front = self.front["time_s"], self.front["front_m"]
        if len(time) > 4:
            axes.plot((time[4:] + time[:-4]) / 2, (front[4:] - front[:-4]) / (time[4:] - time[:-4]),
                      color=RUN, lw=2, label="this run")
        for table, colour in zip(self.measured_tables, MEASURED * len(self.measured_tables)):
            if "x_m" not in table and len(table["time_s"]) > 1:
                where = table["front_m"] if "front_m" in table else table["runout_m"]
                t = table["time_s"]
                axes.plot((t[1:] + t[:-1]) / 2, np.diff(where) / np.diff(t), ls="none", marker="o", ms=5,
                          color=colour, label=table["file"])
        axes.axhline(0, color="0.4", lw=0.8)
        axes.set(xlabel="time (s)", ylabel="front (m/s)")
        axes.grid(color="0.9")
        axes.set_axisbelow(True)

    def final_profile(self, axes):
        last = at_time(self.profiles, self.profiles["time_s"].max())
        for name, label, style in [("wall", "next to the wall", "--"), ("middle", "in the middle", ":"),
                                   ("mean", "mean across", "-.")]:
            if f"height_{name}_m" in last:
                axes.plot(last["x_m"], last[f"height_{name}_m"], color="0.35", lw=1.2, ls=style,
                          label=label, zorder=3)
        for table, colour in self.profiles_measured():
            here = self.shown_with(table["time_s"]) == last["time_s"][0] if "time_s" in table else slice(None)
            x, height = table["x_m"][here], table["height_m"][here]
            if x.size:
                off = np.sqrt(np.nanmean((np.interp(x, last["x_m"], last["height_m"]) - height) ** 2))
                axes.plot(x, height, ls="none", marker="o", ms=5, color=colour, zorder=5,
                          label=f"{table['file']}: {1000 * off:.1f} mm (rms)")
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
                    borderaxespad=0.2, columnspacing=1.2)

    def draw(self):
        ratio = self.z_max / self.x_max
        columns = 2 if ratio > 0.1 else 1
        width = (14.6 - 0.75 * (columns - 1)) / columns
        height, step = ratio * width, ratio * width + 0.22
        times = choose_times(np.unique(self.sections["time_s"]),
                             number(self.measured, "rest_time_s"))
        measured = [self.shown_with(t["time_s"]) for t, _ in self.profiles_measured() if "time_s" in t]
        times = np.unique(np.concatenate([times, *measured]))
        images = [(t, section_image(at_time(self.sections, t))) for t in times]

        top = 1.05
        front_top = top + math.ceil(len(images) / columns) * step + 1.6
        speed_top = front_top + 3.4 + 0.9
        profile_top = speed_top + 1.8 + 1.6
        energy_top = profile_top + 14.6 * ratio + 1.2
        self.height = energy_top + (4.0 if self.energy else -0.4)
        self.figure = plt.figure(figsize=(WIDTH, self.height))
        self.titles()
        self.snapshots(top, images, columns, width, height, step)
        runout = self.axes(1.0, front_top, 14.6, 3.4)
        self.runout(runout)
        speed = self.axes(1.0, speed_top, 14.6, 1.8)
        self.front_speed(speed)
        speed.set_xlim(runout.get_xlim())
        self.final_profile(self.axes(1.0, profile_top, 14.6, 14.6 * ratio))
        if self.energy:
            energy_panel(self.axes(1.0, energy_top, 10.2, 3.2), self.energy,
                         "J" if self.inputs["dimension"] == 3 else "J/m")
        return self.figure


if __name__ == "__main__":
    run(__doc__, "summary.json",
        lambda folder, *measured: (Picture(folder, *measured).draw(), "collapse.png"), files=True)
