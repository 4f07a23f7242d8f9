#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""What a step costs: phases, threads, growth, memory; transfers; compiling the first program.

    python3 bench/step.py BUILD_DIR OUT_DIR [--quick]

Runs bench_step and bench_transfers of BUILD_DIR/bench and compiles README.md's first program; writes
step.json, step.md and step.png to OUT_DIR.
"""
import json
import os
import pathlib
import re
import resource
import subprocess
import sys
import tempfile
import time

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parent.parent
PHASES = ["to_grid", "assembly", "solve", "to_particles"]


def step(build, **options):
    words = [w for key, value in options.items() for w in (f"--{key.replace('_', '-')}", str(value))]
    print("bench_step", *words, flush=True)
    out = subprocess.run([build / "bench" / "bench_step", *words], check=True, capture_output=True, text=True)
    return json.loads(out.stdout)


def transfers(build, repetitions):
    print("bench_transfers", flush=True)
    out = subprocess.run(
        [build / "bench" / "bench_transfers", f"--benchmark_repetitions={repetitions}", "--benchmark_format=json",
         "--benchmark_min_time=0.05"], check=True, capture_output=True, text=True)
    runs = json.loads(out.stdout)["benchmarks"]
    return {r["run_name"]: r["ns_per_particle"] for r in runs if r.get("aggregate_name") == "median"}


def first_program():
    """Seconds and bytes that g++ -O2 takes for the first program of the README."""
    code = re.search(r"```cpp\n(// first\.cpp.*?)```", (ROOT / "README.md").read_text(), re.S)
    with tempfile.TemporaryDirectory() as folder:
        source = pathlib.Path(folder) / "first.cpp"
        source.write_text(code.group(1))
        start = time.perf_counter()
        subprocess.run(["g++", "-std=c++20", "-O2", "-I", ROOT / "include", "-I", "/usr/include/eigen3", source,
                        "-o", source.with_suffix("")], check=True)
        seconds = time.perf_counter() - start
    return {"seconds": seconds, "bytes": 1024 * resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss}


def draw(results, path):
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.8))
    bottom = [0.0] * len(results["reference"])
    names = [f"{r['threads']} thread{'s' * (r['threads'] > 1)}" for r in results["reference"]]
    for phase in PHASES:
        values = [r["seconds"][phase] for r in results["reference"]]
        left.bar(names, values, bottom=bottom, label=phase.replace("_", " "))
        bottom = [b + v for b, v in zip(bottom, values)]
    left.set(ylabel="s a step", title=f"B15, {results['reference'][0]['particles']:,} particles")
    left.legend(fontsize=8)
    for key, label in (("growth_particles", "more particles a cell"), ("growth_nodes", "finer cells")):
        runs = results[key]
        right.loglog([r["particles"] for r in runs],
                     [(r["seconds"]["to_grid"] + r["seconds"]["to_particles"]) / r["particles"] * 1e9 for r in runs],
                     "o-", label=f"transfers, {label}")
        right.loglog([r["particles"] for r in runs], [r["seconds"]["step"] / r["particles"] * 1e9 for r in runs],
                     "s--", label=f"step, {label}")
    right.set(xlabel="particles", ylabel="ns a particle, one thread")
    right.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def table(results):
    lines = ["| run | particles | cones | threads | to grid | assembly | solve | to particles | step |"
             " transfers, ns a particle | solve, ns a cone and sweep | sweeps | peak MB |",
             "|---" * 13 + "|"]
    for key in ("reference", "single", "growth_particles", "growth_nodes", "plane"):
        for r in results[key]:
            s = r["seconds"]
            lines.append(
                f"| {r['dim']}-D, h/{r['finer']:g}{', float' * (r['particle_data'] == 'float')} | {r['particles']:,} | {r['cones']:.0f} | {r['threads']} | "
                + " | ".join(f"{s[p]:.4f}" for p in PHASES + ["step"])
                + f" | {(s['to_grid'] + s['to_particles']) / r['particles'] * 1e9:.0f}"
                + f" | {r['solve_ns_per_cone_and_sweep']:.0f} | {r['sweeps']:.0f}"
                + f" | {r['memory_peak_bytes'] / 1e6:.0f} |")
    lines += ["", "Memory: " + f"{results['bytes_per_particle']:.0f} bytes a particle and "
              f"{results['bytes_per_node']:.0f} a node of the box, from the peaks of runs that differ in one of them.",
              "", "| transfers, ns a particle | 8 a cell (4) | 27 (9) | 216 (36) |", "|---|---|---|---|"]
    names = sorted({name.rsplit("/", 1)[0] for name in results["transfers"]})
    for name in names:
        lines.append(f"| {name} | " + " | ".join(
            f"{results['transfers'][f'{name}/per_axis:{n}']:.1f}" for n in (2, 3, 6)) + " |")
    first = results["first_program"]
    lines += ["", f"First program of the README, g++ -O2: {first['seconds']:.1f} s, {first['bytes'] / 1e6:.0f} MB."]
    return "\n".join(lines) + "\n"


def main():
    build, out = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    quick = "--quick" in sys.argv
    first = first_program()  # before the benchmarks: the peak memory is that of any child so far
    most = 3 if quick else 6
    results = {
        "first_program": first,
        "reference": [step(build, finer=2, per_axis=most, threads=t, skip=2 if quick else 120, steps=10)
                      for t in ((1,) if quick else sorted({1, 2, os.cpu_count()}))],
        "single": [step(build, finer=2, per_axis=most, particle_data="float", skip=2 if quick else 120, steps=10)],
        "growth_particles": [step(build, finer=2, per_axis=n, skip=10) for n in range(2, most + 1)],
        "growth_nodes": [step(build, finer=f, per_axis=3, skip=10) for f in ((1, 2) if quick else (1, 1.5, 2, 3))],
        "plane": [step(build, dim=2, finer=f, per_axis=3, skip=10) for f in ((1, 2) if quick else (1, 2, 4, 8))],
        "transfers": transfers(build, 1 if quick else 5),
    }
    few, many = results["growth_particles"][0], results["growth_particles"][-1]
    per_particle = (many["memory_peak_bytes"] - few["memory_peak_bytes"]) / (many["particles"] - few["particles"])
    small, large = results["growth_nodes"][0], results["growth_nodes"][-1]
    results["bytes_per_particle"] = per_particle
    results["bytes_per_node"] = (large["memory_peak_bytes"] - small["memory_peak_bytes"] -
                                 per_particle * (large["particles"] - small["particles"])) / \
        (large["cells"] - small["cells"])
    out.mkdir(parents=True, exist_ok=True)
    (out / "step.json").write_text(json.dumps(results, indent=1))
    (out / "step.md").write_text(table(results))
    draw(results, out / "step.png")
    print(table(results))


if __name__ == "__main__":
    main()
