# SPDX-License-Identifier: GPL-2.0-or-later
"""Machines, poses that they reach, and machines with a planted error."""

import csv
import io
import json
import re
import subprocess
from pathlib import Path

import numpy as np
import pkmkins

REPOSITORY = Path(__file__).resolve().parents[2]
LETTERS = "XYZABCUVW"


class Machine:
    """An INI file, as `pkm` sees it."""

    def __init__(self, pkm, ini):
        self.pkm, self.ini, self.name = pkm, Path(ini), Path(ini).stem
        self.text = self.ini.read_text()
        self.meters = 0.0254 if re.search(r"^LINEAR_UNITS\s*=\s*in", self.text, re.M) else 1e-3
        self.has_two = bool(re.search(r"^KINEMATICS.*\bsecond=", self.text, re.M))
        scene = json.loads(self.run("scene", self.ini, *(["--mechanism", "1"] if self.has_two else [])).stdout)
        self.spindle = scene["spindle_offset"]
        self.is_carried = scene["is_carried"]
        self.is_bare = not scene["sees_tool"]
        self.has_spare = len(scene["legs"]) > len(scene["coordinates"])
        self.kinds = sorted({leg["kind"] for leg in scene["legs"]})
        self.legs = scene["legs"]
        self.constraints = re.findall(r"^KIND\s*=\s*(\S+)$", self.text, re.M)
        self.size = max(np.abs(leg["base"] + leg["platform"]).max() for leg in self.legs) * self.meters
        self.unit = "inch" if self.meters == 0.0254 else "mm"
        self.mechanisms = self.halves() if self.has_two else [Mechanism(pkmkins.Machine.from_ini(self.ini), self)]

    def run(self, *words, check=True):
        return subprocess.run([self.pkm, *map(str, words)], capture_output=True, text=True, check=check)

    def value(self, section, key):
        """Returns the words of the first such key."""
        found = re.search(rf"^\[{section}\]$(.*?)(?=^\[|\Z)", self.text, re.M | re.S)
        found = found and re.search(rf"^{key}\s*=\s*(.*)$", found[1], re.M)
        return found[1].split() if found else None

    def home(self):
        home = [float(word) for word in self.value("TRAJ", "HOME")]
        return np.array(home + [0.0] * (9 - len(home)))

    def ranges(self):
        """Returns lowest and highest value of each letter of LinuxCNC."""
        def limit(letter, key):
            word = self.value(f"AXIS_{letter}", key)
            return float(word[0]) if word else 0.0
        return np.array([[limit(letter, key) for letter in LETTERS] for key in ("MIN_LIMIT", "MAX_LIMIT")])

    def poses(self, count, random):
        """Returns up to `count` poses of LinuxCNC that the machine reaches, and the values of the model's joints by
        name there. Nearly all directions away from home, and up to the limits of the axes."""
        low, high = self.ranges()
        home = self.home()
        share = random.uniform(0, 1, (4 * count, 1)) ** (1 / 3)
        poses = home + share * (random.uniform(low, high, (4 * count, 9)) - home)
        poses[:, high <= low] = home[high <= low]
        return self.states(poses, count)

    def states(self, poses, count=None):
        """Returns the poses of these that the machine reaches, at most `count`, and the values of the joints by name."""
        text = io.StringIO()
        csv.writer(text).writerows([list(LETTERS.lower()), *poses.tolist()])
        done = subprocess.run([self.pkm, "joints", self.ini, "--passive"], input=text.getvalue(), capture_output=True,
                              text=True, check=False)
        rows = list(csv.reader(io.StringIO(done.stdout)))
        if not rows:
            raise RuntimeError(f"{self.ini}: {done.stderr}")
        header, rows = rows[0], rows[1:]
        # With a table or a chain a pose may be refused at once: its row is empty.
        good = [n for n, row in enumerate(rows) if all(row)][:count]
        values = np.array([[float(cell) for cell in rows[n]] for n in good]).reshape(len(good), len(header))
        return poses[good], dict(zip(header, values.T, strict=True))

    def halves(self):
        """Returns both mechanisms, each as a machine of its legs."""
        words = dict(word.split("=") for word in self.value("KINS", "KINEMATICS")[1:])
        angles = [letter for letter in words["second_coordinates"] if letter in "ABC"]
        second = dict(zip("XYZ", "UVW", strict=True)) | dict(zip(angles, words["second_angles"], strict=True))
        found, legs, joints = [], 0, 0
        for number, letters in (1, {}), (2, second):
            scene = json.loads(self.run("scene", self.ini, "--mechanism", number).stdout)
            own = [self.keys(f"LEG_{legs + n}") | {"kind": leg["kind"], "limits": self.limits(joints + n)}
                   for n, leg in enumerate(scene["legs"])]
            moved = scene["coordinates"] + scene["table"]
            home = [self.home()[LETTERS.index(letters.get(letter, letter))] * (letter in moved) for letter in "XYZ"]
            machine = pkmkins.Machine(own, scene["coordinates"], table=scene["table"], home=home, unit=self.unit,
                                      pkm=self.frame("SECOND" if letters else "PKM"))
            found.append(Mechanism(machine, self, joints, "second_" if letters else "", letters, scene))
            legs, joints = legs + len(own), joints + len(machine.joints)
        return found

    def frame(self, section):
        """Returns the keys of a mechanism that move its platform's frame."""
        keys = self.keys(section)
        return {key: keys[key][0] if len(keys[key]) == 1 else keys[key] for key in ("spindle_offset", "centre") if key in keys}

    def limits(self, joint):
        """Returns the smallest and the largest value of a joint."""
        return [float(self.value(f"JOINT_{joint}", key)[0]) for key in ("MIN_LIMIT", "MAX_LIMIT")]

    def keys(self, section):
        """Returns the keys of a section that are numbers; none without the section."""
        part = re.search(rf"^\[{section}\]$(.*?)(?=^\[|\Z)", self.text, re.M | re.S)
        lines = re.findall(r"^(\w+)\s*=\s*(.*)$", part[1] if part else "", re.M)
        return {key.lower(): [float(word) for word in words.split()] for key, words in lines if re.match(r"[-+.\d]", words)}


