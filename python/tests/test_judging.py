# SPDX-License-Identifier: GPL-2.0-or-later
"""Tests the parts of the search over geometries that need no pymoo."""

import csv
import dataclasses
import io
import json
import math
import re

import numpy as np
import pytest
from conftest import ini
from pkmkins import CommandFailed, Machine, MachineError, kinds
from pkmkins.design import Front, Judgement, Study, StudyError, candidate, judge, result, scatter
from pkmkins.design.engine import BATCH, Serial, batches, judged
from pkmkins.design.record import Record, RecordError
from pkmkins.design.study import Range, Required

STUDY = """
kind = "tripod"
objectives = ["stiffness", "size", "stroke", "tool_error"]

[fixed]
home = [0, 0, 400]
strut = [300, 1200]
joint_angle = 85

[range]
base_radius = [200, 900]

[required]
x = [-30, 20]
z = [-10, 40]

[legs]
stiffness_n_per_um = 10
joint_sigma_um = 5

[search]
population = 8
candidates = 16
"""


@pytest.fixture
def study():
    return Study.parse(STUDY)


def test_a_study_is_read_with_its_defaults(study):
    assert (study.name, study.kind, study.seed, study.population, study.candidates, study.bands) == ("tripod", "tripod", 1, 8, 16, 12)
    default = Study.parse(STUDY[: STUDY.index("[search]")])
    assert (default.seed, default.population, default.candidates, default.bands) == (1, 60, 3000, 12)
    for key, ends in [("seed", (0, 2**31)), ("population", (4, 100_000)), ("candidates", (4, 100_000_000)), ("bands", (4, 200))]:
        assert [getattr(Study.parse(STUDY[: STUDY.index("[search]")] + f"[search]\n{key} = {end}\n"), key) for end in ends] == list(ends)
    assert study.ranges == (Range("base_radius", None, 200.0, 900.0),) and study.fixed["strut"] == [300, 1200]
    assert study.required == Required(box=((-30.0, 20.0), (0.0, 0.0), (-10.0, 40.0)))
    required = study.required
    assert (required.tilt, required.conditioning, required.feed, required.joint_speed) == (0, 0, 0, math.inf)
    assert study.legs == "[legs]\nstiffness_n_per_um = 10\njoint_sigma_um = 5\n"
    assert study.dimensions([321]) == {"home": [0, 0, 400], "strut": [300, 1200], "joint_angle": 85, "base_radius": 321.0}
    several = Study.parse(STUDY.replace("strut = [300, 1200]\n", "").replace("[range]\n", "[range]\nstrut = [[200, 400], [900, 1300]]\n"))
    assert [(one.name, one.place) for one in several.ranges] == [("strut", 0), ("strut", 1), ("base_radius", None)]
    assert several.dimensions([300, 1200, 500])["strut"] == [300.0, 1200.0]
    whole = Study.parse(STUDY.replace("x = [-30, 20]", "tilt = 5\nconditioning = 0.2\nfeed = 10\njoint_speed = 20"))
    assert whole.required == Required(((0.0, 0.0), (0.0, 0.0), (-10.0, 40.0)), 5.0, 0.2, 10.0, 20.0)
    assert study.hash != whole.hash and Study.parse(STUDY).hash == study.hash
    assert Study.parse(STUDY[:STUDY.index("[legs]")].replace('"stiffness", "size", "stroke", "tool_error"', '"size"')).legs == ""
    words = Study.parse(STUDY.replace("[search]", 'screw = "self-locking"\n[search]'))
    assert words.legs.endswith('screw = "self-locking"\n')


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("population = 8", "population = 3", "search.population: 3; expected an integer from 4 to 100000"),
        ("population = 8", "population = true", "search.population: True"),
        ("population = 8", "seed = -1", "search.seed: -1; expected an integer from 0 to"),
        ("population = 8", "seed = 2147483649", "search.seed: 2147483649"),
        ("population = 8", "population = 100001", "search.population: 100001"),
        ("candidates = 16", "candidates = 3", "search.candidates: 3"),
        ("candidates = 16", "candidates = 100_000_001", "search.candidates: 100000001"),
        ("population = 8", "bands = 3", "search.bands: 3"),
        ("population = 8", "bands = 201", "search.bands: 201"),
        ("x = [-30, 20]", "x = [20, -30]", "required.x: 20.0 to -30.0 is empty"),
        ("x = [-30, 20]", "tilt = -1", "expected numbers >= 0"),
        ("x = [-30, 20]", "tilt = true", "required.tilt: True"),
        ("x = [-30, 20]", "w = [0, 1]", "required.w: unknown key"),
        ("x = [-30, 20]", "joint_speed = 3", "belong together"),
        ("x = [-30, 20]", "feed = 3", "belong together"),
        ("base_radius = [200, 900]", "base_radius = [200, 200]", "range.base_radius: 200.0 to 200.0 is empty"),
        ("base_radius = [200, 900]", "base_radius = [200, 300, 400]", "expected two numbers"),
        ("base_radius = [200, 900]", "base_radius = [200, nan]", "range.base_radius: nan; expected a number"),
        ("base_radius = [200, 900]", "", "nothing to search"),
        ('"size", ', '"stiffness", ', "an objective appears twice"),
        ('"size", ', '"weight", ', "objectives: weight; expected some of"),
        ('["stiffness", "size", "stroke", "tool_error"]', "[]", "objectives: expected a list"),
        ("stiffness_n_per_um = 10\n", "", "objective stiffness: [legs] needs stiffness_n_per_um"),
        ("joint_sigma_um = 5", "", "objective tool_error: [legs] needs joint_sigma_um"),
        ("joint_sigma_um = 5", 'joint_sigma_um = "5"', "legs.joint_sigma_um: 5; expected a number"),
        ("[search]", "[search]\nother = 1", "search.other: unknown key"),
        ('kind = "tripod"', "kind = 3", "kind: expected a word"),
        ("joint_angle = 85", "base_radius = 85", "[fixed] and [range] both have base_radius"),
        ("[legs]", "[legs", "line"),
    ],
)
def test_a_wrong_study_is_refused(old, new, text):
    with pytest.raises(StudyError, match=re.escape(text)):
        Study.parse(STUDY.replace(old, new, 1))


