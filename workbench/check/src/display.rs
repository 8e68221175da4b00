// SPDX-License-Identifier: GPL-2.0-or-later
//! The machine in the user interface: letters of its picture, and whether it counts as a lathe.

use crate::findings::Report;
use crate::programs;
use kinematics::Letter;
use machine::read::diagnostic::Severity;
use machine::read::mechanism::Mechanism;

/// Letters that move the tip along the picture's X, Y and Z: AXIS draws U, V and W in the same way.
const PLACES: [(Letter, [char; 2]); 3] =
    [(Letter::X, ['X', 'U']), (Letter::Y, ['Y', 'V']), (Letter::Z, ['Z', 'W'])];

/// Checks all of it.
pub(super) fn check(report: &mut Report, config: &Mechanism) {
    if programs::is_axis(&config.ini) {
        picture(report, config);
    }
    lathe(report, config);
}

/// Reports a picture of the path that omits a letter. Rotary letters count only after a `!`.
fn picture(report: &mut Report, config: &Mechanism) {
    let Some(entry) = config.ini.first("DISPLAY", "GEOMETRY") else { return };
    let given = entry.value.to_uppercase();
    let moved = PLACES.into_iter().filter(|(letter, _)| !config.machine.layout().is_held(*letter));
    let absent: String = moved
        .filter(|(_, letters)| !given.contains(letters))
        .map(|(_, letters)| letters[0])
        .collect();
    if !absent.is_empty() && !given.is_empty() {
        let text = format!("AXIS shows the path flat, without {absent}: expected XYZ");
        report.finding(Severity::Warning, config.ini.refuse(entry, &text));
    }
}

/// Reports a lathe that moves Y. For user interfaces the key means yes, whatever its value.
fn lathe(report: &mut Report, config: &Mechanism) {
    let Some(entry) = config.ini.first("DISPLAY", "LATHE") else { return };
    if entry.value.is_empty() || config.machine.layout().is_held(Letter::Y) {
        return;
    }
    let text = "with this key, whatever its value, the GUI shows only X and Z, and the keys of AXIS jog X in reverse: \
                remove the line, because this machine moves Y";
    report.finding(Severity::Warning, config.ini.refuse(entry, text));
}
