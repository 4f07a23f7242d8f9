#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Draws what `sh bench/run.sh global` measured.

    python3 bench/global_solver.py OUT_DIR

Reads OUT_DIR/histories.json, resolution_*.json, threads_*.json (bench_global_solver) and creep.csv; writes
residuals.png (residual against time), resolution.png (sweeps against resolution), creep.png and
global_solver.md.
"""
import csv
import json
import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

COLOURS = {"accelerated": "tab:red", "accelerated-secular": "tab:orange", "plain": "tab:blue",
           "plain-secular": "tab:cyan", "coulomb-secular": "tab:green", "coulomb-newton": "tab:gray"}


def name(path):
    return pathlib.Path(path).stem


def draw_residuals(results, path):
    problems = sorted({r["problem"] for r in results})
    columns = min(3, len(problems))
    rows = -(-len(problems) // columns)
    figure, axes = plt.subplots(rows, columns, figsize=(4.5 * columns, 3.6 * rows), squeeze=False)
    for axis in axes.flat[len(problems):]:
        axis.axis("off")
    for axis, problem in zip(axes.flat, problems):
        for r in (r for r in results if r["problem"] == problem):
            axis.loglog([h["seconds"] for h in r["history"]], [h["residual_l2"] for h in r["history"]],
                        label=r["solver"], color=COLOURS.get(r["solver"]), linewidth=1.6)
        axis.set_title(f"{name(problem)}, {r['cones']} cones, {r['start']}", fontsize=9)
        axis.set_xlabel("seconds")
        axis.set_ylabel("residual, l2")
        axis.grid(True, which="major", alpha=0.3)
    axes.flat[0].legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def draw_resolution(results, path):
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.8), sharey=True)
    for axis, dimension in zip(axes, (2, 3)):
        of_dimension = [r for r in results if r["dimension"] == dimension]
        for solver in sorted({r["solver"] for r in of_dimension}):
            for start, style in (("warm", "-"), ("cold", "--")):
                points = sorted((r["cones"], r["iterations"]) for r in of_dimension
                                if r["solver"] == solver and r["start"] == start)
                axis.loglog(*zip(*points), style, marker="o", color=COLOURS.get(solver),
                            label=f"{solver}, {start}")
        axis.set_title(f"B15 at t = 0.2 s, {dimension}-D, h, h/2" + (", h/4" if dimension == 2 else ""))
        axis.set_xlabel("cones")
        axis.grid(True, which="both", alpha=0.3)
    axes[0].set_ylabel(f"sweeps to a residual of {results[0]['tolerance']:g}")
    axes[0].legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def draw_creep(rows, path):
    figure, axis = plt.subplots(figsize=(5.5, 4))
    for angle in sorted({row["angle_deg"] for row in rows}, key=float):
        of_angle = [row for row in rows if row["angle_deg"] == angle]
        tolerance = [float(row["tolerance"]) for row in of_angle]
        axis.loglog(tolerance, [float(row["speed_max_m_s"]) for row in of_angle], "o-",
                    label=f"{float(angle):g} degrees, largest")
        axis.loglog(tolerance, [float(row["speed_rms_m_s"]) for row in of_angle], "s--",
                    label=f"{float(angle):g} degrees, root mean square of the steps' largest")
    axis.axhline(1e-4, color="gray", linewidth=1)
    axis.axvline(5e-5, color="gray", linewidth=1, linestyle=":")
    axis.set_xlabel("tolerance (l2 residual); dotted: the default")
    axis.set_ylabel("speed of a bed at rest, m/s")
    axis.legend(fontsize=7)
    axis.grid(True, which="major", alpha=0.3)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def table(results):
    lines = ["| problem | cones | start | solver | threads | sweeps | residual | µs a cone and sweep | time, ratio to "
             "coulomb-newton |", "|---|---|---|---|---|---|---|---|---|"]
    base = {(r["problem"], r["start"]): r["seconds"] for r in results if r["solver"] == "coulomb-newton"}
    for r in sorted(results, key=lambda r: (r["problem"], r["start"], r["seconds"])):
        against = base.get((r["problem"], r["start"]))
        ratio = f"{r['seconds'] / against:.3f}" if against else ""
        lines.append(f"| {name(r['problem'])} | {r['cones']} | {r['start']} | {r['solver']} | {r['threads']} | "
                     f"{r['iterations']}{'' if r['status'] == 'converged' else ' (not converged)'} | "
                     f"{r['residual_l2']:.1e} | {r['microseconds_per_cone_and_sweep']:.3f} | {ratio} |")
    return "\n".join(lines) + "\n"


def main():
    out = pathlib.Path(sys.argv[1])
    histories, resolution, threads = (
        [result for file in sorted(out.glob(pattern)) for result in json.loads(file.read_text())]
        for pattern in ("histories.json", "resolution_*.json", "threads_*.json"))
    with open(out / "creep.csv", encoding="utf-8") as file:
        creep = list(csv.DictReader(file))
    draw_residuals(histories, out / "residuals.png")
    draw_resolution(resolution, out / "resolution.png")
    draw_creep(creep, out / "creep.png")
    (out / "global_solver.md").write_text(table(histories) + "\n" + table(resolution) + "\n" + table(threads))


if __name__ == "__main__":
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        sys.exit(__doc__)
    main()
