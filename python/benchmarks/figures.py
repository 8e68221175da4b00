# SPDX-License-Identifier: GPL-2.0-or-later
"""Writes build/design-figures.md: poses per second in Python, candidates per second, cost of every engine.

Ratios are from one run on one computer; times are printed, never asserted.
"""

import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from pkmkins import Machine
from pkmkins.design import Study
from pkmkins.design.engine import BATCH, Cluster, Processes, Serial, judged
from pkmkins.design.search import design, sample

ROOT = Path(__file__).resolve().parents[2]
STUDY = ROOT / "docs/studies/examples/design-hexapod.toml"
POSES = 200_000
TURNS = 15
CANDIDATES = 240


def median(seconds):
    return sorted(seconds)[len(seconds) // 2]


def timed(call):
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def by_numpy(machine):
    """Computes the inverse kinematics of a hexapod without a lead, as a user would in numpy."""
    text = machine.text
    anchors = [[list(map(float, line.split("=")[1].split())) for line in text.splitlines() if line.startswith(key + " =")] for key in ("BASE", "PLATFORM")]
    base, platform = np.array(anchors)

    def inverse(poses):
        a, b, c = np.radians(poses[:, 3:]).T
        ca, sa, cb, sb, cc, sc = np.cos(a), np.sin(a), np.cos(b), np.sin(b), np.cos(c), np.sin(c)
        turn = np.array([
            [cc * cb, cc * sb * sa - sc * ca, cc * sb * ca + sc * sa],
            [sc * cb, sc * sb * sa + cc * ca, sc * sb * ca - cc * sa],
            [-sb, cb * sa, cb * ca],
        ])
        ends = np.einsum("ijn,kj->nki", turn, platform) + poses[:, None, :3]
        return np.linalg.norm(ends - base, axis=2)

    return inverse


class Batch:
    """The batch of command/benches/batch.rs, which runs in turns with Python."""

    def __init__(self, ini, poses, folder):
        rows = folder / "poses"
        rows.write_bytes(poses.astype("<f8").tobytes())
        words = ["cargo", "bench", "--locked", "--quiet", "-p", "pkm", "--bench", "batch", "--", ini, rows]
        self._process = subprocess.Popen(words, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def seconds(self, call):
        print(call, file=self._process.stdin, flush=True)
        return float(self._process.stdout.readline())

    def close(self):
        self._process.communicate()


def rates():
    """Returns rows of poses per second, in millions, on one core and on all, in separate processes."""
    code = f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r}); from figures import measured; measured()"
    found = []
    for cores in ({"RAYON_NUM_THREADS": "1"}, {}):
        run = subprocess.run([sys.executable, "-c", code], env=os.environ | cores, stdout=subprocess.PIPE, text=True, check=True)
        found.append(json.loads(run.stdout))
    return found


def measured():
    """Prints the measurements of one process, the calls in turns."""
    ini = ROOT / "configs" / "lab-hexapod" / "lab-hexapod.ini"
    machine = Machine.from_ini(ini)
    rng = np.random.default_rng(1)
    poses = machine.home + rng.uniform(-1, 1, (POSES, 6)) * [40, 40, 30, 5, 5, 5]
    joints, seeds = machine.inverse(poses).values, poses + [0.1, 0, 0, 0.01, 0, 0]
    plain = by_numpy(machine)
    with tempfile.TemporaryDirectory() as name:
        batch = Batch(ini, poses, Path(name))
        calls = {
            "inverse": lambda: timed(lambda: machine.inverse(poses)),
            "inverse, batch in Rust": lambda: batch.seconds("inverse"),
            "inverse in numpy": lambda: timed(lambda: plain(poses)),
            "forward, seeds 0.1 mm and 0.01° away": lambda: timed(lambda: machine.forward(joints, seed=seeds)),
            "forward, batch in Rust": lambda: batch.seconds("forward"),
            "jacobian": lambda: timed(lambda: machine.jacobian(poses)),
            "margins": lambda: timed(lambda: machine.margins(poses)),
        }
        turns = [{name: call() for name, call in calls.items()} for _ in range(TURNS)]
        batch.close()
    print(json.dumps({name: POSES / median([turn[name] for turn in turns]) * 1e-6 for name in calls}))


def searched():
    """Returns the front of the study with all its candidates, by two processes, and its duration in seconds."""
    study = Study.read(STUDY)
    with tempfile.TemporaryDirectory() as name:
        pool = Processes(2)
        start = time.perf_counter()
        front = design(study, Path(name) / "r.jsonl", engine=pool)
        seconds = time.perf_counter() - start
        pool.close()
    return front, seconds


def engines():
    """Returns seconds for a sample of candidates by every engine, and bytes per judgement."""
    text = STUDY.read_text()
    lines = [f"candidates = {CANDIDATES}" if line.startswith("candidates") else line for line in text.splitlines()]
    study = Study.parse("\n".join(lines))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)

        def run(name, engine):
            seconds = timed(lambda: sample(study, folder / f"{name}.jsonl", (1, 1), engine=engine))
            engine.close()
            return seconds

        os.environ["RAYON_NUM_THREADS"] = "1"
        found = {"this process": run("serial", Serial())}
        for workers in (1, 2):
            pool = Processes(workers)
            # Exclude the start of the interpreters from the judgements.
            list(pool.each(study, [middle(study)] * workers))
            found[f"--workers {workers}"] = run(f"pool-{workers}", pool)
        with dask(folder, 2) as address:
            cluster = Cluster(address)
            list(cluster.each(study, [middle(study)] * 2))
            found["--scheduler, two workers"] = run("dask", cluster)
            cost = nothing(address)
        size = (folder / "serial.jsonl").stat().st_size / CANDIDATES
    return found, cost, size


