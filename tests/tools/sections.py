#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""The rows across of sections.csv and profiles.csv, and the static threshold, as options of `collapse`.

    sections.py PROGRAM FOLDER

Needs numpy.
"""
import pathlib
import shutil
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "examples/python"))
import numpy as np
import talus_results

PROGRAM, FOLDER = sys.argv[1], pathlib.Path(sys.argv[2])


def start(out, *options):
    return subprocess.run([PROGRAM, "--case", "B00", "--end-time", "0.25", "--snapshot-interval", "0.25", "--vtk", "none",
                           "--quiet", "--no-plot", "--out", FOLDER / out, *options], capture_output=True, text=True)


def run(out, *options):
    done = start(out, *options)
    assert done.returncode == 0, done.stderr
    return talus_results.Run(FOLDER / out)


def refused(words, *options):
    done = start("refused", *options)
    assert done.returncode == 2 and words in done.stderr, f"not \"{words}\" but: {done.stderr}"


def contour(values, z, level):
    """Where each column of values falls below the level, going up."""
    heights = []
    for column in values:
        below = np.nonzero(~(column >= level))[0]
        k = below[0] if len(below) else None
        heights.append(z[-1] if k is None else z[0] if k == 0 else
                       np.interp(level, [column[k], column[k - 1]], [z[k], z[k - 1]]))
    return np.array(heights)


def check(results, row, rows, threshold):
    """Are profile and sections those of these rows (m)?"""
    found = np.unique(results.table("sections")["y_m"])
    assert np.allclose(found, rows), f"rows at {found} instead of {rows}"
    assert np.isclose(results.summary["inputs"]["profile_y_m"], row)
    section, profile = results.section(y=row), results.profile()
    height = contour(section["volume_fraction"], section["z_m"], 0.5)
    still = np.minimum(height, contour(-section["speed_m_s"], section["z_m"], -threshold))
    assert np.allclose(profile["height_m"], height), "the profile is not that of the section"
    assert np.allclose(profile["static_height_m"], still), "the static height is not that of the section"
    speed = sum(section[f"velocity_{a}_m_s"] ** 2 for a in "xyz") ** 0.5
    assert np.allclose(section["speed_m_s"], speed)
    assert np.allclose(section["pressure_Pa"], sum(section[f"stress_{a}{a}_Pa"] for a in "xyz") / 3)
    assert section["pressure_Pa"].max() > 500 and section["strain_rate_1_s"].max() > 1
    return profile


shutil.rmtree(FOLDER, ignore_errors=True)
wall = check(run("wall"), 0, [0], 0.01)
middle = check(run("middle", "--profile-row", "middle"), 0.02, [0.02], 0.01)
every = check(run("all", "--section-rows", "all", "--profile-row", "2", "--static-threshold", "0.1"), 0.04,
              [0, 0.02, 0.04, 0.06], 0.1)
assert np.abs(wall["height_m"] - middle["height_m"]).max() > 1e-4
# whatever --profile-row is, there are the three places; the mean lies between
for name in ("height", "static_height"):
    assert np.array_equal(every[f"{name}_wall_m"], wall[f"{name}_m"]) or name == "static_height"
    assert np.array_equal(middle[f"{name}_middle_m"], middle[f"{name}_m"])
assert np.array_equal(wall["height_mean_m"], middle["height_mean_m"])
assert np.abs(wall["height_mean_m"] - wall["height_m"]).max() > 1e-5
front = talus_results.Run(FOLDER / "middle").table("front")
assert np.array_equal(front["front_middle_m"], front["front_m"])
assert np.isnan(front["front_speed_m_s"][0])
assert np.allclose(front["front_speed_m_s"][1:], np.diff(front["front_m"]) / np.diff(front["time_s"]))
assert np.abs(every["static_height_m"] - middle["static_height_m"]).max() > 5e-3
check(run("two", "--section-rows", "wall", "3"), 0, [0, 0.06], 0.01)
# rigid side walls, one cell thick, outside of the channel: opened 0.2 s later, at rest before
solid = run("solid", "--preset", "repository", "--section-rows", "all")
assert np.allclose(np.unique(solid.table("sections")["y_m"]), [0, 0.02, 0.04, 0.06])
# the gate, two cells thick: 1/2 + s (1 - |s|/2) of a node's volume is free a distance of s cells from it; its lower edge is
# in the first cells. The walls are beside the rows.
seen, inputs = solid.section(0, y=0.02), solid.summary["inputs"]
half = inputs["gate_thickness_m"] / 2
gap = np.abs(seen["x_m"] - inputs["column_length_m"] - half) - half
s = np.clip(gap / seen["x_m"][1], -1, 1)
assert np.allclose(seen["solid_fraction"][:, 5:], (0.5 - s * (1 - abs(s) / 2))[:, None], atol=1e-9), "the gate"
assert seen["solid_fraction"][:, 5:].max() > 0.9 and seen["solid_fraction"][:, 0].max() < 0.1
flat = run("flat", "--dim", "2").table("sections")
assert "y_m" not in flat and not any("y" in name.split("_")[1] for name in flat), sorted(flat)

refused("--section-rows is 4; allowed: wall, middle, all, or 0 to 3", "--section-rows", "4")
refused("--section-rows is edge; allowed", "--section-rows", "wall", "edge")
refused("--section-rows is all; allowed: nothing in 2-D", "--dim", "2", "--section-rows", "all")
refused("--profile-row is all; allowed: wall, middle, or 0 to 3", "--profile-row", "all")
refused("--profile-row goes with --dim 3", "--dim", "2", "--profile-row", "middle")
refused("--static-threshold is -1; allowed", "--static-threshold", "-1")
def measured(name, text):
    (FOLDER / name).write_text(text)
    return "--compare", str(FOLDER / name)


refused("it has neither the columns x_m and height_m nor time_s and front_m or runout_m",
        *measured("wrong.csv", "x_m,z_m\n0,1\n"))
refused("no column \"heigth_m\" is known", *measured("slip.csv", "x_m,height_m,heigth_m\n0,1,1\n"))
refused("it has no rows", *measured("empty.csv", "x_m,height_m\n"))
compared = run("compared", *measured("deposit.csv", "x_m,height_m\n0,0.1\n0.1,0.05\n"),
               *measured("front.csv", "time_s,runout_m\n0,0\n0.2,0.1\n"))
assert [t["file"] for t in compared.summary["compare"]] == ["deposit.csv", "front.csv"]
assert compared.summary["compare"][0]["height_m"] == [0.1, 0.05]
assert compared.summary["state_checksum"] == talus_results.Run(FOLDER / "wall").summary["state_checksum"]
print("the rows that were asked for")
