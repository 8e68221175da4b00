# SPDX-License-Identifier: GPL-2.0-or-later
"""A machine as described by `pkm scene`, and the positions of its parts: `pkm help reference/view`.

No kinematics: lower ends of legs are computed from joint values, upper ends from the pose.
Vectors are tuples of three, machine units; angles are degrees.
"""

import json
from math import cos, radians, sin, sqrt

VERSION = 1

# Margin around the machine in the first view, as a fraction of its size.
ROOM = 1.2


class SceneError(Exception):
    """An invalid scene file, with the reason."""


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
    """Returns Rz(c) Ry(b) Rx(a) as three columns."""
    ca, cb, cc = (cos(radians(angle)) for angle in (a, b, c))
    sa, sb, sc = (sin(radians(angle)) for angle in (a, b, c))
    return ((cc * cb, sc * cb, -sb),
            (cc * sb * sa - sc * ca, sc * sb * sa + cc * ca, cb * sa),
            (cc * sb * ca + sc * sa, sc * sb * ca - cc * sa, cb * ca))


def turned(columns, v):
    """Rotates a vector from the platform's frame to base."""
    return tuple(sum(column[k] * part for column, part in zip(columns, v)) for k in range(3))


def about(axis, angle, v):
    """Rotates `v` about a unit vector, right-handed."""
    along = scaled(axis, dot(axis, v))
    across = subtract(v, along)
    return add(along, add(scaled(across, cos(radians(angle))), scaled(cross(axis, v), sin(radians(angle)))))


class Frame:
    """The position of a body: three columns of its rotation, and its origin."""

    def __init__(self, columns=((1, 0, 0), (0, 1, 0), (0, 0, 1)), origin=(0, 0, 0)):
        self.columns, self.origin = columns, origin

    def out(self, point):
        """Converts a point of the body to the outer frame."""
        return add(self.origin, turned(self.columns, point))

    def into(self, point):
        """Converts a point of the outer frame to the body's frame."""
        way = subtract(point, self.origin)
        return tuple(dot(column, way) for column in self.columns)

    def carrying(self, other):
        """Converts a frame fixed in this body to the outer frame."""
        return Frame(tuple(turned(self.columns, column) for column in other.columns), self.out(other.origin))


def frame(place):
    """Returns the frame of X Y Z A B C."""
    return Frame(rotation(*place[3:]), tuple(place[:3]))


class Place:
    """The positions of all parts at one pose."""

    def __init__(self, lower, upper, platform, base, work, tool, passive):
        # Ends of the legs, and the platform, in base, which an axis may carry.
        self.lower, self.upper, self.platform = lower, upper, platform
        self.columns, self.nose = platform.columns, platform.origin
        # Base and workpiece on the ground.
        self.base, self.work = base, work
        # Points of the tool, from its holder to its tip, on the ground.
        self.tool = tool
        self.tip = tool[-1]
        # Ends of the parts of constraints, in base.
        self.passive = passive


