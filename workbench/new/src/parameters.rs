// SPDX-License-Identifier: GPL-2.0-or-later
//! Parameters of a new machine: one table for options, questions, help and defaults.

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// A positive length.
    Length,
    /// A length that may be 0.
    Distance,
    /// A length of any sign.
    Place,
    /// A list of this many lengths of any sign.
    Places(usize),
    /// Smallest and largest value of a linear drive, lengths.
    Travel,
    /// Smallest and largest value of a rotary drive, degrees.
    Swing,
    /// A positive angle, degrees; at most the number.
    Angle(u16),
    /// An angle of any sign, degrees.
    Turn,
    /// A length per minute.
    Feed,
    /// A length per second squared.
    Acceleration,
    /// Degrees per second.
    Turning,
    /// One of these words.
    Choice(&'static [&'static str]),
    /// R and L, one for all screws or one for each.
    Hands,
    /// Letters of X Y Z A B C.
    Letters,
    /// Letters of X Y Z A B C, each with its smallest and largest value.
    Limits,
    File,
}

/// Whether a value is required.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// Required, unless a table gives the anchors.
    Anchor,
    /// Required.
    Needed,
    /// Optional.
    Optional,
}

/// A parameter of a new machine.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    pub name: &'static str,
    pub measure: Measure,
    /// Value for a machine in mm, as text; empty: none. For a required value it is an
    /// example, which questions offer.
    pub default: &'static str,
    /// Whether it is required.
    pub need: Need,
    /// Its meaning.
    pub text: &'static str,
}

pub(super) const fn anchor(
    name: &'static str,
    measure: Measure,
    default: &'static str,
    text: &'static str,
) -> Parameter {
    Parameter { name, measure, default, need: Need::Anchor, text }
}

pub(super) const fn needed(
    name: &'static str,
    measure: Measure,
    default: &'static str,
    text: &'static str,
) -> Parameter {
    Parameter { need: Need::Needed, ..anchor(name, measure, default, text) }
}

pub(super) const fn optional(
    name: &'static str,
    measure: Measure,
    default: &'static str,
    text: &'static str,
) -> Parameter {
    Parameter { need: Need::Optional, ..anchor(name, measure, default, text) }
}

/// Unit of the machine and of all given lengths.
pub const UNIT: Parameter = optional(
    "unit",
    Measure::Choice(&["mm", "inch"]),
    "mm",
    "Unit of all lengths, and of the machine",
);
pub const ANCHORS: Parameter = optional(
    "anchors",
    Measure::File,
    "",
    "CSV file with the anchors of every leg, instead of dimensions",
);
/// Height of base.
pub const HEIGHT: Parameter = optional(
    "height",
    Measure::Place,
    "0",
    "Z of the base joints, or of the rails (at carriage position 0), above Z = 0 of programs, for example the table top",
);
/// Distance from the platform joints to the reference point of tools.
pub const NOSE: Parameter = optional(
    "nose",
    Measure::Distance,
    "0",
    "Distance from the plane of the platform joints to the spindle nose, along the tool",
);
pub const TOOL: Parameter = optional(
    "tool",
    Measure::Choice(&["down", "up"]),
    "down",
    "Direction of the tool: down with the platform below its base, or up with the platform above it",
);
/// Direction of tools for machines that stand on their base.
pub(super) const TOOL_UP: Parameter = Parameter { default: "up", ..TOOL };
/// Direction of tools for machines whose platform is beside their base.
pub(super) const TOOL_BESIDE: Parameter = Parameter { text: "Direction of the tool", ..TOOL };
/// Side of the platform of a lathe.
pub(super) const LATHE_SIDE: Parameter = Parameter {
    text: "Side of the rails on which platform and tool are: up for larger Y, or down for smaller Y",
    ..TOOL_UP
};
/// Home position of the platform.
pub const HOME: Parameter = optional(
    "home",
    Measure::Places(3),
    "",
    "Position at home of a tool of zero length; chosen automatically if not given",
);
/// Swing of the joints.
pub const JOINT_ANGLE: Parameter = optional(
    "joint-angle",
    Measure::Angle(180),
    "40",
    "Largest swing of a leg's base joint from its direction at home",
);
/// Thickness of legs.
pub const DIAMETER: Parameter = optional(
    "diameter",
    Measure::Length,
    "",
    "Thickness of the legs; center lines keep a fifth more. Not judged if not given",
);
/// Required tilt of the platform.
pub const TILT: Parameter = optional(
    "tilt",
    Measure::Angle(90),
    "",
    "Axis limits of A, B and C, in both directions; by default up to 15, less if that would leave little of X Y Z",
);
/// Required axis limits.
pub const LIMITS: Parameter = optional(
    "limits",
    Measure::Limits,
    "",
    "Axis limits of a letter, to be proved, such as --limits X -60 60; repeatable. Limits of other letters are computed",
);
/// Speed of the tool.
pub const FEED: Parameter =
    optional("feed", Measure::Feed, "3000", "Highest speed of the tool along X Y Z");