def test_required_poses_are_corners_edges_and_middle_at_every_tilt():
    machine = Machine.from_ini(ini("hexapod"))
    required = Required(box=((-30.0, 20.0), (0.0, 0.0), (-10.0, 40.0)), tilt=10.0)
    poses = candidate.required_poses(machine, required) - machine.home
    assert sorted({tuple(pose[:3]) for pose in poses}) == [(x, 0, z) for x in (-30, -5, 20) for z in (-10, 15, 40)]
    turns = sorted({tuple(pose[3:].round(9)) for pose in poses})
    assert len(turns) == 9 and len(poses) == 81 and (0, 0, 0) in turns
    azimuths = []
    for a, b, c in turns:
        about_x, about_y = np.radians([a, b])
        axis = [np.sin(about_y) * np.cos(about_x), -np.sin(about_x), np.cos(about_y) * np.cos(about_x)]
        assert c == 0 and np.degrees(np.arccos(axis[2])) == pytest.approx(10 if a or b else 0, abs=1e-5)
        if a or b:
            azimuths.append(np.degrees(np.arctan2(axis[1], axis[0])) % 360)
    assert sorted(np.round(azimuths)) == pytest.approx([0, 45, 90, 135, 180, 225, 270, 315])
    # Without A the platform tilts by B alone.
    flat = Machine.from_ini(ini("four-rod-lathe"))
    level = candidate.required_poses(flat, Required(tilt=10.0)) - flat.home
    assert (level[:, [0, 1, 2, 3, 5]] == 0).all() and level[:, 4].max() == pytest.approx(10) and level[:, 4].min() == pytest.approx(-10)
    assert len(candidate.required_poses(machine, Required())) == 1


