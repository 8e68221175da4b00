#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Tests the viewer's programs without LinuxCNC: stand-ins for HAL and LinuxCNC's status answer like the real ones.

    PKM=target/host/pkm /usr/bin/python3 -m pytest -q -p no:cacheprovider tests/viewer/scripts_test.py
"""

import importlib.machinery
import importlib.util
import io
import json
import math
import os
import struct
import subprocess
import sys
import types
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
VIEWER = Path(os.environ.get("PKMKINS_VIEWER", REPOSITORY / "viewer"))
sys.path.insert(0, str(VIEWER))
sys.dont_write_bytecode = True
import pkmkins_pins  # noqa: E402
from pkmkins_mesh import MeshError, read as read_mesh  # noqa: E402
from pkmkins_panel import reason, words  # noqa: E402
from pkmkins_refusal import count_legs, sentence  # noqa: E402
from pkmkins_scene import Frame, Scene, SceneError, about, extent, frame, rotation, whole  # noqa: E402

PKM = os.environ.get("PKM", str(REPOSITORY / "target/host/pkm"))


def ini(name):
    return REPOSITORY / "configs" / name / f"{name}.ini"


def scene(name, mechanism=1):
    done = subprocess.run([PKM, "scene", ini(name), "--mechanism", str(mechanism)], capture_output=True, text=True, check=True)
    return Scene(json.loads(done.stdout))


class Component(dict):
    """A HAL component."""

    def __init__(self, name):
        self.name, self.pins, self.is_ready, self.has_ended = name, {}, False, False

    def newpin(self, name, kind, way):
        self.pins[name] = (kind, way)
        self[name] = 0

    def ready(self):
        self.is_ready = True

    def exit(self):
        self.has_ended = True


class Hal(types.ModuleType):
    """HAL with pins that a test sets."""

    HAL_FLOAT, HAL_BIT, HAL_OUT, HAL_IN = "float", "bit", "out", "in"

    def __init__(self):
        super().__init__("hal")
        self.values, self.made = {}, []

    def component(self, name):
        self.made.append(Component(name))
        return self.made[-1]

    def get_value(self, name):
        if name not in self.values:
            raise RuntimeError(f"Can't get {name}")
        return self.values[name]


class Status:
    """LinuxCNC's status."""

    def __init__(self):
        self.actual_position = (1, 2, 3, 4, 5, 6, 7, 8, 9, 0)
        self.inpos, self.interp_state, self.motion_mode = True, 1, 2
        self.joints, self.homed = 6, (1,) * 6 + (0,) * 10
        self.adaptive_feed_enabled = False
        self.motion_line, self.file, self.current_vel = 12, "/nc/part.ngc", 2.5
        self.task_mode, self.task_state = 2, 4
        self.fails = None

    def poll(self):
        if self.fails:
            raise self.fails


class LinuxCNC(types.ModuleType):
    """Returns the module of that name."""

    MODE_MANUAL, MODE_AUTO, MODE_MDI = 1, 2, 3
    STATE_ESTOP, STATE_ESTOP_RESET, STATE_OFF, STATE_ON = 1, 2, 3, 4
    INTERP_IDLE, INTERP_READING, INTERP_PAUSED, INTERP_WAITING = 1, 2, 3, 4
    TRAJ_MODE_FREE, TRAJ_MODE_COORD, TRAJ_MODE_TELEOP = 1, 2, 3

    class error(Exception):
        """The exception that its calls raise."""

    def __init__(self):
        super().__init__("linuxcnc")
        self.status, self.messages, self.opened = Status(), [], 0

    def stat(self):
        self.opened += 1
        return self.status

    def command(self):
        return types.SimpleNamespace(error_msg=self.messages.append)


@pytest.fixture
def hal(monkeypatch):
    made = Hal()
    monkeypatch.setitem(sys.modules, "hal", made)
    return made


@pytest.fixture
def linuxcnc(monkeypatch):
    made = LinuxCNC()
    monkeypatch.setitem(sys.modules, "linuxcnc", made)
    return made


def program(name):
    """Imports a program without a file extension as a module."""
    loader = importlib.machinery.SourceFileLoader(name.replace("-", "_"), str(VIEWER / name))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    loader.exec_module(module)
    return module


@pytest.fixture
def panel(hal, linuxcnc):
    return program("pkmkins-panel")


@pytest.fixture
def vismach():
    return program("pkmkins-vismach")


def pkm_in_path(folder, text):
    """Writes a command `pkm` of a few lines."""
    script = folder / "pkm"
    script.write_text(f"#!/usr/bin/python3\n{text}")
    script.chmod(0o755)
    return str(folder)


# The panel's pins for the remaining travel.


def test_the_panel_has_a_pin_for_every_way_and_asks_with_both_tools(panel, hal, linuxcnc):
    made = panel.Panel("machine.ini", ["x", "c", "w"]).component
    ways = {f"{letter}-{way}": ("float", "out") for letter in "xcw" for way in ("minus", "plus")}
    assert made.pins == ways | {"known": ("bit", "out"), "guard-on": ("bit", "out"), "kinematics": ("float", "out"),
                                "ask-machine": ("bit", "in"), "ask-joints": ("bit", "in")}
    assert made.name == "pkmkins-panel" and made.is_ready
    assert all(math.isnan(made[way]) for way in ways) and made["known"] is False
    machine = panel.Machine()
    hal.values |= {f"pkmkins.tool-offset-eff-{letter}": value for letter, value in zip("xyz", (0.5, 0.25, 60))}
    assert machine.question() == {"at": [1, 2, 3, 4, 5, 6, 7, 8, 9], "tools": [[0.5, 0.25, 60]]}
    hal.values |= {f"pkmkins.second.tool-offset-eff-{letter}": value for letter, value in zip("xyz", (1, 2, 3))}
    assert machine.question()["tools"] == [[0.5, 0.25, 60], [1, 2, 3]]


