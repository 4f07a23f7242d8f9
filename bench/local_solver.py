#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Draws local_solver.json (Google Benchmark's output) as one picture and one table.

    python3 bench/local_solver.py OUT_DIR

Reads OUT_DIR/local_solver.json; writes OUT_DIR/local_solver.md and OUT_DIR/local_solver.png. Times
are ratios to Fischer-Burmeister Newton ("newton") on the same problems in the same run: a ratio of
10 is ten times as fast.
"""
import json
import pathlib
import statistics
import sys


def load(path):
    """{(law, size, set): {policy: (seconds, iterations, misses)}}, medians of the repetitions."""
    runs = {}
    for run in json.loads(path.read_text())["benchmarks"]:
        if run.get("run_type") == "aggregate":
            continue
        parts = run["run_name"].split("/")
        if parts[0].endswith("_prepare"):
            continue
        policy, law, size, problems = parts[0], parts[1], parts[2], "/".join(parts[3:])
        runs.setdefault((law, size, problems), {}).setdefault(policy, []).append(
            (run["per_solve"], run["iterations"], run["misses"]))
    return {key: {policy: tuple(statistics.median(column) for column in zip(*values))
                  for policy, values in policies.items()}
            for key, policies in runs.items()}


def table(results):
    policies = sorted({p for row in results.values() for p in row} - {"newton"})
    lines = ["Speed relative to `newton` in the same run; in brackets iterations, and misses if any.", "",
             "| law, size, problems | newton, ns | " + " | ".join(policies) + " |",
             "|---|---|" + "---|" * len(policies)]
    for (law, size, problems), row in sorted(results.items()):
        base = row.get("newton")
        if not base:
            continue
        cells = []
        for policy in policies:
            if policy not in row:
                cells.append("")
                continue
            seconds, iterations, misses = row[policy]
            extra = f"{iterations:.1f}" + (f", misses {misses:.0%}" if misses else "")
            cells.append(f"{base[0] / seconds:.1f} ({extra})")
        missed = f", misses {base[2]:.0%}" if base[2] else ""
        lines.append(f"| {law}, {size}, {problems} | {base[0] * 1e9:.0f} ({base[1]:.1f}{missed}) | "
                     + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def draw(results, path):
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    sizes = ["N2", "N3", "N6"]
    policies = [p for p in ("secular", "secular_batch4", "secular_batch8", "quartic", "hybrid", "projection")
                if any(p in row for row in results.values())]
    figure, axes = plt.subplots(1, 3, figsize=(13, 5), sharey=True, layout="constrained")
    for axis, size in zip(axes, sizes):
        rows = [(key, row) for key, row in sorted(results.items())
                if key[0] == "associated" and key[1] == size and "newton" in row]
        for place, policy in enumerate(policies):
            x = [k + 0.8 * (place - len(policies) / 2 + 0.5) / len(policies) for k in range(len(rows))]
            speed = [row["newton"][0] / row[policy][0] if policy in row else 0 for _, row in rows]
            axis.bar(x, speed, 0.8 / len(policies), label=policy, color=f"C{place}")
        axis.axhline(1, color="k", lw=0.8)
        axis.set_yscale("log")
        axis.set_xticks(range(len(rows)), [key[2].replace("/", "\n") for key, _ in rows], fontsize=7)
        axis.set_title(f"cone size {size[1:]}, associated law")
    axes[0].set_ylabel("speed relative to Fischer-Burmeister Newton")
    axes[0].legend(fontsize=8)
    figure.savefig(path, dpi=110)


def main():
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        print(__doc__)
        return 0 if len(sys.argv) == 2 else 2
    out = pathlib.Path(sys.argv[1])
    try:
        results = load(out / "local_solver.json")
    except (OSError, ValueError, KeyError) as error:
        print(f"{out / 'local_solver.json'}: not Google Benchmark's output: {error!r}", file=sys.stderr)
        return 2
    text = table(results)
    (out / "local_solver.md").write_text(text)
    print(text)
    draw(results, out / "local_solver.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
