#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Measures how functions are documented: tools/doc_verbs.py [--list]

Prints for each component how many documented functions begin with a verb in the third person ("Returns", "Reads").
Fails if the share of all is below LEAST. With --list it prints the others, file and line first.
"""

import pathlib
import re
import subprocess
import sys

# Comparable projects reach 76 to 92 of 100; a constructor or a trait's method may well begin otherwise.
LEAST = 0.85
VERBS = set(pathlib.Path(__file__).with_name("verbs.txt").read_text().split())

RUST = re.compile(
    r"^[ \t]*///[ ]?(?P<doc>[^\n]*)\n(?:[ \t]*///[^\n]*\n)*(?:[ \t]*#\[(?:[^\]\n]|\n)*?\]\n)*"
    r"[ \t]*(?:pub(?:\([^)]*\))? )?(?:const |unsafe |async |extern \"C\" )*fn (?P<name>\w+)",
    re.MULTILINE,
)
PYTHON = re.compile(r"^[ \t]*def (?P<name>\w+)\([^:]*?(?:\n[^:]*?)*:\n[ \t]*\"\"\"(?P<doc>[^\n]*)", re.MULTILINE)


def functions(path):
    """Yields line, name and first doc line of every documented function of a file."""
    text = path.read_text()
    for found in (PYTHON if path.suffix == ".py" else RUST).finditer(text):
        yield text.count("\n", 0, found.start()) + 1, found["name"], found["doc"]


def main():
    """Prints the table and returns the exit status."""
    files = subprocess.run(["git", "ls-files", "*.rs", "*.py"], check=True, capture_output=True, text=True).stdout.split()
    counts, others = {}, []
    for path in map(pathlib.Path, files):
        component = "/".join(path.parts[:2])
        for line, name, doc in functions(path):
            verb = re.match(r"([A-Z][a-z]+)(?! (?:of|that|which)\b|[,.:;])", doc)
            good = bool(verb) and verb[1] in VERBS
            total = counts.setdefault(component, [0, 0])
            total[0] += good
            total[1] += 1
            if not good:
                others.append(f"{path}:{line}: {name}: {doc}")
    if "--list" in sys.argv:
        print("\n".join(others))
    for component, (good, total) in sorted(counts.items()):
        print(f"{component:28} {good:5} of {total:5}")
    good, total = (sum(column) for column in zip(*counts.values(), strict=True))
    print(f"{'all':28} {good:5} of {total:5}: {good / total:.0%} begin with a verb")
    return good < LEAST * total


if __name__ == "__main__":
    sys.exit(main())
