#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Replaces LinuxCNC's user interface: runs one scenario, then ends, which ends LinuxCNC.

The job beside this file (job.json) names the scenario, its arguments and the folder for results.
"""

import json
import sys
import traceback
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import scenarios  # noqa: E402
from machine import Failure, Machine  # noqa: E402


def main():
    job = json.loads((HERE / "job.json").read_text())
    out = Path(job["out"])
    result = {"ok": False, "error": "LinuxCNC could not be reached", "messages": []}
    try:
        machine = Machine()
        result["messages"] = machine.messages
        result.update(getattr(scenarios, job["scenario"])(machine, out, **job["arguments"]) or {})
        result.update(ok=True, error=None)
    except (Failure, AssertionError) as reason:
        result["error"] = str(reason)
    except Exception:
        result["error"] = traceback.format_exc()
    (out / "result.json").write_text(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