def test_objectives_are_those_of_the_machine(study):
    values = [550.0]
    machine = kinds.machine_of("tripod", **study.dimensions(values))
    poses = candidate.required_poses(machine, study.required)
    found = judge(study, values)
    assert found.fits and found.violations == {}
    least = machine.stiffness(poses, study.legs).translation.values[:, 0].min()
    joints = machine.inverse(poses).values
    jacobian = machine.jacobian(poses).values[:, :, :3]
    # Three struts: the deviation at the tip is sigma times the norm of the inverse.
    error = max(np.linalg.norm(np.linalg.inv(one)) for one in jacobian) * 5e-3
    assert found.objectives == pytest.approx((least, candidate.size(machine, poses).max(), np.ptp(joints, axis=0).max(), error))
    inch = dataclasses.replace(study, objectives=("tool_error",), fixed={**study.fixed, "unit": "inch", "home": [0, 0, 16], "strut": [12, 48]}, required=Required())
    machine = kinds.machine_of("tripod", **inch.dimensions([20.0]))
    [one] = machine.jacobian(machine.home[None]).values[:, :, :3]
    assert judge(inch, [20.0]).objectives[0] == pytest.approx(np.linalg.norm(np.linalg.inv(one)) * 5e-3 / 25.4)
    volume = dataclasses.replace(study, objectives=("volume",))
    machine = kinds.machine_of("tripod", **study.dimensions(values))
    assert judge(volume, values).objectives == (machine.workspace(bands=12).volume,)


def test_violations_say_what_is_missing_and_by_how_much(study):
    machine = kinds.machine_of("tripod", **study.dimensions([550.0]))
    poses = candidate.required_poses(machine, study.required)
    least = machine.conditioning(poses).values.min()
    fastest = np.linalg.norm(machine.jacobian(poses).values[:, :, :3], axis=2).max()

    def of(**required):
        return judge(dataclasses.replace(study, required=dataclasses.replace(study.required, **required)), [550.0]).violations

    assert of(conditioning=0.99 * least) == {} and of(feed=10.0, joint_speed=10.01 * fastest) == {}
    assert of(conditioning=2 * least) == {"conditioning": pytest.approx(0.5)}
    assert of(feed=10.0, joint_speed=5 * fastest) == {"joint speed": pytest.approx(1.0)}
    assert of(feed=10.0, joint_speed=0.0) == {"joint speed": candidate.NO_MACHINE}
    wide = of(box=((-900.0, 900.0), (0.0, 0.0), (0.0, 0.0)))
    far = kinds.machine_of("tripod", **study.dimensions([550.0]))
    poses = candidate.required_poses(far, Required(box=((-900.0, 900.0), (0.0, 0.0), (0.0, 0.0))))
    margins = far.margins(poses)
    columns = [k for k, name in enumerate(margins.names) if name.startswith("joint range")]
    missing = -np.minimum(margins.share[:, columns], 0).min(axis=0).sum()
    assert wide["joint range"] == pytest.approx(missing) and missing > 0 and "axis range" not in wide
    delta = Machine.from_ini(ini("linear-delta"))
    poses = delta.home + np.array([[0.0] * 6, [9e3, 0, 0, 0, 0, 0], [0, 9e3, 0, 0, 0, 0]])
    assert candidate._violations(delta, poses, Required())["reach"] == pytest.approx(1 + 2 / 3)
    nothing = judge(study, [899.0 * 20])
    assert not nothing.fits and list(nothing.violations) == ["machine"] and candidate.NO_MACHINE <= nothing.violations["machine"] <= candidate.NO_MACHINE + 1
    assert all(map(math.isnan, nothing.objectives)) and len(nothing.objectives) == 4


