# SPDX-License-Identifier: GPL-2.0-or-later
"""Edits of an INI file's text; the forms are described in tests/cases/ini/cases.toml."""

import re


def edited(text, edits):
    """Returns the INI text after `edits`, applied in order."""
    lines = text.splitlines()
    for edit in edits:
        lines = _edited_lines(lines, edit)
    return "\n".join(lines) + "\n"


def value(text, section, key, default=None):
    """Returns the first value of a key, as LinuxCNC's own readers do."""
    first, end = _section(text.splitlines(), section)
    for line in text.splitlines()[first:end]:
        found = re.fullmatch(rf"\s*{re.escape(key)}\s*=\s*(.*?)\s*", line)
        if found:
            return found[1]
    return default


def extra_letters(text):
    """Returns the letters of the axes that pass their coordinate through; their joints are the last ones."""
    found = re.search(r"\baxes=(\S*)", value(text, "KINS", "KINEMATICS"))
    return found[1].upper() if found else ""


def second_letters(text):
    """Returns the letters of a second mechanism, whose joints precede those of extra axes."""
    words = dict(re.findall(r"(\S+)=(\S*)", value(text, "KINS", "KINEMATICS")))
    linear = "".join("UVW"["XYZ".index(letter)] for letter in words.get("second_coordinates", "").upper()
                     if letter in "XYZ")
    return linear + words.get("second_angles", "").upper()


def second_legs(text):
    """Returns the number of its legs."""
    words = dict(re.findall(r"(\S+)=(\S*)", value(text, "KINS", "KINEMATICS")))
    return sum(int(group.split(":")[1]) for group in words.get("second", "").split(",") if group)


def _parsed(text):
    section, rest = text[1:].split("]", 1)
    if rest == "-":
        return {"section": section, "remove": True}
    if rest.startswith("+"):
        return {"section": section, "append": rest[1:].split("\n")}
    return {"section": section, "key": rest.split("=")[0].strip(), "lines": rest.split("\n") if "=" in rest else []}


def _edited_lines(lines, edit):
    edit = _parsed(edit) if isinstance(edit, str) else edit
    first, end = _section(lines, edit["section"])
    if edit.get("remove"):
        return lines[:first] + lines[end:]
    body = lines[first:end] or [f"[{edit['section']}]"]
    if "append" in edit:
        return lines[:first] + body + list(edit["append"]) + [""] + lines[end:]
    return lines[:first] + _with_key(body, edit["key"], edit["lines"]) + lines[end:]


def _section(lines, section):
    """Returns the range of lines of a section with its heading; empty at the end of the file if absent."""
    headings = [n for n, line in enumerate(lines) if re.match(r"\s*\[.*\]\s*$", line)]
    for n, following in zip(headings, headings[1:] + [len(lines)]):
        if lines[n].strip() == f"[{section}]":
            return n, following
    return len(lines), len(lines)


def _with_key(lines, key, replacement):
    places = [n for n, line in enumerate(lines) if re.match(rf"\s*{re.escape(key)}\s*=", line)]
    kept = [line for n, line in enumerate(lines) if n not in places]
    place = places[0] if places else len(kept)
    return kept[:place] + list(replacement) + kept[place:]
