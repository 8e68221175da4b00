// SPDX-License-Identifier: GPL-2.0-or-later
//! The keys of a machine's INI file that describe the kinematics, as one table.
//!
//! A new key is named only here. `cargo xtask header` writes docs/reference/keys.md and a section of
//! docs/reference/pkmkins.9 from this table, and the workbench reads INI files with it, for `pkm` and for
//! `pkmkins-pins`, which prints the pins.

use Need::{Cardan, Needed, Optional, With};
use Range::{Above, Any, From, Hash, Model, Sign, Whole, Word};
use kinematics::leg::Kind;
use kinematics::{Carries, ConstraintGeometry, MAX_ITERATIONS};

/// Name of the key with row L of a box's matrix, without the letter; one number per leg.
pub const ROW: &str = "ROW_";

/// Kinds of legs that end at a point of the platform.
const POINTED: &[Kind] = &[Kind::Strut, Kind::Slider, Kind::Crank];

const XYZ: &[&str] = &["x", "y", "z"];
const XYZABC: &[&str] = &["x", "y", "z", "a", "b", "c"];
const TURNS: &[&str] = &["about", "across"];
const RADIUS_HEIGHT: &[&str] = &["r", "z"];
const LENGTH: &str = "machine units";
const DEGREES: &str = "degrees";

/// A key of the INI file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Key {
    /// Name.
    pub name: &'static str,
    /// Names of its numbers; empty for a single number.
    pub parts: &'static [&'static str],
    /// Whether it is required.
    pub need: Need,
    /// The pin without `pkmkins.`, with N for the leg, constraint or joint, K for the box and L for the axis; each number
    /// has its own pin. Empty: no pin.
    pub pin: &'static str,
    /// Range of each of its numbers.
    pub range: Range,
    /// Unit of its numbers; empty if they have none.
    pub unit: &'static str,
    /// Value of the pin if the key is absent, unless the pin keeps its default.
    pub absent: Option<u32>,
    /// Kinds of legs that have the key.
    pub kinds: &'static [Kind],
    /// One sentence, as in the manual page.
    pub text: &'static str,
}

/// Whether a key is required.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// Always.
    Needed,
    /// Never.
    Optional,
    /// If the strut has a lead.
    Cardan,
    /// Never, but if it is given, this other key of the section is required.
    With(&'static str),
}

/// Range of a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Range {
    /// Any decimal number.
    Any,
    /// More than the first and at most the second.
    Above(f64, f64),
    /// From the first to the second.
    From(f64, f64),
    /// Only digits, from the first to the second.
    Whole(u32, u32),
    /// 1 or -1.
    Sign,
    /// A word instead of a number: its index in the list, counted from 1, is the value of the pin, if there is one.
    Word(&'static [&'static str]),
    /// A hash of 32 bits, as 0x and hexadecimal digits or decimal.
    Hash,
    /// Instead of numbers the file with a shape, its unit, and its origin.
    Model,
}

impl Range {
    /// Returns whether `value` (spelled `word`) is in the range.
    pub fn holds(self, word: &str, value: f64) -> bool {
        match self {
            Any | Model => true,
            Hash => hash(word).is_some(),
            Above(least, most) => value > least && value <= most,
            From(least, most) => value >= least && value <= most,
            Whole(least, most) => {
                let digits = word.bytes().all(|b| b.is_ascii_digit());
                digits && value >= f64::from(least) && value <= f64::from(most)
            }
            Sign => matches!(word, "1" | "+1" | "-1"),
            Word(words) => words.contains(&word),
        }
    }
}

impl Key {
    /// Returns the number of its numbers.
    pub const fn count(&self) -> usize {
        if self.parts.is_empty() { 1 } else { self.parts.len() }
    }