@pytest.mark.parametrize(
    ("text", "by"),
    [("joint 0 would be 700; 100 to 600", 100 / 600), ("it would stand at -50.5 mm; -10 to 90", 40.5 / 140.5), ("joint 0 would be 300; 100 to 600", 0), ("no such machine", 1)],
)
def test_how_far_a_machine_is_from_existing_is_read_from_its_refusal(text, by):
    assert candidate._by_how_much(text) == pytest.approx(by)


def test_engines_hand_out_everything_once(study):
    for count, workers in [(0, 2), (1, 2), (7, 1), (100, 2), (1000, 3)]:
        pieces = list(batches([[k] for k in range(count)], workers))
        assert [one for piece in pieces for one in piece] == list(enumerate([k] for k in range(count)))
        assert all(1 <= len(piece) <= BATCH for piece in pieces)
        assert count < 8 or len(pieces) >= 4 * workers
    candidates = [[400.0], [550.0]]
    assert repr(list(Serial().each(study, candidates))) == repr(list(enumerate(judged(study, candidates))))


def judgement(*objectives, **violations):
    return Judgement(objectives, violations)


def test_judgements_are_kept_to_the_last_bit_and_once(study, tmp_path):
    file = tmp_path / "r.jsonl"
    with Record(file, study) as record:
        record.add((0.1, 1 / 3), judgement(1.5, math.nan, 2.0, 3.0, reach=0.25))
        record.add((0.1, 1 / 3), judgement(9.0, 9.0, 9.0, 9.0))
        record.add((0.1, 0.3333), judgement(1.0, 2.0, 3.0, 4.0))
        with pytest.raises(RecordError, match="another run is writing to it"):
            Record(file, study)
    with open(file, "ab") as half:
        half.write(b'{"x": [1.0')
    with Record(file, study) as record:
        assert len(record) == 2 and record.get((0.1, 1 / 3)).violations == {"reach": 0.25} and record.get((5.0, 5.0)) is None
        assert [values for values, _ in record.items()] == [(0.1, 1 / 3), (0.1, 0.3333)]
        assert math.isnan(record.items()[0][1].objectives[1]) and record.items()[1][1].fits
        record.add((7.0, 8.0), judgement(1.0, 2.0, 3.0, 4.0))
    lines = [json.loads(line) for line in file.read_text().splitlines()]
    assert len(lines) == 4 and lines[0]["study"] == study.hash and lines[1]["objectives"] == [1.5, None, 2.0, 3.0] and lines[3]["x"] == [7.0, 8.0]
    with pytest.raises(RecordError, match="another study"):
        Record(file, Study.parse(STUDY.replace("population = 8", "population = 12")))
    changed = {**lines[0], "version": "0.0.1"}
    file.write_text(json.dumps(changed) + "\n")
    with pytest.raises(RecordError, match="another version of pkmkins"):
        Record(file, study)
    file.write_text(json.dumps(lines[0]) + "\n" + '{"x": [1]}\n')
    with pytest.raises(RecordError, match="line 2 is not a judgment"):
        Record(file, study)


@pytest.fixture
def front(study, tmp_path):
    """Returns a result for stiffness (maximized) and size (minimized)."""
    two = dataclasses.replace(study, name="a <b>", objectives=("stiffness", "size"))
    with Record(tmp_path / "r.jsonl", two) as record:
        record.add((300.0,), judgement(10.0, 100.0))
        record.add((400.0,), judgement(19.0, 120.0))
        record.add((500.0,), judgement(20.0, 200.0))
        # Worse in both than 400, and as good as 300 in one.
        record.add((600.0,), judgement(18.0, 130.0))
        record.add((700.0,), judgement(9.0, 100.0))
        record.add((800.0,), judgement(math.nan, math.nan, reach=1.0, conditioning=0.5))
        record.add((900.0,), judgement(math.nan, math.nan, reach=2.0))
        return Front.of(two, record)


