// SPDX-License-Identifier: GPL-2.0-or-later
//! Suggestions for misspelt names: sections, and keys of LinuxCNC's own sections.

/// Sections without a number or letter.
const SECTIONS: [&str; 14] = [
    "EMC",
    "DISPLAY",
    "FILTER",
    "RS274NGC",
    "EMCMOT",
    "TASK",
    "HAL",
    "HALUI",
    "APPLICATIONS",
    "TRAJ",
    "KINS",
    "EMCIO",
    "PKM",
    "SECOND",
];

/// Stems of section names that end in a number or letter.
const STEMS: [&str; 8] =
    ["LEG_", "CONSTRAINT_", "JOINT_", "AXIS_", "CHAIN_", "BOX_", "SECOND_BOX_", "SPINDLE_"];

/// Keys of a joint that LinuxCNC 2.9 reads.
const JOINT: &[&str] = &[
    "TYPE",
    "HOME",
    "UNITS",
    "MAX_VELOCITY",
    "MAX_ACCELERATION",
    "BACKLASH",
    "COMP_FILE",
    "COMP_FILE_TYPE",
    "MIN_LIMIT",
    "MAX_LIMIT",
    "MIN_FERROR",
    "FERROR",
    "LOCKING_INDEXER",
    "HOME_OFFSET",
    "HOME_SEARCH_VEL",
    "HOME_LATCH_VEL",
    "HOME_FINAL_VEL",
    "HOME_USE_INDEX",
    "HOME_INDEX_NO_ENCODER_RESET",
    "HOME_IGNORE_LIMITS",
    "HOME_IS_SHARED",
    "HOME_ABSOLUTE_ENCODER",
    "HOME_SEQUENCE",
    "VOLATILE_HOME",
];

/// Keys of an axis.
const AXIS: &[&str] = &[
    "TYPE",
    "HOME",
    "MAX_VELOCITY",
    "MAX_ACCELERATION",
    "MIN_LIMIT",
    "MAX_LIMIT",
    "WRAPPED_ROTARY",
    "LOCKING_INDEXER_JOINT",
    "OFFSET_AV_RATIO",
];

/// Keys of the other sections that a machine depends on.
const OTHERS: [(&str, &[&str]); 5] = [
    (
        "TRAJ",
        &[
            "COORDINATES",
            "LINEAR_UNITS",
            "ANGULAR_UNITS",
            "HOME",
            "DEFAULT_LINEAR_VELOCITY",
            "MAX_LINEAR_VELOCITY",
            "DEFAULT_LINEAR_ACCELERATION",
            "MAX_LINEAR_ACCELERATION",
            "DEFAULT_ANGULAR_VELOCITY",
            "MAX_ANGULAR_VELOCITY",
            "DEFAULT_ANGULAR_ACCELERATION",
            "MAX_ANGULAR_ACCELERATION",
            "POSITION_FILE",
            "NO_FORCE_HOMING",
            "SPINDLES",
        ],
    ),
    ("KINS", &["KINEMATICS", "JOINTS"]),
    ("HAL", &["HALFILE", "POSTGUI_HALFILE", "SHUTDOWN", "HALUI", "HALCMD", "TWOPASS"]),
    ("EMCMOT", &["EMCMOT", "SERVO_PERIOD", "BASE_PERIOD", "TRAJ_PERIOD", "COMM_TIMEOUT"]),
    ("EMCIO", &["EMCIO", "CYCLE_TIME", "TOOL_TABLE", "RANDOM_TOOLCHANGER", "TOOL_CHANGE_POSITION"]),
];

/// Returns the largest number of differing letters for a suggestion, by the name's length: one for a short name.
fn most(name: &str) -> usize {
    if name.len() < 6 { 1 } else { 2 }
}

/// Returns the nearest known word to a misspelt one in capital letters, if any is near; none for a known word.
pub fn word<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    among(&name.to_ascii_uppercase(), known).filter(|nearest| *nearest != name)
}

