# SPDX-License-Identifier: GPL-2.0-or-later
"""Random programs for `truth.py --random`, which use all of the interpreter's state.

The writer follows the machine position with a model of LinuxCNC's offsets, so that most moves end where they
should. Verdicts do not depend on this model: `truth_cycles.py` judges the executed motion. A third of the programs
has one move beyond a limit, slightly or grossly, in the program's state at that point.
"""

import random
import re
from math import cos, hypot, pi, radians, sin

import ini_edit
from truth_programs import Program

PLANES = {"G17": "XYZ", "G18": "ZXY", "G19": "YZX"}
SYSTEMS = ["G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"]
# Forms of several moves: the plane, the profile of a turning cycle, and the blocks. A lower-case letter is a target
# relative to the beginning of the form, in units of its size, or of 3 degrees. After a letter * multiplies by the size,
# @ by the G93 feed for a move of that length, % by the feed per spindle turn. The writer replaces words in braces.
SIDE = ("G17", "", "{side}; G1 x.5 y.3; G1 x1 z-.1; G3 x1.4 y.7 R*.4; G1 y1.2; G1 x.5; G40; G0 x0 y0 z0")
SPIN = "M3 S300; G4 P1"
PROFILE = "G0 x-.6; G1 z-.2; G3 x-.5 z-.3 R*.1; G1 x-.3; G1 x-.3 z-.6; G1 x.05 z-.9"
FORMS = [
    SIDE, SIDE, SIDE,
    ("G18", "", "{side}; G1 x.5 z-.3; G1 x1; G1 z-.9; G1 x.5; G40; G0 x0 z0"),
    ("G17", "", "G5 x1 y.4 I*.3 J*.5 P*-.3 Q*-.5; G5 x1.6 y0 P*-.2 Q*.3; G1 z-.2"),
    ("G17", "", "G5.1 x1 y0 I*.5 J*.7; G5.1 x2 y.2 I*.5 J*-.7"),
    ("G17", "", "G5.2 P1 L3; x.2 y.6 P1; x.8 y.5 P2; x1 y0 P1; G5.3; {back}"),
    ("G17", "", "G93; G1 x.6 y.2 F@1; G2 x1 y.6 R*.5 F@1; G1 a1 b-1 c1 F@.5; G1 x0 z-.3 a0 b0 c0 F@.7; G94 {feed}"),
    ("G17", "", f"{SPIN}; G96 D300 S{{surface}}; G95 F%; G1 x1 y.3; G33 z-.4 K%; G97 S300; G1 x0; G94 {{feed}}; M5"),
    ("G17", "", "G96 D200 S{surface} M4; G1 x-1; G2 x-1.4 y.4 R*.4; G97 S200; M5"),
    ("G18", "", f"{SPIN}; G76 P% z-.9 I*-.1 J*.03 K*.08 R1.5 Q29.5 H1 E*.1 L{{taper}}; G0 z0; M5"),
    ("G18", PROFILE, "{rough} Q{profile} {start} D*.05 I*.15 R*.03; G70 Q{profile} {start} D*.1 E*.02 P2; {back}"),
]
# Messages at the end, half of them with the position: M66 waits for the motion and reads the position from it.
# Otherwise the interpreter's position is wrong after G10 L2 R has rotated an offset under G92.
ENDS = ("(MSG,last)", "M66 P0 L0\n(DEBUG,end #<_metric> #<_abs_x> #<_abs_y> #<_abs_z> #<_abs_a> #<_abs_b> #<_abs_c>)")


def random_programs(configs, number, seed=0):
    """Returns that many programs, over all machines in turn."""
    return [Writer(configs[n % len(configs)], f"{seed} {n}").program(f"r{n:04}") for n in range(number)]


