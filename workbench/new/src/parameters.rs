// SPDX-License-Identifier: GPL-2.0-or-later
//! What a builder is asked for: one table for options, questions, help and defaults.

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// A length above 0.
    Length,
    /// A length that may be 0.
    Distance,
    /// A length of any sign.
    Place,
    /// This many lengths of any sign.
    Places(usize),
    /// Smallest and largest value of a drive that moves along, lengths.
    Travel,
    /// Smallest and largest value of a drive that turns, degrees.
    Swing,
    /// An angle above 0, degrees; at most the number.
    Angle(u16),
    /// A length a minute.
    Feed,
    /// A length a second squared.
    Acceleration,
    /// Degrees a second.
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

/// Whether a value has to be given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// Always, but where a table gives the anchors in its place.
    Anchor,
    /// Always.
    Needed,
    /// Never.
    Optional,
}

/// One value that a builder is asked for.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    pub name: &'static str,
    pub measure: Measure,
    /// Value of a machine in mm, as one would write it; empty: none. Where the value is needed it is an
    /// example, which questions offer.
    pub default: &'static str,
    /// Whether it has to be given.
    pub need: Need,
    /// What it means.
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

const fn optional(
    name: &'static str,
    measure: Measure,
    default: &'static str,
    text: &'static str,
) -> Parameter {
    Parameter { need: Need::Optional, ..anchor(name, measure, default, text) }
}

/// Unit of all lengths that are given and of the machine.
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
    "CSV file with the anchors of every leg, in place of the dimensions that make them",
);
/// Where base is.
pub const HEIGHT: Parameter = optional(
    "height",
    Measure::Place,
    "0",
    "Z of the base joints, or of the rails (where their carriages are at 0), over Z = 0 of programs, such as a table's top",
);
/// From the platform joints to where tools are measured from.
pub const NOSE: Parameter = optional(
    "nose",
    Measure::Distance,
    "0",
    "From the plane of the platform joints to the spindle's nose, along the tool",
);
pub const TOOL: Parameter = optional(
    "tool",
    Measure::Choice(&["down", "up"]),
    "down",
    "Where the tool points: down with the platform below its base, or up with the platform above it",
);
/// The same for what stands on its base.
pub(super) const TOOL_UP: Parameter = Parameter { default: "up", ..TOOL };
/// Where the platform is to stand.
pub const HOME: Parameter = optional(
    "home",
    Measure::Places(3),
    "",
    "Place of the tool without a length at home; chosen by the kinematics where it is not given",
);
/// What joints may swing.
pub const JOINT_ANGLE: Parameter = optional(
    "joint-angle",
    Measure::Angle(180),
    "40",
    "How far a leg's joint at the base may swing from its direction at home",
);
/// Thickness of legs.
pub const DIAMETER: Parameter = optional(
    "diameter",
    Measure::Length,
    "",
    "Thickness of the legs; their centre lines keep a fifth more. Not judged where it is not given",
);
/// How far the platform is to tilt.
pub const TILT: Parameter = optional(
    "tilt",
    Measure::Angle(90),
    "",
    "Largest A, B and C that the axis limits are to have, either way; without it up to 15, less where that would leave little of X Y Z",
);
/// Where the axes are to end.
pub const LIMITS: Parameter = optional(
    "limits",
    Measure::Limits,
    "",
    "Axis limits that a letter is to have, all of it proved: --limits X -60 60, again for other letters; those of the others are found",
);
/// Speed of the tool.
pub const FEED: Parameter =
    optional("feed", Measure::Feed, "3000", "Largest speed of the tool along X Y Z");
/// How fast it is reached.
pub const ACCEL: Parameter =
    optional("accel", Measure::Acceleration, "400", "Largest acceleration along X Y Z");
