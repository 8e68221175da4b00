#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Returns the viewer's positions of tool tip, workpiece, lower and upper ends of legs, and ends of passive parts: a line of
JSON in, a line out. Used by `command/tests/scene.rs` and `tests/page`.

    placed.py SCENE.json < {"joints": [...], "pose": [...], "tool": [...], "values": {...}, "of_work": [...]}
"""

import json
import sys
from pathlib import Path

sys.dont_write_bytecode = True
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "viewer"))
from pkmkins_scene import Scene  # noqa: E402

scene = Scene.read(sys.argv[1])
for line in sys.stdin:
    asked = json.loads(line)
    place = scene.place(asked["joints"], asked["pose"], asked["tool"], asked["values"], asked.get("dependent", ()))
    ends = [list(map(place.base.out, ends)) for ends in (place.lower, place.upper)]
    passive = [list(map(place.base.out, ends)) for ends in place.passive]
    print(json.dumps([place.tip, place.work.out(asked["of_work"]), *ends, passive]))
