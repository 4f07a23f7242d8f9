#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Makes a movie of the snapshots of a run; --movie of the programs calls it.

usage: movie.py DIR [--gif] [--still SECONDS]

Reads DIR/summary.json and DIR/maps.csv with DIR/terrain.asc, or DIR/sections.csv; writes
DIR/PROGRAM.mp4 with ffmpeg, or DIR/PROGRAM.gif where there is none, or with --gif. With --still it
writes only the frame nearest to that time, DIR/PROGRAM_frame.png. The movie lasts 5 s, more if there
are more than 125 snapshots. Exits with 1 and a message if something is missing or cannot be used.
"""
import argparse
import json
import pathlib
import subprocess
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.animation
import matplotlib.colors
import matplotlib.pyplot as plt
import numpy as np

from plotting import GroundMap, SectionPicture, at_time, colour_bar, number, read_sections

WIDTH = 9.6  # inches, at 100 dots each


class Sections:
    """The speed in sections.csv, along one row across."""
    label = "speed (m/s)"

    def __init__(self, folder, row):
        self.table = read_sections(folder / "sections.csv", row)
        self.times = np.unique(self.table["time_s"])
        x, z = (np.unique(self.table[name].round(9)) for name in ("x_m", "z_m"))
        self.ratio = np.ptp(z) / np.ptp(x)
        self.factor = max(1, min(8, 1000 // len(x), 1000 // len(z)))
        speeds = self.table["speed_m_s"][self.table["volume_fraction"] >= 0.5]
        fastest = max(np.percentile(speeds, 99.8) if speeds.size else 0, 1e-3)
        self.norm = matplotlib.colors.PowerNorm(0.5, vmin=0, vmax=fastest, clip=True)

    def draw(self, axes, time):
        section = at_time(self.table, time)
        image = SectionPicture(section, self.factor).draw(axes, self.norm)
        axes.set(xlabel="x (m)", ylabel="z (m)")
        axes.set_title(f"t = {section['time_s'][0]:.3f} s", fontsize=12)
        return image


class Maps(GroundMap):
    """The depth in maps.csv, on the terrain."""
    label = "depth (m)"

    def draw(self, axes, time):
        image = super().draw(axes, time)
        axes.set(xlabel="x (m)", ylabel="y (m)")
        return image


class Movie:
    def __init__(self, folder):
        with open(folder / "summary.json") as file:
            summary = json.load(file)
        picture = summary.get("picture", {})
        self.program = summary["program"]
        self.title = picture.get("title", self.program.capitalize())
        self.frames = (Maps(folder) if (folder / "maps.csv").is_file() else
                       Sections(folder, number(summary.get("inputs"), "profile_y_m")))
        room = WIDTH - 2.4  # for axis and colour bar
        wide = max(min(room, 6 / self.frames.ratio), 0.5)
        high = self.frames.ratio * wide
        self.size = [2 * round(50 * inches) / 100 for inches in (wide + 2.4, high + 1.5)]  # even dots
        self.figure = plt.figure(figsize=self.size, dpi=100)
        self.box = [1.1 / self.size[0], 0.65 / self.size[1], wide / self.size[0], high / self.size[1]]

    def draw(self, time):
        self.figure.clear()
        axes = self.figure.add_axes(self.box)
        image = self.frames.draw(axes, time)
        left, bottom, wide, high = self.box
        bar = self.figure.add_axes([left + wide + 0.15 / self.size[0], bottom, 0.15 / self.size[0], high])
        colour_bar(self.figure, bar, image, self.frames.label)
        self.figure.text(0.5, 1 - 0.25 / self.size[1], self.title, ha="center", va="center",
                         weight="bold", fontsize=14)

    def save(self, writer, path):
        with writer.saving(self.figure, path, dpi=100):
            for time in self.frames.times:
                self.draw(time)
                writer.grab_frame()
        print(path)


def make(folder, gif, still):
    movie = Movie(folder)
    if still is not None:
        movie.draw(still)
        movie.figure.savefig(folder / f"{movie.program}_frame.png", dpi=100)
        print(folder / f"{movie.program}_frame.png")
        return
    rate = min(25, max(2, round(len(movie.frames.times) / 5)))  # frames a second
    if not gif and matplotlib.animation.FFMpegWriter.isAvailable():
        path = folder / f"{movie.program}.mp4"
        try:
            movie.save(matplotlib.animation.FFMpegWriter(
                fps=rate, codec="libx264", extra_args=["-pix_fmt", "yuv420p", "-crf", "20"]), path)
            return
        except (OSError, subprocess.CalledProcessError):
            path.unlink(missing_ok=True)
            print("ffmpeg could not write an mp4: a GIF instead", file=sys.stderr)
    if not matplotlib.animation.PillowWriter.isAvailable():
        raise ValueError("for a movie ffmpeg or the Python package pillow must be there")
    movie.save(matplotlib.animation.PillowWriter(fps=rate), folder / f"{movie.program}.gif")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(usage="movie.py DIR [--gif] [--still SECONDS]", add_help=False)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--gif", action="store_true")
    parser.add_argument("--still", type=float)
    if len(sys.argv) < 2 or {"-h", "--help"} & set(sys.argv):
        sys.exit(__doc__)
    arguments = parser.parse_args()
    matplotlib.rcParams.update({"font.size": 11, "axes.spines.top": False, "axes.spines.right": False})
    try:
        make(arguments.folder, arguments.gif, arguments.still)
    except OSError as error:
        sys.exit(f"movie.py: {error.filename}: {error.strerror}")
    except KeyError as error:
        sys.exit(f"movie.py: {arguments.folder}: no entry {error}")
    except ValueError as error:
        sys.exit(f"movie.py: {error}")