ANSWER = {"travel": [{"letter": "X", "minus": {"left": 1.5, "stop": "a"}, "plus": {"left": 2.5, "stop": "b"}},
                     {"letter": "W", "minus": {"left": None, "stop": None}, "plus": {"left": 7, "stop": "c"}},
                     {"letter": "Y", "minus": {"left": 3, "stop": "a"}, "plus": {"left": 4, "stop": "b"}}]}


def test_answers_go_to_their_pins_and_an_error_takes_them_back(panel, capsys):
    own = panel.Panel("machine.ini", ["x", "w"])
    own.show(ANSWER)
    assert {name: own.component[name] for name in ("x-minus", "x-plus", "w-minus", "w-plus", "known")} == {
        "x-minus": 1.5, "x-plus": 2.5, "w-minus": math.inf, "w-plus": 7, "known": True}
    assert "y-minus" not in own.component
    for _ in range(2):
        own.show({"error": "out of reach"})
        assert own.component["known"] is False and math.isnan(own.component["x-plus"]) and math.isnan(own.component["w-minus"])
    assert capsys.readouterr().err == "pkmkins-panel: out of reach\n"
    own.show(ANSWER)
    own.show({"error": "out of reach"})
    assert capsys.readouterr().err == "pkmkins-panel: out of reach\n"


def test_a_question_is_asked_once_and_not_before_homing(panel, hal, linuxcnc):
    own, asked = panel.Panel("machine.ini", ["x", "w"]), []
    own.travel.ask = lambda question: asked.append(question) or ANSWER
    linuxcnc.status.homed = (1, 1, 1, 1, 1, 0)
    own.look()
    assert asked == [] and own.component["known"] is False
    linuxcnc.status.homed = (1,) * 6 + (0,) * 10
    linuxcnc.status.adaptive_feed_enabled = True
    own.look()
    own.look()
    assert len(asked) == 1 and own.component["known"] is True and own.component["guard-on"] is True
    linuxcnc.status.actual_position = (1.5, *linuxcnc.status.actual_position[1:])
    linuxcnc.status.adaptive_feed_enabled = False
    own.look()
    assert len(asked) == 2 and own.component["guard-on"] is False
    linuxcnc.status.homed = (0,) * 16
    own.look()
    assert own.component["known"] is False
    linuxcnc.status.homed = (1,) * 16
    own.look()
    assert len(asked) == 3 and own.component["known"] is True


@pytest.mark.parametrize(
    ("status", "why"),
    [({}, None), ({"inpos": False}, "the machine is moving"), ({"interp_state": 2}, "a program is running"), ({"motion_mode": 3}, "world mode")],
)
def test_kinematics_are_switched_by_a_press_at_rest_alone(panel, linuxcnc, status, why):
    own = panel.Panel("machine.ini", ["x"])
    vars(linuxcnc.status).update(status)
    own.switch(True)
    assert own.component["kinematics"] == (0 if why else 1) and len(linuxcnc.messages) == (1 if why else 0)
    assert why is None or why in linuxcnc.messages[0]
    own.switch(True)
    assert len(linuxcnc.messages) == (1 if why else 0)
    own.switch(False)
    # An unchanged request causes no new message.
    assert own.component["kinematics"] == 0 and len(linuxcnc.messages) == (1 if why else 0)


def test_a_button_is_looked_at_each_time(panel, linuxcnc):
    own = panel.Panel("machine.ini", ["x"])
    own.travel.ask = lambda _: ANSWER
    own.component["ask-joints"] = True
    own.look()
    assert own.component["kinematics"] == 1
    own.component["ask-joints"] = False
    own.look()
    assert own.component["kinematics"] == 0


ECHO = """import sys, json
assert sys.argv[1:] == ["travel", "machine.ini", "--serve"], sys.argv
for line in sys.stdin:
    at = json.loads(line)["at"]
    if at == "end":
        sys.exit(3)
    print("no json" if at == "words" else json.dumps({"error": at}), flush=True)
"""