def variant(config, number):
    """Returns edits of the INI file: none; a tool-change position; corrections and a narrow joint; slow
    joints."""
    draw = random.Random(f"variant {config.name} {number}")

    def edit(section, key, value):
        return {"section": section, "key": key, "lines": [f"{key} = {value:.6f}" if isinstance(value, float) else f"{key} = {value}"]}
    if number == 1:
        there = " ".join(f"{config.home[l] + 0.1 * config.room * draw.uniform(-1, 1):.4f}" for l in "XYZ")
        return (edit("EMCIO", "TOOL_CHANGE_POSITION", there),)
    joints = range(config.joints)
    home, low, high = ([config.joint_value(n, key) for n in joints] for key in ("HOME", "MIN_LIMIT", "MAX_LIMIT"))
    narrow = draw.choice(joints)
    scale = config.room if config.joint_value(narrow, "MAX_VELOCITY") > config.speed else 10.0
    scale = 10.0 if "crank" in config.text else scale
    if number == 2:
        side = draw.choice(("MIN_LIMIT", "MAX_LIMIT"))
        limit = home[narrow] + (0.12 if side == "MAX_LIMIT" else -0.12) * scale
        return (*(edit(f"JOINT_{n}", key, value) for n in joints
                  for key, value in (("CORRECTION_LIMIT", 0.01 * scale), ("CORRECTION_RATE", 0.02 * config.speed))),
                edit(f"JOINT_{narrow}", side, min(max(limit, low[narrow]), high[narrow])))
    if number == 3:
        # The speed that a short move reaches.
        slow = 0.4 * min(config.speed, (config.acceleration * 0.06 * config.room) ** 0.5)
        slow = 0.1 * config.joint_value(narrow, "MAX_VELOCITY") if "crank" in config.text else slow
        return (edit(f"JOINT_{narrow}", "MAX_VELOCITY", slow),
                *(edit(f"JOINT_{n}", "MAX_ACCELERATION", 0.5 * config.joint_value(n, "MAX_ACCELERATION")) for n in joints))
    return ()