/// Acceleration of the tool.
pub const ACCEL: Parameter =
    optional("accel", Measure::Acceleration, "400", "Highest acceleration along X Y Z");
/// Speed of angles.
pub const TURN: Parameter = optional(
    "turn",
    Measure::Turning,
    "8",
    "Highest speed of A, B and C, reached within a tenth of a second",
);
pub const BOXES: Parameter = optional(
    "boxes",
    Measure::Choice(&["yes", "no"]),
    "yes",
    "Prove boxes for the start without a seed; takes seconds, for a hexapod minutes",
);
/// Letters that legs from a table move.
pub const COORDINATES: Parameter = optional(
    "coordinates",
    Measure::Letters,
    "",
    "Letters that the legs move; by default XYZ for three legs, XYZAB for five, XYZABC for six",
);

pub(super) const STRUT: Parameter = needed(
    "strut",
    Measure::Travel,
    "550 850",
    "Shortest and longest strut length, between the centers of its joints",
);
pub(super) const LEAD: Parameter = optional(
    "lead",
    Measure::Distance,
    "0",
    "Travel of a strut per turn of its screw, if rotation of the platform about a strut turns the screw; 0 if it does not",
);
pub(super) const HANDS: Parameter = optional(
    "hands",
    Measure::Hands,
    "R",
    "Right- and left-hand screws: one letter for all, or one for each strut",
);
pub(super) const BASE_RADIUS: Parameter = anchor(
    "base-radius",
    Measure::Length,
    "400",
    "Distance from the center of the base to the center of a joint, seen from above",
);
pub(super) const BASE_HALF_ANGLE: Parameter = anchor(
    "base-half-angle",
    Measure::Angle(60),
    "12",
    "Half the angle between two neighboring joints of the base, seen from its center",
);
pub(super) const PLATFORM_RADIUS: Parameter = anchor(
    "platform-radius",
    Measure::Length,
    "180",
    "Distance from the center of the platform to the center of a joint",
);
pub(super) const PLATFORM_HALF_ANGLE: Parameter = anchor(
    "platform-half-angle",
    Measure::Angle(60),
    "15",
    "Half the angle between two neighboring joints of the platform; these pairs are between those of the base",
);
pub(super) const CARRIAGE: Parameter = needed(
    "carriage",
    Measure::Travel,
    "0 1000",
    "Travel of a carriage on its rail, measured from the zero of the rail",
);
pub(super) const ROD: Parameter =
    anchor("rod", Measure::Length, "700", "Length of a rod, between the centers of its joints");
