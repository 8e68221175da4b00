# SPDX-License-Identifier: GPL-2.0-or-later
"""A design study, as read from its TOML file."""

import hashlib
import math
import tomllib
from dataclasses import dataclass, field

# Objectives, with the direction that is better.
OBJECTIVES = {
    "volume": "largest",
    "stiffness": "largest",
    "tool_error": "smallest",
    "size": "smallest",
    "stroke": "smallest",
}

# Requirements on a pose of the required box in addition to the limits of the machine.
REQUIRED = {"x", "y", "z", "tilt", "conditioning", "joint_speed", "feed"}


class StudyError(ValueError):
    """An invalid study: file, key, value and what is expected."""


@dataclass(frozen=True)
class Range:
    """One number to search for: number `place` of a dimension of `pkm new`."""

    name: str
    place: int | None
    low: float
    high: float


@dataclass(frozen=True)
class Required:
    """Poses that the machine must reach, about its home, in machine units and degrees."""

    box: tuple = ((0.0, 0.0), (0.0, 0.0), (0.0, 0.0))
    tilt: float = 0.0
    conditioning: float = 0.0
    feed: float = 0.0
    joint_speed: float = math.inf


@dataclass(frozen=True)
class Study:
    """The parsed study."""

    name: str
    kind: str
    fixed: dict
    ranges: tuple
    required: Required
    objectives: tuple
    seed: int
    population: int
    candidates: int
    bands: int
    legs: str
    hash: str = field(compare=False)

    @classmethod
    def read(cls, path):
        """Reads a file. StudyError names file and key."""
        try:
            with open(path, "rb") as file:
                return cls.parse(file.read())
        except OSError as error:
            raise StudyError(f"{path}: {error.strerror}") from None
        except StudyError as error:
            raise StudyError(f"{path}: {error}") from None

    @classmethod
    def parse(cls, text):
        """Parses the file's text."""
        text = text.encode() if isinstance(text, str) else text
        try:
            given = tomllib.loads(text.decode())
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise StudyError(str(error)) from None
        _known("", given, {"name", "kind", "fixed", "range", "required", "objectives", "search", "legs"})
        kind = _word(given, "kind")
        search = _table(given, "search")
        _known("search.", search, {"seed", "population", "candidates", "bands"})
        study = cls(
            name=_word(given, "name", default=kind),
            kind=kind,
            fixed=dict(_table(given, "fixed")),
            ranges=_ranges(_table(given, "range")),
            required=_required(_table(given, "required")),
            objectives=_objectives(given.get("objectives")),
            seed=_whole(search, "seed", 1, 0, 2**31),
            population=_whole(search, "population", 60, 4, 100_000),
            candidates=_whole(search, "candidates", 3000, 4, 100_000_000),
            bands=_whole(search, "bands", 12, 4, 200),
            legs=_legs(_table(given, "legs")),
            hash=hashlib.sha256(text).hexdigest()[:16],
        )
        both = set(study.fixed) & {one.name for one in study.ranges}
        if both:
            raise StudyError(f"[fixed] and [range] both have {', '.join(sorted(both))}")
        if "stiffness" in study.objectives and "stiffness_n_per_um" not in study.legs:
            raise StudyError("objective stiffness: [legs] needs stiffness_n_per_um")
        if "tool_error" in study.objectives and "joint_sigma_um" not in study.legs:
            raise StudyError("objective tool_error: [legs] needs joint_sigma_um")
        if "tool_error" in study.objectives:
            _number("legs.joint_sigma_um", given["legs"]["joint_sigma_um"])
        return study

    def dimensions(self, values):
        """Returns the words of `pkm new` for numbers in the order of `ranges`."""
        found = dict(self.fixed)
        for one, value in zip(self.ranges, values, strict=True):
            if one.place is None:
                found[one.name] = float(value)
            else:
                found[one.name] = [*found.get(one.name, []), float(value)]
        return found


def _known(where, table, keys):
    unknown = sorted(set(table) - keys)
    if unknown:
        raise StudyError(f"{where}{unknown[0]}: unknown key; expected one of {', '.join(sorted(keys))}")


def _table(given, name):
    table = given.get(name, {})
    if not isinstance(table, dict):
        raise StudyError(f"{name}: expected a table [{name}]")
    return table


def _word(given, name, default=None):
    value = given.get(name, default)
    if not isinstance(value, str) or not value:
        raise StudyError(f'{name}: expected a word, such as {name} = "hexapod"')
    return value


def _number(name, value):
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise StudyError(f"{name}: {value}; expected a number")
    return float(value)


def _whole(table, name, default, low, high):
    value = table.get(name, default)
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise StudyError(f"search.{name}: {value}; expected an integer from {low} to {high}")
    return value


def _pair(name, value, *, may_meet=False):
    if not isinstance(value, list) or len(value) != 2:
        raise StudyError(f"{name}: {value}; expected two numbers, the smaller first")
    low, high = (_number(name, one) for one in value)
    if not (low <= high if may_meet else low < high):
        raise StudyError(f"{name}: {low} to {high} is empty; expected the smaller number first")
    return low, high


def _ranges(table):
    found = []
    for name, value in table.items():
        many = isinstance(value, list) and value and all(isinstance(one, list) for one in value)
        for place, pair in enumerate(value if many else [value]):
            low, high = _pair(f"range.{name}", pair)
            found.append(Range(name, place if many else None, low, high))
    if not found:
        raise StudyError("[range]: nothing to search; add dimensions of `pkm new`, such as base_radius = [300, 500]")
    return tuple(found)


def _required(table):
    _known("required.", table, REQUIRED)
    box = tuple(_pair(f"required.{axis}", table.get(axis, [0, 0]), may_meet=True) for axis in "xyz")
    rest = {key: _number(f"required.{key}", table[key]) for key in REQUIRED - set("xyz") if key in table}
    if any(value < 0 for value in rest.values()):
        raise StudyError("[required]: expected numbers >= 0")
    if ("feed" in rest) != ("joint_speed" in rest):
        raise StudyError("required.feed and required.joint_speed belong together, in machine units per second: set both")
    return Required(box=box, **rest)


def _objectives(given):
    if not isinstance(given, list) or not given:
        raise StudyError(f"objectives: expected a list of {', '.join(OBJECTIVES)}")
    for name in given:
        if name not in OBJECTIVES:
            raise StudyError(f"objectives: {name}; expected some of {', '.join(OBJECTIVES)}")
    if len(set(given)) != len(given):
        raise StudyError("objectives: an objective appears twice; remove it")
    return tuple(given)


def _legs(table):
    """Converts the table [legs] to a study file of `pkm`, which accepts numbers and words."""
    lines = []
    for key, value in table.items():
        text = f'"{value}"' if isinstance(value, str) else str(value)
        lines.append(f"{key} = {text}\n")
    return "[legs]\n" + "".join(lines) if lines else ""
