# SPDX-License-Identifier: GPL-2.0-or-later
"""Writes docs/design-figures.md: poses a second in Python, candidates a second, cost of every engine.

Ratios of one run on one computer; times are printed, never asserted.
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
from pkmkins.design.engine import Cluster, Processes, Serial, judged
from pkmkins.design.search import sample

ROOT = Path(__file__).resolve().parents[2]
STUDY = ROOT / "docs" / "examples" / "design-hexapod.toml"
POSES = 200_000
TURNS = 5
CANDIDATES = 240


def median(seconds):
    return sorted(seconds)[len(seconds) // 2]


def timed(call):
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def by_numpy(machine):
    """Inverse kinematics of a hexapod without a lead, as somebody would write them in numpy."""
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


def rates():
    """Rows of poses a second, in millions: one core, all cores, numpy."""
    code = (
        f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r}); from figures import measured; measured()"
    )
    found = []
    for threads in ("1", "0"):
        environment = os.environ | ({"RAYON_NUM_THREADS": threads} if threads != "0" else {})
        run = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
        found.append(json.loads(run.stdout))
    return found


def measured():
    machine = Machine.from_ini(ROOT / "configs" / "lab-hexapod" / "lab-hexapod.ini")
    rng = np.random.default_rng(1)
    poses = machine.home + rng.uniform(-1, 1, (POSES, 6)) * [40, 40, 30, 5, 5, 5]
    joints = machine.inverse(poses).values
    plain = by_numpy(machine)
    calls = {
        "inverse": lambda: machine.inverse(poses),
        "forward, seeds 0.1 mm and 0.01° away": lambda: machine.forward(joints, seed=poses + [0.1, 0, 0, 0.01, 0, 0]),
        "jacobian": lambda: machine.jacobian(poses),
        "margins": lambda: machine.margins(poses),
        "inverse in numpy": lambda: plain(poses),
    }
    seconds = {name: [] for name in calls}
    for _ in range(TURNS):
        for name, call in calls.items():
            seconds[name].append(timed(call))
    print(json.dumps({name: POSES / median(times) * 1e-6 for name, times in seconds.items()}))


def engines():
    """Seconds of a sample of candidates by every engine, and bytes a judgement."""
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
            # What starts the interpreters is no part of a judgement.
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
    """Milliseconds that the engine adds to one batch: an empty question."""
    from distributed import Client

    client = Client(address)
    study = Study.read(STUDY)
    seconds = [timed(lambda: client.submit(judged, study, [], pure=False).result()) for _ in range(50)]
    client.close()
    return median(seconds) * 1e3


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


def main():
    one, all_cores = rates()
    found, cost, size = engines()
    alone = found["this process"]
    each = alone / CANDIDATES * 1e3
    lines = [
        "# Figures of the Python package",
        "",
        f"Written by `make python-figures`. Measured on {processor()}, Python {platform.python_version()}, numpy {np.__version__}.",
        "Medians of five turns; ratios hold elsewhere, times do not.",
        "",
        f"Millions of poses a second, lab-hexapod, {POSES} poses:",
        "",
        "| call | one core | all cores |",
        "| --- | --- | --- |",
        *[f"| {name} | {one[name]:.2f} | {all_cores[name]:.2f} |" for name in one],
        "",
        f"Candidates of [design-hexapod.toml](examples/design-hexapod.toml), a plain sample of {CANDIDATES}:",
        "",
        "| engine | candidates a second | beside one process |",
        "| --- | --- | --- |",
        *[f"| {name} | {CANDIDATES / seconds:.1f} | {alone / seconds:.2f} |" for name, seconds in found.items()],
        "",
        f"A judgement takes {each:.1f} ms of one core and {size:.0f} bytes of the file. An empty batch takes {cost:.1f} ms by Dask's",
        f"scheduler on the same computer: below 5 % from batches of {max(1, int(np.ceil(cost / (0.05 * each))))} candidates on; `pkm design` sends up to 16.",
        "",
        f"A million candidates take {each * 1e6 / 3.6e6:.0f} hours of one core and {size * 1e-3:.0f} MB. The scheduler, which has one",
        f"core, hands out some {1e3 / cost:.0f} batches a second here: with 16 candidates each it is busy at about {1e3 / cost * 16 * each / 1e3:.0f} workers.",
    ]
    (ROOT / "docs" / "design-figures.md").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
