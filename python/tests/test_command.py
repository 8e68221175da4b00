# SPDX-License-Identifier: GPL-2.0-or-later
"""Tests the command pkm from Python: its arguments and answers."""

import json

import pytest
from pkmkins import CommandFailed, calibrate, command


@pytest.fixture
def say(tmp_path, monkeypatch):
    """Writes a command `pkm` that writes its arguments into a file, and prints the text of a test."""

    def said(out="", errors="", status=0):
        script = tmp_path / "pkm"
        script.write_text(
            f"#!/usr/bin/python3\nimport json, sys\njson.dump(sys.argv[1:], open({str(tmp_path / 'words')!r}, 'w'))\n"
            f"sys.stdout.write({out!r})\nsys.stderr.write({errors!r})\nsys.exit({status})\n"
        )
        script.chmod(0o755)
        monkeypatch.setenv("PKM", str(script))
        return lambda: json.loads((tmp_path / "words").read_text())

    return said


def test_an_answer_is_a_dictionary_whatever_the_status(say):
    for status in (0, 1, 2):
        words = say('{"fits": false, "errors": []}', "progress", status)
        assert calibrate("m.ini", "log.csv", "--write", 3) == {"fits": False, "errors": []}
        assert words() == ["--format", "json", "calibrate", "m.ini", "log.csv", "--write", "3"]


@pytest.mark.parametrize(
    ("out", "errors", "status", "text"),
    [('{"errors": ["one", "two"]}', "other", 2, "^one\ntwo$"), ("no json", " why \n", 2, "^why$"), ("", "", 9, "^pkm ended with 9$")],
)
def test_a_command_that_fails_says_why(say, out, errors, status, text):
    say(out, errors, status)
    with pytest.raises(CommandFailed, match=text):
        calibrate("m.ini")


def test_the_command_is_the_one_of_the_variable_or_of_the_path(say, tmp_path, monkeypatch):
    say()
    assert command.pkm() == str(tmp_path / "pkm")
    monkeypatch.delenv("PKM")
    monkeypatch.setenv("PATH", str(tmp_path))
    assert command.pkm() == str(tmp_path / "pkm")
    monkeypatch.setenv("PATH", "")
    with pytest.raises(CommandFailed, match="not in PATH"):
        command.pkm()


def test_options_of_preflight_come_to_the_judge_by_their_names(monkeypatch):
    seen = []
    monkeypatch.setattr(command, "preflight_json", lambda *words: seen.append(words) or '{"fits": null, "version": 1}')
    assert command.preflight("m.ini", "p.ngc") == {"version": 1, "command": "preflight", "fits": None, "errors": []}
    assert seen[0][:4] == ("m.ini", "p.ngc", None, None) and json.loads(seen[0][4]) == {}
    command.preflight(
        "m.ini", "p.ngc", "--mechanism", 2, "--trace", "t.csv", "--hal", "a.hal", "--hal", "b.hal", "--unconfined",
        "--most-moves", 5, "--most-time", 1.5, "--most-standstill", 2, "--patience", 3,
    )
    assert seen[1][2:4] == (2, "t.csv")
    assert json.loads(seen[1][4]) == {
        "hal": ["a.hal", "b.hal"], "unconfined": True, "most_moves": 5, "most_seconds": 1.5, "most_standstill": 2.0, "most_work": 3.0,
    }
    for words, text in [(["--mechanism", 3], "mechanism"), (["--report", "x"], "--report: not an option of preflight in Python"), (["--most-moves", "x"], "most-moves")]:
        with pytest.raises(CommandFailed, match=text):
            command.preflight("m.ini", "p.ngc", *words)
    assert len(seen) == 2