/// Returns the known word with the fewest differing letters, if any is near.
pub fn among<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let apart = |word: &str| strsim::osa_distance(name, word);
    let nearest = known.into_iter().min_by_key(|word| apart(word))?;
    (apart(nearest) <= most(name)).then_some(nearest)
}

/// Returns whether LinuxCNC or pkmkins reads the section.
pub fn is_section(name: &str) -> bool {
    SECTIONS.contains(&name) || STEMS.iter().any(|stem| is_one(name, stem))
}

/// Suggests the section for a misspelt name; none for a known name, or if none is near.
pub fn section(name: &str) -> Option<String> {
    if is_section(name) {
        return None;
    }
    let bare = |name: &str| name.to_ascii_uppercase().replace('_', "");
    let number = name.chars().rev().take_while(char::is_ascii_digit).count();
    let end = if number > 0 { number } else { 1 };
    let (front, back) = name.split_at(name.len().saturating_sub(end));
    let stem = STEMS.iter().find(|stem| {
        let apart = strsim::osa_distance(&bare(front), &bare(stem));
        is_one(&format!("{stem}{}", back.to_ascii_uppercase()), stem) && apart <= 1
    });
    match stem {
        Some(stem) => Some(format!("{stem}{}", back.to_ascii_uppercase())),
        None => word(name, SECTIONS).map(Into::into),
    }
}

/// Returns whether a name is this stem and a number, or a letter if the stem takes one.
fn is_one(name: &str, stem: &str) -> bool {
    let Some(back) = name.strip_prefix(stem) else { return false };
    match stem {
        "AXIS_" | "CHAIN_" => back.len() == 1 && "XYZABCUVW".contains(back),
        _ => !back.is_empty() && back.bytes().all(|b| b.is_ascii_digit()),
    }
}

/// Returns the keys that LinuxCNC reads in a section; `None` if any key is allowed.
fn known(section: &str) -> Option<&'static [&'static str]> {
    match section {
        _ if is_one(section, "JOINT_") => Some(JOINT),
        _ if is_one(section, "AXIS_") => Some(AXIS),
        _ => OTHERS.iter().find(|(name, _)| *name == section).map(|(_, keys)| *keys),
    }
}

/// Returns whether LinuxCNC reads this key.
pub fn is_of_linuxcnc(section: &str, key: &str) -> bool {
    known(section).is_some_and(|known| known.contains(&key))
}

/// Suggests the key for a misspelt key of one of LinuxCNC's sections; none if any key is allowed
/// there.
pub fn key(section: &str, key: &str) -> Option<&'static str> {
    let known = known(section)?;
    match known.contains(&key) {
        true => None,
        false => word(key, known.iter().copied()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sections_are_known_by_their_stem_and_number() {
        for (name, meant) in [
            ("LEG0", "LEG_0"),
            ("leg_12", "LEG_12"),
            ("JOIT_3", "JOINT_3"),
            ("AXISX", "AXIS_X"),
            ("PKN", "PKM"),
            ("TRAJECTORY", ""),
            ("LEG_3", ""),
            ("SECOND_BOX_0", ""),
            ("PROBE", ""),
            ("KIN", "KINS"),
            ("AXES_Z", "AXIS_Z"),
        ] {
            assert_eq!(section(name).unwrap_or_default(), meant, "{name}");
        }
    }

    #[test]
    fn keys_are_known_by_their_section_and_others_are_left_alone() {
        assert_eq!(key("JOINT_3", "MAX_VELOCTY"), Some("MAX_VELOCITY"));
        assert_eq!(key("JOINT_3", "HOME_SEQUENCE"), None);
        assert_eq!(key("JOINT_3", "SCALE"), None);
        assert_eq!(key("AXIS_X", "MAXLIMIT"), Some("MAX_LIMIT"));
        assert_eq!(key("MY_OWN", "HALFLE"), None);
        assert_eq!(key("HAL", "HALFLE"), Some("HALFILE"));
    }
}
