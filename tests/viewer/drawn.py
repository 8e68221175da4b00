# SPDX-License-Identifier: GPL-2.0-or-later
"""Checks whether pictures of a model show every part where the scene's formulas and the projection place it."""

import json
import sys
from math import cos, hypot, radians, sin, tan
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(REPOSITORY / "viewer"))
from pkmkins_scene import Scene, add, scaled, subtract, whole  # noqa: E402

# The view of a model in LinuxCNC's library: degrees, and the distance in sizes of the model.
LATITUDE, LONGITUDE, FIELD, DISTANCE = -70, 30, 30, 3
# Rounding of a position; a part is a few pixels wide.
NEIGHBORS = 1
# Parts may hide others: legs cross, and a platform is in front of rods. With a view rotated by 8 degrees 12 of the
# 18 configurations fall below this, by 15 degrees 17 do.
SEEN = 0.7
# Pixels that a part must move for its motion to be visible.
MOTION = 6
# Smallest fraction of the model's window that changes if parts have moved: rods are thin.
CHANGED = 0.002


class Picture:
    """A PPM file of ImageMagick."""

    def __init__(self, file):
        data = file.read_bytes()
        head = data.split(maxsplit=4)[:4]
        assert head[0] == b"P6" and head[3] in (b"255", b"65535"), head
        self.width, self.height, most = (int(word) for word in head[1:])
        self.step = 1 if most == 255 else 2
        self.pixels = data[-3 * self.step * self.width * self.height:]

    def at(self, x, y):
        if not (0 <= x < self.width and 0 <= y < self.height):
            return (0, 0, 0)
        start = 3 * self.step * (y * self.width + x)
        return tuple(self.pixels[start:start + 3 * self.step:self.step])

    def differs(self, other, window):
        """Returns the fraction of a window whose pixels differ from those of another picture."""
        left, top, width, height = window
        rows = [slice(*(3 * self.step * (y * self.width + x) for x in (left, left + width)))
                for y in range(top, top + height)]
        pixel = 3 * self.step
        pairs = ((self.pixels[row], other.pixels[row]) for row in rows)
        return sum(one[n:n + pixel] != two[n:n + pixel] for one, two in pairs if one != two
                   for n in range(0, len(one), pixel)) / (width * height)

    def shows(self, place, is_color):
        x, y = (round(part) for part in place)
        near = range(-NEIGHBORS, NEIGHBORS + 1)
        return any(is_color(self.at(x + i, y + j)) for i in near for j in near)


# Colors under LinuxCNC's two lights, one of them blue: distinguished by the larger part.
def is_green(color):
    red, green, blue = color
    return green > 45 and green > 1.15 * red and green > 1.15 * blue


def is_blue(color):
    red, green, blue = color
    return blue > 50 and blue > 1.25 * red and blue > 1.1 * green


def is_metal(color):
    # The red warning background does not count.
    return max(color) > 60 and color[0] < 1.8 * color[2] and not is_green(color)


class View:
    """The projection of the machine onto pixels of the whole screen."""

    def __init__(self, scenes, window):
        self.left, self.top, self.width, self.height = window
        self.size, self.middle = whole(scenes)

    def pixel(self, point):
        x, y, z = subtract(point, self.middle)
        lon, lat = radians(LONGITUDE), radians(LATITUDE)
        x, y = x * cos(lon) - y * sin(lon), x * sin(lon) + y * cos(lon)
        y, z = y * cos(lat) - z * sin(lat), y * sin(lat) + z * cos(lat)
        focus = self.height / 2 / tan(radians(FIELD / 2)) / (DISTANCE * self.size - z)
        return self.left + self.width / 2 + focus * x, self.top + self.height / 2 - focus * y


def parts(scenes, state):
    """Returns name, a point, and a color test of all parts of all mechanisms."""
    return [part for scene, own in zip(scenes, state["mechanisms"]) for part in parts_of(scene, own)]


def parts_of(scene, state):
    place = scene.place(state["joints"], state["pose"], state["tool"])
    found = []
    legs = zip((joint["number"] for joint in scene.joints), scene.legs, place.lower, place.upper)
    for n, leg, low, high in legs:
        way = subtract(high, low)
        found.append((f"rod of leg {n}", add(low, scaled(way, 0.85)), is_metal))
        if leg["kind"] == "slider":
            found.append((f"carriage of leg {n}", low, is_blue))
        if leg["kind"] == "crank":
            found.append((f"arm of leg {n}", scaled(add(low, tuple(leg["base"])), 0.5), is_blue))
    centre = scaled(tuple(map(sum, zip(*place.upper))), 1 / len(place.upper))
    found += [(f"platform at leg {n}", scaled(add(centre, end), 0.5), is_green) for n, end in enumerate(place.upper)]
    return found


def farthest(view, before, after):
    """Returns the largest motion of a part in pixels."""
    return max(hypot(*subtract(view.pixel(one[1]), view.pixel(two[1]))) for one, two in zip(before, after))


def missing(scenes, state, picture):
    """Returns names of missing parts; none if nearly all are visible, because parts hide each other."""
    view, all_parts = View(scenes, state["window"]), parts(scenes, state)
    names = [name for name, point, color in all_parts if not picture.shows(view.pixel(point), color)]
    return names if len(names) > (1 - SEEN) * len(all_parts) else []


def judged(out):
    """Returns a summary; raises AssertionError if a part is not drawn, or has not moved."""
    scenes = [Scene(fields) for fields in json.loads((out / "scenes.json").read_text())]
    log = (out / "linuxcnc.log").read_text(errors="replace")
    assert "pkmkins: panel:" not in log, [line for line in log.splitlines() if "pkmkins: panel:" in line]
    places, pictures = {}, {}
    for stem in ("home", "program"):
        state = json.loads((out / f"{stem}.json").read_text())
        view, pictures[stem] = View(scenes, state["window"]), Picture(out / f"{stem}.ppm")
        places[stem] = [(name, view.pixel(point)) for name, point, _ in parts(scenes, state)]
        wrong = missing(scenes, state, pictures[stem])
        assert not wrong, f"{stem}: of {len(places[stem])} parts not where they should be: {wrong}"
        assert state["pins"]["pkmkins-panel.known"], f"{stem}: no travel left"
    gone = [hypot(*subtract(one[1], two[1])) for one, two in zip(*places.values())]
    assert max(gone) > MOTION, "nothing has moved"
    changed = pictures["home"].differs(pictures["program"], state["window"])
    assert changed > CHANGED, f"parts have gone {max(gone):.0f} pixels, and {changed:.1%} of the model has changed"
    return f"{len(gone)} parts, which go {max(gone):.0f} pixels"


def has_shape(out, points):
    """Returns whether points of a shape, in the platform's frame, are drawn at home, and the legs as well."""
    scene = Scene(json.loads((out / "scenes.json").read_text())[0])
    state = json.loads((out / "home.json").read_text())
    view, picture = View([scene], state["window"]), Picture(out / "home.ppm")
    own = state["mechanisms"][0]
    platform = scene.place(own["joints"], own["pose"], own["tool"]).platform
    for point in points:
        x, y = map(round, view.pixel(platform.out(point)))
        assert is_green(picture.at(x, y)), f"no shape at {point}, pixel {x} {y}: {picture.at(x, y)}"
    rods = [part for part in parts([scene], state) if part[0].startswith("rod")]
    missing = [name for name, point, color in rods if not picture.shows(view.pixel(point), color)]
    assert len(missing) <= 1, missing
    return f"{len(points)} points of the shape, {len(rods)} legs"
