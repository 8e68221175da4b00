# SPDX-License-Identifier: GPL-2.0-or-later
"""The command `pkm design`, which finds this program as `pkm-design`."""

import argparse
import json
import sys
import time
from pathlib import Path

from .._core import VERSION
from ..command import CommandFailed
from .engine import Cluster, EngineError, Processes, Serial
from .record import RecordError
from .result import write_machine
from .scatter import scatter
from .search import design, merge, sample
from .study import OBJECTIVES, Study, StudyError

TEXT = """Find the best machine of a kind for a purpose, before it is built

STUDY.toml has a kind of `pkm new`, fixed dimensions and ranges of the others, a box of poses that the machine must
reach, and the objectives. Every judged candidate is saved to a file immediately, so a stopped run continues where it
was, with the same result.
"""

EPILOG = """exit status: 0 if machines fit, 1 if none does (with the reason), 2 if the input is invalid

examples:
  pkm design study.toml                                 search with two processes
  pkm design study.toml --write machine                 also write the chosen machine, complete and checked
  pkm design study.toml --scheduler tcp://host:8786     use the workers of a Dask scheduler
  pkm design study.toml --shard 3/64                    judge one part of a plain sample (Slurm, GNU parallel)
  pkm design study.toml --merge study-*-of-64.jsonl     show the front of all parts

`pkm help studies/design` describes the study file.
"""


def main(arguments=None):
    """Runs the command; returns its exit status."""
    given = _parser().parse_args(arguments)
    try:
        return _run(given)
    except (StudyError, RecordError, EngineError, CommandFailed, OSError) as error:
        print(f"pkm design: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("\npkm design: stopped; results are kept, run the same command to continue", file=sys.stderr)
        return 130


def _parser():
    form = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser("pkm design", description=TEXT, epilog=EPILOG, formatter_class=form)
    parser.add_argument("study", metavar="STUDY.toml", type=Path)
    parser.add_argument("--results", metavar="FILE.jsonl", type=Path, help="file for judgments [STUDY.jsonl]")
    parser.add_argument("--workers", metavar="N", type=_count, default=2, help="number of processes on this computer [2]")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="use a Dask scheduler, such as tcp://host:8786")
    parser.add_argument("--shard", metavar="K/N", type=_shard, help="judge part K of N of a plain sample instead")
    parser.add_argument("--merge", metavar="FILE", nargs="+", type=Path, help="merge files of judgments")
    parser.add_argument(
        "--tolerance",
        metavar=("LENGTH", "DEGREES"),
        nargs=2,
        type=_deviation,
        help="also judge the chosen machine with these standard deviations of lengths and angles",
    )
    parser.add_argument("--csv", metavar="FILE.csv", type=Path, help="also write the front as CSV")
    parser.add_argument("--page", metavar="FILE.html", type=Path, help="also write the front as a page")
    parser.add_argument("--write", metavar="FOLDER", type=Path, help="also write the chosen machine as a configuration")
    parser.add_argument("--format", choices=["text", "json"], default="text", help="output format")
    parser.add_argument("--quiet", action="store_true", help="print no progress")
    parser.add_argument("--version", action="version", version=f"pkmkins {VERSION}")
    return parser


def _count(text):
    if not text.isdecimal() or not 1 <= int(text) <= 1024:
        raise argparse.ArgumentTypeError(f"{text}: expected 1 to 1024")
    return int(text)


def _deviation(text):
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 <= value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text}: expected a number of 0 or more")
    return value


def _shard(text):
    number, _, count = text.partition("/")
    if not (number.isdecimal() and count.isdecimal() and 1 <= int(number) <= int(count)):
        raise argparse.ArgumentTypeError(f"{text}: expected K/N, such as 3/64")
    return int(number), int(count)


def _run(given):
    study = Study.read(given.study)
    results = given.results or given.study.with_suffix(".jsonl")
    if given.shard and not given.results:
        results = given.study.with_name(f"{given.study.stem}-{given.shard[0]}-of-{given.shard[1]}.jsonl")
    if given.write and given.write.exists():
        raise StudyError(f"{given.write} is there already, and nothing in it is changed: give another folder")
    front = _front(given, study, results)
    found = front.fields()
    if given.tolerance and front.machines:
        spread = scatter(study, front.chosen()[0], *given.tolerance)
        found["tolerances"] = {"mean": spread.mean, "deviation": spread.deviation, "fitting": spread.fitting}
    print(json.dumps(found, indent=2) if given.format == "json" else front)
    if given.tolerance and front.machines and given.format == "text":
        print(spread.lines(study))
    if given.csv:
        given.csv.write_text(front.csv())
    if given.page:
        given.page.write_text(front.page())
    if not front.machines:
        return 1
    if given.write:
        values, _ = front.chosen()
        said = write_machine(study, values, given.write)
        if given.format == "text":
            print(said)
    return 0


def _front(given, study, results):
    if given.merge:
        missing = [part for part in given.merge if not part.is_file()]
        if missing:
            raise RecordError(f"{missing[0]}: no such file")
        return merge(study, results, given.merge)
    engine = _engine(given)
    progress = _quiet if given.quiet or not sys.stderr.isatty() else Progress(study)
    try:
        if given.shard:
            return sample(study, results, given.shard, engine=engine, progress=progress)
        return design(study, results, engine=engine, progress=progress)
    finally:
        engine.close()
        if isinstance(progress, Progress):
            progress.end()


def _engine(given):
    if given.scheduler:
        return Cluster(given.scheduler)
    return Processes(given.workers) if given.workers > 1 else Serial()


def _quiet(_record):
    pass


class Progress:
    """One line that is overwritten: number of judged machines, time left, the best of each objective."""

    def __init__(self, study):
        self._study, self._start, self._first, self._shown = study, time.monotonic(), None, 0.0

    def __call__(self, record):
        now = time.monotonic()
        self._first = len(record) - 1 if self._first is None else self._first
        if now - self._shown < 0.5:
            return
        self._shown = now
        done, total = len(record), self._study.candidates
        left = (now - self._start) / max(1, done - self._first) * max(0, total - done)
        best = [_best(record, k, name) for k, name in enumerate(self._study.objectives)]
        print(f"\r{done} of {total}, {left:.0f} s left; best so far: {', '.join(best)}\033[K", end="", file=sys.stderr)

    def end(self):
        """Ends the line."""
        print("\r\033[K", end="", file=sys.stderr)


def _best(record, k, name):
    values = [found.objectives[k] for _, found in record.items() if found.fits]
    if not values:
        return f"{name} -"
    return f"{name} {max(values) if OBJECTIVES[name] == 'largest' else min(values):.5g}"


if __name__ == "__main__":
    sys.exit(main())