/// Speed of tilts.
pub const TURN: Parameter = optional(
    "turn",
    Measure::Turning,
    "8",
    "Largest speed of A, B and C, reached in a tenth of a second",
);
pub const BOXES: Parameter = optional(
    "boxes",
    Measure::Choice(&["yes", "no"]),
    "yes",
    "Whether to prove boxes for the start without a seed; takes seconds, of a hexapod minutes",
);
/// Letters of legs that a table gives.
pub const COORDINATES: Parameter = optional(
    "coordinates",
    Measure::Letters,
    "",
    "Letters that the legs move: XYZ for three legs, XYZAB for five, XYZABC for six, if not given; the others are held",
);

pub(super) const STRUT: Parameter = needed(
    "strut",
    Measure::Travel,
    "550 850",
    "Shortest and longest length of a strut, between the centres of its joints",
);
pub(super) const LEAD: Parameter = optional(
    "lead",
    Measure::Distance,
    "0",
    "Travel of a strut in a turn of its screw, where the platform's turn about a strut turns the screw too; 0: it does not",
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
    "From the middle of the base to the centre of a joint, seen from above",
);
pub(super) const BASE_HALF_ANGLE: Parameter = anchor(
    "base-half-angle",
    Measure::Angle(60),
    "12",
    "Half of the angle between two neighbouring joints of the base, seen from its middle",
);
pub(super) const PLATFORM_RADIUS: Parameter = anchor(
    "platform-radius",
    Measure::Length,
    "180",
    "From the middle of the platform to the centre of a joint",
);
pub(super) const PLATFORM_HALF_ANGLE: Parameter = anchor(
    "platform-half-angle",
    Measure::Angle(60),
    "15",
    "Half of the angle between two neighbouring joints of the platform; these pairs stand between those of the base",
);
pub(super) const CARRIAGE: Parameter = needed(
    "carriage",
    Measure::Travel,
    "0 1000",
    "Where a carriage begins and ends on its rail, measured from the rail's zero",
);
pub(super) const ROD: Parameter =
    anchor("rod", Measure::Length, "700", "Length of a rod, between the centres of its joints");
pub(super) const RAIL_SPACING: Parameter =
    anchor("rail-spacing", Measure::Length, "350", "From the middle rail to each outer one");
pub(super) const TABLE: Parameter = needed(
    "table",
    Measure::Travel,
    "-210 210",
    "Where the table under the work begins and ends along its axes",
);
pub(super) const FOOT_RADIUS: Parameter = anchor(
    "foot-radius",
    Measure::Length,
    "700",
    "From the middle to the lower end of a guide, where its carriage is at 0",
);
pub(super) const TOP_RADIUS: Parameter =
    anchor("top-radius", Measure::Distance, "200", "From the middle to the upper end of a guide");
pub(super) const GUIDE_RISE: Parameter =
    anchor("guide-rise", Measure::Length, "1000", "How much higher the upper end of a guide is");
pub(super) const RAIL_DISTANCE: Parameter = anchor(
    "rail-distance",
    Measure::Length,
    "900",
    "From the left rail to the right one, across the spindle",
);
pub(super) const PLATFORM_WIDTH: Parameter = anchor(
    "platform-width",
    Measure::Length,
    "300",
    "From the left platform joints to the right ones, across the rails",
);
pub(super) const PLATFORM_LENGTH: Parameter = anchor(
    "platform-length",
    Measure::Length,
    "120",
    "From the platform joints at one end to those at the other, along the rails",
);

impl Measure {
    pub const fn values(self) -> &'static [&'static str] {
        match self {
            Self::Length | Self::Distance | Self::Place => &["LENGTH"],
            Self::Places(3) => &["X", "Y", "Z"],
            Self::Places(_) => &["HEIGHT"; 5],
            Self::Travel | Self::Swing => &["MIN", "MAX"],
            Self::Angle(_) => &["DEGREES"],
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

    /// Whether its numbers change with the unit of length.
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
            Self::Swing | Self::Angle(_) => "degrees".into(),
            Self::Choice(words) => words.join(" or "),
            Self::Hands => "R or L".into(),
            Self::Letters => "of XYZABC".into(),
            Self::Limits => format!("letter MIN MAX, {length} or degrees"),
            Self::File => "a file".into(),
            _ => length.into(),
        }
    }
}
