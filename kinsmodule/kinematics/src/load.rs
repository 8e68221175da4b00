// SPDX-License-Identifier: GPL-2.0-or-later
//! The module's load parameters: `legs=KIND:COUNT[,KIND:COUNT] coordinates=LETTERS table=LETTERS`.

use crate::geometry::Coordinates;

/// Legs of the machines that this version drives: six struts hold X Y Z A B C.
pub const LEGS: usize = 6;

/// What the load parameters ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Load {
    /// Order of the pose letters.
    pub coordinates: Coordinates,
}

/// Why load parameters are refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LoadError {
    /// `legs` is not `KIND:COUNT[,KIND:COUNT]`.
    LegsMalformed,
    /// A kind of leg that does not exist.
    KindUnknown,
    /// A kind of leg that this version does not drive.
    KindUnsupported,
    /// Not as many legs as coordinates.
    CountWrong,
    /// `coordinates` is not each of X Y Z A B C once.
    CoordinatesWrong,
    /// A table, which this version does not drive.
    TableUnsupported,
}

impl LoadError {
    /// One sentence for people, with the way out.
    pub const fn text(self) -> &'static str {
        match self {
            Self::LegsMalformed => "legs= must be KIND:COUNT[,KIND:COUNT], such as strut:6",
            Self::KindUnknown => "the kinds of legs are strut, slider, crank",
            Self::KindUnsupported => "this version drives struts only, such as legs=strut:6",
            Self::CountWrong => "the coordinates XYZABC need six legs, such as legs=strut:6",
            Self::CoordinatesWrong => "coordinates= must hold each of X Y Z A B C once",
            Self::TableUnsupported => "this version drives no table axes: leave table= out",
        }
    }
}

impl Load {
    /// From the texts of the parameters; `None` or empty = default
    /// (`legs=strut:6 coordinates=XYZABC`, no table).
    ///
    /// # Errors
    /// The [`LoadError`] of the first parameter that does not fit.
    pub fn parse(
        legs: Option<&[u8]>,
        coordinates: Option<&[u8]>,
        table: Option<&[u8]>,
    ) -> Result<Self, LoadError> {
        if let Some(text) = given(legs)
            && count_legs(text)? != LEGS
        {
            return Err(LoadError::CountWrong);
        }
        if given(table).is_some() {
            return Err(LoadError::TableUnsupported);
        }
        let coordinates = match given(coordinates) {
            None => Coordinates::XYZABC,
            Some(text) => Coordinates::parse(text).ok_or(LoadError::CoordinatesWrong)?,
        };
        Ok(Self { coordinates })
    }
}

fn given(text: Option<&[u8]>) -> Option<&[u8]> {
    text.filter(|t| !t.is_empty())
}

fn count_legs(text: &[u8]) -> Result<usize, LoadError> {
    let mut sum = 0;
    for group in text.split(|c| *c == b',') {
        let mut parts = group.split(|c| *c == b':');
        let (Some(kind), Some(count), None) = (parts.next(), parts.next(), parts.next()) else {
            return Err(LoadError::LegsMalformed);
        };
        match kind {
            b"strut" => {}
            b"slider" | b"crank" => return Err(LoadError::KindUnsupported),
            b"" => return Err(LoadError::LegsMalformed),
            _ => return Err(LoadError::KindUnknown),
        }
        sum += number(count).ok_or(LoadError::LegsMalformed)?;
    }
    Ok(sum)
}

/// A count of one or two digits.
fn number(text: &[u8]) -> Option<usize> {
    if text.is_empty() || text.len() > 2 || !text.iter().all(u8::is_ascii_digit) {
        return None;
    }
    Some(text.iter().fold(0, |n, digit| 10 * n + usize::from(digit - b'0')))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn legs(text: &str) -> Result<Load, LoadError> {
        Load::parse(Some(text.as_bytes()), None, None)
    }

    #[test]
    fn six_struts_are_the_default_however_they_are_grouped() {
        let default = Load::parse(None, None, None).unwrap();
        assert_eq!(default.coordinates, Coordinates::XYZABC);
        for text in ["", "strut:6", "strut:06", "strut:4,strut:2"] {
            assert_eq!(legs(text), Ok(default), "{text}");
        }
    }

    #[test]
    fn what_does_not_fit_is_refused_with_its_reason() {
        for (text, error) in [
            ("strut", LoadError::LegsMalformed),
            ("strut:", LoadError::LegsMalformed),
            ("strut:6,", LoadError::LegsMalformed),
            ("strut:-6", LoadError::LegsMalformed),
            ("strut:6:1", LoadError::LegsMalformed),
            ("strut:100", LoadError::LegsMalformed),
            ("hexapod:6", LoadError::KindUnknown),
            ("slider:6", LoadError::KindUnsupported),
            ("strut:0", LoadError::CountWrong),
            ("strut:5", LoadError::CountWrong),
            ("strut:6,strut:1", LoadError::CountWrong),
        ] {
            assert_eq!(legs(text), Err(error), "{text}");
        }
        let coordinates = |t: &str| Load::parse(None, Some(t.as_bytes()), None);
        assert_eq!(coordinates("XYZB"), Err(LoadError::CoordinatesWrong));
        assert_eq!(Load::parse(None, None, Some(b"XY")), Err(LoadError::TableUnsupported));
    }
}
