# SPDX-License-Identifier: GPL-2.0-or-later
"""A machine as `pkm scene` describes it, and where its parts are: docs/scene.md.

No kinematics: lower ends of legs follow from joint values, upper ends from the pose.
Vectors are tuples of three, machine units; angles are degrees.
"""

import json
from math import cos, radians, sin, sqrt

VERSION = 1


class SceneError(Exception):
    """A file that is no scene, with the reason."""


def add(a, b):
    return tuple(x + y for x, y in zip(a, b))


def subtract(a, b):
    return tuple(x - y for x, y in zip(a, b))


def scaled(a, by):
    return tuple(x * by for x in a)


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def norm(a):
    return sqrt(dot(a, a))


def rotation(a, b, c):
    """Rz(c) Ry(b) Rx(a) as three columns."""
    ca, cb, cc = (cos(radians(angle)) for angle in (a, b, c))
    sa, sb, sc = (sin(radians(angle)) for angle in (a, b, c))
    return ((cc * cb, sc * cb, -sb),
            (cc * sb * sa - sc * ca, sc * sb * sa + cc * ca, cb * sa),
            (cc * sb * ca + sc * sa, sc * sb * ca - cc * sa, cb * ca))


def turned(columns, v):
    """The vector of the platform's frame in base."""
    return tuple(sum(column[k] * part for column, part in zip(columns, v)) for k in range(3))


def about(axis, angle, v):
    """`v` turned about a unit vector, right-handed."""
    along = scaled(axis, dot(axis, v))
    across = subtract(v, along)
    return add(along, add(scaled(across, cos(radians(angle))), scaled(cross(axis, v), sin(radians(angle)))))


class Place:
    """Where everything is at one pose."""

    def __init__(self, lower, upper, nose, tip, columns, table):
        self.lower, self.upper = lower, upper
        # Origin of the platform's frame, where a tool begins, and the tool's tip.
        self.nose, self.tip = nose, tip
        self.columns = columns
        # What the table has carried the work by.
        self.table = table


class Scene:
    """A machine; every field of its file is an attribute."""

    def __init__(self, fields):
        version = fields.get("version") if isinstance(fields, dict) else None
        if version != VERSION:
            raise SceneError(f"expected a scene of version {VERSION}, as pkm scene writes it; found {version}")
        self.__dict__.update(fields)

    @classmethod
    def read(cls, file):
        try:
            with open(file, encoding="utf-8") as stream:
                return cls(json.load(stream))
        except (OSError, ValueError, SceneError) as error:
            raise SceneError(f"{file}: {error}") from error

    def lower(self, leg, joint):
        """The lower end of a leg at its joint value."""
        base, value = tuple(leg["base"]), joint + leg["offset"]
        if leg["kind"] == "slider":
            return add(base, scaled(leg["guide"], value))
        if leg["kind"] == "crank":
            return add(base, about(tuple(leg["axis"]), value, tuple(leg["arm"])))
        return base

    def upper(self, leg, lower, point, columns):
        """The upper end of a leg on the platform that has `point` where its centre is."""
        end = add(point, turned(columns, subtract(leg["platform"], self.centre)))
        if leg["kind"] != "ring":
            return end
        outward = subtract(lower, end)
        outward = subtract(outward, scaled(columns[2], dot(columns[2], outward)))
        return add(end, scaled(outward, leg["radius"] / norm(outward)))

    def place(self, joints, pose, tool):
        """Everything at joint values and a pose that belong together; `tool` points from the tip to the
        control point, the spindle's offset included."""
        columns = rotation(*pose[3:6])
        reference = add(subtract(pose[:3], tool), turned(columns, add(tool, self.centre)))
        letters = list(zip("XYZ", reference))
        point = tuple(value if letter in self.coordinates else 0.0 for letter, value in letters)
        table = tuple(-value if letter in self.table else 0.0 for letter, value in letters)
        lower = [self.lower(leg, joint) for leg, joint in zip(self.legs, joints)]
        upper = [self.upper(leg, end, point, columns) for leg, end in zip(self.legs, lower)]
        nose = subtract(point, turned(columns, self.centre))
        tip = subtract(nose, turned(columns, tool))
        return Place(lower, upper, nose, tip, columns, table)