class Scene:
    """A machine; every field of its file is an attribute."""

    def __init__(self, fields):
        version = fields.get("version") if isinstance(fields, dict) else None
        if version != VERSION:
            raise SceneError(f"expected a scene of version {VERSION}; found {version}: run pkm scene again")
        # A file from before constraints has none.
        self.__dict__.update({"dependent": "", "passive": [], **fields})

    @classmethod
    def read(cls, file):
        try:
            with open(file, encoding="utf-8") as stream:
                return cls(json.load(stream))
        except (OSError, ValueError, SceneError) as error:
            raise SceneError(f"{file}: {error}") from error

    def lower(self, leg, joint):
        """Returns the lower end of a leg at its joint value."""
        base, value = tuple(leg["base"]), joint + leg["offset"]
        if leg["kind"] == "slider":
            return add(base, scaled(leg["guide"], value))
        if leg["kind"] == "crank":
            return add(base, about(tuple(leg["axis"]), value, tuple(leg["arm"])))
        return base

    def upper(self, leg, lower, point, columns):
        """Returns the upper end of a leg on the platform whose center is at `point`."""
        end = add(point, turned(columns, subtract(leg["platform"], self.centre)))
        if leg["kind"] != "ring":
            return end
        outward = subtract(lower, end)
        outward = subtract(outward, scaled(columns[2], dot(columns[2], outward)))
        return add(end, scaled(outward, leg["radius"] / norm(outward)))

    def carried(self, carries, values):
        """Returns the frame of the carried body, and the points of the rotary axes, all at these values."""
        all_, points = Frame(), []
        for link in self.chain:
            if link["carries"] != carries:
                continue
            axis, value = tuple(link["axis"]), values.get(link["letter"], 0.0)
            if link["is_rotary"]:
                point = tuple(link["point"])
                points.append(all_.out(point))
                columns = tuple(about(axis, value, unit) for unit in Frame().columns)
                own = Frame(columns, subtract(point, turned(columns, point)))
            else:
                own = Frame(origin=scaled(axis, value))
            all_ = all_.carrying(own)
        return all_, points

    def place(self, joints, pose, tool, values=None, dependent=()):
        """Returns the positions at consistent joint values and pose; `tool` points from the tip to the
        control point, including the spindle's offset; `values` are those of axes that carry something, and
        `dependent` those of the dependent coordinates."""
        values = values or {}
        full = {**dict(zip("XYZABC", pose)), **dict(zip(self.dependent, dependent))}
        full = [full[letter] for letter in "XYZABC"]
        columns = rotation(*full[3:6])
        own = tool if self.sees_tool else (0.0, 0.0, 0.0)
        reference = add(subtract(full[:3], own), turned(columns, add(own, self.centre)))
        moved = "XYZ" if self.dependent else self.coordinates
        by_table = subtract(pose[:3], full[:3]) if self.dependent else reference
        point = tuple(value if letter in moved else 0.0 for letter, value in zip("XYZ", reference))
        table = tuple(-value if letter in self.table else 0.0 for letter, value in zip("XYZ", by_table))
        lower = [self.lower(leg, joint) for leg, joint in zip(self.legs, joints)]
        upper = [self.upper(leg, end, point, columns) for leg, end in zip(self.legs, lower)]
        platform = Frame(columns, subtract(point, turned(columns, self.centre)))
        passive = [[self.end(end, lower, platform) for end in part["ends"]] for part in self.passive]
        (base, _), (work, _), (held, pivots) = (self.carried(what, values) for what in ("legs", "work", "tool"))
        # From the holder through the rotary axes to the tip, at the holder's position.
        held = [*pivots, held.out(scaled(tool, -1))]
        if self.holder is None:
            work = Frame(work.columns, add(work.origin, turned(base.columns, table)))
            on = base.carrying(platform)
            held = [on.out(point) for point in [(0.0, 0.0, 0.0), *held]]
        else:
            work = base.carrying(platform).carrying(work)
            held = [add(self.holder, point) for point in [(0.0, 0.0, 0.0), *held]]
        return Place(lower, upper, platform, base, work, held, passive)

    def end(self, end, lower, platform):
        """Returns the position of an end of a part of a constraint."""
        origins = {"base": (0.0, 0.0, 0.0), "platform": platform.origin}
        origin = lower[end["leg"]] if end["origin"] == "leg" else origins[end["origin"]]
        return add(add(origin, end["base"]), turned(platform.columns, end["platform"]))


def extent(scene):
    """Returns half the extent of the first view of the machine, and its center."""
    dependent = scene.home.get("dependent", ())
    place = scene.place(scene.home["joints"], scene.home["pose"], (0, 0, scene.spindle_offset), None, dependent)
    points = [end for ends in [*zip(place.lower, place.upper), *place.passive] for end in ends] + place.tool + [place.work.origin]
    for leg, joint in zip(scene.legs, scene.joints):
        if leg["kind"] == "slider":
            points += [scene.lower(leg, joint[end]) for end in ("min", "max") if joint[end] is not None]
    low, high = ([pick(p[k] for p in points) for k in range(3)] for pick in (min, max))
    return ROOM * norm(subtract(high, low)) / 2, scaled(add(low, high), 0.5)


def whole(scenes):
    """Returns the same for several mechanisms together."""
    sizes, middles = zip(*map(extent, scenes))
    middle = scaled(tuple(map(sum, zip(*middles))), 1 / len(middles))
    return max(size + norm(subtract(own, middle)) for size, own in zip(sizes, middles)), middle
