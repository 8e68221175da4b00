#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Runs random legal moves, tilts and tool changes on every configuration, in the real LinuxCNC.

    tests/live/soak.py --minutes 10 [--seed 1] [--only hexapod] [--out FOLDER]

Each configuration runs its share of the time, at most a minute of motion at a time, with machine
on and homing before it. Every servo cycle is recorded and checked by tests/live/judge. Ends with a
table; exit code 1 if a program stopped, a message or a fault occurred, or a trace is wrong.
"""

import argparse
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
import run_live  # noqa: E402
from unprivileged import (LANES, REPOSITORY, claimed, is_unprivileged,  # noqa: E402
                          only_one, rerun_unprivileged)

TOOLS = REPOSITORY / "target/host"
LONGEST = 60.0  # seconds of motion in one run: a trace of some ten megabytes
# In addition to its least duration a program needs time for corners and accelerations, and LinuxCNC to start.
SLACK = 5
START_SECONDS = 180
ROW = "row.json"  # the results of a program, in the folder of its results
MISMATCH = re.compile(r"forward against inverse \(pose\) +(\S+) (\S+)")


def generated(folder, options):
    """Generates program files, in turn over the machines, for the given minutes."""
    configs = [path for path in sorted((REPOSITORY / "configs").iterdir())
               if path.is_dir() and options.only in path.name]
    if not configs:
        sys.exit(f"soak: no machine has {options.only!r} in its name")
    share = 60 * options.minutes / len(configs)
    rounds = max(1, round(share / LONGEST))
    files = []
    for turn in range(rounds):
        for config in configs:
            file = folder / f"{config.name}.{turn}.ngc"
            command = [TOOLS / "pkm", "random", config / f"{config.name}.ini",
                       "--seed", str(options.seed + turn), "--seconds", str(share / rounds)]
            file.write_text(subprocess.run(command, check=True, text=True, stdin=subprocess.DEVNULL,
                                           stdout=subprocess.PIPE).stdout)
            files.append(file)
    return files, share / rounds


def run_one(file, out, seconds):
    """Returns the results of one program, as a row of the table."""
    name = file.name.split(".")[0]
    text = file.read_text()
    result = run_live.run(Path("configs") / name, file.name, out, SLACK * seconds + 30, text)
    row = {"machine": name, "moves": result["moves"], "changes": text.count("G43.1") + text.count("\nG49"),
           "seconds": result.get("seconds", 0), "cycle": result.get("servo_tmax_ns", 0),
           "errors": len(result["messages"]) + result.get("fault_count", 0), "mismatch": 0.0, "unit": ""}
    if not result["ok"]:
        row["errors"] = max(row["errors"], 1)
        print(f"FAIL {file.name}: {result['error']}", flush=True)
        return row
    judged = judge(name, out)
    found = MISMATCH.search(judged.stdout)
    if judged.returncode != 0 or not found:
        row["errors"] += 1
        print(f"FAIL {file.name}: its trace is not as it must be\n{judged.stdout}{judged.stderr}", flush=True)
        return row
    row["mismatch"], row["unit"] = float(found[1]), found[2]
    for large in ("trace.csv", "linuxcnc.log"):
        (out / large).unlink()
    print(f"PASS {file.name}: {row['moves']} moves, {row['seconds']} s", flush=True)
    return row


def judge(name, out):
    ini = REPOSITORY / "configs" / name / f"{name}.ini"
    command = [REPOSITORY / "given/judge", ini, out / "trace.csv", out / "result.json", out / "report"]
    return subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True)


def table(rows):
    lines = ["| machine | moves | tool changes | minutes | errors | largest mismatch | longest cycle |",
             "| --- | ---: | ---: | ---: | ---: | ---: | ---: |"]
    for name in sorted({row["machine"] for row in rows}):
        own = [row for row in rows if row["machine"] == name]
        total = {key: sum(row[key] for row in own) for key in ("moves", "changes", "seconds", "errors")}
        worst = max(own, key=lambda row: row["mismatch"])
        lines.append(f"| {name} | {total['moves']} | {total['changes']} | {total['seconds'] / 60:.1f} "
                     f"| {total['errors']} | {worst['mismatch']:.1e} {worst['unit']} "
                     f"| {max(row['cycle'] for row in own) / 1000:.0f} us |")
    return "\n".join(lines)


def run_all(seconds):
    """Runs the programs that other lanes have not claimed."""
    files = sorted((REPOSITORY / "given").glob("*.ngc"), key=lambda path: (int(path.suffixes[0][1:]), path.name))
    with only_one():
        for file in files:
            out = REPOSITORY / "out" / file.stem
            if claimed(out):
                (out / ROW).write_text(json.dumps(run_one(file, out, seconds)))
    return 0


def sum_up(files, out):
    """Prints the table; returns whether every program ran correctly."""
    found = [out / file.stem / ROW for file in files]
    rows = [json.loads(path.read_text()) for path in found if path.exists()]
    print(table(rows))
    missing = [path.parent.name for path in found if not path.exists()]
    errors = sum(row["errors"] for row in rows) + len(missing)
    print(f"soak: {sum(row['moves'] for row in rows)} moves, {errors} errors"
          + (f"; not run: {' '.join(missing)}" if missing else ""))
    return not errors


def parsed():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--minutes", type=float, default=10, help="of motion, all machines together")
    arguments.add_argument("--seed", type=int, default=1, help="the same seed gives the same programs")
    arguments.add_argument("--only", default="", help="machines whose name contains this text")
    arguments.add_argument("--out", help="folder that keeps results, and traces that failed")
    arguments.add_argument("--seconds", type=float, help=argparse.SUPPRESS)
    return arguments.parse_args()


def main():
    options = parsed()
    if is_unprivileged():
        return run_all(options.seconds)
    with tempfile.TemporaryDirectory(prefix="pkmkins-soak-") as folder:
        files, seconds = generated(Path(folder), options)
        limit = len(files) * (SLACK * seconds + START_SECONDS)
        out = Path(options.out or Path(folder) / "out").resolve()
        for stale in out.glob(f"*/{ROW}"):
            stale.unlink()
        code = rerun_unprivileged("tests/live/soak.py", ["--seconds", str(seconds)], limit, out,
                                  [*files, TOOLS / "judge"], LANES)
        return 0 if sum_up(files, out) and code == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
