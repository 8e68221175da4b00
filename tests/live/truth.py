#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Compares `pkm preflight` with LinuxCNC in virtual time, and that with the real LinuxCNC.

    tests/live/truth.py [--random NUMBER [--seed SEED]] [--live short|all] [--alone] [--only EXPRESSION] [--out FOLDER]

With --random the programs are random, and every servo cycle of them is checked against limits that
`truth_cycles.py` reads itself; their table has only those that differ from the prediction.

`pkm preflight` judges each program and keeps LinuxCNC's run of it as a trace; the result is a table of
LinuxCNC's behavior, the line, and the prediction. With --live all of them, or a handful, also run in
the real LinuxCNC, every servo cycle recorded, and a second table compares the two runs; with --alone
the other programs are left out. Exit code 1 if LinuxCNC stops a program and this was not predicted with its
line, if a prediction did not come true, if a peak differs from its prediction, or if the two
runs differ in any cycle of a motion.
"""

import argparse
import json
import re
import shutil
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
import ini_edit  # noqa: E402
import truth_cycles  # noqa: E402
import truth_judge  # noqa: E402
import truth_programs  # noqa: E402
import truth_random  # noqa: E402
import truth_virtual  # noqa: E402
from session import Session  # noqa: E402
from unprivileged import (LANES, REPOSITORY, claimed, is_unprivileged,  # noqa: E402
                          only_one, rerun_unprivileged)

PKM = REPOSITORY / "target/host/pkm"
# Parameters of the stored G54, from X on.
G54 = {letter: 5221 + n for n, letter in enumerate("XYZABC")}
STATE = ("G40 G49 G54 G80 G90 G92.1 M5")
SECONDS_A_PROGRAM = 200
VIRTUAL_AT_ONCE = 2
# On a busy computer LinuxCNC's interpreter lags behind: the machine then stops, or blends a motion,
# unexpectedly. Such differences are run again, with the others at rest.
TRIES = 3


def prepared(folder, programs, is_live=False):
    """Prepares a folder for every different machine: configuration with its edits and work offset, programs."""
    groups = {}
    for program in programs:
        key = (program.machine, json.dumps(program.edits), program.offset, program.name if program.is_random else "")
        groups.setdefault(key, []).append(program)
    return [group(folder / f"{n:02}", members, is_live) for n, members in enumerate(groups.values())]


def group(folder, members, is_live):
    name = members[0].machine
    config = folder / name
    shutil.copytree(REPOSITORY / "configs" / name, config)
    ini = config / f"{name}.ini"
    ini.write_text(ini_edit.edited(ini.read_text(), members[0].edits))
    if members[0].offset:
        (config / f"{name}.var").write_text(
            "".join(f"{G54[letter]}\t{value:.6f}\n" for letter, value in members[0].offset))
    for program in members:
        text = program.text if is_live else program.run_text()
        (config / "programs" / f"truth-{program.name}.ngc").write_text(text)
    offset = " ".join(f"{letter}{value:.6f}" for letter, value in members[0].offset) or "X0 Y0 Z0"
    listed = {"machine": name, "offset": f"G10 L2 P1 {offset} R0", "random": members[0].is_random,
              "programs": [[p.name, p.seconds, p.deletes] for p in members]}
    (folder / "list.json").write_text(json.dumps(listed))
    return folder


def name_of(machine, program):
    return f"{machine}.{program}"


# -------------------------------------------------------------------- in virtual time

def run_virtual(folders, out, kept):
    """Returns outcome and prediction of every program by its name, run some at a time; the traces of those that are
    `kept` stay in `out`."""
    out.mkdir(parents=True, exist_ok=True)
    jobs = [(folder, machine, program, out / f"{name_of(machine, program)}.csv", name_of(machine, program) in kept)
            for folder in folders for machine, program, *_ in listed(folder)]
    with ProcessPoolExecutor(VIRTUAL_AT_ONCE) as pool:
        return dict(pool.map(run_one, jobs))


def listed(folder):
    found = json.loads((folder / "list.json").read_text())
    return [(found["machine"], *program) for program in found["programs"]]


def run_one(job):
    folder, machine, program, trace, is_kept = job
    ini = folder / machine / f"{machine}.ini"
    file = folder / machine / "programs" / f"truth-{program}.ngc"
    is_random = json.loads((folder / "list.json").read_text())["random"]
    found = (truth_cycles if is_random else truth_virtual).judged(PKM, ini, file, trace)
    if not is_kept:
        trace.unlink(missing_ok=True)
    return name_of(machine, program), found


# -------------------------------------------------------------------- live

def run_live(scratch, programs, out, lanes):
    """Returns outcomes of programs by their names; recordings go to `out`."""
    folders = prepared(scratch, programs, is_live=True)
    shutil.rmtree(out, ignore_errors=True)
    rerun_unprivileged("tests/live/truth.py", [], SECONDS_A_PROGRAM * len(programs), out, folders, lanes)
    return gathered(folders, out)


def gathered(folders, out):
    """Collects outcomes, and the traces by the names of their programs."""
    found = {}
    for folder in folders:
        file = out / folder.name / "outcomes.json"
        outcomes = json.loads(file.read_text()) if file.exists() else {}
        for machine, program, *_ in listed(folder):
            name = name_of(machine, program)
            found[name] = outcomes.get(program, {"failed": "LinuxCNC did not come to it"})
            trace = out / folder.name / f"{program}.csv"
            if trace.exists():
                trace.rename(out / f"{name}.csv")
    return found


def run_group(folder, out):
    """Returns outcomes of all programs of a group; restarts LinuxCNC after each program that it stops."""
    waiting = listed(folder)
    name = waiting[0][0]
    offset = json.loads((folder / "list.json").read_text())["offset"]
    outcomes = {}
    while waiting:
        with Session(folder / name) as session:
            startup = ini_edit.value(session.ini.read_text(), "RS274NGC", "RS274NGC_STARTUP_CODE")
            jobs = [[p, str(session.copy / "programs" / f"truth-{p}.ngc"), seconds, deletes]
                    for _, p, seconds, deletes in waiting]
            limit = 60 + sum(seconds for _, _, seconds, _ in waiting)
            result = session.run("truth", out, limit, programs=jobs, before=[*STATE, offset, startup], startup=startup)
        done = result.get("outcomes", {})
        if not done:
            # Reported once, and not retried forever.
            outcomes[waiting[0][1]] = {"failed": result["error"]}
            waiting = waiting[1:]
            continue
        outcomes.update(done)
        for program in done:
            end = "ran to its end" if done[program]["ended"] else "not at its end in time"
            print(f"  {name} {program}: {done[program]['errors'] or end}", flush=True)
        waiting = waiting[len(done):]
    return outcomes


def run_all():
    """Runs the programs that other lanes have not claimed."""
    with only_one():
        for folder in sorted(path for path in (REPOSITORY / "given").iterdir() if path.is_dir()):
            out = REPOSITORY / "out" / folder.name
            if not claimed(out):
                continue
            (out / "outcomes.json").write_text(json.dumps(run_group(folder, out), indent=1))
    return 0


def judged_live(scratch, programs, found, out, is_recorded):
    """Returns rows of the comparison of live and virtual runs; a program that differs is run again."""
    rows = {}
    for turn in range(1 if is_recorded else TRIES):
        waiting = [p for p in programs if not rows.get(name_of(p.machine, p.name), {}).get("same")]
        if not waiting:
            break
        recorded = out / f"live-{turn}"
        if is_recorded:
            outcomes = json.loads((recorded / "outcomes.json").read_text())
        else:
            outcomes = run_live(scratch / f"{turn}", waiting, recorded, LANES if turn == 0 else 1)
            (recorded / "outcomes.json").write_text(json.dumps(outcomes, indent=1))
        names = [name_of(p.machine, p.name) for p in waiting]
        jobs = [(name, outcomes.get(name), found[name]["outcome"], recorded / f"{name}.csv", out / f"virtual/{name}.csv",
                 program.is_random) for name, program in zip(names, waiting)]
        with ProcessPoolExecutor(VIRTUAL_AT_ONCE) as pool:
            rows.update(zip(names, pool.map(truth_judge.beside, jobs)))
    return [rows[name_of(p.machine, p.name)] for p in programs if name_of(p.machine, p.name) in rows]


# -------------------------------------------------------------------- both

def chosen(options):
    configs = [truth_programs.Config(path) for path in sorted((REPOSITORY / "configs").iterdir())
               if (path / f"{path.name}.ini").is_file()]
    programs = (truth_random.random_programs(configs, options.random, options.seed) if options.random
                else truth_programs.all_programs(configs, PKM))
    return [program for program in programs
            if re.search(options.only, f"{program.machine} {program.name}")]


def parsed():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--live", choices=("short", "all"),
                           help="compare with LinuxCNC itself as well: a handful that take seconds each, or all")
    arguments.add_argument("--random", type=int, default=0, metavar="NUMBER", help="random programs, in place of the others")
    arguments.add_argument("--seed", default="0", help="of the random programs")
    arguments.add_argument("--alone", action="store_true", help="with --live: no programs but these")
    arguments.add_argument("--only", default="", help="programs whose machine and name match this expression")
    arguments.add_argument("--recorded", action="store_true",
                           help="compare with what --out holds of a live run, without running it again")
    arguments.add_argument("--out", type=Path, default=REPOSITORY / "build/truth", help="folder for the results")
    options = arguments.parse_args()
    if options.alone and not options.live:
        arguments.error("--alone: needs --live")
    return options


def main():
    if is_unprivileged():
        return run_all()
    options = parsed()
    out = options.out.resolve()
    with tempfile.TemporaryDirectory(prefix="pkmkins-truth-") as scratch:
        programs = [p for p in chosen(options) if options.live == "all" or options.only or p.kind != "reading"
                    or truth_programs.is_short(p)]
        beside = [p for p in programs if options.live == "all" or options.live and truth_programs.is_short(p)]
        programs = beside if options.alone else programs
        kept = {name_of(p.machine, p.name) for p in beside}
        found = run_virtual(prepared(Path(scratch) / "virtual", programs), out / "virtual", kept)
        judge = truth_cycles if options.random else truth_judge
        rows = [judge.row(p, **found[name_of(p.machine, p.name)]) for p in programs]
        (out / "rows.json").write_text(json.dumps(rows, indent=1))
        print(judge.table(rows))
        print(judge.summary(rows), flush=True)
        right = all(row["right"] for row in rows)
        if beside:
            live = judged_live(Path(scratch), beside, found, out, options.recorded)
            (out / "live.json").write_text(json.dumps(live, indent=1))
            print(truth_judge.table_beside(live))
            print(truth_judge.summary_beside(live))
            right = right and all(row["same"] for row in live)
    return 0 if right else 1


if __name__ == "__main__":
    sys.exit(main())
