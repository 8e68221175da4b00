// SPDX-License-Identifier: GPL-2.0-or-later
//! Spindle speeds of a program, read from its S words.
//!
//! A move has the speed of the last S word at its line or above it. In a program that jumps or
//! calls subroutines this is so only where all S words say the same.

/// Why a program has no speeds that are known.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoSpeeds {
    /// No S word.
    #[error("the program names no spindle speed (an S word); name one with --rpm")]
    None,
    /// An S word that is not a number above 0.
    #[error("line {0}: the spindle speed is no number above 0; name one with --rpm")]
    NoNumber(u32),
    /// Several speeds in a program that does not run from top to bottom.
    #[error(
        "line {0}: another spindle speed, in a program with subroutines or loops, so that it is \
         not known which counts where; name one with --rpm"
    )]
    Unordered(u32),
    /// Another speed in a file of a subroutine.
    #[error("a subroutine in a file of its own names another spindle speed; name one with --rpm")]
    Elsewhere,
    /// G96: the speed follows from the place.
    #[error("line {0}: G96 makes the spindle speed depend on the place; name one with --rpm")]
    Surface(u32),
    /// Moves before the first S word.
    #[error("line {0}: the tool cuts before a spindle speed is named")]
    Late(u32),
}

/// The speeds of a program: lines and 1/min, by rising line.
#[derive(Clone, Debug, PartialEq)]
pub struct Speeds(Vec<(u32, f64)>);

impl Speeds {
    /// Of a program's text, and of the files of subroutines that it runs.
    ///
    /// # Errors
    /// See [`NoSpeeds`].
    pub fn read(text: &str, subroutines: &[String]) -> Result<Self, NoSpeeds> {
        if subroutines.is_empty() {
            return Self::of_file(text, true);
        }
        let mut own = Self::of_file(text, false);
        for text in subroutines {
            own = match (own, Self::of_file(text, false)) {
                (own, Err(NoSpeeds::None)) => own,
                (Err(NoSpeeds::None), other) => other,
                (Ok(own), Ok(other)) if own == other => Ok(own),
                (Ok(_), Ok(_)) => Err(NoSpeeds::Elsewhere),
                (Err(error), _) | (_, Err(error)) => Err(error),
            };
        }
        own
    }

    fn of_file(text: &str, mut is_ordered: bool) -> Result<Self, NoSpeeds> {
        let mut found: Vec<(u32, f64)> = vec![];
        for (number, line) in (1..).zip(text.lines()) {
            let words = without_comments(line);
            if words.contains("G96") {
                return Err(NoSpeeds::Surface(number));
            }
            is_ordered &= !words.starts_with('O') && !words.contains("M98");
            if let Some(value) = s_word(&words) {
                let speed = value.parse().ok().filter(|speed: &f64| *speed > 0.0);
                found.push((number, speed.ok_or(NoSpeeds::NoNumber(number))?));
            }
        }
        let (_, first) = *found.first().ok_or(NoSpeeds::None)?;
        match found.iter().find(|(_, speed)| !is_ordered && *speed != first) {
            Some((number, _)) => Err(NoSpeeds::Unordered(*number)),
            None if is_ordered => Ok(Self(found)),
            // A subroutine that cuts may stand above the block that calls it.
            None => Ok(Self(vec![(0, first)])),
        }
    }

    /// One speed for all lines.
    pub fn of(rpm: f64) -> Self {
        Self(vec![(0, rpm)])
    }

    /// The speed at a line.
    ///
    /// # Errors
    /// The line stands before the first S word.
    pub fn at(&self, line: u32) -> Result<f64, NoSpeeds> {
        let before = self.0.iter().rev().find(|(number, _)| *number <= line);
        before.map(|(_, speed)| *speed).ok_or(NoSpeeds::Late(line))
    }
}

/// A block in capitals, without spaces, comments, and names of parameters.
fn without_comments(line: &str) -> String {
    let mut kept = String::new();
    let mut depth = 0;
    for c in line.chars() {
        match c {
            ';' if depth == 0 => break,
            '(' | '<' => depth += 1,
            ')' | '>' => depth = (depth - 1).max(0),
            c if depth == 0 && !c.is_whitespace() => kept.push(c.to_ascii_uppercase()),
            _ => {}
        }
    }
    kept
}

/// What follows an S word's letter; those of functions (COS, SQRT) have other letters beside them.
fn s_word(words: &str) -> Option<&str> {
    let is_letter = |c: char| c.is_ascii_alphabetic();
    let mut depth = 0;
    let mut before = ' ';
    for (place, c) in words.char_indices() {
        match c {
            '[' => depth += 1,
            ']' => depth -= 1,
            'S' if depth == 0 && !is_letter(before) => {
                let rest = &words[place + 1..];
                if !rest.starts_with(is_letter) {
                    return Some(rest.split(is_letter).next().unwrap_or_default());
                }
            }
            _ => {}
        }
        before = c;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Speeds, NoSpeeds> {
        Speeds::read(text, &[])
    }

    #[test]
    fn a_line_has_the_speed_of_the_last_s_word_above_it() {
        let speeds = read("G21 (S100)\nM3 s 6000.5 ; S7\nG1 X[ABS[-3]]\nS9000M3\n").unwrap();
        assert_eq!(speeds.at(1), Err(NoSpeeds::Late(1)));
        assert_eq!([2, 3, 4, 99].map(|line| speeds.at(line).unwrap()), [6000.5, 6000.5, 9e3, 9e3]);
    }

    #[test]
    fn speeds_that_are_not_known_are_refused_with_their_line() {
        assert_eq!(read("G1 X1 (S5)\n"), Err(NoSpeeds::None));
        assert_eq!(read("G1 X1\nS[#1+2] M3\n"), Err(NoSpeeds::NoNumber(2)));
        assert_eq!(read("S0 M3\n"), Err(NoSpeeds::NoNumber(1)));
        let text = "o<cut> sub\nG1 X1\no<cut> endsub\nS100 M3\no<cut> call\n";
        assert_eq!(read(text).unwrap().at(2), Ok(100.0));
        let two = format!("{text}S200\no<cut> call\n");
        assert_eq!(read(&two), Err(NoSpeeds::Unordered(6)));
    }

    #[test]
    fn files_of_subroutines_must_name_the_same_speed_or_none() {
        let of = |files: &[&str]| {
            let files: Vec<String> = files.iter().map(|text| text.to_string()).collect();
            Speeds::read("S100 M3\nG22.1 X1\n", &files)
        };
        assert_eq!(of(&["G1 X1\n", "G1 X2\nS100\n"]).unwrap().at(1), Ok(100.0));
        assert_eq!(of(&["S90\nG1 X1\n"]), Err(NoSpeeds::Elsewhere));
        // Lines of a subroutine are not those of the program.
        let two = Speeds::read("S100\nG1 X1\nS200\nG22.1 X1\n", &["G1 X1\n".into()]);
        assert_eq!(two, Err(NoSpeeds::Unordered(3)));
    }

    #[test]
    fn a_speed_that_depends_on_the_place_is_not_taken_for_turns() {
        assert_eq!(read("S100 M3\nG96 D2500 S200\n"), Err(NoSpeeds::Surface(2)));
    }
}
