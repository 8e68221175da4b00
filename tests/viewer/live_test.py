#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Tests pkm-live without a LinuxCNC: the page, the stream, refused requests, and refused starts.

    tests/viewer/live_test.py
"""

import pathlib
import re
import socket
import subprocess
import sys
import tempfile
import threading
import time

REPOSITORY = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(REPOSITORY / "tests/live"))
from browsers import HOST, Browser  # noqa: E402

LIVE = REPOSITORY / "viewer/pkm-live"
INI = REPOSITORY / "configs/hexapod/hexapod.ini"
PAGE = b"<!doctype html><title>Machine</title>"


class Served:
    """pkm-live at a free port, with a separate page."""

    def __init__(self, folder, *options):
        page = pathlib.Path(folder) / "page.html"
        page.write_bytes(PAGE)
        self.process = subprocess.Popen([LIVE, INI, "--port", "0", "--page", page, *options],
                                        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.port = int(re.search(r":(\d+)/$", self.process.stdout.readline())[1])

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.communicate()

    def answer(self, request, name=f"Host: {HOST}"):
        """Returns status and body of a request as written."""
        with socket.create_connection((HOST, self.port), timeout=10) as connection:
            connection.sendall(f"{request} HTTP/1.1\r\n{name}\r\nConnection: close\r\n\r\n".encode())
            answer = b"".join(iter(lambda: connection.recv(65536), b""))
        head, _, body = answer.partition(b"\r\n\r\n")
        return int(head.split()[1]), body


def refused(*arguments):
    """Returns the message of a start that ends with exit code 2."""
    done = subprocess.run([LIVE, *map(str, arguments)], capture_output=True, text=True, timeout=60)
    assert done.returncode == 2 and not done.stdout, done
    assert done.stderr.startswith("pkm-live: ") and "Traceback" not in done.stderr, done.stderr
    return done.stderr


def test_the_page_and_the_state_are_served(served):
    assert served.answer("GET /") == (200, PAGE)
    assert served.answer("GET /?again") == (200, PAGE)
    assert served.answer("HEAD /") == (200, b"")
    browser = Browser(served.port)
    state = browser.wait(lambda state: True, 10, "a state")
    assert state["state"] == "not running" and state["pose"] is None, state
    assert state["sequence"] > 0 and set(state) == set(pkmkins_fields()), state
    browser.stop()


def pkmkins_fields():
    """Returns the fields that docs/reference/view.md lists."""
    rows = (REPOSITORY / "docs/reference/view.md").read_text().split("### Events")[1].split("\n## ")[0].splitlines()
    return [name for row in rows if row.startswith("| `") for name in re.findall(r"`([^`]+)`", row.split("|")[1])]


def test_paths_beside_the_two_are_refused(served):
    for path in ("/../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd", "//etc/passwd", "/events/../../etc/passwd", "/index.html",
                 "/events/", "http://127.0.0.1/etc/passwd", "/\\..\\..\\etc\\passwd"):
        status, body = served.answer(f"GET {path}")
        assert status == 404 and b"root:" not in body, (path, status)


def test_names_of_others_are_refused(served):
    for name in ("evil.example", f"evil.example:{served.port}", "127.0.0.1.evil.example", "", "localhost.evil.example", "[::1",
                 "::1"):
        for path in ("/", "/events"):
            status, body = served.answer(f"GET {path}", f"Host: {name}")
            assert status == 403 and PAGE not in body, (name, status)
    assert served.answer("GET /", "Accept: */*")[0] == 403
    for name in (HOST, f"{HOST}:{served.port}", "localhost", "LOCALHOST:80", "[::1]:8123"):
        assert served.answer("GET /", f"Host: {name}") == (200, PAGE), name


def test_only_reading_is_served(served):
    for method in ("POST", "PUT", "DELETE", "PATCH", "OPTIONS"):
        assert served.answer(f"{method} /")[0] == 405, method
    for request in ("BREW /", "GET", ""):
        with socket.create_connection((HOST, served.port), timeout=10) as connection:
            connection.sendall(f"{request}\r\n\r\n".encode())
            assert connection.recv(4096)[:12] not in (b"HTTP/1.1 200", b"HTTP/1.0 200"), request
    assert served.answer("GET /") == (200, PAGE)


def test_silent_connections_block_no_other(served):
    idle = [socket.create_connection((HOST, served.port)) for _ in range(200)]
    end = time.monotonic() + 20
    # The first fifty end normally, those beyond at once.
    while True:
        try:
            assert served.answer("GET /") == (200, PAGE)
            break
        except (OSError, IndexError):
            assert time.monotonic() < end, "the page is not served any more"
            time.sleep(0.5)
    for connection in idle:
        connection.close()


def test_starts_that_cannot_be_are_refused(served):
    with tempfile.TemporaryDirectory() as folder:
        page = pathlib.Path(folder) / "page.html"
        page.write_bytes(PAGE)
        message = refused(INI, "--page", page, "--port", served.port)
        assert "in use" in message and str(served.port) in message and "--port" in message, message
        assert "No such file" in refused(INI, "--page", page.parent / "none.html")
        assert "No such file" in refused(page.parent / "none.ini", "--page", page)
        other = page.parent / "other.ini"
        other.write_text("[KINS]\nKINEMATICS = trivkins\n")
        message = refused(other, "--page", page)
        assert "expected pkmkins" in message and "trivkins" in message, message
        assert "--port" in refused(INI, "--page", page, "--port", 70000)
        assert "--host" in refused(INI, "--page", page, "--host", "192.0.2.1")
        assert "--host" in refused(INI, "--page", page, "--host", "no.such.name.invalid")


def main():
    tests = [(name, test) for name, test in globals().items() if name.startswith("test_")]
    with tempfile.TemporaryDirectory() as folder:
        for name, test in tests:
            with Served(folder) as served:
                test(served)
                assert served.process.poll() is None, f"{name}: pkm-live has ended"
            print(f"PASS {name.removeprefix('test_')}", flush=True)
    assert threading.active_count() < 3


if __name__ == "__main__":
    main()
