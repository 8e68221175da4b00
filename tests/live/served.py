# SPDX-License-Identifier: GPL-2.0-or-later
"""The page of a running machine, served by pkm-live."""

import os
import re
import subprocess
from pathlib import Path

from unprivileged import REPOSITORY, SYSTEM_PYTHON


class Served:
    """A pkm-live process beside LinuxCNC."""

    def __init__(self, session, out):
        page = out / "page.html"
        page.write_text("<!doctype html><title>Machine</title>")
        command = [SYSTEM_PYTHON, REPOSITORY / "viewer/pkm-live", session.ini, "--port", "0", "--page", page]
        # LinuxCNC keeps a table of its tools in the home folder, and the session has a private one.
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
        """Returns the memory of this process, kB."""
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        return int(re.search(r"VmRSS:\s*(\d+)", status)[1])
