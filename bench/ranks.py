#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""How a step of B15 scales with ranks, phase by phase, and what ranks send each other.

    python3 bench/ranks.py BUILD_DIR OUT_DIR [--quick] [--finer F ...] [--ranks N ...]

Runs bench_ranks with 1, 2, 4, ... ranks of one thread, in turns: strong scaling at each --finer, weak scaling in a channel
as many times as wide. Seconds are the least of the rounds, of the slowest rank. Strong runs must end in the same bits.
Then says on paper where strong scaling ends on a cluster of a given latency and bandwidth, from the measured cost of a
cone and sweep and from the messages of a sweep. Writes ranks.json and ranks.md to OUT_DIR. $MPIRUN may be given.
"""
import argparse
import json
import os
import pathlib
import subprocess

PHASES = ["to_grid", "assembly", "solve", "to_particles", "step"]


def run(build, ranks, **options):
    words = os.environ.get("MPIRUN", "mpirun").split() + ["-n", str(ranks), str(build / "bench" / "bench_ranks")]
    for name, value in options.items():
        words += ["--" + name.replace("_", "-"), str(value)]
    environment = dict(os.environ, OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1",
                       OMPI_MCA_rmaps_base_oversubscribe="1")
    return json.loads(subprocess.run(words, check=True, capture_output=True, text=True, env=environment).stdout)


def measure(build, counts, rounds, scene, weak=False):
    """One result for each number of ranks, with the least seconds of the rounds."""
    results = {}
    for _ in range(rounds):
        for n in counts:
            result = run(build, n, wider=n if weak else 1, **scene)
            if n in results:
                for phase in PHASES:
                    least = min(results[n]["seconds"][phase], result["seconds"][phase])
                    results[n]["seconds"][phase] = least
            else:
                results[n] = result
    if not weak and len({r["state_checksum"] for r in results.values()}) != 1:
        raise SystemExit("different bits for different numbers of ranks")
    return list(results.values())


def table(title, results, weak):
    lines = [title, "", "| ranks | particles | cones | sweeps | " +
             " | ".join(p.replace("_", " ") + " (ms)" for p in PHASES) + " | " + ("efficiency" if weak else "speed-up") +
             " | messages, kB, reductions a sweep | MB a rank |", "|---" * (len(PHASES) + 7) + "|"]
    first = results[0]
    for r in results:
        gain = first["seconds"]["step"] / r["seconds"]["step"]
        lines.append(f"| {r['ranks']} | {r['particles']:,} | {r['cones']:,.0f} | {r['sweeps']:.0f} | " +
                     " | ".join(f"{1e3 * r['seconds'][p]:.1f}" for p in PHASES) + f" | {gain:.2f} | " +
                     f"{r['messages_per_sweep']:.1f}, {r['bytes_per_sweep'] / 1e3:.1f}, {r['reductions_per_sweep']:.1f} | " +
                     f"{r['memory_of_a_rank_bytes'] / 1e6:.0f} |")
    return "\n".join(lines) + "\n"


def on_paper(cones, cone_seconds, latency, bandwidth, block=4, colours=8, bytes_a_node=32):
    """Seconds of a sweep of `cones` cones, all dense, by number of ranks of one core: computing, messages of a cubic part
    to its neighbours (the six faces: edges and corners go with other colours' messages in part, and are counted as
    latency), one message to each neighbour a colour, and two reductions."""
    rows = []
    ranks = 1
    while ranks <= 4096:
        part = cones / ranks
        if part < block ** 3:
            break
        edge = part ** (1 / 3)
        compute = part * cone_seconds
        neighbours = 0 if ranks == 1 else min(26, ranks - 1)
        halo_nodes = 0 if ranks == 1 else 6 * edge ** 2
        # each node near an edge is sent after most colours: those whose blocks reach it, about 2 of 8 inside a face
        sent = halo_nodes * bytes_a_node * 2 * 2
        hops = max(1, (ranks - 1).bit_length()) if ranks > 1 else 0
        messages = colours * neighbours / 4 * latency + (latency * colours if ranks > 1 else 0)
        reductions = 2 * hops * latency
        total = compute + messages + sent / bandwidth + reductions
        rows.append((ranks, compute, messages + reductions, sent / bandwidth, total))
        ranks *= 2
    return rows


def paper_table(cones, cone_seconds, latency, bandwidth):
    rows = on_paper(cones, cone_seconds, latency, bandwidth)
    lines = [f"{cones:,.0f} cones, {1e9 * cone_seconds:.0f} ns a cone and sweep, {1e6 * latency:.1f} µs, "
             f"{bandwidth / 1e9:.0f} GB/s:", "",
             "| ranks | computing (µs a sweep) | latency | bytes | speed-up | efficiency |", "|---|---|---|---|---|---|"]
    for ranks, compute, wait, sent, total in rows:
        gain = rows[0][-1] / total
        lines.append(f"| {ranks} | {1e6 * compute:,.0f} | {1e6 * wait:,.0f} | {1e6 * sent:,.0f} | {gain:.0f} | "
                     f"{100 * gain / ranks:.0f} % |")
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description="Seconds of a step by number of ranks.")
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--quick", action="store_true", help="one round of a small case")
    parser.add_argument("--finer", type=float, nargs="+", default=[2, 4])
    parser.add_argument("--per-axis", type=int, default=3, help="particles a cell and axis")
    parser.add_argument("--ranks", type=int, nargs="+", help="default: 1, 2, 4, ... up to the number of processors")
    parser.add_argument("--latency", type=float, default=2e-6, help="of a message between nodes, s")
    parser.add_argument("--bandwidth", type=float, default=10e9, help="of a rank, bytes/s")
    options = parser.parse_args()
    counts = options.ranks
    if not counts:
        processors = len(os.sched_getaffinity(0))
        counts = [n for n in (1, 2, 4, 8, 16, 32, 64) if n <= processors]
    rounds = 1 if options.quick else 3
    shared = {"per_axis": 2, "skip": 2, "steps": 5} if options.quick else {
        "per_axis": options.per_axis, "skip": 30, "steps": 10}
    text, results = [], {}
    for finer in [1] if options.quick else options.finer:
        strong = measure(options.build, counts, rounds, {"finer": finer, **shared})
        results[f"strong_{finer:g}"] = strong
        text.append(table(f"Strong, B15 at h/{finer:g}:", strong, False))
    finer = 1 if options.quick else 2
    results["weak"] = measure(options.build, counts, rounds, {"finer": finer, **shared}, weak=True)
    text.append(table(f"Weak, at h/{finer:g}, a channel as many times as wide:", results["weak"], True))
    one = strong[0]
    cone_seconds = one["seconds"]["solve"] / one["cones"] / one["sweeps"]
    for cones in (one["cones"], 1e7):
        text.append(paper_table(cones, cone_seconds, options.latency, options.bandwidth))
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "ranks.json").write_text(json.dumps(results, indent=1))
    (options.out / "ranks.md").write_text("\n".join(text))
    print("\n".join(text))


if __name__ == "__main__":
    main()
