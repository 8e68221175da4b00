# SPDX-License-Identifier: GPL-2.0-or-later
"""Runs a test script as a normal user in a private folder, in several lanes in parallel.

LinuxCNC refuses root, and a normal user may be unable to read the repository. So the parts
that the tests need are copied to a fresh temporary folder and the script runs from there. LinuxCNC
runs once per machine, but shares little: `lane.sh` makes that private to each lane.
"""

import fcntl
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
PARTS = ("configs", "tests/live", "tests/viewer", "viewer", "tests/cases/ini")
MARK = "PKMKINS_UNPRIVILEGED"
LANES = 3  # more overload two cores while LinuxCNC starts
SYSTEM_PYTHON = "/usr/bin/python3"  # the one LinuxCNC's Python modules are built for


def rerun_unprivileged(script, arguments, timeout, out=None, given=(), lanes=1):
    """Runs `script` (path inside the repository) as a normal user and returns its exit code, the
    largest of all lanes. `timeout` is for all lanes together; if only one can run, it gets that
    much for the work of each.

    Every lane runs the same script with the same arguments in the same folder: they divide the
    work with `claimed`. The script finds the files and folders `given` in its folder `given`. Files that it writes
    into its folder `out` are copied to the folder `out`.
    """
    # Not in /tmp, which is private to each lane.
    folder = Path(tempfile.mkdtemp(prefix="pkmkins-live-", dir="/var/tmp"))
    try:
        for part in PARTS:
            shutil.copytree(REPOSITORY / part, folder / part,
                            ignore=shutil.ignore_patterns("__pycache__"))
        (folder / "out").mkdir()
        (folder / "given").mkdir()
        for path in map(Path, given):
            copy = shutil.copytree if path.is_dir() else shutil.copy
            copy(path, folder / "given" / path.name)
        code = _run_as_user(folder, script, arguments, timeout, lanes)
        if out is not None:
            shutil.copytree(folder / "out", out, dirs_exist_ok=True)
        return code
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _run_as_user(folder, script, arguments, timeout, lanes):
    as_user = folder / "tests/live/as-user.sh"
    if os.getuid() == 0:
        user = ["sh", str(as_user), "id", "-u"]
        uid = int(subprocess.run(user, check=True, capture_output=True, text=True).stdout)
        for path in (folder, *folder.rglob("*")):
            os.chown(path, uid, -1)
    command = ["sh", str(as_user), SYSTEM_PYTHON, str(folder / script), *arguments]
    environment = {**os.environ, MARK: "1", "PYTHONDONTWRITEBYTECODE": "1"}
    environment.pop("DISPLAY", None)
    lane = ["sh", str(folder / "tests/live/lane.sh")]
    commands, end = [command], signal.SIGINT  # allows it to end its LinuxCNC
    if lanes > 1 and can_split(lane):
        commands, end = [[*lane, *command]] * lanes, signal.SIGKILL  # ends the whole lane
    elif lanes > 1:
        print("one LinuxCNC after another: only root can give each what it needs for itself")
        timeout *= lanes
    processes = [subprocess.Popen(command, env=environment) for command in commands]
    deadline = time.monotonic() + timeout
    try:
        return max(abs(process.wait(max(1, deadline - time.monotonic()))) for process in processes)
    except subprocess.TimeoutExpired:
        print(f"{script}: not finished after {timeout} s", file=sys.stderr)
        return 1
    finally:
        for process in processes:
            if process.poll() is None:
                process.send_signal(end)
                process.wait(60)


def can_split(lane):
    """Returns whether this user may run commands in lanes."""
    return os.getuid() == 0 and subprocess.run([*lane, "true"], capture_output=True).returncode == 0


def claimed(out):
    """Claims the work whose results go to the folder `out`: returns whether this lane is the first."""
    try:
        out.mkdir()
        return True
    except FileExistsError:
        return False


def is_unprivileged():
    """Returns whether this process is the copy that rerun_unprivileged started."""
    return MARK in os.environ


@contextmanager
def only_one():
    """Holds the lock that every HAL session needs: HAL exists once per machine."""
    with open(Path.home() / ".pkmkins-live.lock", "w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            print("waiting for another live run to end", file=sys.stderr)
            fcntl.flock(lock, fcntl.LOCK_EX)
        refuse_beside_other_sessions()
        # Ends a session of an earlier run; from here on each session ends itself.
        clear_hal()
        yield


def refuse_beside_other_sessions():
    """Ends this process if HAL is in use: the cleanup after a run would end that session too."""
    # The realtime process of a session that has just ended still exists for a moment.
    for _ in range(20):
        running = subprocess.run(["pgrep", "-x", "rtapi_app"], capture_output=True, text=True)
        if running.returncode != 0:
            return
        time.sleep(0.5)
    sys.exit(f"LinuxCNC or another HAL session is running (process {running.stdout.split()[0]}): end "
             "it first; what a broken run left behind is ended by `halrun -U`")


def clear_hal():
    """Ends a HAL session."""
    subprocess.run(["halrun", "-U"], stdin=subprocess.DEVNULL, capture_output=True, timeout=60)


def lost_its_start(log):
    """Returns whether the output of a session shows that HAL did not start because of a temporary problem of LinuxCNC.

    rtapi_app creates shared memory as root and only then gives it to the user: a process that opens it in between is
    refused, in less than one start in a thousand according to its source. Memory that the previous session is still
    removing is refused as well. The test is for these messages.
    """
    return ("due to shmget" in log and "Permission denied" in log) or "could not initialize RTAPI" in log


def has_ended(log):
    """Returns whether LinuxCNC has begun to end, according to the output of a session."""
    return "Shutting down and cleaning up LinuxCNC" in log
