# SPDX-License-Identifier: GPL-2.0-or-later
"""The search over geometries: a known optimum, the same result with every engine, no loss on an interruption."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

pytest.importorskip("pymoo")

from conftest import needs_linuxcnc  # noqa: E402
from pkmkins import CommandFailed, preflight  # noqa: E402
from pkmkins._core import VERSION  # noqa: E402
from pkmkins.design import Study, scatter, write_machine  # noqa: E402
from pkmkins.design.candidate import MEASURES  # noqa: E402
from pkmkins.design.command import main  # noqa: E402
from pkmkins.design.engine import Cluster, EngineError, Processes, judged  # noqa: E402
from pkmkins.design.record import RecordError  # noqa: E402
from pkmkins.design.search import design, merge, sample  # noqa: E402

STUDY = """
name = "hexapod"
kind = "hexapod"
objectives = ["stiffness", "size"]

[fixed]
tool = "up"
strut = [550, 850]
joint_angle = 45
platform_half_angle = 15

[range]
base_radius = [300, 500]
base_half_angle = [5, 25]
platform_radius = [100, 250]

[required]
x = [-60, 60]
y = [-60, 60]
z = [-40, 40]
tilt = 10
conditioning = 0.1

[legs]
stiffness_n_per_um = 10

[search]
seed = 3
population = 12
candidates = 48
"""


@pytest.fixture
def study():
    return Study.parse(STUDY)


TRIPOD = """
kind = "tripod"
objectives = ["stiffness"]

[fixed]
home = [0, 0, 400]
strut = [300, 1200]
joint_angle = 85

[range]
base_radius = [200, 900]

[legs]
stiffness_n_per_um = 10

[search]
candidates = 600
population = 20
"""


def test_a_known_optimum_is_found(tmp_path):
    """Tests the optimum of three struts of stiffness k that meet at height h over feet on a circle of radius R.
    They lean by s, tan s = R/h. The point has the stiffness 3 k cos² s along Z and 3/2 k sin² s across it. The least of
    both is largest when they are equal: R = sqrt(2) h, and both are k."""
    [(values, objectives)] = design(Study.parse(TRIPOD), tmp_path / "r.jsonl").machines
    # 600 candidates reach a thousandth; the stiffness has a kink there, so that it is as near.
    assert values[0] == pytest.approx(400 * np.sqrt(2), rel=1e-3)
    assert objectives[0] == pytest.approx(10_000, rel=2e-3)


def test_the_same_study_gives_the_same_front_with_every_engine(study, tmp_path):
    alone = design(study, tmp_path / "alone.jsonl")
    pool = Processes(2)
    two = design(study, tmp_path / "two.jsonl", engine=pool)
    pool.close()
    assert alone.machines and alone.csv() == two.csv()


def test_a_killed_run_goes_on_and_judges_nothing_twice(study, tmp_path):
    file, results = tmp_path / "study.toml", tmp_path / "study.jsonl"
    file.write_text(STUDY)
    run = subprocess.Popen([sys.executable, "-m", "pkmkins.design.command", file, "--workers", "1"], stdout=subprocess.DEVNULL)
    while not results.exists() or results.read_bytes().count(b"\n") < 10:
        assert run.poll() is None
        time.sleep(0.05)
    os.kill(run.pid, signal.SIGKILL)
    run.wait()
    with open(results, "ab") as half:
        half.write(b'{"x": [1.0, 2')
    kept = results.read_bytes().count(b"\n")
    front = design(study, results)
    assert front.csv() == design(study, tmp_path / "whole.jsonl").csv()
    lines = [json.loads(line) for line in results.read_text().splitlines()[1:]]
    assert len(lines) == len({tuple(line["x"]) for line in lines}) == front.judged > kept - 1


def test_judgements_of_another_study_or_run_are_refused(study, tmp_path):
    results = tmp_path / "r.jsonl"
    design(study, results)
    other = Study.parse(STUDY.replace("tilt = 10", "tilt = 11"))
    with pytest.raises(RecordError, match="another study"):
        design(other, results)
    (tmp_path / "bad.jsonl").write_text("{}\n")
    with pytest.raises(RecordError, match="another study"):
        design(study, tmp_path / "bad.jsonl")
    (tmp_path / "worse.jsonl").write_text("no json\n")
    with pytest.raises(RecordError, match="line 1 is not a judgment"):
        design(study, tmp_path / "worse.jsonl")
    with pytest.raises(RecordError, match="No such file"):
        design(study, tmp_path / "no" / "folder.jsonl")


def test_shards_of_a_sample_merge_to_the_whole(study, tmp_path):
    whole = sample(study, tmp_path / "whole.jsonl", (1, 1))
    parts = [tmp_path / f"{k}.jsonl" for k in (1, 2, 3)]
    for k, part in enumerate(parts, 1):
        sample(study, part, (k, 3))
    assert merge(study, tmp_path / "merged.jsonl", [*parts, parts[0]]).csv() == whole.csv()


def test_what_nothing_meets_is_said_with_the_constraint(tmp_path, capsys):
    file = tmp_path / "study.toml"
    file.write_text(STUDY.replace("tilt = 10", "tilt = 60"))
    assert main([str(file), "--workers", "1", "--quiet"]) == 1
    said = capsys.readouterr().out
    assert "none of 48 candidates fits. Most are ruled out by: " in said and "widen [range]" in said


def test_inaccuracies_of_making_scatter_as_the_slope_says():
    """Tests the kink of the tripod's stiffness, where both sides have known slopes: 3 k cos² s, 3/2 k sin² s."""
    study, far = Study.parse(TRIPOD), 800.0
    spread = scatter(study, [far], 1.0, 0.0)
    slope = -2 * 3 * 10_000 * 400**2 * far / (far**2 + 400**2) ** 2
    assert spread.fitting == 1
    # 64 samples give a standard deviation to a tenth; allow three of them.
    assert spread.deviation[0] == pytest.approx(abs(slope), rel=0.3)
    assert scatter(study, [far], 0.0, 0.0).deviation == (0.0,)