    /// Describes the range of its numbers for users; empty if any number is accepted.
    pub fn expected(&self) -> String {
        let unit = if self.unit == DEGREES { " degrees" } else { "" };
        match self.range {
            Any => String::new(),
            Above(least, f64::INFINITY) => format!("more than {least}{unit}"),
            Above(least, most) => format!("more than {least} and at most {most}{unit}"),
            From(least, most) => format!("{least} to {most}{unit}"),
            Whole(0, u32::MAX) => "a non-negative integer".into(),
            Whole(least, most) => format!("an integer from {least} to {most}"),
            Sign => "1 or -1".into(),
            Hash => "0x and up to 8 hexadecimal digits, or a non-negative integer".into(),
            Word(words) => words.join(" or "),
            Model => "FILE UNIT [X Y Z [A B C]], FILE .stl or .obj without spaces, UNIT mm, cm, m or inch".into(),
        }
    }
}

/// Creates an optional number of all kinds of legs.
const fn key(text: &'static str) -> Key {
    Key {
        name: "",
        parts: &[],
        need: Optional,
        pin: "",
        range: Any,
        unit: "",
        absent: None,
        kinds: Kind::ALL,
        text,
    }
}

macro_rules! table {
    ($($(#[$doc:meta])* $section:ident { $($name:ident = $key:expr;)* })*) => {
        $($(#[$doc])* pub mod $section {
            use super::*;

            $(
                #[doc = concat!("`", stringify!($name), "`")]
                pub const $name: Key = Key { name: stringify!($name), ..$key };
            )*

            /// All keys of the section.
            pub const ALL: &[&Key] = &[$(&$name),*];
        })*
    };
}

table! {
    /// `[PKM]`: the machine.
    machine {
        SCREW_LEAD = Key { pin: "screw-lead", unit: "machine units a turn",
            ..key("Lead of every strut without its own LEAD, which then needs it; 0 if the struts are not open screws.") };
        CENTRE = Key { parts: XYZ, pin: "centre", unit: LENGTH,
            ..key("Only if the legs do not move all of X, Y and Z: the point of the platform, in its frame, that a column or slide keeps at 0 in the others. If the legs move Z, A and B, for example, this point stays at X0 Y0 of the base frame.") };
        SPINDLE_OFFSET = Key { pin: "spindle-offset", unit: LENGTH,
            ..key("Part of the tool length that is not in the tool table; for its sign see SIGN OF TOOL LENGTHS.") };
        TOOL_DIRECTION = Key { range: Word(DIRECTIONS),
            ..key("Direction of tools along the platform's Z from its reference point, used to check lengths (SIGN OF TOOL LENGTHS).") };
        CONVERGENCE_CRITERION = Key { pin: "convergence-criterion", range: Above(0.0, f64::INFINITY), unit: LENGTH,
            ..key("Largest leg length error that forward kinematics accept.") };
        LIMIT_ITERATIONS = Key { pin: "limit-iterations", range: Whole(1, MAX_ITERATIONS), absent: Some(MAX_ITERATIONS),
            ..key("Maximum number of linear solves in one forward call.") };
        RESIDUAL_LIMIT = Key { pin: "residual-limit", range: Above(0.0, f64::INFINITY), unit: LENGTH,
            ..key("Largest contradiction between joint values, if there are more legs than coordinates.") };
        MAX_ERROR = Key { pin: "max-error",
            ..key("Accepted for compatibility, no effect.") };
        CONDITIONING_LIMIT = Key { pin: "conditioning-limit", range: Above(0.0, 1.0),
            ..key("Conditioning (smallest singular value of the Jacobian, pin conditioning) at which the guard stops the machine.") };
        ROD_CLEARANCE = Key { pin: "rod-clearance", range: Above(0.0, f64::INFINITY), unit: LENGTH,
            ..key("Smallest distance between the center lines of two legs.") };
        MECHANISM_CLEARANCE = Key { pin: "mechanism-clearance", range: Above(0.0, f64::INFINITY), unit: LENGTH,
            ..key("Smallest distance between the legs and platforms of two mechanisms; the guard stops the machine before they come closer.") };
        TILT_LIMIT = Key { pin: "tilt-limit", range: From(0.0, 180.0), unit: DEGREES,
            ..key("Largest angle between the tool axis and its direction at A = B = C = 0; 0 for no limit.") };
        FEED_FLOOR = Key { pin: "feed-floor", range: Above(0.0, 1.0),
            ..key("Smallest feed scale that the guard sets.") };
        WORK_ON_PLATFORM = Key { parts: XYZ, pin: "work-on-platform", unit: LENGTH,
            ..key("Only if the platform carries the work and the tools stand still: position of the tool holder in the base frame. Tool lengths are measured from it.") };
        BASE_MODEL = Key { range: Model,
            ..key("Shape of the frame below the legs, for viewers; placed in the base frame.") };
        PLATFORM_MODEL = Key { range: Model,
            ..key("Shape of the platform, in the platform frame; its origin is the control point without a tool.") };
        SPINDLE_MODEL = Key { range: Model,
            ..key("Shape of the spindle on the platform, in the platform frame.") };
        TABLE_MODEL = Key { range: Model,
            ..key("Shape of the table under the work, for viewers; placed in the base frame, with all axes at 0.") };
    }

    /// `[SECOND]`: the differences of a second mechanism.
    second {
        CENTRE = Key { parts: XYZ, pin: "second.centre", unit: LENGTH,
            ..key("Like [PKM]CENTRE, for the second mechanism: in its platform's frame.") };
        SPINDLE_OFFSET = Key { pin: "second.spindle-offset", unit: LENGTH,
            ..key("Part of its tool length that is not in the tool table.") };
        TOOL_DIRECTION = Key { range: Word(DIRECTIONS),
            ..key("Direction of its tools along its platform's Z, used to check lengths (SIGN OF TOOL LENGTHS).") };
    }

    /// `[LEG_N]`: leg N.
    leg {
        BASE = Key { parts: XYZ, need: Needed, pin: "base.N", unit: LENGTH,
            ..key("Base anchor.") };
        PLATFORM = Key { parts: XYZ, need: Needed, pin: "platform.N", unit: LENGTH, kinds: POINTED,
            ..key("Center of the platform joint, in the platform frame.") };
        EFFECTOR = Key { parts: RADIUS_HEIGHT, need: Needed, pin: "effector.N", unit: LENGTH, kinds: &[Kind::Ring],
            ..key("Radius of the ring that rotates about the tool axis, 0 or more, and its Z in the platform frame.") };
        BASE_N = Key { parts: XYZ, need: Cardan, pin: "base-n.N", kinds: &[Kind::Strut],
            ..key("Base-fixed axis of the base cardan joint; any length.") };
        PLATFORM_N = Key { parts: XYZ, need: Cardan, pin: "platform-n.N", kinds: &[Kind::Strut],
            ..key("Platform-fixed axis of the platform cardan joint; any length.") };
        LEAD = Key { pin: "lead.N", unit: "machine units a turn", kinds: &[Kind::Strut],
            ..key("Lead of this strut instead of SCREW_LEAD; 0 for none.") };
        GUIDE = Key { parts: XYZ, need: Needed, pin: "guide.N", kinds: &[Kind::Slider],
            ..key("Direction of the guide for increasing joint values; any length.") };
        AXIS = Key { parts: XYZ, need: Needed, pin: "axis.N", kinds: &[Kind::Crank],
            ..key("Direction of the axis about which the arm rotates; any length.") };
        ARM = Key { parts: XYZ, need: Needed, pin: "arm.N", unit: LENGTH, kinds: &[Kind::Crank],
            ..key("Vector from BASE to the end of the arm at 0 degrees.") };
        ROD = Key { need: Needed, pin: "rod.N", range: Above(0.0, f64::INFINITY), unit: LENGTH, kinds: &[Kind::Slider, Kind::Crank],
            ..key("Length of the rod.") };
        SIDE = Key { need: Needed, pin: "side.N", range: Sign, kinds: &[Kind::Slider, Kind::Crank],
            ..key("Choice between the two joint values for a position of the platform joint: 1 the larger, -1 the smaller.") };
        OFFSET = Key { pin: "offset.N", unit: "joint units",
            ..key("Value subtracted from the leg length, carriage position or arm angle.") };
        BASE_CONE = Key { pin: "base-cone.N", range: Above(0.0, 180.0), unit: DEGREES,
            ..key("Largest angle between the leg and its direction at the reference pose, in the base frame.") };
        PLATFORM_CONE = Key { pin: "platform-cone.N", range: Above(0.0, 180.0), unit: DEGREES, kinds: POINTED,
            ..key("The same in the platform frame.") };
        BASE_PYRAMID = Key { parts: TURNS, need: With("BASE_N"), pin: "base-pyramid.N", range: Above(0.0, 180.0), unit: DEGREES, kinds: &[Kind::Strut],
            ..key("Largest rotations of the leg from its direction at the reference pose, in both directions: about the axis BASE_N of its base joint, and across it.") };
        PLATFORM_PYRAMID = Key { parts: TURNS, need: With("PLATFORM_N"), pin: "platform-pyramid.N", range: Above(0.0, 180.0), unit: DEGREES, kinds: &[Kind::Strut],
            ..key("The same in the platform frame, about and across the axis PLATFORM_N.") };
    }

    /// `[CONSTRAINT_N]`: constraint N of the platform.
    constraint {
        KIND = Key { need: Needed, pin: "constraint.N.kind", range: Word(ConstraintGeometry::KINDS),
            ..key("Equation that passive joints impose on the platform: a platform point stays in a plane of the base (PRS and RPS legs), a plane of the platform contains a base point (UPR and SPR legs, a passive leg fixed to the platform), or a platform direction stays perpendicular to a base direction (universal joint).") };
        PLATFORM = Key { parts: XYZ, need: Needed, pin: "constraint.N.platform", unit: LENGTH,
            ..key("(point-in-plane, plane-through-point) The point of the platform, or a point of its plane, in the platform frame.") };
        BASE = Key { parts: XYZ, need: Needed, pin: "constraint.N.base", unit: LENGTH,
            ..key("(point-in-plane, plane-through-point) A point of the plane of the base, or the base point.") };
        NORMAL = Key { parts: XYZ, need: Needed, pin: "constraint.N.normal",
            ..key("(point-in-plane, plane-through-point) Normal of the plane, any length, in the frame of the part that has the plane.") };
        PLATFORM_AXIS = Key { parts: XYZ, need: Needed, pin: "constraint.N.platform-axis",
            ..key("(square) Direction in the platform frame, any length.") };
        BASE_AXIS = Key { parts: XYZ, need: Needed, pin: "constraint.N.base-axis",
            ..key("(square) Direction in the base frame, any length.") };
    }

    /// `[CHAIN_L]`: what the extra axis L carries.
    chain {
        CARRIES = Key { need: Needed, pin: "chain.L.carries", range: Word(CARRIED),
            ..key("Part that the axis carries: the work, the tool, or the base of the legs.") };
        AXIS = Key { parts: XYZ, need: Needed, pin: "chain.L.axis",
            ..key("Direction of the axis, any length, in the frame of its carrier: right-handed for increasing A B C, the motion of the carried part for increasing U V W.") };
        POINT = Key { parts: XYZ, need: Needed, pin: "chain.L.point", unit: LENGTH,
            ..key("(A, B, C) Point on the axis, in the frame of its carrier with every axis of the chain at 0.") };
    }

    /// `[JOINT_N]`: joint N, in addition to LinuxCNC's own keys.
    joint {
        MIN_LIMIT = Key { need: Needed, pin: "min-limit.N", unit: "joint units",
            ..key("Smallest value; less than MAX_LIMIT.") };
        MAX_LIMIT = Key { need: Needed, pin: "max-limit.N", unit: "joint units",
            ..key("Largest value.") };
        MAX_VELOCITY = Key { need: Needed, pin: "max-velocity.N", range: Above(0.0, f64::INFINITY), unit: "joint units a second",
            ..key("Largest speed.") };
        MAX_ACCELERATION = Key { need: Needed, pin: "max-acceleration.N", range: Above(0.0, f64::INFINITY), unit: "joint units a second squared",
            ..key("Largest acceleration.") };
        CORRECTION_LIMIT = Key { pin: "correction-limit.N", range: Above(0.0, f64::INFINITY), unit: "joint units",
            ..key("Largest correction, positive or negative, that joint-correction.N may request while the machine runs; it reduces the range of the joint at both ends. Without the key there is no correction.") };
        CORRECTION_RATE = Key { pin: "correction-rate.N", range: Above(0.0, f64::INFINITY), unit: "joint units a second",
            ..key("Largest rate of the correction. Required with CORRECTION_LIMIT.") };
    }

    /// `[BOX_K]`: box K for the start without a seed, in addition to the rows of its matrix.
    workspace_box {
        LOW = Key { parts: XYZABC, need: Needed, pin: "box.K.low",
            ..key("Lower ends of the box.") };
        HIGH = Key { parts: XYZABC, need: Needed, pin: "box.K.high",
            ..key("Upper ends of the box.") };
        STEPS = Key { need: Needed, pin: "box.K.steps", range: Whole(0, u32::MAX),
            ..key("Number of search steps after which the box has a result.") };
        GEOMETRY = Key { need: Needed, pin: "box.K.geometry", range: Hash,
            ..key("Hash of the geometry for which the box was proved.") };
        WEIGHT = Key { parts: XYZABC, need: Needed,
            ..key("Weights of the coordinates in the proof; used only by pkm boxes.") };
        CONTRACTION = Key { need: Needed,
            ..key("Proved contraction of the search; used only by pkm boxes.") };
    }
}

/// Parses a hash as users and programs write it: hexadecimal, as everywhere in pkmkins, or decimal.
pub fn hash(text: &str) -> Option<u32> {
    let (digits, radix) = match text.strip_prefix("0x") {
        Some(digits) => (digits, 16),
        None => (text, 10),
    };
    // Otherwise a sign would be accepted.
    let is_digits = digits.len() <= 10 && digits.bytes().all(|b| b.is_ascii_hexdigit());
    u32::from_str_radix(digits, radix).ok().filter(|_| is_digits)
}

/// Names of the things that an axis can carry.
const CARRIED: &[&str] = &[Carries::ALL[0].name(), Carries::ALL[1].name(), Carries::ALL[2].name()];

/// Directions of tools: down, with positive lengths, and up, with negative ones.
const DIRECTIONS: &[&str] = &["down", "up"];

/// Returns the keys of the axis with this letter: only rotary axes have a point.
pub fn of_axis(letter: char) -> impl Iterator<Item = &'static Key> {
    let turns = "ABC".contains(letter);
    chain::ALL.iter().copied().filter(move |key| turns || key.name != chain::POINT.name)
}

/// Returns the keys of a constraint of this kind.
pub fn of_constraint(kind: &str) -> impl Iterator<Item = &'static Key> {
    let is_square = ConstraintGeometry::KINDS.last().is_some_and(|square| *square == kind);
    let is_axis = |key: &Key| *key == constraint::PLATFORM_AXIS || *key == constraint::BASE_AXIS;
    let own = move |key: &&Key| **key == constraint::KIND || is_axis(key) == is_square;
    constraint::ALL.iter().copied().filter(own)
}

