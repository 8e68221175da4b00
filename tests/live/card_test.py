#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Checks which patterns of LinuxCNC's test card hostmot2 registers, and with what parts.

    tests/live/card_test.py

The live tests run the HAL files for Mesa cards on this card (hm2_test), with stand-ins (`board/board.tcl`) for
the parts that it lacks. This test requests from hostmot2, for every pattern, all parts that those files use. HAL
alone runs. Prints a line for each pattern and a closing line; exit code 1 if any differs from docs/guide/drives.md.
"""

import re
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
from unprivileged import clear_hal, is_unprivileged, only_one, rerun_unprivileged

# The parts that the files for cards request from hostmot2.
CONFIG = "num_encoders=6 num_pwmgens=6 num_stepgens=6"

# The messages of hostmot2 for every pattern that it refuses; hm2_test lacks the last one.
REFUSED = {
    0: "invalid cookie, got 0x00000000, expected 0x55AACAFE",
    1: "invalid config name",
    2: "invalid IDROM type 0",
    3: "invalid IDROM type 4660",
    4: "invalid IDROM PortWidth 0",
    5: "invalid IDROM PortWidth 29",
    6: "IDROM IOPorts is 0 but llio num_ioport_connectors is 1",
    7: "IDROM IOWidth is 99",
    8: "IDROM IOPorts is 2 but llio num_ioport_connectors is 1",
    9: "IDROM ClockLow is 12345",
    10: "IDROM ClockHigh is 0",
    11: "pin 0 primary tag is 0",
    13: "invalid IDROM PortWidth 24, this board has 5 pins per connector",
    14: "IDROM IOPorts is 0 but llio num_ioport_connectors is 1",
    15: "unknown test pattern 15",
}

REGISTERED = 12
GPIO = [f"gpio.{n:03}.{pin}" for n in range(24) for pin in ("in", "in_not", "out")]
FUNCTIONS = ["read", "read_gpio", "write", "write_gpio"]

CARD = "hm2_test.0."


class Wrong(Exception):
    """An unexpected result."""


def answered(folder, pattern):
    """Loads the card in halrun; returns the exit code and the output."""
    script, out = folder / "card.hal", folder / "out"
    script.write_text(f'loadrt hostmot2\nloadrt hm2_test test_pattern={pattern} config="{CONFIG}"\n'
                      f"show pin {CARD}*\nshow funct {CARD}*\n")
    # The process that runs the realtime modules inherits the file; a pipe would stay open.
    with open(out, "w") as written:
        done = subprocess.run(["halrun", "-f", str(script)], stdin=subprocess.DEVNULL, stdout=written,
                              stderr=written, timeout=60)
    return done.returncode, out.read_text(errors="replace")


def refused(pattern, code, text):
    if code == 0 or REFUSED[pattern] not in text or "registered\n" in text:
        raise Wrong(f"exit code {code}, expected {REFUSED[pattern]!r}: {text}")
    return f"refused, {REFUSED[pattern]}"


def registered(code, text):
    if code != 0 or f"hm2/{CARD[:-1]}: registered" not in text:
        raise Wrong(f"exit code {code}: {text}")
    pins, _, functions = text.partition("Exported Functions:")
    named = [sorted(re.findall(rf" {re.escape(CARD)}(\S+)$", part, re.MULTILINE)) for part in (pins, functions)]
    # The execution time of each function is a pin too.
    parts = [name for name in named[0] if not name.endswith(".time")]
    if parts != sorted(GPIO) or named[1] != FUNCTIONS:
        raise Wrong(f"pins {parts}, functions {named[1]}")
    return f"{len(GPIO) // 3} gpio and no other part, {', '.join(FUNCTIONS)}"


def passes(folder, pattern):
    try:
        code, text = answered(folder, pattern)
        outcome = registered(code, text) if pattern == REGISTERED else refused(pattern, code, text)
        print(f"PASS pattern {pattern}: {outcome}", flush=True)
        return True
    except (Wrong, subprocess.TimeoutExpired) as error:
        print(f"FAIL pattern {pattern}: {error}", flush=True)
        return False
    finally:
        clear_hal()


def main():
    if not is_unprivileged():
        return rerun_unprivileged("tests/live/card_test.py", [], timeout=300)
    with only_one(), tempfile.TemporaryDirectory() as folder:
        results = [passes(Path(folder), pattern) for pattern in sorted([*REFUSED, REGISTERED])]
    print(f"{sum(results)} passed, {len(results) - sum(results)} failed")
    return 0 if all(results) else 1


if __name__ == "__main__":
    sys.exit(main())