def test_the_chosen_machine_is_written_checked_and_has_the_box(study, tmp_path):
    front = design(study, tmp_path / "r.jsonl")
    values, _ = front.chosen()
    said = write_machine(study, values, tmp_path / "machine")
    assert "fits" in said
    text = (tmp_path / "machine" / "machine.ini").read_text()
    assert "MIN_LIMIT = -60\nMAX_LIMIT = 60\n" in text


def test_a_machine_that_does_not_prove_the_box_is_not_written(tmp_path):
    with pytest.raises(CommandFailed, match="--limits X -600 600, .*: not proved for every pose within: at X-600 "):
        write_machine(Study.parse(STUDY.replace("x = [-60, 60]", "x = [-600, 600]")), [400, 15, 180], tmp_path / "machine")
    assert not (tmp_path / "machine").exists()


@needs_linuxcnc
def test_the_first_program_of_the_chosen_machine_fits(study, tmp_path):
    values, _ = design(study, tmp_path / "r.jsonl").chosen()
    write_machine(study, values, tmp_path / "machine")
    found = preflight(tmp_path / "machine" / "machine.ini", tmp_path / "machine" / "programs" / "first.ngc")
    assert found["fits"] is True, found


def test_an_objective_that_is_no_number_rules_a_machine_out_by_name(study, tmp_path, monkeypatch):
    monkeypatch.setitem(MEASURES, "size", lambda *_: float("nan"))
    front = design(study, tmp_path / "r.jsonl")
    assert not front.machines and "objective size" in front.why_nothing()
    assert [name for name, _ in front.killers if name.startswith("objective")] == ["objective size"]


@pytest.mark.parametrize("lines", [0, 2, 20])
def test_ctrl_c_ends_a_run_with_a_word_and_it_goes_on(study, tmp_path, lines):
    """Sends it to all processes of the terminal, when the file has this many lines: with none, while workers start."""
    file, results = tmp_path / "study.toml", tmp_path / "study.jsonl"
    file.write_text(STUDY)
    command = [sys.executable, "-m", "pkmkins.design.command", file]
    run = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True)
    while not results.exists() or results.read_bytes().count(b"\n") < lines:
        assert run.poll() is None
        time.sleep(0.01)
    os.killpg(run.pid, signal.SIGINT)
    said = run.communicate(timeout=60)[1]
    assert run.returncode == 130 and said.strip() == "pkm design: stopped; results are kept, run the same command to continue"
    kept = results.read_bytes()
    front = design(study, results)
    assert results.read_bytes().startswith(kept) and front.csv() == design(study, tmp_path / "whole.jsonl").csv()


