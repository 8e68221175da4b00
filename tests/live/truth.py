#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""`pkm preflight` compared with the real LinuxCNC: a hundred programs on all shipped machines.

    tests/live/truth.py [--short] [--only TEXT] [--out FOLDER]

Each program is judged by `pkm preflight` and then run in LinuxCNC with drives that lag, with every
servo cycle recorded. Ends in a table: what LinuxCNC did and in which line, what was predicted, and how
far the joint speeds predicted and recorded differ. The guard is off (M52 P0) in all of them: it would
slow down what is to be compared. Exit code 1 where an error of LinuxCNC was not predicted with its
line, where something was predicted that did not come, or where a peak is not as predicted.
"""

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
import ini_edit  # noqa: E402
import truth_judge  # noqa: E402
import truth_programs  # noqa: E402
from session import Session  # noqa: E402
from unprivileged import (LANES, REPOSITORY, claimed, is_unprivileged,  # noqa: E402
                          only_one, rerun_unprivileged)

TOOLS = REPOSITORY / "target/host"
# Parameters of the stored G54, from X on.
G54 = {letter: 5221 + n for n, letter in enumerate("XYZABC")}
STATE = ("T0 M6", "G40 G49 G54 G80 G90 G92.1 M5")
SECONDS_A_PROGRAM = 200


def prepared(folder, programs):
    """A folder for every different machine: configuration with its edits and work offset, programs."""
    groups = {}
    for program in programs:
        key = (program.machine, json.dumps(program.edits), program.offset)
        groups.setdefault(key, []).append(program)
    return [group(folder / f"{n:02}", members) for n, members in enumerate(groups.values())]


def group(folder, members):
    name = members[0].machine
    config = folder / name
    shutil.copytree(REPOSITORY / "configs" / name, config)
    ini = config / f"{name}.ini"
    ini.write_text(ini_edit.edited(ini.read_text(), members[0].edits))
    if members[0].offset:
        (config / f"{name}.var").write_text(
            "".join(f"{G54[letter]}\t{value:.6f}\n" for letter, value in members[0].offset))
    for program in members:
        (config / "programs" / f"truth-{program.name}.ngc").write_text(program.text)
    listed = [[p.name, p.kind, p.seconds] for p in members]
    (folder / "list.json").write_text(json.dumps({"machine": name, "programs": listed}))
    return folder


def flights(folder):
    """What preflight says of the programs of a group."""
    listed = json.loads((folder / "list.json").read_text())
    name = listed["machine"]
    found = {}
    for program, _, _ in listed["programs"]:
        config = folder / name
        command = [TOOLS / "pkm", "preflight", config / f"{name}.ini",
                   config / "programs" / f"truth-{program}.ngc", "--format", "json"]
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True)
        found[program] = json.loads(done.stdout) if done.returncode < 2 else {"refused": done.stderr.strip()}
    return found


def run_group(folder, out, keep):
    """Outcomes of all programs of a group; LinuxCNC is started anew after each that it stops."""
    listed = json.loads((folder / "list.json").read_text())
    name = listed["machine"]
    waiting = listed["programs"]
    outcomes = {}
    while waiting:
        with Session(folder / name) as session:
            startup = ini_edit.value(session.ini.read_text(), "RS274NGC", "RS274NGC_STARTUP_CODE")
            jobs = [[p, str(session.copy / "programs" / f"truth-{p}.ngc"), seconds]
                    for p, _, seconds in waiting]
            limit = 60 + sum(seconds for _, _, seconds in waiting)
            result = session.run("truth", out, limit, programs=jobs, before=[*STATE, startup],
                                 keep=keep)
        done = result.get("outcomes", {})
        if not done:
            # Told once, and not tried for ever.
            outcomes[waiting[0][0]] = {"failed": result["error"]}
            waiting = waiting[1:]
            continue
        outcomes.update(done)
        for program in done:
            print(f"  {name} {program}: {done[program]['errors'] or 'ran to its end'}", flush=True)
        waiting = waiting[len(done):]
    return outcomes


def run_all(keep):
    """Runs what other lanes have not taken."""
    with only_one():
        for folder in sorted(path for path in (REPOSITORY / "given").iterdir() if path.is_dir()):
            out = REPOSITORY / "out" / folder.name
            if not claimed(out):
                continue
            outcomes = run_group(folder, out, keep)
            (out / "outcomes.json").write_text(json.dumps(outcomes, indent=1))
    return 0


def chosen(options):
    configs = [truth_programs.Config(path) for path in sorted((REPOSITORY / "configs").iterdir())
               if (path / f"{path.name}.ini").is_file()]
    return [program for program in truth_programs.all_programs(configs, TOOLS / "pkm")
            if options.only in f"{program.machine} {program.name}"
            and (truth_programs.is_short(program) or not options.short)]


def parsed():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--only", default="", help="programs whose machine and name contain this text")
    arguments.add_argument("--short", action="store_true", help="a dozen that take seconds each")
    arguments.add_argument("--traces", action="store_true", help="keep every servo cycle")
    arguments.add_argument("--recorded", action="store_true", help="judge what --out holds, without running")
    arguments.add_argument("--out", type=Path, default=REPOSITORY / "build/truth", help="folder for the results")
    return arguments.parse_args()


def main():
    options = parsed()
    if is_unprivileged():
        return run_all(options.traces)
    out = options.out.resolve()
    with tempfile.TemporaryDirectory(prefix="pkmkins-truth-") as scratch:
        programs = chosen(options)
        folders = prepared(Path(scratch), programs)
        predicted = {folder.name: flights(folder) for folder in folders}
        limit = SECONDS_A_PROGRAM * len(programs)
        code = 0 if options.recorded else rerun_unprivileged(
            "tests/live/truth.py", ["--traces"] if options.traces else [], limit, out,
            folders, LANES)
        rows = []
        for folder in folders:
            file = out / folder.name / "outcomes.json"
            outcomes = json.loads(file.read_text()) if file.exists() else {}
            listed = json.loads((folder / "list.json").read_text())
            ini = (folder / listed["machine"] / f"{listed['machine']}.ini").read_text()
            rows += [truth_judge.row(listed["machine"], ini, program, kind, outcomes.get(program),
                                     predicted[folder.name][program])
                     for program, kind, _ in listed["programs"]]
    (out / "rows.json").write_text(json.dumps(rows, indent=1))
    print(truth_judge.table(rows))
    print(truth_judge.summary(rows))
    return code or (0 if all(row["right"] for row in rows) else 1)


if __name__ == "__main__":
    sys.exit(main())