def test_a_grid_has_up_to_five_round_numbers():
    ends = [(0, 4), (0, 8), (0, 10), (0, 20), (0, 36), (-1, 2.6)]
    assert [result._round_between(*one) for one in ends] == [
        [0, 1, 2, 3, 4], [0, 2, 4, 6, 8], [0, 2.5, 5, 7.5, 10], [0, 5, 10, 15, 20], [0, 10, 20, 30], [-1, 0, 1, 2]]


def test_a_front_has_the_machines_that_none_is_better_than(front):
    assert front.machines == (((500.0,), (20.0, 200.0)), ((400.0,), (19.0, 120.0)), ((300.0,), (10.0, 100.0)))
    assert (front.judged, front.fitting, front.killers) == (7, 5, (("reach", 2), ("conditioning", 1)))
    # As shares: 300 is 1 and 0 away from the best, 500 is 0 and 1, 400 is 0.1 and 0.2.
    assert front.chosen() == ((400.0,), (19.0, 120.0))
    rows = list(csv.DictReader(io.StringIO(front.csv())))
    assert [(row["base_radius"], row["stiffness"], row["size"]) for row in rows] == [("500.0", "20.0", "200.0"), ("400.0", "19.0", "120.0"), ("300.0", "10.0", "100.0")]
    fields = front.fields()
    assert fields["chosen"] == {"base_radius": 400.0, "stiffness": 19.0, "size": 120.0} and fields["fits"] is None
    assert (fields["version"], fields["command"], fields["study"]) == (1, "design", "a <b>")
    assert (fields["judged"], fields["fitting"], fields["constraints"], len(fields["front"])) == (7, 5, {"reach": 2, "conditioning": 1}, 3)
    lines = str(front).splitlines()
    assert lines[0].startswith("a <b>: 5 of 7 candidates") and lines[0].endswith("3 are on the front")
    assert [line.split()[:3] for line in lines[1:]] == [["base_radius", "stiffness", "size"], ["500", "20", "200"], ["400", "19", "120"], ["300", "10", "100"]]
    assert [("nearest" in line) for line in lines] == [False, False, False, True, False]
    page = front.page()
    assert "a &lt;b&gt;" in page and page.count("<tr class=chosen>") == 1 and "<tr class=chosen><td>400</td><td>19</td><td>120</td>" in page
    dots = re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)" r="(\d)"', page)
    # Across 80 to 410 for 10 to 20 N/mm, up 270 to 30 for 100 to 200 mm.
    assert dots == [("410.0", "30.0", "3"), ("377.0", "222.0", "6"), ("80.0", "270.0", "3")]
    assert "stiffness, N/mm (largest is best)" in page and "size, mm (smallest is best)" in page
    assert "<th>base_radius<br><small>mm</small></th>" in page and page.count('stroke="#ddd"') == 10


def test_a_front_of_nothing_says_why(study, tmp_path):
    with Record(tmp_path / "r.jsonl", study) as record:
        assert Front.of(study, record).why_nothing() == "tripod: nothing was judged"
        record.add((800.0,), judgement(*[math.nan] * 4, reach=1.0))
        front = Front.of(study, record)
    assert front.chosen() is None and front.fields()["fits"] is False and front.fields()["chosen"] is None
    assert str(front) == front.why_nothing() == "tripod: none of 1 candidates fits. Most are ruled out by: reach (1). Ask less of reach, or widen [range]"
    assert front.why_nothing() in front.page() and "<svg" not in front.page()


def test_a_long_front_is_cut_with_a_word(study):
    machines = tuple(((float(k),), (float(-k), float(-k))) for k in range(30))
    two = dataclasses.replace(study, objectives=("stiffness", "size"))
    text = str(Front(two, machines, 30, 30, ())).splitlines()
    assert text[-1] == "and 10 more: --csv FILE.csv or --page FILE.html has all"
    assert sum("nearest" in line for line in text) == 1