def test_the_command_is_kept_open_and_started_again_in_time(panel, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", pkm_in_path(tmp_path, ECHO))
    # Behind other tests a process takes a while to start.
    monkeypatch.setattr(panel, "SILENCE", 30)
    travel = panel.Travel("machine.ini")
    assert travel.ask({"at": "a"}) == {"error": "a"}
    process = travel.process
    assert travel.ask({"at": "b"}) == {"error": "b"} and travel.process is process
    with pytest.raises(panel.Stopped, match="unexpected output of pkm travel machine.ini, 'no json'"):
        travel.ask({"at": "words"})
    with pytest.raises(panel.Stopped, match="pkm travel machine.ini exited with code 3"):
        travel.ask({"at": "end"})
    # It does not restart at once, and prints nothing.
    with pytest.raises(panel.Stopped, match="^$"):
        travel.ask({"at": "a"})
    travel.since -= panel.AGAIN
    assert travel.ask({"at": "c"}) == {"error": "c"}
    travel.process.kill()
    monkeypatch.setenv("PATH", str(tmp_path / "none"))
    with pytest.raises(panel.Stopped, match="make install-pkm"):
        panel.Travel("machine.ini").ask({})


def test_a_command_that_is_silent_is_ended(panel, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", pkm_in_path(tmp_path, "import time\ntime.sleep(60)\n"))
    monkeypatch.setattr(panel, "SILENCE", 0.2)
    travel = panel.Travel("machine.ini")
    with pytest.raises(panel.Stopped, match="code -9"):
        travel.ask({})
    assert travel.process is None


def test_the_panel_tells_why_it_knows_nothing_and_leaves_no_numbers(panel, linuxcnc, monkeypatch, capsys):
    own = panel.Panel("machine.ini", ["x"])
    own.show(ANSWER)
    ways = iter([lambda: setattr(linuxcnc.status, "fails", linuxcnc.error("no NML")), lambda: setattr(linuxcnc.status, "fails", SystemError("tools"))])

    def sleep(seconds):
        assert seconds == panel.PERIOD
        step = next(ways, None)
        if step is None:
            raise KeyboardInterrupt
        step()

    def stopped(_question):
        raise panel.Stopped("pkm is gone")

    own.travel.ask = stopped
    monkeypatch.setattr(panel.time, "sleep", sleep)
    with pytest.raises(KeyboardInterrupt):
        own.run()
    assert capsys.readouterr().err.splitlines() == [
        "pkmkins-panel: pkm is gone", "pkmkins-panel: LinuxCNC does not answer: no NML", "pkmkins-panel: LinuxCNC does not answer: tools"]
    assert own.component["known"] is False and math.isnan(own.component["x-minus"])


@pytest.mark.parametrize("words", [[], ["machine.ini"], ["machine.ini", "x", "q"], ["machine.ini", "xy"]])
def test_wrong_words_get_the_help(panel, monkeypatch, words):
    monkeypatch.setattr(sys, "argv", ["pkmkins-panel", *words])
    with pytest.raises(SystemExit, match="loadusr"):
        panel.main()


def test_the_panel_leaves_the_processor_to_others_and_a_signal_ends_it_without_an_error(panel, monkeypatch):
    handlers, nice, ran = {}, [], []
    monkeypatch.setattr(panel.signal, "signal", handlers.__setitem__)
    monkeypatch.setattr(panel.os, "nice", nice.append)
    monkeypatch.setattr(panel.Panel, "run", lambda own: ran.append((own.travel.ini, own.letters)))
    monkeypatch.setattr(sys, "argv", ["pkmkins-panel", "machine.ini", "x", "c"])
    panel.main()
    assert ran == [("machine.ini", ["x", "c"])] and nice == [10]
    for number in (panel.signal.SIGTERM, panel.signal.SIGINT):
        with pytest.raises(SystemExit) as ended:
            handlers[number]()
        assert ended.value.code == 0


# The model in 3D.


def test_colors_of_legs_are_those_of_the_room_of_their_joints(vismach):
    joint = {"min": 100.0, "max": 300.0}
    expected = {99.9: vismach.RED, 100: vismach.ORANGE, 119.9: vismach.ORANGE, 120.1: vismach.STEEL, 200: vismach.STEEL,
                279.9: vismach.STEEL, 280.1: vismach.ORANGE, 300: vismach.ORANGE, 300.1: vismach.RED}
    assert {value: vismach.color_of(joint, value) for value in expected} == expected
    for end in ("min", "max"):
        assert vismach.color_of({**joint, end: None}, 99) == vismach.STEEL


@pytest.mark.parametrize(("name", "mechanism"), [("hexapod", 1), ("lathe-mirrored", 2), ("hexapod-rotary-table", 1)])
def test_values_come_from_the_pins_of_their_mechanism(vismach, name, mechanism):
    own, hal = scene(name, mechanism), Hal()
    joints = [joint["number"] for joint in own.joints]
    chain = {link["letter"]: link["joint"] for link in own.chain}
    hal.values = {f"joint.{number}.pos-fb": 100.0 + number for number in [*joints, *chain.values()]}
    hal.values |= {f"{own.pins}{letter}": float(k) for k, letter in enumerate("xyzabc")}
    hal.values |= {f"{own.pins}tool-offset-eff-{letter}": 50.0 + k for k, letter in enumerate("xyz")}
    hal.values[f"{own.pins}geometry-hash"] = own.geometry_hash - (2**32 if own.geometry_hash >= 2**31 else 0)
    values = vismach.Values(own, hal.get_value)
    pose = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    carrying = {letter: 100.0 + joint for letter, joint in chain.items()}
    assert values.now() == ([100.0 + n for n in joints], pose, [50.0, 51.0, 52.0], carrying, [], "")
    assert (mechanism == 2) == own.pins.startswith("pkmkins.second.")
    hal.values[f"{own.pins}geometry-hash"] ^= 1
    assert values.now()[-1].startswith("ANOTHER MACHINE: loaded 0x")
    del hal.values[f"{own.pins}tool-offset-eff-z"]
    assert values.now() == (own.home["joints"], own.home["pose"], [0.0, 0.0, own.spindle_offset], {}, [], f"not connected: Can't get {own.pins}tool-offset-eff-z")


@pytest.mark.parametrize(("name", "shapes"), [("tricept", {"tube", "axis"}), ("exechon", {"axis"}), ("z3-head", {"axis"})])
def test_dependent_coordinates_come_from_their_pins(vismach, name, shapes):
    file = REPOSITORY / f"configs/{name}/{name}.ini"
    own, hal = Scene(json.loads(subprocess.run([PKM, "scene", file], capture_output=True, check=True).stdout)), Hal()
    assert {part["shape"] for part in own.passive} == shapes
    hal.values = {f"joint.{joint['number']}.pos-fb": value for joint, value in zip(own.joints, own.home["joints"])}
    hal.values |= {f"pkmkins.{letter.lower()}": value for letter, value in zip("XYZABC", own.home["pose"])}
    hal.values |= {f"pkmkins.tool-offset-eff-{letter}": 0.0 for letter in "xyz"}
    hal.values["pkmkins.geometry-hash"] = own.geometry_hash - (2**32 if own.geometry_hash >= 2**31 else 0)
    values = vismach.Values(own, hal.get_value)
    assert values.now()[-1].startswith("not connected: Can't get pkmkins.dependent.")
    hal.values |= {f"pkmkins.dependent.{letter.lower()}": 10.0 + n for n, letter in enumerate(own.dependent)}
    joints, pose, tool, carrying, dependent, text = values.now()
    assert (dependent, text) == ([10.0, 11.0, 12.0], "")
    place = own.place(joints, pose, tool, carrying, dependent)
    full = dict(zip("XYZABC", pose)) | dict(zip(own.dependent, dependent))
    assert place.columns == rotation(*(full[letter] for letter in "ABC"))
    assert place.nose == pytest.approx([full[letter] for letter in "XYZ"])


def test_all_joints_of_both_mechanisms_count_for_homing(vismach):
    scenes, hal = [scene("lathe-mirrored", n) for n in (1, 2)], Hal()
    is_homed = vismach.Homed(scenes, hal.get_value)
    assert not is_homed()
    hal.values = {f"joint.{n}.homed": True for n in range(8)}
    assert is_homed()
    for n in range(8):
        hal.values[f"joint.{n}.homed"] = False
        assert not is_homed()
        hal.values[f"joint.{n}.homed"] = True


def test_an_axis_that_carries_something_counts_for_homing(vismach):
    own, hal = scene("hexapod-rotary-table"), Hal()
    is_homed = vismach.Homed([own], hal.get_value)
    hal.values = {f"joint.{n}.homed": n < 6 for n in range(7)}
    assert not is_homed()
    hal.values["joint.6.homed"] = True
    assert is_homed()


def test_a_path_begins_one_picture_after_homing_and_ends_with_it(vismach):
    homed = iter([False, True, True, False, True, True])
    known = vismach.Known(lambda: next(homed))
    assert [known() for _ in range(6)] == [False, False, True, False, False, True]


@pytest.mark.parametrize("name", ["tripod", "hexapod", "linear-delta", "rotary-delta", "four-rod-lathe", "pentapod", "hexapod-rotary-table"])
def test_legs_are_drawn_at_home_and_not_with_the_values_before_homing(vismach, name):
    own = scene(name)
    size, _ = whole([own])

    def drawn(joints, pose):
        place = own.place(joints, pose, (0.0, 0.0, own.spindle_offset))
        ends = zip(place.lower, place.upper)
        return [vismach.is_rod(*leg, size) for leg in zip(own.legs, joints, ends)]

    assert all(drawn(own.home["joints"], own.home["pose"]))
    # Homed, but 1 % of the size behind the command: a drive lags by less.
    late = [value + (0.01 * size if joint["unit"] != "degrees" else 0.5) for value, joint in zip(own.home["joints"], own.joints)]
    assert all(drawn(late, own.home["pose"]))
    # A drive without absolute encoder stands at 0 before homing.
    assert not any(drawn([0.0] * len(own.joints), own.home["pose"]))


def test_scenes_come_from_the_command_both_of_a_pair(vismach, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", f"{Path(PKM).resolve().parent}:{os.environ['PATH']}")
    pair = vismach.read_scenes(str(ini("lathe-mirrored")))
    assert [own.pins for own in pair] == ["pkmkins.", "pkmkins.second."]
    [alone] = vismach.read_scenes(str(ini("tripod")))
    assert alone.length_unit == "inch"
    file = tmp_path / "scene.json"
    file.write_text(json.dumps(vars(alone)))
    [again] = vismach.read_scenes(str(file))
    assert vars(again) == vars(alone)
    with pytest.raises(SceneError, match="missing.ini"):
        vismach.read_scenes("missing.ini")
    with pytest.raises(SceneError, match="missing.json"):
        vismach.read_scenes("missing.json")
    for text in ("[]", '{"version": 2}', "no JSON"):
        file.write_text(text)
        with pytest.raises(SceneError, match="scene.json: "):
            vismach.read_scenes(str(file))
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(SceneError, match="make install-pkm"):
        vismach.read_scenes(str(ini("tripod")))


def test_shapes_that_cannot_be_read_are_told_and_the_others_drawn(vismach, tmp_path):
    good, bad = tmp_path / "good.obj", tmp_path / "bad.stl"
    good.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    bad.write_text("no shape")
    mesh = {"part": "table", "file": str(good), "scale": 25.4, "place": [1, 2, 3, 0, 0, 90]}
    found, wrong = vismach.meshes(types.SimpleNamespace(meshes=[mesh, {**mesh, "part": "base", "file": str(bad)}]))
    [(part, at, scale, triangles)] = found
    assert part == "table" and scale == 25.4 and len(triangles) == 1 and at.out((1, 0, 0)) == pytest.approx((1, 3, 3))
    assert len(wrong) == 1 and wrong[0].startswith("base is drawn without its model: ") and "bad.stl" in wrong[0]


def test_the_backplot_forgets_its_oldest_points(vismach):
    plot = vismach.Backplot()
    for n in range(vismach.POINTS + 1):
        plot.append(n)
    assert len(plot) == vismach.POINTS - vismach.POINTS // 10 + 1
    assert plot[-1] == vismach.POINTS and plot[0] == vismach.POINTS // 10


@pytest.mark.parametrize(
    ("given", "expected"),
    [(["m.ini"], ("m.ini", None)), (["m.ini", "--geometry", "1x2+3+4"], ("m.ini", "1x2+3+4")), ([], None), (["--help"], None),
     (["m.ini", "--geometry"], None), (["a", "b"], None)],
)
def test_words_of_the_model(vismach, monkeypatch, given, expected):
    monkeypatch.setattr(sys, "argv", ["pkmkins-vismach", *given])
    if expected is None:
        with pytest.raises(SystemExit, match="APP = pkmkins-vismach"):
            vismach.parsed()
    else:
        assert vismach.parsed() == expected
    monkeypatch.delenv("DISPLAY", raising=False)
    with pytest.raises(SystemExit, match="no display" if expected else "APP"):
        vismach.main()


@pytest.mark.parametrize("area", [(0, 0, 1920, 1080), (0, 27, 1366, 741), (0, 0, 1280, 800), (60, 0, 3780, 2160)])
def test_the_model_stands_beside_axis(vismach, area):
    # AXIS with the panel of a hexapod.
    width = 1118
    x, y, wide, high = vismach.beside(area, width)
    assert x == area[0] + width and x + wide <= area[0] + area[2], "beside AXIS, on the screen"
    assert y == area[1] and y + high <= area[1] + area[3]
    assert wide == high == min(area[2] - width, vismach.LARGE)


def test_the_model_stays_on_a_screen_without_room_for_both(vismach):
    assert vismach.beside((0, 0, 1024, 768), 1118) == (874, 0, 150, 150)


class Window:
    """A window of X, whose content begins at `x`."""

    def __init__(self, name=None, x=0, width=0, is_shown=True, **properties):
        self.name, self.x, self.width, self.is_shown, self.properties = name, x, width, is_shown, properties
        self.children, self.moves = [], []

    def get_full_property(self, name, _):
        return types.SimpleNamespace(value=self.properties[name]) if name in self.properties else None

    def get_wm_class(self):
        return self.name and (self.name.lower(), self.name)

    def get_attributes(self):
        return types.SimpleNamespace(map_state=2 if self.is_shown else 0)

    def get_geometry(self):
        return types.SimpleNamespace(width=self.width)

    def translate_coords(self, window, x, _):
        return types.SimpleNamespace(x=window.x + x)

    def query_tree(self):
        return self

    def configure(self, x, y):
        self.moves.append((x, y))


@pytest.fixture
def screen(vismach, monkeypatch):
    """Returns a screen of 1920 by 1080 points, and its `Axis`."""
    made = types.SimpleNamespace(root=Window(), width_in_pixels=1920, height_in_pixels=1080)
    display = types.SimpleNamespace(screen=lambda: made, intern_atom=str, create_resource_object=lambda _, number: made.root.children[number], sync=lambda: None)
    monkeypatch.setitem(sys.modules, "Xlib", types.SimpleNamespace(X=types.SimpleNamespace(IsViewable=2), display=types.SimpleNamespace(Display=lambda: display)))
    return made, vismach.Axis()


def test_the_screen_without_panels_is_the_desktops_or_all_of_it(screen):
    made, axis = screen
    assert axis.area() == [0, 0, 1920, 1080]
    made.root.properties["_NET_WORKAREA"] = (10, 20, 1400, 900, 0, 0, 1, 1)
    assert axis.area() == [10, 20, 1400, 900]


def test_the_window_of_axis_is_found_once_it_is_shown(screen):
    made, axis = screen
    assert axis.window() is None and axis.arrange([0, 0, 1920, 1080], 0) is None
    made.root.children = [Window(), Window("Other"), Window("Axis", is_shown=False), Window("Axis")]
    assert axis.window() is made.root.children[3]
    made.root.properties["_NET_CLIENT_LIST"] = (1, 2)
    assert axis.window() is None
    made.root.properties["_NET_CLIENT_LIST"] = (0, 3)
    assert axis.window() is made.root.children[3]


@pytest.mark.parametrize(
    ("x", "before", "moves"),
    # With its frame of 2 and 3 the window is 705 wide, and the model begins at 10 + 705.
    [(12, 0, []), (13, 0, [(10, 20)]), (300, 0, [(10, 20)]), (300, 705, []), (300, 700, [(10, 20)])],
)
def test_axis_moves_to_the_left_edge_if_the_model_needs_its_place(screen, x, before, moves):
    made, axis = screen
    window = Window("Axis", x, 700, _NET_FRAME_EXTENTS=(2, 3, 20, 4))
    made.root.children = [window]
    assert axis.arrange([10, 20, 1400, 900], before) == 705 and window.moves == moves
    window.properties = {}
    assert axis.arrange([10, 20, 1400, 900], 700) == 700


# Formulas of the scene.


def test_frames_turn_right_handed_and_there_and_back():
    assert frame([1, 2, 3, 0, 0, 90]).out((1, 0, 0)) == pytest.approx((1, 3, 3))
    assert frame([0, 0, 0, 90, 0, 0]).out((0, 1, 0)) == pytest.approx((0, 0, 1))
    assert frame([0, 0, 0, 0, 90, 0]).out((0, 0, 1)) == pytest.approx((1, 0, 0))
    # First A, then B, then C, about fixed axes.
    assert frame([0, 0, 0, 90, 90, 90]).out((0, 1, 0)) == pytest.approx((0, 1, 0))
    assert about((0, 0, 1), 90, (1, 0, 5)) == pytest.approx((0, 1, 5))
    own = frame([1, -2, 3, 20, -30, 40])
    point = (5.0, 6.0, -7.0)
    assert own.into(own.out(point)) == pytest.approx(point) and own.into(point) != pytest.approx(own.out(point))
    inner = frame([3, 1, 2, -10, 5, 60])
    assert own.carrying(inner).out(point) == pytest.approx(own.out(inner.out(point)))
    assert Frame().out(point) == point


def test_axes_carry_one_after_the_other_what_is_theirs():
    def link(letter, carries, axis, point=None):
        return {"letter": letter, "carries": carries, "axis": axis, "point": point, "is_rotary": point is not None}

    own = Scene.__new__(Scene)
    own.chain = [link("U", "legs", (1, 0, 0)), link("C", "tool", (0, 0, 1), (10, 0, 0)), link("V", "legs", (0, 1, 0)), link("A", "tool", (1, 0, 0), (10, 5, 0))]
    legs, points = own.carried("legs", {"U": 5, "V": 7})
    assert legs.out((1, 2, 3)) == (6, 9, 3) and points == []
    tool, points = own.carried("tool", {"C": 90, "A": 90})
    # C has turned the pivot of A about its own.
    assert points == [pytest.approx((10, 0, 0)), pytest.approx((5, 0, 0))]
    assert tool.out((10, 6, 0)) == pytest.approx((5, 0, 1)) and tool.out((12, 5, 0)) == pytest.approx((5, 2, 0))
    assert own.carried("work", {})[0].out((1, 2, 3)) == (1, 2, 3)
    # An axis without a value is at 0.
    assert own.carried("legs", {"V": 7})[0].origin == (0, 7, 0)


@pytest.mark.parametrize("name", ["tripod", "hexapod", "linear-delta", "four-rod-lathe", "hexaglide", "hexapod-rotary-table"])
def test_a_first_view_shows_the_whole_machine(name):
    own = scene(name)
    place = own.place(own.home["joints"], own.home["pose"], (0, 0, own.spindle_offset))
    points = [*place.lower, *place.upper, place.tip, place.work.origin]
    for leg, joint in zip(own.legs, own.joints):
        if leg["kind"] == "slider":
            points += [own.lower(leg, joint["min"]), own.lower(leg, joint["max"])]
    low, high = ([pick(p[k] for p in points) for k in range(3)] for pick in (min, max))
    size, middle = extent(own)
    assert middle == pytest.approx([(a + b) / 2 for a, b in zip(low, high)])
    assert size == pytest.approx(0.6 * math.dist(low, high))
    assert whole([own]) == (size, pytest.approx(middle))


def test_a_first_view_shows_both_mechanisms():
    scenes = [scene("lathe-mirrored", n) for n in (1, 2)]
    (one, here), (two, there) = map(extent, scenes)
    size, middle = whole(scenes)
    assert middle == pytest.approx([(a + b) / 2 for a, b in zip(here, there)])
    assert size == pytest.approx(max(one + math.dist(here, middle), two + math.dist(there, middle)))


# Pins and status for pkm-live.


def test_joints_and_letters_are_counted_as_linuxcnc_does(tmp_path):
    for name, joints, extra in [("hexapod", 6, {}), ("pyramid", 6, {}), ("lathe-counter-spindle", 4, {"c": 4, "w": 5}),
                                ("hexapod-rotary-table", 6, {"c": 6}), ("tripod", 3, {}), ("pyramid-cross", 5, {})]:
        machine = pkmkins_pins.Machine(ini(name))
        assert (list(machine.joints), machine.extra) == (list(range(joints)), extra), name
        assert machine.task == "milltask" and machine.nml is None
    file = tmp_path / "own.ini"
    file.write_text("; a = 1\n# [KINS]\n[EMC]\nNML_FILE = own.nml\nNML_FILE = other.nml\n[TASK]\nTASK = /opt/bin/a-task-with-a-long-name -x\n"
                    "[KINS]\nKINEMATICS = pkmkins legs=strut:2,slider:3 table=X axes=UV\n")
    machine = pkmkins_pins.Machine(file)
    assert list(machine.joints) == list(range(6)) and machine.extra == {"u": 6, "v": 7}
    assert machine.nml == "own.nml" and machine.task == "a-task-with-a-l"
    file.write_text("[KINS]\nKINEMATICS = pkmkins\n")
    assert list(pkmkins_pins.Machine(file).joints) == list(range(6))
    for text, why in [("[KINS]\nKINEMATICS = trivkins coordinates=XYZ\n", "found trivkins coordinates=XYZ"), ("", "found nothing"),
                      ("[KINS]\nKINEMATICS = pkmkins legs=strut:x\n", "legs=strut:x"), ("[KINS]\nKINEMATICS = pkmkins legs=strut\n", "legs=strut$")]:
        file.write_text(text)
        with pytest.raises(pkmkins_pins.NotAMachine, match=why):
            pkmkins_pins.Machine(file)
    with pytest.raises(pkmkins_pins.NotAMachine, match="No such file"):
        pkmkins_pins.Machine(tmp_path / "none.ini")


def test_a_state_has_every_value_at_its_name(hal):
    machine = pkmkins_pins.Machine(ini("lathe-counter-spindle"))
    hal.values = {f"joint.{n}.pos-fb": 10.0 + n for n in range(6)} | {f"pkmkins.{letter}": k / 2 for k, letter in enumerate("xyzabc")}
    hal.values |= {f"pkmkins.tool-offset-eff-{letter}": -float(k) for k, letter in enumerate("xyz")} | {"pkmkins.geometry-hash": 77, "pkmkins.fault": 0}
    values = pkmkins_pins.Values(machine, hal.get_value, lambda: {"line": 3})
    assert values.now() == {"state": "running", "pose": [0, 0.5, 1, 1.5, 2, 2.5], "joints": [10, 11, 12, 13], "extra": {"c": 14, "w": 15},
                            "tool": [0, -1, -2], "geometry_hash": 77, "fault": None, "line": 3}
    hal.values |= {"pkmkins.fault": -19, f"pkmkins.base.{0}.x": 0, "pkmkins.base.1.x": 0, "pkmkins.fault-leg": 1}
    assert values.now()["fault"] == sentence(-19, 1, 2)
    del hal.values["pkmkins.fault-leg"]
    assert values.now()["fault"] == sentence(-19, -1, 2)
    hal.values["joint.5.pos-fb"] = math.inf
    del hal.values["pkmkins.geometry-hash"]
    state = values.now()
    assert state["extra"] == {"c": 14, "w": None} and state["geometry_hash"] is None
    # A pose or tool without one of its values is unknown. HAL's numbers have a sign, hashes have none.
    del hal.values["pkmkins.c"]
    hal.values |= {"pkmkins.tool-offset-eff-x": math.nan, "pkmkins.geometry-hash": -2}
    state = values.now()
    assert state["pose"] is None and state["tool"] is None and state["joints"] == [10, 11, 12, 13] and state["geometry_hash"] == 2**32 - 2


def test_status_is_told_in_words_and_is_null_where_linuxcnc_is_silent(linuxcnc):
    read, status = pkmkins_pins.status_reader(linuxcnc), linuxcnc.status
    assert read() == {"line": 12, "file": "part.ngc", "feed": 2.5, "mode": "auto", "task state": "on", "interpreter": "idle"}
    status.task_mode, status.task_state, status.interp_state, status.file, status.current_vel = 3, 2, 4, "", math.nan
    assert read() == {"line": 12, "file": None, "feed": None, "mode": "mdi", "task state": "estop reset", "interpreter": "waiting"}
    assert linuxcnc.opened == 1
    for error in (linuxcnc.error("gone"), SystemError("tools")):
        status.fails = error
        assert read() == dict.fromkeys(("line", "file", "feed", "mode", "task state", "interpreter"))
        status.fails = None
        # It is opened again.
        assert read()["mode"] == "mdi"
    assert linuxcnc.opened == 3


def test_a_process_is_found_by_its_name_while_it_lives():
    own = Path("/proc/self/comm").read_text().strip()
    child = subprocess.Popen(["sleep", "60"])
    try:
        assert not pkmkins_pins.is_dead(str(child.pid)) and pkmkins_pins.process_of("sleep") is not None
        child.kill()
        while Path(f"/proc/{child.pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z":
            pass
        assert pkmkins_pins.is_dead(str(child.pid))
    finally:
        child.kill()
        child.wait()
    assert pkmkins_pins.is_dead(str(child.pid)) and not pkmkins_pins.is_dead(str(os.getpid()))
    assert pkmkins_pins.process_of(own) is not None and pkmkins_pins.process_of("no-such-process") is None


def test_states_are_written_until_linuxcnc_ends(hal, linuxcnc, monkeypatch, tmp_path):
    machine, lives, slept = pkmkins_pins.Machine(ini("tripod")), [3], []
    machine.nml = "own.nml"

    def is_dead(_process):
        lives[0] -= 1
        return lives[0] < 0

    monkeypatch.setattr(pkmkins_pins, "is_dead", is_dead)
    monkeypatch.setattr(pkmkins_pins.time, "sleep", slept.append)
    handlers = {}
    monkeypatch.setattr(pkmkins_pins.signal, "signal", handlers.__setitem__)
    with open(tmp_path / "out", "w") as out, open(tmp_path / "errors", "w") as errors:
        monkeypatch.setattr(sys, "stdout", out)
        monkeypatch.setattr(sys, "stderr", errors)
        # LinuxCNC's library itself writes to standard output.
        linuxcnc.status.poll = lambda: out.flush() or os.write(out.fileno(), b"noise")
        pkmkins_pins.follow(machine, ["1"])
    lines = [json.loads(line) for line in (tmp_path / "out").read_text().splitlines()]
    assert (tmp_path / "errors").read_text() == 3 * "noise"
    assert handlers[pkmkins_pins.signal.SIGINT] == pkmkins_pins.signal.SIG_IGN
    with pytest.raises(SystemExit):
        handlers[pkmkins_pins.signal.SIGTERM]()
    assert len(lines) == 3 and all(line["state"] == "running" and line["line"] == 12 for line in lines)
    # These sleeps take no time, so that the next one is longer by a period.
    assert len(slept) == 3 and all(0 < one <= n * pkmkins_pins.PERIOD for n, one in enumerate(slept, 1))
    [component] = hal.made
    assert component.name == f"pkm-live-{os.getpid()}" and component.is_ready and component.has_ended and linuxcnc.nmlfile == "own.nml"


def test_linuxcnc_runs_where_its_memory_and_both_processes_are(monkeypatch):
    machine, lives, memory = pkmkins_pins.Machine(ini("tripod")), {"rtapi_app": "12", "milltask": "34"}, [f"key shmid\n1 2\n{0x48414C32} 5\n"]
    monkeypatch.setattr(pkmkins_pins, "process_of", lives.get)
    monkeypatch.setattr(pkmkins_pins, "open", lambda *_, **__: io.StringIO(memory[0]), raising=False)
    assert pkmkins_pins.running(machine) == ["12", "34"]
    memory[0] = "key shmid\n1 2\n"
    assert pkmkins_pins.running(machine) is None
    memory[0] = f"{0x48414C32} 5\n"
    for name in list(lives):
        process = lives.pop(name)
        assert pkmkins_pins.running(machine) is None
        lives[name] = process

    def missing(*_, **__):
        raise OSError("no /proc")

    monkeypatch.setattr(pkmkins_pins, "open", missing, raising=False)
    assert pkmkins_pins.running(machine) is None


def test_the_reader_follows_a_linuxcnc_that_runs_alone(monkeypatch, tmp_path):
    followed, runs = [], [None]
    monkeypatch.setattr(pkmkins_pins, "running", lambda _: runs[0])
    monkeypatch.setattr(pkmkins_pins, "follow", lambda machine, processes: followed.append(processes))
    for given, why in [([], "LinuxCNC"), (["--help"], "LinuxCNC"), (["a", "b"], "LinuxCNC"), ([str(tmp_path / "none.ini")], "pkmkins_pins: .*No such file")]:
        monkeypatch.setattr(sys, "argv", ["pkmkins_pins.py", *given])
        with pytest.raises(SystemExit, match=why):
            pkmkins_pins.main()
    monkeypatch.setattr(sys, "argv", ["pkmkins_pins.py", str(ini("tripod"))])
    pkmkins_pins.main()
    assert followed == []
    runs[0] = ["12", "34"]
    pkmkins_pins.main()
    assert followed == [["12", "34"]]


@pytest.mark.parametrize("last", ["no json\n", "", "{half", "silent"])
def test_states_are_passed_on_until_their_reader_ends_fails_or_is_silent(tmp_path, monkeypatch, last):
    live, states = program("pkm-live"), []
    reader = tmp_path / "reader.py"
    ending = "import time; time.sleep(60)" if last == "silent" else f"sys.stdout.write({last!r})"
    reader.write_text(f"import sys\nassert sys.argv[1:] == ['m.ini']\nsys.stdout.write('{{\"n\": 1}}\\n{{\"n\": 2}}\\n')\nsys.stdout.flush()\n{ending}\n")
    monkeypatch.setattr(live.pkmkins_pins, "__file__", str(reader))
    # Behind other tests a process takes a while to start.
    monkeypatch.setattr(live, "SILENCE", 5 if last == "silent" else 30)
    live.relay("m.ini", types.SimpleNamespace(put=states.append))
    assert states == [{"n": 1}, {"n": 2}]


@pytest.mark.parametrize(
    ("text", "page"),
    [
        ("open(sys.argv[-1], 'w').write('page')", b"page"), ("open(sys.argv[-1], 'w').write('page'); sys.exit(1)", b"page"),
        ("open(sys.argv[-1], 'w').write('page'); sys.stderr.write(' why '); sys.exit(2)", "^why$"),
        ("sys.stderr.write('why')", "^why$"), ("", "^pkm view wrote no page$"), (None, "run make install-pkm, or give a page with --page"),
    ],
)
def test_the_page_is_what_pkm_view_writes(tmp_path, monkeypatch, text, page):
    live = program("pkm-live")
    asked = "import sys\nassert sys.argv[1:5] == ['view', 'm.ini', '--live', '--html'], sys.argv\n"
    monkeypatch.setenv("PATH", str(tmp_path / "none") if text is None else pkm_in_path(tmp_path, asked + text))
    if isinstance(page, bytes):
        assert live.made("m.ini") == page
    else:
        with pytest.raises(live.Refused, match=page):
            live.made("m.ini")


# Refusals in words, and shapes.


def test_a_refusal_names_its_part():
    for number, legs, part in [(-1, 6, ""), (0, 6, "leg 0: "), (5, 6, "leg 5: "), (6, 6, "joint 6: ")]:
        said = sentence(-19, number, legs)
        assert said.startswith(part) and said.endswith("[code -19]") and ("leg " in said.split(";")[0][:5]) == (part[:3] == "leg"), said
    assert "pkm help reference/causes" in sentence(-999, -1, 6)
    pins = {f"pkmkins.base.{n}.x": 0 for n in range(4)}
    assert count_legs(lambda name: pins[name] if name in pins else int("no")) == 4


def test_the_panel_says_what_is_ahead_before_what_was():
    pins = {"pkmkins.limit-soon": True, "pkmkins.limit-reason": -90, "pkmkins.limit-leg": 2, "pkmkins.fault": -19, "pkmkins.fault-leg": 1}
    assert words(pins.get, 6).splitlines() == ["ahead: " + sentence(-90, 2, 6), "last: " + sentence(-19, 1, 6)]
    assert words({**pins, "pkmkins.limit-soon": False}.get, 6) == "last: " + sentence(-19, 1, 6)
    assert words({**pins, "pkmkins.fault": 0}.get, 6) == "ahead: " + sentence(-90, 2, 6)
    assert words({}.get, 6) == "nothing"


def test_the_words_of_a_panel_are_kept_up_to_date(hal, monkeypatch):
    waiting = []
    variable = types.SimpleNamespace(set=lambda text: setattr(variable, "text", text))
    monkeypatch.setitem(sys.modules, "tkinter", types.SimpleNamespace(StringVar=lambda _: variable))
    master = types.SimpleNamespace(after=lambda time, look: waiting.append((time, look)))
    assert reason(master) is variable and master.pkmkins_reason is variable
    assert variable.text.startswith("pins are missing: ")
    hal.values = {f"pkmkins.base.{n}.x": 0 for n in range(3)} | {"pkmkins.limit-soon": False, "pkmkins.fault": -19, "pkmkins.fault-leg": 3}
    (time, look) = waiting.pop()
    assert time == 300
    look()
    assert variable.text == "last: " + sentence(-19, 3, 3) and sentence(-19, 3, 3).startswith("joint 3")
    assert len(waiting) == 1
    hal.values["pkmkins.fault-leg"] = 2
    waiting.pop()[1]()
    assert variable.text.startswith("last: leg 2")


def test_corners_of_faces_are_those_of_the_file(tmp_path):
    file = tmp_path / "a.OBJ"
    file.write_text("v 0 0 0\nv 2 0 0\nv 2 3 0\nv 0 3 1\nf 1/1 2/2 3/3 4/4\nf -1 -2 -3\n")
    a, b, c, d = (0, 0, 0), (2, 0, 0), (2, 3, 0), (0, 3, 1)
    assert read_mesh(str(file)) == [(a, b, c), (a, c, d), (d, c, b)]
    text = tmp_path / "two.stl"
    text.write_text("solid two\n" + "".join(f"vertex {x} {y} {z}\n" for x, y, z in (a, b, c, c, d, a)) + "endsolid\n")
    assert read_mesh(str(text)) == [(a, b, c), (c, d, a)]
    binary = tmp_path / "binary.stl"
    binary.write_bytes(bytes(80) + struct.pack("<I12fH12fH", 2, 0, 0, 1, *a, *b, *c, 0, 0, 0, 1, *c, *d, *a, 0))
    assert read_mesh(str(binary)) == [(a, b, c), (c, d, a)]


@pytest.mark.parametrize(
    ("name", "data", "why"),
    [
        ("cut.stl", bytes(80) + struct.pack("<I12f", 1, *range(12)), "neither a text STL nor"), ("empty.stl", b"", "neither a text STL nor"),
        ("half.stl", b"solid a\nvertex 0 0 0\nvertex 1 0 0\n", "is incomplete"), ("words.stl", b"solid a\nvertex 1 x 2\n", "could not convert"),
        ("none.obj", b"v 0 0 0\n", "no triangles"), ("far.obj", b"v 0 0 0\nf 1 2 3\n", "does not exist"), ("zero.obj", b"v 0 0 0\nf 1 0 1\n", "does not exist"),
        ("short.obj", b"v 0 0\n", "fewer than three numbers"), ("nan.obj", b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "NaN or too far"),
        ("away.obj", b"v 0 0 1e31\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "NaN or too far"), ("missing.stl", None, "No such file"),
    ],
)
def test_a_file_without_a_shape_is_refused_with_the_reason(tmp_path, name, data, why):
    file = tmp_path / name
    if data is not None:
        file.write_bytes(data)
    with pytest.raises(MeshError, match=f"{name}: .*{why}"):
        read_mesh(str(file))


def test_a_shape_too_large_to_draw_is_refused_unread(tmp_path):
    file = tmp_path / "huge.stl"
    for size, why in [(20_000_000, "neither"), (20_000_001, "20 MB, expected at most 20 MB: use a coarser mesh")]:
        with open(file, "wb") as huge:
            huge.truncate(size)
        with pytest.raises(MeshError, match=why):
            read_mesh(str(file))
