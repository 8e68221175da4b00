# SPDX-License-Identifier: GPL-2.0-or-later
"""Changes Python code in one place at a time, and runs the tests of the file: mutants.py FOLDER PART

FOLDER has copies of `python` and `viewer`. Cosmic-ray makes the changes; only those that a mistake could cause. Writes
caught.txt, missed.txt and unviable.txt into FOLDER's parent.
"""

import hashlib
import os
import subprocess
import sys
import time
from pathlib import Path

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator

# Seconds after which a test has noticed the change: it waits for something that the change removed. On a busy computer tests
# take longer, even without a change: then the limit is a multiple of that time.
PATIENCE = 120
TIMES = 10

OPERATORS = [
    *(f"core/ReplaceBinaryOperator_{pair}" for pair in ("Add_Sub", "Sub_Add", "Mul_Div", "Div_Mul", "FloorDiv_Mul", "Mod_Mul", "Pow_Mul", "BitAnd_BitOr")),
    *(f"core/ReplaceComparisonOperator_{pair}" for pair in ("Eq_NotEq", "NotEq_Eq", "Lt_LtE", "LtE_Lt", "Gt_GtE", "GtE_Gt", "Lt_GtE", "Gt_LtE", "LtE_Gt", "GtE_Lt", "Is_IsNot", "IsNot_Is")),
    "core/ReplaceUnaryOperator_Delete_USub", "core/ReplaceUnaryOperator_Delete_Not", "core/NumberReplacer", "core/AddNot", "core/ReplaceTrueWithFalse",
    "core/ReplaceFalseWithTrue", "core/ReplaceAndWithOr", "core/ReplaceOrWithAnd", "core/ReplaceBreakWithContinue", "core/ReplaceContinueWithBreak", "core/ExceptionReplacer",
    "core/ZeroIterationForLoop",
]

# Files and the tests that judge them, without code that draws, searches (needs pymoo) or uses a terminal.
VIEWER = ["tests/viewer/scripts_test.py"]
FILES = {
    "viewer/pkmkins_scene.py": VIEWER + ["scene"], "viewer/pkmkins_pins.py": VIEWER, "viewer/pkmkins_mesh.py": VIEWER,
    "viewer/pkmkins_refusal.py": VIEWER, "viewer/pkmkins_panel.py": VIEWER, "viewer/pkmkins-panel": VIEWER, "viewer/pkmkins-vismach": VIEWER,
    "viewer/pkm-live": ["live"] + VIEWER,
    "python/pkmkins/compare.py": ["python/tests/test_compare.py"], "python/pkmkins/kinds.py": ["python/tests/test_judging.py"],
    "python/pkmkins/command.py": ["python/tests/test_command.py"],
    **{f"python/pkmkins/design/{name}.py": ["python/tests/test_judging.py"] for name in ("candidate", "engine", "record", "result", "scatter", "study")},
}
SCRIPTS = {"scene": ["tests/viewer/scene_test.py", os.environ["PKM"]], "live": ["tests/viewer/live_test.py"]}

# Code after these lines is not changed: it draws with OpenGL (judged by tests/viewer/screens.py) or uses several processes
# (judged by test-wheel).
UNTIL = {"viewer/pkmkins-vismach": "def model(", "python/pkmkins/design/engine.py": "class Processes:"}

# Colors of the model, which tests/viewer/screens.py judges, too.
COLORS = ("GRAY, STEEL", "BLUE, GREEN", "BACKGROUND =", "WARNING =")


def changes(text):
    """Yields for each change the operator's name, the operator, line and column, and the occurrence that it changes."""
    tree = get_ast(text)
    for name in OPERATORS:
        operator = get_operator(name)()
        places = [start for node in ast_nodes(tree) for start, _ in operator.mutation_positions(node)]
        for occurrence, place in enumerate(places):
            yield name, operator, place, occurrence


def is_noticed(tests, patience):
    """Returns whether a test fails or exceeds the limit in seconds."""
    for test in tests:
        own = SCRIPTS.get(test)
        command = ["/usr/bin/python3", *own] if own else ["/usr/bin/python3", "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", test]
        try:
            done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, timeout=patience)
        except subprocess.TimeoutExpired:
            return True
        if done.returncode:
            return True
    return False


def main():
    folder, (part, parts) = Path(sys.argv[1]), map(int, sys.argv[2].split("/"))
    os.chdir(folder)
    found = {"caught": [], "missed": [], "unviable": []}
    patience = {}
    for tests in {tuple(tests): None for tests in FILES.values()}:
        began = time.monotonic()
        if is_noticed(tests, patience=None):
            sys.exit(f"mutants: {tests} fail before anything is changed")
        patience[tests] = max(PATIENCE, TIMES * (time.monotonic() - began))
    for file, tests in FILES.items():
        path = Path(file)
        text = path.read_text()
        end = text.index(UNTIL[file]) if file in UNTIL else len(text)
        last = text.count("\n", 0, end)
        for name, operator, (line, column), occurrence in changes(text):
            # A number from file, line and change, which does not depend on other changes.
            number = int(hashlib.sha256(f"{file} {line} {column} {name}".encode()).hexdigest(), 16)
            if line > last or number % parts != part or text.splitlines()[line - 1].startswith(COLORS):
                continue
            what = f"{file}:{line}:{column}: {name.partition('/')[2]}: {text.splitlines()[line - 1].strip()[:80]}"
            try:
                changed = mutate_code(text, operator, occurrence)
                compile(changed, file, "exec")
                path.write_text(changed)
                found["caught" if is_noticed(tests, patience[tuple(tests)]) else "missed"].append(what)
            # Cosmic-ray cannot replace an exception whose name has a dot.
            except (SyntaxError, AttributeError):
                found["unviable"].append(what)
            finally:
                path.write_text(text)
            for kind, lines in found.items():
                (folder.parent / f"{kind}.txt").write_text("".join(f"{line}\n" for line in lines))


if __name__ == "__main__":
    main()
