# SPDX-License-Identifier: GPL-2.0-or-later
"""Reads shapes from STL and OBJ files, as triangles: `pkm help reference/view`."""

import os
import struct

# Larger files would be drawn too slowly beside a running machine, and take long to read.
MOST_BYTES = 20_000_000

# Sizes in binary STL: the header before the triangles, and a triangle.
HEAD, TRIANGLE = 84, 50


class MeshError(Exception):
    """A file without a valid shape, with the reason."""


def read(file):
    """Reads triangles of three points each."""
    try:
        size = os.path.getsize(file)
        if size > MOST_BYTES:
            raise MeshError(f"{size / 1e6:.0f} MB, expected at most {MOST_BYTES / 1e6:.0f} MB: use a coarser mesh")
        with open(file, "rb") as stream:
            data = stream.read()
        triangles = of_obj(data) if file.lower().endswith(".obj") else of_stl(data)
    except OSError as error:
        raise MeshError(f"{file}: {error.strerror}") from error
    except (MeshError, ValueError, IndexError, UnicodeDecodeError) as error:
        raise MeshError(f"{file}: {error}") from error
    if not triangles:
        raise MeshError(f"{file}: the file has no triangles")
    if not all(-1e30 < number < 1e30 for triangle in triangles for point in triangle for number in point):
        raise MeshError(f"{file}: a point is NaN or too far away")
    return triangles


def of_stl(data):
    count = struct.unpack_from("<I", data, HEAD - 4)[0] if len(data) >= HEAD else None
    if count is not None and len(data) == HEAD + TRIANGLE * count:
        rows = struct.iter_unpack("<12f2x", data[HEAD:])
        return [(row[3:6], row[6:9], row[9:12]) for row in rows]
    if not data.lstrip().startswith(b"solid"):
        raise MeshError("neither a text STL nor a complete binary STL")
    words = [line.split() for line in data.decode().splitlines()]
    points = [numbers(line[1:4]) for line in words if line[:1] == ["vertex"]]
    if len(points) % 3:
        raise MeshError("its last triangle is incomplete")
    return [tuple(points[n:n + 3]) for n in range(0, len(points), 3)]


def of_obj(data):
    points, triangles = [], []
    for line in data.decode().splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            points.append(numbers(words[1:4]))
        elif words[:1] == ["f"]:
            # Indices count from 1, or backward from the last one.
            places = [int(word.split("/")[0]) for word in words[1:]]
            if not all(0 < abs(place) <= len(points) for place in places):
                raise MeshError(f"\"{line}\" names a point that does not exist")
            corners = [points[place - 1 if place > 0 else place] for place in places]
            triangles += [(corners[0], *pair) for pair in zip(corners[1:], corners[2:])]
    return triangles


def numbers(words):
    point = tuple(map(float, words))
    if len(point) != 3:
        raise MeshError("a point has fewer than three numbers")
    return point