def middle(study):
    return [(one.low + one.high) / 2 for one in study.ranges]


def nothing(address):
    """Returns milliseconds of client, scheduler and a worker for a batch without work, many of them in parallel."""
    from distributed import Client

    study, count = Study.read(STUDY), 500
    with Client(address) as client:
        def empty():
            client.gather([client.submit(judged, study, [], pure=False) for _ in range(count)])

        return median([timed(empty) for _ in range(5)]) / count * 1e3


class dask:
    """A scheduler and workers on this computer."""

    def __init__(self, folder, workers):
        self.info = folder / "scheduler.json"
        common = ["--scheduler-file", str(self.info), "--no-dashboard"]
        words = [["dask_scheduler", "--host", "127.0.0.1", "--port", "0", *common]]
        words += [["dask_worker", *common, "--nthreads", "1", "--no-nanny", "--local-directory", str(folder)]] * workers
        self.started = [
            subprocess.Popen([sys.executable, "-m", "distributed.cli." + name, *rest], stderr=subprocess.DEVNULL)
            for name, *rest in words
        ]

    def __enter__(self):
        while not self.info.exists() or not self.info.read_text():
            time.sleep(0.1)
        return json.loads(self.info.read_text())["address"]

    def __exit__(self, *_):
        for process in self.started:
            process.kill()
            process.wait()


def processor():
    names = [line.split(":", 1)[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")]
    return f"{len(names)} cores of {names[0]}"


def table(head, rows):
    """Returns the lines of a table."""
    return ["| " + " | ".join(row) + " |" for row in [head, ["---"] * len(head), *rows]]


def write(name, lines):
    """Writes a page into build/ and prints it."""
    (ROOT / "build").mkdir(exist_ok=True)
    (ROOT / "build" / name).write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


def of_rates(one, both):
    """Returns lines about poses per second, compared with others."""
    def share(name, other):
        return f"{one[name] / one[other]:.2f} and {both[name] / both[other]:.2f}"

    forward = "forward, seeds 0.1 mm and 0.01° away"
    return [
        f"Millions of poses a second, lab-hexapod, {POSES} poses, all calls in turns, medians of {TURNS}:",
        "",
        *table(["call", "one core", "all cores"], [[name, f"{one[name]:.2f}", f"{both[name]:.2f}"] for name in one]),
        "",
        f"Beside the batch in Rust, on one core and on all, inverse reaches {share('inverse', 'inverse, batch in Rust')} of it,",
        f"forward {share(forward, 'forward, batch in Rust')}; beside numpy inverse is {share('inverse', 'inverse in numpy')} times as fast.",
    ]


def of_search(front, seconds):
    """Returns lines about the study with all its candidates."""
    return [
        f"[design-hexapod.toml](../docs/studies/examples/design-hexapod.toml) as it is, `pkm design --workers 2`: {front.judged} candidates in {seconds:.0f} s,",
        f"of which {front.fitting} keep their limits at the poses looked at; {len(front.machines)} are on the front.",
    ]


def of_engines(found, cost, size, each):
    """Returns lines that compare engines, and the consequences for many computers."""
    alone = found["this process"]
    batch = max(1, int(np.ceil(cost / (0.05 * each))))
    rows = [[name, f"{CANDIDATES / seconds:.1f}", f"{alone / seconds:.2f}"] for name, seconds in found.items()]
    return [
        f"The same study, a plain sample of {CANDIDATES}, of which fewer are measured to the end than in a search:",
        "",
        *table(["engine", "candidates a second", "beside one process"], rows),
        "",
        f"A batch without work takes client, scheduler and worker of Dask {cost:.2f} ms of this computer: {cost / BATCH:.3f} ms a candidate in",
        f"batches of {BATCH}, which `pkm design` sends at the most, and below 5 % of the work from batches of {batch} on.",
        "",
        "## To the scale of the internet",
        "",
        f"A judgement of the search takes {each:.1f} ms of one core, and {size:.0f} bytes of the file. A million candidates take",
        f"{each * 1e6 / 3.6e6:.0f} hours of one core and {size:.0f} MB. The scheduler has one core: with {1e3 / cost:.0f} batches of {BATCH} a second at the most",
        f"it keeps {each / cost * BATCH:.0f} workers busy. A search waits for the end of each generation, so that more workers than a",
        "generation has candidates (`population`) stand idle; a plain sample in parts (`--shard`) has neither limit.",
    ]


def main():
    one, both = rates()
    front, seconds = searched()
    found, cost, size = engines()
    each = 2 * seconds / front.judged * 1e3
    lines = [
        "# Figures of the Python package",
        "",
        f"Written by `cargo xtask python-figures`. Measured on {processor()}, Python {platform.python_version()}, numpy {np.__version__}.",
        "Ratios hold elsewhere, times do not.",
        "",
        *of_rates(one, both),
        "",
        *of_search(front, seconds),
        "",
        *of_engines(found, cost, size, each),
    ]
    write("design-figures.md", lines)


if __name__ == "__main__":
    main()
