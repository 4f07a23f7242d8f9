#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""What the documentation shows is what is compiled: compares every snippet with its file.

    python3 tests/docs/check_snippets.py [--update]

In a Markdown file, the line

    <!-- snippet: tests/docs/first.cpp -->            the file, without its SPDX line
    <!-- snippet: tests/docs/tutorial.cpp#heap -->    what stands between two lines // [heap] in it

right above a fence ``` says where its text comes from; indentation that all lines share is left
out. Fences of C++ without such a line are refused, since nobody compiles them. Links between
files of the project are checked, too. --update writes the files' text into the fences.
"""
import re
import subprocess
import sys
import textwrap
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SNIPPET = re.compile(r"(?:<!-- snippet: (\S+) -->\n)?```(\w*)\n(.*?)```", re.DOTALL)
LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)]*)?\)")


def source(reference):
    """The text that `reference` names; raises ValueError with what is wrong with it."""
    name, _, part = reference.partition("#")
    if not (ROOT / name).is_file():
        raise ValueError(f"{name} does not exist")
    lines = (ROOT / name).read_text(encoding="utf-8").splitlines()
    if not part:
        return "\n".join(line for line in lines if "SPDX-License-Identifier" not in line).strip("\n") + "\n"
    marks = [i for i, line in enumerate(lines) if line.strip() in (f"// [{part}]", f"# [{part}]")]
    if len(marks) != 2:
        raise ValueError(f"{name} has {len(marks)} lines // [{part}] instead of 2")
    inside = lines[marks[0] + 1 : marks[1]]
    inside = [line for line in inside if not re.fullmatch(r"\s*// \[[\w-]+\]", line)]  # marks of other parts
    return textwrap.dedent("\n".join(inside)).strip("\n") + "\n"


def check(path, update):
    """Complaints about one Markdown file, and its number of snippets."""
    text = path.read_text(encoding="utf-8")
    complaints, count = [], 0

    def compare(match):
        nonlocal count
        reference, language, shown = match.groups()
        line = text.count("\n", 0, match.start()) + 1
        where = f"{path.relative_to(ROOT)}:{line}"
        if reference is None:
            if language in ("cpp", "c++", "cc"):
                complaints.append(f"{where}: C++ that is in no file: add <!-- snippet: FILE#PART --> above it")
            return match.group(0)
        count += 1
        try:
            expected = source(reference)
        except ValueError as error:
            complaints.append(f"{where}: {error}")
            return match.group(0)
        if shown != expected and not update:
            complaints.append(f"{where}: differs from {reference}; --update takes it over")
        return match.group(0).replace(f"{language}\n{shown}```", f"{language}\n{expected}```")

    updated = SNIPPET.sub(compare, text)
    if update and updated != text:
        path.write_text(updated, encoding="utf-8")
    prose = re.sub(r"```.*?```", "", text, flags=re.DOTALL)
    for target in LINK.findall(prose):
        if "://" not in target and not (path.parent / target).exists():
            complaints.append(f"{path.relative_to(ROOT)}: the link {target} leads nowhere")
    return complaints, count


def main():
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "*.md"],
        cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    complaints, snippets = [], 0
    for name in listed:
        if (ROOT / name).is_file():
            found, count = check(ROOT / name, "--update" in sys.argv[1:])
            complaints += found
            snippets += count
    for complaint in complaints:
        print(complaint)
    print(f"{len(listed)} Markdown files, {snippets} snippets, {len(complaints)} complaints")
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
