#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""How a step of B15 scales with threads, phase by phase.

    python3 bench/scaling.py BUILD_DIR OUT_DIR [--quick] [--finer F] [--per-axis N]

Runs bench_step with 1, 2, 4, ... threads up to the number of processors, in turns, five rounds. Seconds are the least of
the rounds: what else the machine does only adds. The serial share f is Amdahl's: speed-up = 1/(f + (1 - f)/threads); what
grows with the threads (memory, waiting) counts in it. All runs must end in the same bits. Writes scaling.json, .md and
.png to OUT_DIR.
"""
import argparse
import json
import os
import pathlib

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

from step import PHASES, step  # noqa: E402


def thread_counts(processors):
    counts = [1]
    while 2 * counts[-1] < processors:
        counts.append(2 * counts[-1])
    return counts + [processors] * (processors > 1)


def measure(build, counts, rounds, **options):
    """The least seconds of each phase, by number of threads."""
    runs = {t: [] for t in counts}
    for _ in range(rounds):
        for threads in counts:
            runs[threads].append(step(build, threads=threads, **options))
    checksums = {run["state_checksum"] for each in runs.values() for run in each}
    if len(checksums) != 1:
        raise SystemExit(f"different bits for different numbers of threads: {checksums}")
    least = {t: {p: min(run["seconds"][p] for run in runs[t]) for p in PHASES + ["step"]} for t in counts}
    first = runs[1][0]
    return {"options": options, "particles": first["particles"], "cones": first["cones"], "sweeps": first["sweeps"],
            "state_checksum": checksums.pop(), "load_average": os.getloadavg(), "seconds": least}


def serial_share(threads, speed_up):
    return (threads / speed_up - 1) / (threads - 1)


def table(results):
    seconds = results["seconds"]
    lines = ["| threads | " + " | ".join(p.replace("_", " ") for p in PHASES + ["step"]) + " |",
             "|---" * (len(PHASES) + 2) + "|"]
    for threads, of in seconds.items():
        cells = []
        for phase in PHASES + ["step"]:
            cell = f"{1e3 * of[phase]:.1f} ms"
            if threads > 1:
                speed_up = seconds[1][phase] / of[phase]
                cell += f", {speed_up:.2f} ×, serial {100 * serial_share(threads, speed_up):.0f} %"
            cells.append(cell)
        lines.append(f"| {threads} | " + " | ".join(cells) + " |")
    return "\n".join([f"B15, {results['particles']:,} particles, {results['cones']:.0f} cones, "
                      f"{results['sweeps']:.0f} sweeps a step:", ""] + lines) + "\n"


def draw(results, path):
    seconds = results["seconds"]
    figure, axes = plt.subplots(figsize=(5, 3.8))
    for phase in PHASES + ["step"]:
        axes.plot(list(seconds), [seconds[1][phase] / of[phase] for of in seconds.values()],
                  "k-o" if phase == "step" else "o--", label=phase.replace("_", " "))
    axes.plot(list(seconds), list(seconds), ":", color="grey", label="as many as threads")
    axes.set(xlabel="threads", ylabel="times as fast as one", xticks=list(seconds))
    axes.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main():
    parser = argparse.ArgumentParser(description="Seconds of a step by number of threads.")
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--quick", action="store_true", help="one round of a small case")
    parser.add_argument("--finer", type=float, default=2, help="2: the paper's resolution, 4: half of its cells")
    parser.add_argument("--per-axis", type=int, default=6, help="particles a cell and axis")
    options = parser.parse_args()
    counts = thread_counts(len(os.sched_getaffinity(0)))
    if options.quick:
        results = measure(options.build, counts, 1, finer=1, per_axis=3, skip=2, steps=5)
    else:
        results = measure(options.build, counts, 5, finer=options.finer, per_axis=options.per_axis, skip=60, steps=10)
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "scaling.json").write_text(json.dumps(results, indent=1))
    (options.out / "scaling.md").write_text(table(results))
    draw(results, options.out / "scaling.png")
    print(table(results))


if __name__ == "__main__":
    main()