def test_limits_of_the_chosen_machine_are_the_required_box():
    machine = Machine.from_ini(ini("hexapod"))
    box = ((-30.0, 20.0), (0.0, 0.0), (-10.0, 40.0))
    x, _, z = machine.home[:3]
    assert result._limits(Required(box=box), machine) == {"X": (x - 30, x + 20), "Z": (z - 10, z + 40)}
    assert result._limits(Required(box=box, tilt=12.0), machine) == {"X": (x - 30, x + 20), "Z": (z - 10, z + 40), "A": (-12.0, 12.0), "B": (-12.0, 12.0)}
    assert result._limits(Required(tilt=12.0), machine) == {}
    tripod = Machine.from_ini(ini("tripod"))
    assert list(result._limits(Required(box=box, tilt=12.0), tripod)) == ["X", "Z"]


def test_machines_that_do_not_fit_are_a_share_of_those_drawn(study):
    two = dataclasses.replace(study, objectives=("size",), required=Required())
    spread = scatter(two, [550.0], 20.0, 0.0, drawn=16)
    drawn = np.random.default_rng(two.seed).normal(size=(16, 1)) * 20 + 550
    sizes = [judge(two, row).objectives[0] for row in drawn]
    assert spread.mean == pytest.approx((np.mean(sizes),)) and spread.deviation == pytest.approx((np.std(sizes, ddof=1),)) and spread.fitting == 1
    none = scatter(two, [90000.0], 1.0, 0.0, drawn=4)
    assert none.fitting == 0 and math.isnan(none.mean[0]) and math.isnan(none.deviation[0])
    angle = dataclasses.replace(two, ranges=(Range("joint_angle", None, 80, 88),), fixed={**two.fixed, "base_radius": 550})
    del angle.fixed["joint_angle"]
    assert scatter(angle, [85.0], 500.0, 0.0, drawn=4).deviation == (0.0,)
    assert "100 %" in spread.lines(two) and "size: " in spread.lines(two)


@pytest.mark.parametrize(("said", "text"), [("sys.stderr.write(' why '); print('other')", "^why$"), ("print(' only ')", "^only$")])
def test_a_machine_that_is_not_written_says_why(study, tmp_path, monkeypatch, said, text):
    script = tmp_path / "pkm"
    script.write_text(f"#!/usr/bin/python3\nimport sys\n{said}\nsys.exit(1)\n")
    script.chmod(0o755)
    monkeypatch.setenv("PKM", str(script))
    with pytest.raises(CommandFailed, match=text):
        result.write_machine(study, [550.0], tmp_path / "machine")


def test_a_machine_is_written_by_pkm_new_with_its_dimensions_and_limits_and_checked(study, tmp_path, monkeypatch):
    script = tmp_path / "pkm"
    script.write_text(f"#!/usr/bin/python3\nimport sys\nprint(*sys.argv[1:], file=open({str(tmp_path / 'words')!r}, 'a'))\nprint(sys.argv[1])\n")
    script.chmod(0o755)
    monkeypatch.setenv("PKM", str(script))
    folder = tmp_path / "machine"
    assert result.write_machine(study, [550.0], folder) == "check\n"
    assert (tmp_path / "words").read_text().splitlines() == [
        f"new tripod --out {folder} --home 0.0 0.0 400.0 --strut 300.0 1200.0 --joint-angle 85.0 --base-radius 550.0 --limits X -30.0 20.0 --limits Z 390.0 440.0",
        f"check {folder}/machine.ini",
    ]


@pytest.mark.parametrize(("value", "expected"), [("up", ["up"]), (3, ["3.0"]), (0.1, ["0.1"]), ((550, 850), ["550.0", "850.0"]), (np.array([1, 2]), ["1.0", "2.0"])])
def test_values_become_words_of_pkm_new(value, expected):
    assert kinds.words(value) == expected
    with pytest.raises(MachineError):
        kinds.machine_of("tripod", base_radius=1e9)