class Mechanism:
    """One mechanism of a machine, with a Jacobian in the package for Python."""

    def __init__(self, own, machine, first_joint=0, prefix="", letters=None, scene=None):
        self.own, self.machine, self.prefix = own, machine, prefix
        self.spindle = scene["spindle_offset"] if scene else machine.spindle
        self.is_bare = not scene["sees_tool"] if scene else machine.is_bare
        self.joints = [f"joint_{first_joint + n}" for n in range(len(own.joints))]
        self.places = [LETTERS.index((letters or {}).get(letter, letter)) for letter in "XYZABC"]

    def own_poses(self, poses):
        """Returns the mechanism's own poses at poses of LinuxCNC."""
        if self.machine.is_carried:
            return self.own.own_poses(poses).values
        # Other letters are extra axes, which pass through.
        return np.where([letter in self.own.coordinates for letter in "XYZABC"], poses[:, self.places], 0)


def shipped():
    """Returns the INI files of all shipped machines."""
    return sorted(REPOSITORY.glob("configs/*/*.ini"))


# -------------------------------------------------------------------- planted errors

def edited(text, section, key, change):
    """Returns the text with the words of a key changed."""
    part = re.search(rf"^\[{section}\]$.*?(?=^\[|\Z)", text, re.M | re.S)
    line = re.search(rf"^{key}\s*=\s*(.*)$", part[0], re.M)
    words = change([float(word) for word in line[1].split()])
    new = part[0].replace(line[0], f"{key} = {' '.join(map(repr, words))}")
    return text.replace(part[0], new)


def tilted(v):
    """Returns the direction tilted by 0.1 degrees."""
    v = np.array(v)
    across = np.cross(v, [0.3, -0.5, 0.8])
    return (v + np.tan(np.radians(0.1)) * np.linalg.norm(v) * across / np.linalg.norm(across)).tolist()


def swapped(text):
    """Returns the text with the anchors of the first two legs swapped, if their kind and guide allow it."""
    names = re.findall(r"^\[(LEG_\d+)\]$", text, re.M)[:2]
    return re.sub(rf"^\[({names[0]}|{names[1]})\]$",
                  lambda found: f"[{names[1 if found[1] == names[0] else 0]}]", text, flags=re.M)


def planted(machine):
    """Returns the texts of machines with an error in a leg and in a constraint of each kind, by the error's name."""
    text = re.sub(r"\b(second_)?boxes=\d+", "", machine.text)
    text = re.sub(r"^\[(SECOND_)?BOX_\d+\]$.*?(?=^\[|\Z)", "", text, flags=re.M | re.S)
    millimeter = 1e-3 / machine.meters
    # A tenth, along a direction that no leg is normal to.
    shift = np.array([0.06, -0.05, 0.0624]) * millimeter
    found = {}
    for kind in machine.kinds:
        n = next(n for n, leg in enumerate(machine.legs) if leg["kind"] == kind)
        section = f"LEG_{n}"
        found[f"{kind}: base"] = edited(text, section, "BASE", lambda v: (np.array(v) + shift).tolist())
        key = "EFFECTOR" if kind == "ring" else "PLATFORM"
        found[f"{kind}: platform"] = edited(text, section, key, lambda v: (np.array(v) + shift[:len(v)]).tolist())
        axis = {"slider": "GUIDE", "crank": "AXIS"}.get(kind)
        if axis:
            found[f"{kind}: axis"] = edited(text, section, axis, tilted)
        screws = [n for n, leg in enumerate(machine.legs) if leg.get("lead")]
        if kind == "strut" and screws:
            section, lead = f"LEG_{screws[0]}", machine.legs[screws[0]]["lead"]
            found["screw: axis"] = edited(text, section, "BASE_N", tilted)
            bare = re.sub(rf"(^\[{section}\]\n(?:(?!\[).*\n)*?)LEAD\s*=.*\n", r"\1", text, flags=re.M)
            for name, factor in ("lead", 1.1), ("hand", -1):
                found[f"screw: {name}"] = bare.replace(f"[{section}]\n", f"[{section}]\nLEAD = {lead * factor}\n", 1)
    for n, kind in reversed(list(enumerate(machine.constraints))):
        section = f"CONSTRAINT_{n}"
        if kind != "square":
            for key in "PLATFORM", "BASE":
                found[f"{kind}: {key}"] = edited(text, section, key, lambda v: (np.array(v) + shift).tolist())
        for key in ("PLATFORM_AXIS", "BASE_AXIS") if kind == "square" else ("NORMAL",):
            found[f"{kind}: {key}"] = edited(text, section, key, tilted)
    if len(machine.legs) > 1 and len({json.dumps(leg, sort_keys=True) for leg in machine.legs[:2]}) == 2:
        found["swapped"] = swapped(text)
    return found
