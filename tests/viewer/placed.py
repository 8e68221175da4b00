#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Where the viewer puts tool tip and work: a line of JSON in, a line out. `workbench/tests/scene.rs` asks.

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
    place = scene.place(asked["joints"], asked["pose"], asked["tool"], asked["values"])
    print(json.dumps([place.tip, place.work.out(asked["of_work"])]))