class Writer:
    """Writes one program, and tracks its position."""

    def __init__(self, config, seed):
        self.config, self.draw = config, random.Random(f"{config.name} {seed}")
        self.letters = [*config.letters, *config.others, *config.passed]
        for n, letter in enumerate(config.passed):
            config.home[letter] = config.joint_value(config.joints + ini_edit.second_legs(config.text) + n, "HOME")
        self.at = {l: config.home[l] for l in self.letters}
        self.lines, self.subs, self.labels, self.slot = [], [], 100, 31
        self.unit = 1.0  # program units per machine unit
        self.is_inch = "G20" in config.start
        self.incremental = False
        self.plane = "G17"
        self.arc_absolute = False
        self.current = 0
        self.systems = [dict.fromkeys("XYZABCUVWR", 0.0) for _ in SYSTEMS]
        self.shift = dict.fromkeys("XYZABCUVW", 0.0)  # G92, G52
        self.tool = dict.fromkeys("XYZABCUVW", 0.0)
        tools = [words for words in (dict(re.findall(r"([A-Z])(-?[\d.]+)", line.split(";")[0]))
                                     for line in (config.file.with_suffix(".tbl")).read_text().splitlines()) if "T" in words]
        self.table = {int(words["T"]): {l: float(words.get(l, 0.0)) for l in "XYZUVW"} for words in tools}
        self.diameters = {int(words["T"]): float(words["D"]) for words in tools}
        self.loaded = 0
        self.stored = {}  # G28, G30
        self.variant = self.draw.choice((0, 0, 1, 2, 3))
        self.edits = variant(config, self.variant)
        self.change = [float(word) for edit in self.edits if edit["key"] == "TOOL_CHANGE_POSITION"
                       for word in edit["lines"][0].split("=")[1].split()]

    # ---------------------------------------------------------------- coordinates

    def to_program(self, place):
        """Converts a machine position to program coordinates, in program units."""
        system = self.systems[self.current]
        found = {l: place[l] - system[l] - self.tool[l] for l in place}
        turn = radians(system["R"])
        if "X" in found and "Y" in found:
            x, y = found["X"], found["Y"]
            found["X"], found["Y"] = x * cos(turn) + y * sin(turn), y * cos(turn) - x * sin(turn)
        return {l: (found[l] - self.shift[l]) * self.of(l) for l in found}

    def to_machine(self, place):
        """Converts program coordinates of all letters to a machine position."""
        system = self.systems[self.current]
        found = {l: place[l] / self.of(l) + self.shift[l] for l in place}
        turn = radians(system["R"])
        x, y = found["X"], found["Y"]
        found["X"], found["Y"] = x * cos(turn) - y * sin(turn), x * sin(turn) + y * cos(turn)
        return {l: found[l] + system[l] + self.tool[l] for l in found}

    def of(self, letter):
        return 1.0 if letter in "ABC" else self.unit

    def near(self, size=0.06):
        """Returns a target around home, with some of the letters changed."""
        there = dict(self.at)
        for letter in self.draw.sample(self.letters, self.draw.randint(1, len(self.letters))):
            home, draw = self.config.home[letter], self.draw.uniform(-1, 1)
            reach = size * self.config.room if letter in "XYZUVW" else min(1.5, 0.3 * (self.config.high[letter] - home))
            there[letter] = home + reach * draw
        return there

    def beyond(self):
        """Returns a target beyond a limit: of an axis, or in tilt and joints at a corner of the axes."""
        there = self.near()
        if self.draw.random() < 0.75:
            letter = self.draw.choice([l for l in self.letters if self.config.high[l] - self.config.low[l] < 800])
            amount = self.draw.choice((0.002, 0.02, 0.3, 0.1 * self.config.room))
            up = self.draw.random() < 0.5
            there[letter] = self.config.high[letter] + amount if up else self.config.low[letter] - amount
        else:
            for letter in self.config.letters:
                there[letter] = self.config.home[letter] + 0.97 * (self.config.between(self.draw.choice((0, 1)), letter) - self.config.home[letter])
        return there

    # ---------------------------------------------------------------- words

    def put(self, line):
        self.lines.append(line)

    def number(self, value):
        """Returns a value in one of several spellings; parameters are set in lines before."""
        text = f"{value:.6f}"
        way = self.draw.randrange(9)
        self.slot = 31 + (self.slot - 30) % 30
        if way == 0:
            self.put(f"#{self.slot} = {text}")
            return f"#{self.slot}"
        if way == 1:
            name = f"<{self.draw.choice(('far', '_far', '_ Very Far'))}{self.slot}>"
            self.put(f"#{name} = [{text} * 2]")
            return f"[#{name} / 2]"
        if way == 2:
            part = self.draw.uniform(-1, 1)
            return f"[{value - part:.6f} + {part:.6f}]".replace("+ -", "- ")
        return text.rstrip("0") if way == 3 else text

    def words(self, there, letters=None):
        """Returns words of a target, absolute or as increments or from the position's parameters."""
        now, then = self.to_program(self.at), self.to_program(there)
        letters = letters or [l for l in self.letters if abs(now[l] - then[l]) > 5e-7]
        if self.incremental:
            return " ".join(f"{l}{self.number(then[l] - now[l])}" for l in letters)
        if self.draw.random() < 0.12:
            return " ".join(f"{l}[#{5420 + 'XYZABCUVW'.index(l)} + {then[l] - now[l]:.6f}]".replace("+ -", "- ") for l in letters)
        return " ".join(f"{l}{self.number(then[l])}" for l in letters)

    def feed(self, share=None):
        return f"F{60 * (share or self.draw.uniform(0.5, 0.9)) * self.config.speed * self.unit:.3f}"

    # ---------------------------------------------------------------- moves

    def line(self, there):
        """Writes a straight move, or a probe that touches nothing."""
        way = self.draw.random()
        if way < 0.12 and not self.incremental:
            word = " ".join(f"{l}{there[l] * self.of(l):.6f}" for l in self.letters)
            self.put(f"G53 {self.draw.choice(('G0', 'G1'))} {word}")
        else:
            words = self.words(there)
            if words:
                self.put(f"{self.draw.choice(('G0', 'G1', 'G01', 'g1 '))} {words}")
        self.at = dict(there)

    def probe(self, there):
        there = {l: there[l] if l in "XYZ" else self.at[l] for l in there}
        if hypot(*(there[l] - self.at[l] for l in "XYZ")) < 0.01 * self.config.room:
            return
        self.put(f"G38.3 {self.words(there)}")
        self.at = there

    def use(self, plane):
        if plane != self.plane:
            self.put(plane)
            self.plane = plane

    def arc(self, bulge=0.0):
        """Writes an arc in any form; with `bulge` its middle exceeds the limit of X by that, and its ends do not."""
        # LinuxCNC rotates work offsets only in X Y.
        turned = radians(self.systems[self.current]["R"])
        self.use("G17" if turned or bulge else self.draw.choice(list(PLANES)))
        one, two, deep = PLANES[self.plane]
        way, turn = self.draw.uniform(0, 2 * pi), self.draw.choice((1, -1))
        angle = self.draw.choice((self.draw.uniform(0.2, 3.0), self.draw.uniform(3.3, 6.0), 2 * pi))
        radius = self.draw.uniform(0.01, 0.04) * self.config.room * self.unit
        if bulge:
            inside = 0.02 * self.config.room
            self.line({**self.at, "X": self.config.high["X"] - inside})
            way, turn, angle, radius = pi / 2 - turned, 1, pi, (inside + bulge) * self.unit
        now = self.to_program(self.at)
        center = {one: now[one] + radius * cos(way), two: now[two] + radius * sin(way)}
        to = way + pi + turn * angle
        end = {**now, one: center[one] + radius * cos(to), two: center[two] + radius * sin(to)}
        turns = 1
        if self.draw.random() < 0.4 and not bulge:
            end[deep] += self.draw.uniform(-0.04, 0.04) * self.config.room * self.unit
            turns = self.draw.choice((1, 1, 2, 3))
        there = self.to_machine(end)
        letters = [l for l in (one, two, deep) if abs(end[l] - now[l]) > 5e-7]
        if angle == 2 * pi and self.draw.random() < 0.5:
            letters = [l for l in letters if l == deep]
        if angles := [l for l in self.letters if l in "ABC" and self.draw.random() < 0.1]:
            there[angles[0]] = self.near()[angles[0]]
            letters.append(angles[0])
        words = f"{'G3' if turn > 0 else 'G2'} {self.words(there, letters) if letters else ''}"
        if angle < 6 and turns == 1 and angle != pi and self.draw.random() < 0.4:
            self.put(f"{words} R{radius if angle < pi else -radius:.6f}")
        else:
            of = " ".join(f"{'IJK'['XYZ'.index(l)]}{center[l] - (0.0 if self.arc_absolute else now[l]):.6f}" for l in (one, two))
            self.put(f"{words} {of}{f' P{turns}' if turns > 1 else ''}")
        self.at = there

    def cycle(self):
        """Writes a canned cycle, once or repeated."""
        self.use("G17")
        now = self.to_program(self.at)
        deep, side = 0.03 * self.config.room * self.unit, 0.05 * self.config.room * self.unit
        x, y, r = self.draw.uniform(-side, side), self.draw.uniform(-side, side), -0.2 * deep
        code = self.draw.choice(("G81", "G82", "G83", "G73", "G85", "G89"))
        extra = {"G82": " P0.05", "G89": " P0.05", "G83": f" Q{0.3 * deep:.6f}", "G73": f" Q{0.3 * deep:.6f}"}.get(code, "")
        back = self.draw.choice(("G98", "G99"))
        end = dict(now)
        if self.incremental:
            turns = self.draw.choice((1, 2))
            self.put(f"{back} {code} X{x / 2:.6f} Y{y / 2:.6f} Z{-0.5 * deep:.6f} R{r:.6f}{extra} L{turns}")
            x, y = x / 2 * turns, y / 2 * turns
        else:
            self.put(f"{back} {code} X{now['X'] + x:.6f} Y{now['Y'] + y:.6f} Z{now['Z'] - deep:.6f} R{now['Z'] + r:.6f}{extra}")
        end["X"], end["Y"] = now["X"] + x, now["Y"] + y
        end["Z"] = now["Z"] + r if back == "G99" else now["Z"]
        self.put("G80")
        self.at = self.to_machine(end)

    def spindle(self):
        """Writes rigid tapping, thread or feed per revolution."""
        pitch = 0.15 * self.config.speed / 5 * self.unit
        depth = 0.04 * self.config.room * self.unit
        # Accelerates to a speed at which a turn takes a whole number of servo cycles.
        self.put(self.draw.choice(("M3 S300", "S300 M4")) + "\nG4 P1")
        now = self.to_program(self.at)
        way = self.draw.randrange(3)
        end = {**now, "Z": now["Z"] - depth}
        word = f"Z{-depth:.6f}" if self.incremental else f"Z{end['Z']:.6f}"
        if way == 0:
            self.put(f"G33.1 {word} K{pitch:.6f}")
        elif way == 1:
            self.put(f"G33 {word} K{pitch:.6f}")
            self.at = self.to_machine(end)
        else:
            self.put(f"G95 F{pitch:.6f}")
            self.put(f"G1 {word}")
            self.at = self.to_machine(end)
            self.put(f"G94 {self.feed()}")
        self.put("M5")

    def form(self, size, flip=None):
        """Writes one of the forms, of a size in machine units; `flip` is 1, or -1 to rotate it by half a turn."""
        draw, is_turned = self.draw, bool(self.systems[self.current]["R"])
        # A program with M98 has no subroutines, and a rotated work offset does not rotate arcs of the other planes.
        plane, profile, text = draw.choice([form for form in FORMS if not (form[1] and self.is_fanuc)
                                            and not (form[0] != "G17" and is_turned)])
        self.use(plane)
        flip = (flip or draw.choice((1, -1))) if plane == "G17" else 1
        begin, length = self.to_program(self.at), size * self.unit
        now = dict(begin)
        kinds = {"*": length, "@": 30 * self.config.speed / size, "%": 0.03 * self.config.speed * self.unit}

        def word(found):
            """Returns a word as in the program, in absolute or incremental distances; moves `now` to its target."""
            letter, kind, value = found[1], found[2], float(found[3] or 1)
            if letter.isupper():
                return f"{letter}{(flip if letter in 'IJPQ' else 1) * kinds[kind] * value:.6f}" if kind else found[0]
            letter = letter.upper()
            if letter not in self.letters:
                return ""
            before, now[letter] = now[letter], begin[letter] + value * (
                3.0 if letter in "ABC" else length * flip if letter in "XY" else length)
            return f"{letter}{now[letter] - before if self.incremental else now[letter]:.6f}"

        def blocks(text):
            return [re.sub(r"([A-Za-z])([*@%]?)(-?[\d.]*)", word, block) for block in text.split("; ")]
        label, self.labels = self.labels, self.labels + 1
        if profile:
            self.subs.append("\n".join([f"o{label} sub", *blocks(profile), f"o{label} endsub"]))
            now = dict(begin)
        words = {
            "side": self.side(size), "feed": self.feed(), "surface": draw.randint(3, 60), "taper": draw.randrange(4),
            # Without G72.2: LinuxCNC's interpreter computes some of its cuts without end.
            "rough": draw.choice(("G71", "G71.1", "G71.2", "G72", "G72.1", "G72.1")), "profile": label,
            # In G91 LinuxCNC's turning cycles use X and Z as if they were absolute.
            "start": "" if self.incremental else "x0 z0",
            "back": f"G90 G0 {' '.join(f'{l}{begin[l]:.6f}' for l in 'XYZ')}{'; G91' if self.incremental else ''}"}
        for block in blocks(text.format(**words)):
            self.put(block)
        self.at = self.to_machine(now)

    def side(self, size):
        """Starts cutter compensation by a diameter, or by a tool smaller than a form of a size in machine units."""
        small = [number for number, diameter in self.diameters.items() if 4 * diameter < size]
        tools = [f" D{number}" for number in small] + [""] * (self.loaded in small)
        code, diameter = self.draw.choice(("G41", "G42")), f".1 D{0.2 * size * self.unit:.6f}"
        return code + self.draw.choice((diameter, self.draw.choice(tools or [diameter])))

    # ---------------------------------------------------------------- state

    def state(self):
        """Changes some state of the interpreter."""
        draw, now = self.draw, self.to_program(self.at)
        way = draw.randrange(16)
        letter = draw.choice(self.letters)
        value = round(now[letter] + draw.uniform(-20, 20), 4)
        if way == 0:
            self.is_inch = not self.is_inch
            of_machine = "inch" if self.config.value("TRAJ", "LINEAR_UNITS") == "inch" else "mm"
            self.unit = 1.0 if self.is_inch == (of_machine == "inch") else 25.4 if of_machine == "inch" else 1 / 25.4
            self.put(("G20\n" if self.is_inch else "G21\n") + self.feed())
        elif way in (1, 2):
            self.incremental = not self.incremental
            self.put("G91" if self.incremental else "G90")
        elif way == 3:
            self.current = draw.randrange(9)
            self.put(SYSTEMS[self.current])
        elif way in (4, 5):
            number = draw.choice((self.current, draw.randrange(9)))
            system, words = self.systems[number], []
            for l in self.letters:
                if draw.random() < 0.4:
                    system[l] = round(draw.uniform(-30, 30), 3) / self.of(l)
                    words.append(f"{l}{system[l] * self.of(l):.6f}")
            # Arcs in the other planes do not rotate with it.
            system["R"] = draw.choice((0.0, round(draw.uniform(-180, 180), 2)))
            self.put(f"G10 L2 P{number + 1 if number != self.current else draw.choice((0, number + 1))} {' '.join(words)} R{system['R']}")
        elif way == 6:
            self.put(f"G10 L20 P{self.current + 1} {letter}{value}")
            # The offset with which the letter has this value here: the position minus that of the value at offset 0.
            for l in self.letters:
                self.systems[self.current][l] = 0.0
            there = self.to_machine({**now, letter: value})
            for l in self.letters:
                self.systems[self.current][l] = self.at[l] - there[l]
        elif way == 7:
            self.put(f"G92 {letter}{value}")
            self.shift[letter] += (now[letter] - value) / self.of(letter)
        elif way == 8:
            self.put(f"G52 {letter}{value}")
            self.shift[letter] = value / self.of(letter)
        elif way == 9:
            self.put("G92.1")
            self.shift = dict.fromkeys(self.shift, 0.0)
        elif way in (10, 11):
            self.tool_change()
        elif way == 12:
            self.put(draw.choice(("G61", "G61.1", "G64", f"G64 P{0.002 * self.config.room * self.unit:.6f}",
                                  f"G64 P{0.002 * self.config.room * self.unit:.6f} Q{0.0002 * self.config.room * self.unit:.6f}")))
        elif way == 13:
            word = draw.choice(("G28", "G30"))
            if word in self.stored:
                self.put(word)
                self.at = dict(self.stored[word])
            else:
                self.put(f"{word}.1")
                self.stored[word] = dict(self.at)
        elif way == 14:
            self.arc_absolute = not self.arc_absolute
            self.put("G90.1" if self.arc_absolute else "G91.1")
        else:
            self.put(draw.choice(("M66 P0 L3 Q0.02", "G4 P0.02", "(MSG,here)", "M1", "M0", "M8", "M9", "M62 P0", "M64 P1", "N10 G4 P0 ; rest")))

    def tool_change(self):
        draw = self.draw
        number = draw.choice(list(self.table))
        # At a tilt pkmkins slowly moves the platform for it.
        level = {l: self.config.home[l] if l in "ABC" else self.at[l] for l in self.at}
        if level != self.at and draw.random() < 0.8:
            self.line(level)
        way = draw.randrange(6)
        if way == 0:
            self.put("G49")
            self.tool = dict.fromkeys(self.tool, 0.0)
            return
        if way == 1:
            length = round(draw.uniform(0, 0.1) * self.config.room, 3)
            self.put(f"G43.1 Z{length * self.unit:.6f}")
            self.tool["Z"] = length
            return
        if way == 2 and self.loaded:
            length = round(draw.uniform(0, 0.1) * self.config.room, 3)
            self.put(f"G10 L1 P{self.loaded} Z{length * self.unit:.6f}")
            self.table[self.loaded] = {**self.table[self.loaded], "Z": length}
            self.put(f"G43 H{self.loaded}")
        elif way == 3:
            self.put(f"G43 H{number}")
            self.tool = {**self.tool, **self.table[number]}
            return
        else:
            self.put(draw.choice((f"T{number} M6 G43", f"T{number}\nM6\nG43", f"T{number} M6\nG43 H{number}")))
            self.loaded = number
            for letter, value in zip("XYZ", self.change):
                self.at[letter] = value
        self.tool = {**self.tool, **self.table[self.loaded]}

    # ---------------------------------------------------------------- programs

    def within(self, write):
        """Writes the output of `write` in a branch, a loop, a subroutine, after / or plain."""
        draw, label = self.draw, self.labels
        way = draw.randrange(14)
        self.labels += 1
        if way > 5:
            return write()
        begin, at = len(self.lines), dict(self.at)
        if way == 0:
            is_taken = draw.choice(("#<_task>", "#<_task> EQ 1", f"#5400 EQ {self.loaded}", f"#<_current_tool> EQ {self.loaded}", "#<_metric> NE #<_imperial>"))
            self.put(f"o{label} if [{is_taken}]")
            write()
            self.put(f"o{label} else\nG53 G0 X{3 * self.config.high['X']}\no{label} endif" if not self.incremental else f"o{label} endif")
            return None
        if way == 1:
            # Skipped by default: the machine stays, and so does the state of the writer.
            saved = dict(self.__dict__)
            write()
            self.lines[begin:] = ["/" + line for part in self.lines[begin:] for line in part.split("\n")]
            lines, labels = self.lines, self.labels
            self.__dict__.update(saved)
            self.lines, self.labels, self.at = lines, labels, at
            return None
        if way == 2:
            self.put(f"#<n{label}> = 0\no{label} while [#<n{label}> LT 1]\n#<n{label}> = [#<n{label}> + 1]")
            write()
            return self.put(f"o{label} endwhile")
        if way == 3:
            self.put(f"o{label} repeat [1]")
            write()
            return self.put(f"o{label} endrepeat")
        write()
        body, self.lines[begin:] = self.lines[begin:], []
        if way == 4 and not self.is_fanuc:
            # State set in a subroutine stays, except numbers up to 30 and local names.
            self.subs.append("\n".join([f"o{label} sub", *body, f"o{label} endsub"]))
            return self.put(f"o{label} call [1] [2]")
        self.is_fanuc = True if not self.subs else self.is_fanuc
        if not self.subs and way == 5:
            self.fanuc.append("\n".join([f"O{label}", *body, "M99"]))
            return self.put(f"M98 P{label}")
        self.lines += body
        return None

    def program(self, name):
        config, draw = self.config, self.draw
        self.fanuc, self.is_fanuc = [], False
        self.put(f"{config.start} {draw.choice(('G61', 'G64', 'G64 P%.5f' % (0.001 * config.room)))} G91.1")
        self.put("M52 P0\n" + self.feed())
        count = draw.randint(5, 9)
        # In a third of them.
        bad = draw.randrange(count) if draw.random() < 1 / 3 else None
        for n in range(count):
            if n == bad:
                self.within(self.broken)
                continue
            for _ in range(draw.randint(0, 2)):
                self.state()
            self.within(lambda: draw.choice((self.line, self.line, self.line, self.arc_to, self.arc_to, self.probe_to, self.cycle_to, self.spindle_to,
                                             self.form_to, self.form_to))(self.near()))
        self.put(draw.choice(ENDS))
        text = "\n".join([*self.subs, *self.lines, "M2", *self.fanuc, ""])
        return Program(name, config.name, "bad" if bad is not None else "good", text, self.edits, seconds=60, is_random=True)

    def broken(self):
        way = self.draw.random()
        if way < 0.25:
            return self.arc(bulge=self.draw.choice((0.005, 0.05, 1)) * 0.02 * self.config.room)
        if way < 0.5:
            return self.form_beyond()
        return self.line(self.beyond())

    def form_beyond(self):
        """Writes a form that begins within the limits, and may exceed them later."""
        letter, up = self.draw.choice("XYZ"), self.draw.choice((1, -1))
        size = self.draw.uniform(0.03, 0.1) * self.config.room
        inside = self.draw.uniform(0.02, 1) * size
        self.line({**self.at, letter: self.config.high[letter] - inside if up > 0 else self.config.low[letter] + inside})
        self.form(size, up)

    def arc_to(self, there):
        self.line(there)
        self.arc()

    def probe_to(self, there):
        if self.draw.random() < 0.4:
            self.probe(there)
        else:
            self.line(there)

    def cycle_to(self, there):
        self.line(there)
        if self.draw.random() < 0.5:
            self.cycle()

    def form_to(self, there):
        self.line(there)
        self.form(self.draw.uniform(0.02, 0.06) * self.config.room)

    def spindle_to(self, there):
        self.line(there)
        if self.draw.random() < 0.3:
            self.spindle()