/// Returns the keys of a leg of this kind.
pub fn of_leg(kind: Kind) -> impl Iterator<Item = &'static Key> {
    leg::ALL.iter().copied().filter(move |key| key.kinds.contains(&kind))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all() -> impl Iterator<Item = &'static Key> {
        let legs = [leg::ALL, constraint::ALL, chain::ALL];
        let all =
            [machine::ALL, second::ALL, joint::ALL, workspace_box::ALL].into_iter().chain(legs);
        all.flatten().copied()
    }

    #[test]
    fn keys_are_the_names_of_pins_in_capitals() {
        for key in all().filter(|key| !key.pin.is_empty()) {
            let stems = ["box.K.", "second.", "chain.L.", "constraint.N."];
            let stem = stems.iter().find_map(|name| key.pin.strip_prefix(name));
            let stem = stem.unwrap_or(key.pin);
            let stem = stem.strip_suffix(".N").unwrap_or(stem);
            assert_eq!(key.name, stem.to_uppercase().replace('-', "_"));
        }
    }

    #[test]
    fn every_kind_of_leg_is_wherever_a_new_one_has_to_be_added() {
        let names = Kind::ALL.iter().map(|kind| kind.name()).collect::<Vec<_>>().join(", ");
        let text = |file: &str| {
            let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../");
            std::fs::read_to_string(format!("{root}{file}")).unwrap()
        };
        for file in ["kinematics/src/load_error.rs", "linuxcnc/src/load.rs"] {
            assert!(text(&format!("kinsmodule/{file}")).contains(&names), "{file} lists the kinds");
        }
        for kind in Kind::ALL {
            let ends = [leg::PLATFORM, leg::EFFECTOR].map(|key| key.kinds.contains(kind));
            assert!(ends[0] != ends[1], "{kind:?} ends at a point or on a ring");
            let geometry = format!("{kind:?}Geometry");
            for (file, word) in [
                ("docs/reference/pkmkins.9", &format!("\n.B {}\n", kind.name())),
                ("tests/cases/ini/cases.toml", &format!("legs={}:", kind.name())),
                ("kinsmodule/kinematics/src/certificate.rs", &geometry),
                ("kinsmodule/kinematics/tests/common/random.rs", &geometry),
                ("page/core/src/described.rs", &geometry),
                ("tests/module/abi/src/sequences/setups.rs", &format!("Kind::{kind:?}")),
                (
                    "tests/module/abi/tests/pins.rs",
                    &format!("{}: OfKind", kind.name().to_uppercase()),
                ),
            ] {
                assert!(text(file).contains(word), "{file} has no {word:?}");
            }
        }
    }

    #[test]
    fn a_key_that_another_one_needs_is_one_of_the_same_legs() {
        for key in all() {
            let With(other) = key.need else { continue };
            let other = leg::ALL.iter().find(|k| k.name == other).expect("a key of a leg");
            assert!(key.kinds.iter().all(|kind| other.kinds.contains(kind)), "{}", key.name);
        }
    }

    #[test]
    fn a_hash_is_read_in_both_ways() {
        for text in ["0x6df26e72", "0x6DF26E72", "1844604530"] {
            assert_eq!(hash(text), Some(0x6df2_6e72), "{text}");
        }
        for text in ["", "0x", "+1", "-1", "6df26e72", "0x1ffffffff", "4294967296", "1.0"] {
            assert_eq!(hash(text), None, "{text}");
        }
    }

    #[test]
    fn a_range_holds_its_ends_as_its_words_say() {
        let pass = |key: Key, word: &str| key.range.holds(word, word.parse().unwrap());
        for (key, words, is_held) in [
            (leg::BASE_CONE, ["180", "0.5"], true),
            (leg::BASE_CONE, ["0", "180.5"], false),
            (machine::TILT_LIMIT, ["0", "180"], true),
            (machine::TILT_LIMIT, ["-1", "181"], false),
            (machine::LIMIT_ITERATIONS, ["1", "288"], true),
            (machine::LIMIT_ITERATIONS, ["0", "289"], false),
            (machine::LIMIT_ITERATIONS, ["12.5", "+12"], false),
            (leg::SIDE, ["+1", "-1"], true),
            (leg::SIDE, ["1.0", "2"], false),
            (leg::ROD, ["1e-9", "1e300"], true),
            (leg::ROD, ["0", "nan"], false),
        ] {
            for word in words {
                assert_eq!(pass(key, word), is_held, "{} = {word}", key.name);
            }
        }
        assert_eq!(leg::BASE_CONE.expected(), "more than 0 and at most 180 degrees");
        assert_eq!(leg::ROD.expected(), "more than 0");
        assert_eq!(machine::TILT_LIMIT.expected(), "0 to 180 degrees");
    }
}
