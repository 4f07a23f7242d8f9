#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Draws performance profiles (Dolan & Moré 2002) of what `sh bench/run.sh profile` measured.

    python3 bench/profile.py OUT_DIR

Reads OUT_DIR/profile_*.json (bench_global_solver --profile); writes profile.png and profile.md. A curve
tells on which share of the problems a solver takes at most so many times the fastest one's time.
"""
import json
import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

TOLERANCES = (1e-4, 1e-6, 1e-8)
LEAST = 1e-3  # s: what is faster counts as equally fast


def times(result):
    """Seconds of the processor by tolerance; none where it was not reached."""
    return {p["tolerance"]: max(p["cpu_seconds"], LEAST) for p in result["profile"] if p["status"] == "converged"}


def draw(by_problem, solvers, path):
    figure, axes = plt.subplots(1, len(TOLERANCES), figsize=(4.2 * len(TOLERANCES), 3.8), sharey=True)
    for axis, tolerance in zip(axes, TOLERANCES):
        for solver in solvers:
            ratios = []
            for taken in by_problem.values():
                best = min((t[tolerance] for t in taken.values() if tolerance in t), default=None)
                if best and tolerance in taken.get(solver, {}):
                    ratios.append(taken[solver][tolerance] / best)
            ratios.sort()
            axis.step([1, *ratios, 1e4], [0, *((i + 1) / len(by_problem) for i in range(len(ratios))),
                                          len(ratios) / len(by_problem)], where="post", label=solver)
        axis.set_xscale("log")
        axis.set_xlim(1, 1e4)
        axis.set_ylim(0, 1.02)
        axis.set_title(f"residual {tolerance:g}, {len(by_problem)} problems")
        axis.set_xlabel("time, of the fastest")
        axis.grid(True, which="major", alpha=0.3)
    axes[0].set_ylabel("share of problems solved")
    axes[0].legend(fontsize=7, loc="lower right")
    figure.tight_layout()
    figure.savefig(path, dpi=100)


def table(results, solvers):
    lines = ["| problem | cones | " + " | ".join(solvers) + " |", "|---|---|" + "---|" * len(solvers)]
    for problem in sorted(results):
        of_problem = results[problem]
        cells = []
        for solver in solvers:
            steps = of_problem[solver]["profile"] if solver in of_problem else []
            cells.append("; ".join(f"{p['iterations']}, {p['cpu_seconds']:.3g} s" if p["status"] == "converged"
                                   else "–" for p in steps if p["tolerance"] in TOLERANCES))
        cones = next(iter(of_problem.values()))["cones"]
        lines.append(f"| {problem} | {cones} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main():
    out = pathlib.Path(sys.argv[1])
    results = {}
    for file in sorted(out.glob("profile_*.json")):
        for result in json.loads(file.read_text()):
            results.setdefault(pathlib.Path(result["problem"]).stem, {})[result["solver"]] = result
    solvers = sorted({solver for of_problem in results.values() for solver in of_problem})
    by_problem = {problem: {solver: times(r) for solver, r in of_problem.items()}
                  for problem, of_problem in results.items()}
    draw(by_problem, solvers, out / "profile.png")
    counts = ["| solver | " + " | ".join(f"{t:g}" for t in TOLERANCES) + " | 1e-8 in 10 times the time of 5e-5 |",
              "|---|" + "---|" * (len(TOLERANCES) + 1)]
    for solver in solvers:
        of_solver = [taken.get(solver, {}) for taken in by_problem.values()]
        reached = [sum(t in taken for taken in of_solver) for t in TOLERANCES]
        tight = sum(1e-8 in taken and taken[1e-8] <= 10 * taken[5e-5] for taken in of_solver)
        counts.append(f"| {solver} | " + " | ".join(map(str, [*reached, tight])) + " |")
    (out / "profile.md").write_text(f"Solved of {len(results)} problems:\n\n" + "\n".join(counts)
                                    + "\n\nIterations and seconds to 1e-4; 1e-6; 1e-8:\n\n"
                                    + table(results, solvers))


if __name__ == "__main__":
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        sys.exit(__doc__)
    main()
