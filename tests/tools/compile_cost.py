#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""What it costs to compile the README's first program (-O2), and whether that is within the budget.

    python3 tests/tools/compile_cost.py [COMPILER...]

Memory, preprocessed lines and template instantiations (clang++ alone counts them) do not depend on
what else the machine does: above their budgets the check fails. Seconds do, so they are only
printed, with whether the goal is met. The same program with talus/precompiled.hpp must need fewer
instantiations, and must link and run with a file of talus/precompiled_definitions.hpp.
"""
import json
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
EIGEN = os.environ.get("EIGEN3_INCLUDE_DIR", "/usr/include/eigen3")
GOAL = {"MB": 600, "CPU seconds": 8}
BUDGET = {"MB": 600, "thousand lines": 150, "thousand instantiations": 25.8,
          "thousand instantiations, with precompiled.hpp": 19.3}


def run(command):
    """CPU seconds and peak memory (MB) of a command."""
    pid = os.posix_spawnp(command[0], command, os.environ)
    _, status, usage = os.wait4(pid, 0)
    if status != 0:
        raise SystemExit(f"failed: {' '.join(command)}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def compile_command(compiler, source, output, *options):
    return [compiler, "-std=c++20", "-O2", *options, f"-I{ROOT}/include", f"-isystem{EIGEN}",
            str(source), "-o", str(output)]


def instantiations(trace):
    """Template instantiations in a trace of clang++, by kind."""
    kinds = {}
    for event in json.loads(trace.read_text(encoding="utf-8"))["traceEvents"]:
        if event["name"].startswith("Instantiate"):
            kinds[event["name"]] = kinds.get(event["name"], 0) + 1
    return kinds


def cost(compiler, source, folder):
    lines = subprocess.run(compile_command(compiler, source, "-", "-E", "-P"), capture_output=True,
                           check=True).stdout.count(b"\n")
    precompiled = ["-include", "talus/precompiled.hpp"]
    seconds, memory = run(compile_command(compiler, source, folder / "first.o", "-c"))
    rebuilt, _ = run(compile_command(compiler, source, folder / "rebuilt.o", "-c", *precompiled))
    found = {"CPU seconds": seconds, "of the seconds, with precompiled.hpp": rebuilt / seconds,
             "MB": memory, "thousand lines": lines / 1000}
    if "clang" in compiler:
        for what, options in (("", []), (", with precompiled.hpp", precompiled)):
            run(compile_command(compiler, source, folder / "traced.o", "-c", "-O0", "-ftime-trace",
                                "-ftime-trace-granularity=0", *options))
            number = sum(instantiations(folder / "traced.json").values()) / 1000
            found["thousand instantiations" + what] = number
    return found


def links_precompiled(compiler, source, folder):
    unit = folder / "precompiled.cpp"
    unit.write_text("#include <talus/precompiled_definitions.hpp>\n", encoding="utf-8")
    run([*compile_command(compiler, unit, folder / "program"), "-O1", "-include", "talus/precompiled.hpp", str(source)])
    run([str(folder / "program")])


def main():
    compilers = sys.argv[1:] or ["g++", "clang++"]
    over = 0
    print(f"tests/docs/first.cpp, -O2; goals: {GOAL['CPU seconds']} s, {GOAL['MB']} MB")
    with tempfile.TemporaryDirectory() as folder:
        for compiler in compilers:
            for what, value in cost(compiler, ROOT / "tests/docs/first.cpp", Path(folder)).items():
                within = value <= BUDGET.get(what, value)
                over += not within
                missed = "MISSED" if value > GOAL.get(what, value) else "met"
                limits = [f"budget {BUDGET[what]}"] if what in BUDGET else []
                limits += [f"goal {GOAL[what]} {missed}"] if what in GOAL else []
                print(f"{'ok     ' if within else 'FAILED '} {compiler}: {value:.3g} {what} ({'; '.join(limits)})")
        links_precompiled(compilers[0], ROOT / "tests/docs/first.cpp", Path(folder))
    return 1 if over else 0


if __name__ == "__main__":
    sys.exit(main())
