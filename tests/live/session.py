# SPDX-License-Identifier: GPL-2.0-or-later
"""One run of the real LinuxCNC on a copy of a configuration, without a screen."""

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import ini_edit
from unprivileged import clear_hal, lost_its_start

HERE = Path(__file__).resolve().parent
DISPLAY_FILES = ("browsers.py", "display.py", "guard.py", "ini_edit.py", "machine.py", "recorder.py", "scenarios.py", "truth_run.py",
                 "watched.py")
START_SECONDS = 60  # for LinuxCNC's start and end, in addition to the time of the scenario


class Session:
    """A copy of a configuration folder, ready to run scenarios."""

    def __init__(self, config, ini_name=None, edits=()):
        self.config = Path(config)
        self.folder = Path(tempfile.mkdtemp(prefix="pkmkins-session-"))
        self.copy = self.folder / "config"
        shutil.copytree(self.config, self.copy)
        self.ini = self.copy / (ini_name or f"{self.config.name}.ini")
        display = {"section": "DISPLAY", "key": "DISPLAY", "lines": ["DISPLAY = ./live/display.py"]}
        self.ini.write_text(ini_edit.edited(self.ini.read_text(), [display, *edits]))
        self._copy_display()
        self.log = self.folder / "linuxcnc.log"

    def _copy_display(self):
        live = self.copy / "live"
        live.mkdir()
        for name in DISPLAY_FILES:
            shutil.copy(HERE / name, live / name)
        (live / "display.py").chmod(0o755)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        shutil.rmtree(self.folder, ignore_errors=True)

    def run(self, scenario, out, limit, **arguments):
        """Returns the result of a scenario as display.py writes it; `ok` is false if it was not reached."""
        out.mkdir(parents=True, exist_ok=True)
        for stale in ("result.json", "progress"):
            (out / stale).unlink(missing_ok=True)
        job = {"scenario": scenario, "out": str(out), "arguments": arguments}
        (self.copy / "live" / "job.json").write_text(json.dumps(job))
        code = self.start_linuxcnc(limit + START_SECONDS, out / "progress")
        if not (out / "result.json").exists() and lost_its_start(self.log_text()):
            code = self.start_linuxcnc(limit + START_SECONDS, out / "progress")
        shutil.copy(self.log, out / "linuxcnc.log")
        if (out / "result.json").exists():
            return json.loads((out / "result.json").read_text())
        reason = "had to be stopped" if code is None else f"exited with code {code}"
        return {"ok": False, "messages": [],
                "error": f"LinuxCNC {reason} before the scenario ended: {self.log_tail()}"}

    def start_linuxcnc(self, limit, progress=None):
        """Runs LinuxCNC to its end and returns its exit code; None if it had to be stopped."""
        # RUNTESTS: all output goes to our log, not to files in the home folder.
        environment = {**os.environ, "HOME": str(self.folder), "RUNTESTS": "1"}
        with open(self.log, "w") as log:
            # A separate session, so that all processes that LinuxCNC starts can be ended together.
            process = subprocess.Popen(["linuxcnc", str(self.ini)], stdin=subprocess.DEVNULL,
                                       stdout=log, stderr=log, env=environment, cwd=self.copy,
                                       start_new_session=True)
        try:
            return follow(process, limit, progress)
        except subprocess.TimeoutExpired:
            return None
        finally:
            try:
                if process.poll() is None:
                    self._stop(process)
            finally:
                clear_hal()

    @staticmethod
    def _stop(process):
        """Ends LinuxCNC in its own way first, then the remaining processes."""
        process.send_signal(signal.SIGTERM)
        try:
            process.wait(20)
        except subprocess.TimeoutExpired:
            pass
        try:
            os.killpg(process.pid, signal.SIGKILL)
        except ProcessLookupError:
            pass
        process.wait(10)

    def log_text(self):
        return self.log.read_text(errors="replace")

    def log_tail(self):
        return " | ".join(self.log_text().strip().splitlines()[-8:])


def follow(process, limit, progress):
    """Waits for the process; shows the text of its progress file, on a terminal while it runs."""
    end = time.monotonic() + limit
    while True:
        try:
            code = process.wait(0.3)
            break
        except subprocess.TimeoutExpired:
            if time.monotonic() > end:
                raise
        if sys.stderr.isatty():
            show(progress, "\r")
    show(progress, "\r" if sys.stderr.isatty() else "", "\n")
    return code


def show(progress, before="", after=""):
    if progress is not None and progress.exists():
        print(f"{before}  {progress.read_text()}", end=after or " ", file=sys.stderr, flush=True)