pub(super) const ARM: Parameter = anchor(
    "arm",
    Measure::Length,
    "250",
    "Length of an arm, from its axis to the joints of the rod",
);
pub(super) const ANGLE: Parameter = needed(
    "angle",
    Measure::Swing,
    "-45 90",
    "Smallest and largest angle of an arm: 0 level and outwards, positive downwards",
);
pub(super) const RAIL_SPACING: Parameter = anchor(
    "rail-spacing",
    Measure::Length,
    "350",
    "Distance from the middle rail to each outer rail",
);
pub(super) const TABLE: Parameter = needed(
    "table",
    Measure::Travel,
    "-210 210",
    "Travel of the table under the work along its axes",
);
/// A table or gantry that a head may do without.
pub(super) const HEAD_TABLE: Parameter = Parameter {
    need: Need::Optional,
    default: "",
    text: "Travel of a table or gantry along X and Y that compensates the head's own motion; none if not given",
    ..TABLE
};
/// A wrist that a platform may do without.
pub(super) const WRIST: Parameter = optional(
    crate::wrist::NAME,
    Measure::Length,
    "",
    "Distance from the spindle nose to the tilting axis A of a wrist, which C turns about the platform's axis; no wrist if not given",
);
/// Speed of a wrist.
pub(super) const WRIST_TURN: Parameter = Parameter {
    text: "Highest speed of the axes of a wrist, reached within a tenth of a second",
    default: "30",
    ..TURN
};
pub(super) const FOOT_RADIUS: Parameter = anchor(
    "foot-radius",
    Measure::Length,
    "700",
    "Distance from the center to the lower end of a guide, at carriage position 0",
);
pub(super) const TOP_RADIUS: Parameter = anchor(
    "top-radius",
    Measure::Distance,
    "200",
    "Distance from the center to the upper end of a guide",
);
pub(super) const GUIDE_RISE: Parameter = anchor(
    "guide-rise",
    Measure::Length,
    "1000",
    "Height of the upper end of a guide above its lower end",
);
pub(super) const RAIL_DISTANCE: Parameter = anchor(
    "rail-distance",
    Measure::Length,
    "900",
    "Distance between the left and right rail, across the spindle",
);
pub(super) const PLATFORM_WIDTH: Parameter = anchor(
    "platform-width",
    Measure::Length,
    "300",
    "Distance between the left and right platform joints, across the rails",
);
pub(super) const PLATFORM_LENGTH: Parameter = anchor(
    "platform-length",
    Measure::Length,
    "120",
    "Distance between the platform joints at both ends, along the rails",
);

impl Measure {
    pub const fn values(self) -> &'static [&'static str] {
        match self {
            Self::Length | Self::Distance | Self::Place => &["LENGTH"],
            Self::Places(3) => &["X", "Y", "Z"],
            Self::Places(_) => &["HEIGHT"; 5],
            Self::Travel | Self::Swing => &["MIN", "MAX"],
            Self::Angle(_) | Self::Turn => &["DEGREES"],
            Self::Feed => &["LENGTH/MIN"],
            Self::Acceleration => &["LENGTH/S2"],
            Self::Turning => &["DEGREES/S"],
            Self::Choice(_) => &["WORD"],
            Self::Hands => &["HANDS"],
            Self::Letters => &["LETTERS"],
            Self::Limits => &["LETTER", "MIN", "MAX"],
            Self::File => &["FILE.csv"],
        }
    }

    /// Returns whether its numbers depend on the unit of length.
    pub const fn is_length(self) -> bool {
        matches!(
            self,
            Self::Length
                | Self::Distance
                | Self::Place
                | Self::Places(_)
                | Self::Travel
                | Self::Feed
                | Self::Acceleration
        )
    }

    pub fn unit(self, length: &str) -> String {
        match self {
            Self::Feed => format!("{length}/min"),
            Self::Acceleration => format!("{length}/s²"),
            Self::Turning => "degrees/s".into(),
            Self::Swing | Self::Angle(_) | Self::Turn => "degrees".into(),
            Self::Choice(words) => words.join(" or "),
            Self::Hands => "R or L".into(),
            Self::Letters => "of XYZABC".into(),
            Self::Limits => format!("letter MIN MAX, {length} or degrees"),
            Self::File => "a file".into(),
            _ => length.into(),
        }
    }
}