def test_a_worker_process_that_is_killed_ends_the_run_with_a_word(study):
    pool = Processes(2)
    found = pool.each(study, [[400, 15, 180]] * 400)
    next(found)
    os.kill(next(iter(pool._pool._processes)), signal.SIGKILL)
    with pytest.raises(EngineError, match="a worker process was killed"):
        list(found)
    pool.close()


class Dask:
    """A Dask scheduler on this computer, and its worker processes."""

    def __init__(self, folder, workers):
        self.distributed = pytest.importorskip("distributed")
        self.info, self.folder, self.workers = folder / "scheduler.json", folder, []
        self.scheduler = self._started("dask_scheduler", "--host", "127.0.0.1", "--port", "0")
        for _ in range(workers):
            self.add()

    def _started(self, name, *words):
        command = [sys.executable, "-m", f"distributed.cli.{name}", "--scheduler-file", str(self.info), "--no-dashboard", *words]
        return subprocess.Popen(command, stderr=subprocess.DEVNULL)

    def add(self, *words):
        """Adds a worker."""
        self.workers.append(self._started("dask_worker", "--nthreads", "1", "--no-nanny", "--local-directory", str(self.folder), *words))

    def engine(self):
        """Returns an engine of its workers, once all of them have started."""
        deadline = time.monotonic() + 60
        while not self.info.exists() or not self.info.read_text():
            assert time.monotonic() < deadline
            time.sleep(0.2)
        address = json.loads(self.info.read_text())["address"]
        with self.distributed.Client(address) as client:
            client.wait_for_workers(len(self.workers), timeout=60)
        return Cluster(address)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for process in [*self.workers, self.scheduler]:
            process.kill()
            process.wait()


def test_workers_of_dask_may_come_and_go(study, tmp_path):
    alone = design(study, tmp_path / "alone.jsonl")
    with Dask(tmp_path, 3) as dask:
        engine = dask.engine()

        def meddle(record):
            if len(record) > 15 and len(dask.workers) == 3:
                dask.workers[0].kill()
                dask.add()

        spread = design(study, tmp_path / "spread.jsonl", engine=engine, progress=meddle)
        engine.close()
        assert len(dask.workers) == 4 and spread.csv() == alone.csv() and spread.judged == alone.judged


def test_a_run_whose_scheduler_is_killed_goes_on_with_another(study, tmp_path):
    alone, results = design(study, tmp_path / "alone.jsonl"), tmp_path / "r.jsonl"
    with Dask(tmp_path, 2) as dask:
        engine = dask.engine()

        def kill(record):
            if len(record) > 15:
                dask.scheduler.kill()

        with pytest.raises(EngineError, match="the scheduler has disappeared; results are kept"):
            design(study, results, engine=engine, progress=kill)
        engine.close()
    kept = results.read_bytes()
    assert kept.count(b"\n") > 15
    dask.info.unlink()
    with Dask(tmp_path, 2) as dask:
        engine = dask.engine()
        front = design(study, results, engine=engine)
        engine.close()
    assert results.read_bytes().startswith(kept)
    assert front.csv() == alone.csv() and front.judged == alone.judged


def test_workers_of_another_version_are_refused(study, tmp_path):
    with pytest.raises(EngineError, match=f"this worker has pkmkins {VERSION}, the study comes from 0.0.1"):
        judged(study, [], "0.0.1")
    other = tmp_path / "other.py"
    other.write_text("import pkmkins._core\npkmkins._core.VERSION = '0.0.1'\n")
    with Dask(tmp_path, 1) as dask:
        dask.add("--preload", str(other))
        with pytest.raises(EngineError, match="has pkmkins 0.0.1, this computer .*: install the same version everywhere"):
            dask.engine()
