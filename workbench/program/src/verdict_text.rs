// SPDX-License-Identifier: GPL-2.0-or-later
//! Text of the verdict on a program.

use crate::report::{Break, LineLoad, Range, Rule, Time, Timing};
use crate::verdict::{ProgramVerdict, Suggestion};
use crate::work_offset::Offset;
use check::cautions::Caution;
use linuxcnc::row::{Ending, Message};

/// Resolution of displayed coordinates.
const PLACES: f64 = 1e-4;

/// Least share of the programmed feed that three digits show.
const LEAST_FEED: f64 = 1e-3;

impl ProgramVerdict<'_> {
    /// Names a line: its number, after the name of its file if it is not the program.
    pub fn place(&self, file: usize, line: u32) -> String {
        match file {
            0 => format!("line {line}"),
            _ => format!("{}, line {line}", self.files[file].display()),
        }
    }

    /// Returns the text of the line of a violation.
    pub fn block(&self, broken: &Break) -> Option<&str> {
        let number = (broken.line as usize).checked_sub(1)?;
        self.texts[broken.file].lines().nth(number).map(str::trim)
    }

    /// Returns a caution with its position.
    pub fn caution(&self, Caution { line, file, text }: &Caution) -> String {
        line.map_or(String::new(), |line| self.place(*file, line) + ": ") + text
    }

    /// Returns the verdict with all facts and findings.
    pub fn text(&self) -> String {
        let verdict = match (self.fits, self.warnings.is_empty()) {
            (Some(true), true) => "The program fits the machine.",
            (Some(true), false) => "The program fits the machine; see the warnings.",
            (Some(false), _) => "The program does not fit the machine.",
            (None, _) => {
                "The judged part of the program fits the machine; the rest was not judged."
            }
        };
        format!("{}{}\n{verdict}\n", self.facts(), self.findings())
    }

    /// Returns the violations, and a remedy.
    pub fn findings(&self) -> String {
        let unit = self.config.length_unit();
        let mut text = String::new();
        for broken in &self.found.breaks {
            text += &format!("\nerror: {}", self.sentence(broken));
        }
        for caution in &self.warnings {
            text += &format!("\nwarning: {}\n", self.caution(caution));
        }
        text += &self.shown();
        if let Some(suggestion) = &self.offset {
            let Suggestion { offset: Offset { shift: [x, y, z], turn }, block, .. } = suggestion;
            let how = match *turn {
                0.0 => format!("shifted by X {x} Y {y} Z {z} {unit}"),
                _ => format!(
                    "rotated by {turn} degrees about Z, then shifted by X {x} Y {y} Z {z} {unit}"
                ),
            };
            text += &format!(
                "\nhelp: the program fits with its work offset {how}: {}.\n  \
                 Clamp the workpiece there, and run once before the program:\n  {block}\n",
                suggestion.checked()
            );
        }
        text
    }

    /// Returns the machine's ranges that the program uses, and the margins.
    fn facts(&self) -> String {
        let found = &self.found;
        let mut text = format!("{} on {}\n", self.program, self.machine);
        let mut row = |name: &str, value: String| text += &format!("  {name:<18} {value}\n");
        let unit = self.config.length_unit();
        let is_stopped =
            matches!(&found.time, Time::Judged(timing) if timing.ending == Ending::Stopped);
        let to_the_stop = if is_stopped { " (up to the stop)" } else { "" };
        let (file, line) = found.last;
        let of_path = &match found.is_whole {
            true => String::new(),
            false => format!(" (up to {})", self.place(file, line)),
        };
        row("moves", format!("{}, {:.1} {unit} long{of_path}", found.moves, found.length));
        row("time", found.time.text("not judged"));
        for margin in &found.margins {
            let how_far = if margin.limit.is_of_time() { to_the_stop } else { of_path };
            let place = match margin.line {
                0 => format!("{}, before the program", margin.part),
                line => format!("{}, {}", margin.part, self.place(margin.file, line)),
            };
            let side = if margin.value < 0.0 { "beyond" } else { "to spare" };
            let amount = format!("{:.4} {}", margin.value.abs(), margin.unit);
            row(margin.limit.name(), format!("{} {side}: {place}{how_far}", amount.trim_end()));
        }
        for range in &found.ranges {
            row(&range.part, range.text() + of_path);
        }
        if let Time::Judged(timing) = &found.time
            && let Some(least) = timing.lines.iter().min_by(|a, b| a.factor.total_cmp(&b.factor))
        {
            row("feed", self.feed(least) + to_the_stop);
        }
        if !found.fits() {
            let is_first = |broken: &&Break| found.share(broken.before) <= found.runnable;
            let stop = found.breaks.iter().find(|broken| broken.limit == Rule::Control);
            let before = match stop.filter(is_first) {
                Some(_) => "LinuxCNC stops it",
                None => "the first limit",
            };
            let share = 100.0 * found.runnable;
            row("runs", format!("{share:.1} % of the path{of_path} before {before}"));
        }
        text
    }

    /// Returns LinuxCNC's messages to the operator for a program that it runs to its end.
    fn shown(&self) -> String {
        let Time::Judged(timing) = &self.found.time else { return String::new() };
        let shown = timing.messages.iter().filter(|_| timing.ending == Ending::Finished);
        let note = |Message { text, line, file, seconds, .. }: &Message| {
            let place = self.place(*file, *line);
            format!("\nnote: {place}, after {seconds:.1} s: LinuxCNC shows: {text}\n")
        };
        shown.map(note).collect()
    }

    /// Returns the largest feed that the joint speeds allow.
    fn feed(&self, LineLoad { line, file, factor }: &LineLoad) -> String {
        let times = match *factor < LEAST_FEED {
            true => format!("less than {LEAST_FEED}"),
            false => format!("{factor:.3}"),
        };
        let place = self.place(*file, *line);
        format!("joint speeds allow {times} times the programmed feed, in {place}")
    }

    /// Returns the verdict in a few words, for a table.
    pub fn summary(&self) -> String {
        let found = &self.found;
        let Some(first) = found.breaks.first() else { return found.time.text("time not judged") };
        let more = match found.breaks.len() - 1 {
            0 => String::new(),
            more => format!(", and {more} more"),
        };
        format!("{}: {}{more}", self.place(first.file, first.line), first.limit.name())
    }

    /// Returns a violation in a sentence, with its line and pose.
    pub fn sentence(&self, broken: &Break) -> String {
        let word = |(letter, value): &(char, f64)| {
            // A value rounded to 0 has no sign.
            let value = (value / PLACES).round() * PLACES + 0.0;
            format!("{letter}{value:.4}")
        };
        let words: Vec<String> = broken.words.iter().map(word).collect();
        let block = self.block(broken).map_or(String::new(), |block| format!("  {block}\n"));
        let more = match broken.moves {
            0 | 1 => String::new(),
            moves => format!(", the first of {moves}"),
        };
        format!(
            "{}: {}: {}\n{block}  at {}{more}\n",
            self.place(broken.file, broken.line),
            broken.limit.name(),
            broken.text,
            words.join(" ")
        )
    }
}

impl Range {
    /// Returns the used range of an axis or joint.
    fn text(&self) -> String {
        let Self { unit, used, allowed, .. } = self;
        let end = |end: f64| if end.is_finite() { end.to_string() } else { "any".into() };
        let [least, most] = allowed.map(end);
        // No -0, nor -0.000 for values that round to 0.
        let [low, high] = used.map(|value| (value * 1e3).round() / 1e3 + 0.0);
        format!("{low:.3} to {high:.3} of {least} to {most} {unit}")
    }
}

impl Time {
    /// Returns the duration, or `not_judged` and the reason.
    fn text(&self, not_judged: &str) -> String {
        match self {
            Self::NotJudged(cause) => format!("{not_judged}: {cause}"),
            Self::Judged(Timing { seconds, ending: Ending::Finished, .. }) => {
                format!("{seconds:.1} s")
            }
            Self::Judged(Timing { seconds, .. }) => {
                format!("{seconds:.1} s, then LinuxCNC stops it")
            }
        }
    }
}
