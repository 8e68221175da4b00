# SPDX-License-Identifier: GPL-2.0-or-later
"""The page of a machine that runs, served by pkm-live."""

import os
import re
import subprocess
from pathlib import Path

from unprivileged import REPOSITORY, SYSTEM_PYTHON


class Served:
    """pkm-live beside LinuxCNC."""

    def __init__(self, session, out):
        page = out / "page.html"
        page.write_text("<!doctype html><title>Machine</title>")
        command = [SYSTEM_PYTHON, REPOSITORY / "viewer/pkm-live", session.ini, "--port", "0", "--page", page]
        # LinuxCNC has a table of its tools at home, and the session a home of its own.
        self.process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True,
                                        env={**os.environ, "HOME": str(session.folder)})
        self.port = int(self.process.stdout.readline().rstrip("/\n").rpartition(":")[2])

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()

    def memory(self):
        """Of this process, kB."""
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        return int(re.search(r"VmRSS:\s*(\d+)", status)[1])
