# SPDX-License-Identifier: GPL-2.0-or-later
"""Clients of pkm-live: browsers that read its events, and one that never reads."""

import http.client
import json
import socket
import threading
import time

HOST = "127.0.0.1"


class Browser(threading.Thread):
    """Reads events until it is stopped, each with the time of its arrival; connects again as a browser does."""

    def __init__(self, port):
        super().__init__(daemon=True)
        self.port = port
        self.events = []
        self.connections = 0
        self.is_stopped = False
        self.start()

    def run(self):
        while not self.is_stopped:
            try:
                self.read()
            except (OSError, http.client.HTTPException):
                time.sleep(0.2)

    def read(self):
        connection = http.client.HTTPConnection(HOST, self.port, timeout=10)
        connection.request("GET", "/events")
        answer = connection.getresponse()
        assert answer.getheader("Content-Type") == "text/event-stream"
        self.connections += 1
        while not self.is_stopped and (line := answer.fp.readline()):
            if line.startswith(b"data: "):
                self.events.append((time.monotonic(), json.loads(line[6:])))
        connection.close()

    def stop(self):
        self.is_stopped = True
        self.join(15)

    def newest(self):
        return self.events[-1][1] if self.events else None

    def wait(self, condition, seconds, what):
        """Returns the first state from now on for which the condition holds."""
        seen, limit = len(self.events), time.monotonic() + seconds
        while True:
            for _, state in self.events[seen:]:
                seen += 1
                if condition(state):
                    return state
            if time.monotonic() > limit:
                raise AssertionError(f"{what}: not within {seconds} s; the last state is {self.newest()}")
            time.sleep(0.005)


def deaf(port):
    """Opens a connection whose answer is never read, with the smallest possible buffer."""
    connection = socket.socket()
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)
    connection.connect((HOST, port))
    connection.sendall(b"GET /events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
    return connection


def is_dropped(connection):
    """Returns whether the other end has closed the connection of a client that does not read."""
    try:
        connection.sendall(b"\r\n")
        time.sleep(0.1)
        connection.sendall(b"\r\n")
    except OSError:
        return True
    return False
