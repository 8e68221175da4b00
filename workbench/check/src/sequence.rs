// SPDX-License-Identifier: GPL-2.0-or-later
//! The order in which LinuxCNC homes all joints, `HOME_SEQUENCE`, and the joints that it never homes.

use machine::read::ini::{Ini, IniError};

/// LinuxCNC's value for a joint without `HOME_SEQUENCE`.
const NONE: f64 = 999.0;

/// Returns the number of a joint; `None` if Home All does not home the joint: it has no number, or one after a gap.
///
/// # Errors
/// A value that is not a number.
pub(crate) fn of(ini: &Ini, section: &str) -> Result<Option<i64>, IniError> {
    let number = given(ini, section)?;
    Ok((number.abs() < end(ini)?).then_some(number))
}

/// Returns the first number that no joint has, at which Home All ends. It begins with 0, or with 1 if no joint has 0.
///
/// # Errors
/// A value that is not a number.
pub(crate) fn end(ini: &Ini) -> Result<i64, IniError> {
    let joints = ini.number_or("KINS", "JOINTS", 0.0)? as usize;
    // A negative number only makes all joints of a sequence do the last move together.
    let numbers = (0..joints).map(|n| Ok(given(ini, &format!("JOINT_{n}"))?.abs()));
    let numbers = numbers.collect::<Result<Vec<i64>, IniError>>()?;
    Ok((1..).find(|number| !numbers.contains(number)).unwrap_or(i64::MAX))
}

fn given(ini: &Ini, section: &str) -> Result<i64, IniError> {
    Ok(ini.number_or(section, "HOME_SEQUENCE", NONE)?.clamp(-NONE, NONE) as i64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    /// Returns the effective number of each joint, as [`of`].
    fn all(numbers: &[i64]) -> Vec<Option<i64>> {
        let joint = |(n, number)| format!("[JOINT_{n}]\nHOME_SEQUENCE = {number}\n");
        let joints: String = numbers.iter().enumerate().map(joint).collect();
        let text = format!("[KINS]\nJOINTS = {}\n{joints}", numbers.len());
        let ini = Ini::parse(Path::new("m.ini"), &text).unwrap();
        (0..numbers.len()).map(|n| of(&ini, &format!("JOINT_{n}")).unwrap()).collect()
    }

    #[test]
    fn home_all_ends_at_the_first_gap() {
        assert_eq!(all(&[0, 0, 1]), [Some(0), Some(0), Some(1)]);
        assert_eq!(all(&[-1, -1, 2]), [Some(-1), Some(-1), Some(2)]);
        assert_eq!(all(&[0, 2, -2]), [Some(0), None, None]);
        assert_eq!(all(&[-2, -2]), [None, None]);
        assert_eq!(all(&[0, 1, 100]), [Some(0), Some(1), None]);
        assert_eq!(all(&[0, i64::MIN, i64::MAX]), [Some(0), None, None]);
    }
}
