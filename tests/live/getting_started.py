#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Runs the commands of docs/guide/getting-started.md as written, and measures their times.

    tests/live/getting_started.py FOLDER

writes the table of that page from the results of live_test.py --only getting_started --out FOLDER.
"""

import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
import run_live  # noqa: E402
from unprivileged import REPOSITORY  # noqa: E402

PAGE = REPOSITORY / "docs/guide/getting-started.md"
SECTION = "Three machines"
BEGIN, END = "<!-- cargo xtask getting-started writes what follows -->\n", "<!-- to here -->\n"
TIMES = "commands.json"


def commands(page):
    """Returns the command lines of every machine of the page, by its name."""
    section = page.read_text().split(f"\n## {SECTION}\n")[1].split("\n## ")[0]
    found = {}
    for part in section.split("\n### ")[1:]:
        lines = re.findall(r"(?m)^    (.*)$", part)
        lines = re.sub(r"\\\n\s*", "", "\n".join(lines)).splitlines()
        found[lines[0].split()[-1]] = lines
    return found


def run(lines, pkm, out):
    """Runs commands in the empty folder `out`, LinuxCNC without a screen; returns the result of LinuxCNC."""
    folder, times, result = out, [], None
    for line in lines:
        name, *words = line.split()
        begin = time.monotonic()
        if name == "cd":
            folder = folder / words[0]
        elif name == "pkm":
            done = subprocess.run([pkm, *words], cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, text=True,
                                  timeout=120)
            assert done.returncode == 0, f"{line}: {done.stdout}{done.stderr}"
        else:
            assert [name, *words] == ["linuxcnc", f"{folder.name}.ini"], line
            result = run_live.run(folder, "first.ngc", out, 120)
        times.append([line, round(time.monotonic() - begin, 2)])
    (out / TIMES).write_text(json.dumps(times, indent=1) + "\n")
    return result


def row(times):
    """Returns the times of a machine as a row of the table."""
    def seconds(begin):
        return sum(spent for line, spent in times if line.startswith(begin))

    new, linuxcnc = seconds("pkm new"), seconds("linuxcnc")
    rest = seconds("pkm") - new
    minutes = (new + rest + linuxcnc) / 60
    return (f"| {times[0][0].split()[-1]} | {len(times)} | {new:.1f} s | {rest:.1f} s | {linuxcnc:.1f} s "
            f"| {minutes:.1f} |\n")


def table(folder):
    rows = [row(json.loads(file.read_text())) for file in sorted(folder.glob(f"*/{TIMES}"))]
    assert rows, f"{folder} has no */{TIMES}"
    processor = re.search(r"(?m)^model name\s*: (.*)$", Path("/proc/cpuinfo").read_text())[1]
    return ("\n| machine | commands | pkm new | the other commands of pkm | LinuxCNC: start, homing, program | minutes |\n"
            "| --- | --: | --: | --: | --: | --: |\n" + "".join(rows) +
            f"\nMeasured on {os.cpu_count()} cores of: {processor}\n\n")


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    before, after = PAGE.read_text().split(BEGIN)
    written = table(Path(sys.argv[1]))
    PAGE.write_text(before + BEGIN + written + END + after.split(END)[1])
    print(written)


if __name__ == "__main__":
    main()
