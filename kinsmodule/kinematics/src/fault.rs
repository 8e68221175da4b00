// SPDX-License-Identifier: GPL-2.0-or-later
//! Causes of refusals: one table is the source of the codes, the C header, the manual and
//! the operator's messages.

use crate::letters::Letter;
use crate::text::Text;

/// Length of a message with its final zero, bytes: LinuxCNC shows 254 characters, some of
/// which may be two bytes long.
const SHOWN: usize = 320;

/// Part of a machine that a refusal names. Legs and joints are counted from 0; the joints of
/// the legs come first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MachinePart {
    /// A leg.
    Leg(u8),
    /// Two legs.
    Legs([u8; 2]),
    /// The joint of a leg.
    Joint(u8),
    /// The joint of a table axis, and the axis.
    TableAxis(u8, Letter),
    /// The joint of an extra axis, and its letter.
    ExtraAxis(u8, u8),
    /// A constraint, counted from 0.
    Constraint(u8),
    /// A coordinate.
    Coordinate(Letter),
    /// A coordinate that constraints determine from the commanded ones, whose bits are set, bit 0 for X.
    Dependent(Letter, u8),
}

impl MachinePart {
    /// Returns the number of the leg (the first of two), the joint or the constraint; `None` for a coordinate.
    pub const fn number(self) -> Option<u8> {
        match self {
            Self::Leg(n)
            | Self::Legs([n, _])
            | Self::Joint(n)
            | Self::TableAxis(n, _)
            | Self::ExtraAxis(n, _)
            | Self::Constraint(n) => Some(n),
            Self::Coordinate(_) | Self::Dependent(..) => None,
        }
    }

    fn counted_from(self, legs: u8, joints: u8) -> Self {
        match self {
            Self::Leg(n) => Self::Leg(n.wrapping_add(legs)),
            Self::Legs(both) => Self::Legs(both.map(|n| n.wrapping_add(legs))),
            Self::Joint(n) => Self::Joint(n.wrapping_add(joints)),
            Self::TableAxis(n, letter) => Self::TableAxis(n.wrapping_add(joints), letter),
            Self::ExtraAxis(n, letter) => Self::ExtraAxis(n.wrapping_add(joints), letter),
            Self::Constraint(_) | Self::Coordinate(_) | Self::Dependent(..) => self,
        }
    }

    fn write_name<const LENGTH: usize>(self, text: &mut Text<LENGTH>) {
        match self {
            Self::Leg(leg) => {
                text.push("leg ");
                text.push(leg);
            }
            Self::Legs([one, other]) => {
                text.push("legs ");
                text.push(one);
                text.push(" and ");
                text.push(other);
            }
            Self::Joint(joint) | Self::TableAxis(joint, _) | Self::ExtraAxis(joint, _) => {
                text.push("joint ");
                text.push(joint);
            }
            Self::Constraint(n) => {
                text.push("constraint ");
                text.push(n);
            }
            Self::Coordinate(letter) => {
                text.push("coordinate ");
                push_letter(text, letter.index());
            }
            Self::Dependent(letter, commanded) => {
                text.push("on this machine ");
                push_letter(text, letter.index());
                text.push(" follows from");
                for k in (0..6).filter(|k| commanded >> k & 1 == 1) {
                    text.push(" ");
                    push_letter(text, k);
                }
            }
        }
        if let Self::TableAxis(_, letter) = self {
            text.push(" (table ");
            text.push(&[letter.name() as u8][..]);
            text.push(")");
        }
        if let Self::ExtraAxis(_, letter) = self {
            text.push(" (axis ");
            text.push(&[letter][..]);
            text.push(")");
        }
    }
}

/// Appends letter `k` of X … C, from a table: the compiler turns a match in a loop into a trap.
fn push_letter<const LENGTH: usize>(text: &mut Text<LENGTH>, k: usize) {
    if let Some(name) = b"XYZABC".get(k..k + 1) {
        text.push(name);
    }
}

/// A refusal: its cause, the part concerned, and an explanatory value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fault {
    /// The cause.
    pub cause: Cause,
    /// Part of the machine concerned, if it is known.
    pub part: Option<MachinePart>,
    /// The offending value, in the unit that [`Cause::text`] names; 0 if there is none.
    pub value: f64,
}

impl Fault {
    pub(crate) const fn new(cause: Cause) -> Self {
        Self { cause, part: None, value: 0.0 }
    }

    /// Creates a refusal that names no part.
    pub const fn with_value(cause: Cause, value: f64) -> Self {
        Self { cause, part: None, value }
    }

    /// Creates a refusal that names leg `leg` (counted from 0).
    pub const fn of_leg(cause: Cause, leg: usize, value: f64) -> Self {
        Self { cause, part: Some(MachinePart::Leg(leg as u8)), value }
    }

    /// Creates a refusal that names two legs (counted from 0).
    pub const fn of_legs(cause: Cause, [one, other]: [usize; 2], value: f64) -> Self {
        Self { cause, part: Some(MachinePart::Legs([one as u8, other as u8])), value }
    }

    /// Returns the number of the named leg, joint or constraint, as the pins show it: the first of two legs.
    pub fn number(&self) -> Option<u8> {
        self.part.and_then(MachinePart::number)
    }

    /// Renumbers the part for a mechanism whose legs and joints are counted from these numbers on.
    #[must_use]
    pub fn counted_from(self, legs: u8, joints: u8) -> Self {
        Self { part: self.part.map(|part| part.counted_from(legs, joints)), ..self }
    }

    /// Appends the problem and its remedy to a message.
    pub fn write_message<const LENGTH: usize>(&self, text: &mut Text<LENGTH>) {
        if let Some(part) = self.part {
            part.write_name(text);
            text.push(": ");
        }
        text.push(self.cause.text());
        if self.value != 0.0 {
            text.push(" (value ");
            text.push(self.value);
            text.push(")");
        }
        text.push("; ");
        text.push(self.cause.remedy());
        text.push(" [code ");
        text.push(self.cause.code());
        text.push("]");
    }
}

impl From<Cause> for Fault {
    fn from(cause: Cause) -> Self {
        Self::new(cause)
    }
}

impl core::fmt::Display for Fault {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let mut text = Text::<SHOWN>::of(&[]);
        self.write_message(&mut text);
        f.write_str(text.as_str())
    }
}

impl core::error::Error for Fault {}

macro_rules! causes {
    ($($(#[$doc:meta])* $name:ident = $code:literal, $text:literal, $remedy:literal;)*) => {
        /// Cause of a refusal. Codes are fixed, negative, never reused; 0 is success.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[non_exhaustive]
        #[repr(i32)]
        pub enum Cause {
            $(#[doc = $text] $name = $code,)*
        }

        /// Every cause, in the order of the table.
        pub const CAUSES: &[Cause] = &[$(Cause::$name),*];

        impl Cause {
            /// Returns the fixed negative number of this cause, as the C functions return it.
            pub const fn code(self) -> i32 {
                self as i32
            }

            /// Returns the name of this cause in the C header, without prefix.
            pub const fn name(self) -> &'static str {
                match self { $(Cause::$name => stringify!($name),)* }
            }

            /// Describes the problem in one sentence.
            pub const fn text(self) -> &'static str {
                match self { $(Cause::$name => $text,)* }
            }

            /// Describes the remedy in one sentence.
            pub const fn remedy(self) -> &'static str {
                match self { $(Cause::$name => $remedy,)* }
            }
        }
    };
}

causes! {
    // The argument of inverse.
    PoseNotFinite = -10, "the pose contains NaN or infinity",
        "check the program line or the offset that produced it";
    AngleTooLarge = -11, "an angle of the pose is beyond 1e6 degrees",
        "rotate the axis back towards 0";
    StrutTooShort = -12, "both ends of the strut coincide at this pose",
        "keep the platform away from this base joint";
    StrutAlongAxis = -13, "the strut is (nearly) parallel to the fixed axis of one of its cardan joints, so its nut rotation is undefined",
        "tilt less, or check BASE_N and PLATFORM_N";
    ToolChangedTilted = -14, "the tool offset changed at a tilt, so the joints would jump",
        "level the platform first, and set a wrist beside constraints to 0; else add pkmkins.monitor to a thread and limits to all joints";
    ToolNotFinite = -15, "a tool or spindle offset is NaN or infinite",
        "check the tool table and the nets to the tool-offset pins";
    TiltNearRightAngle = -16, "B is near 90 degrees, where A and C are not distinct",
        "stay away from B = 90 degrees";
    ResultNotFinite = -17, "the result is not finite",
        "check the pose and the geometry";
    ToolOutOfReach = -18, "at this tilt the new tool offset violates joint limits, is out of reach, or is near a singularity",
        "level the platform or retract, then change the tool length";
    ToolTooLong = -86, "a tool or spindle offset is beyond a million times the machine's size",
        "check the tool table and the nets to the tool-offset pins";
    CorrectionBeyond = -87, "the requested correction of the joint is beyond its limit, or not a number; the active correction stays",
        "check the source of pkmkins.joint-correction, or raise CORRECTION_LIMIT";
    OutOfReach = -19, "the rod does not reach the platform anchor: too short by this length (too long if negative)",
        "move the platform nearer to this guide or crank, or check ROD, BASE and GUIDE or AXIS";
    AxisAtAnchor = -28, "the tool axis is nearer to the base anchor of the strut than the radius of its ring (distance shown)",
        "keep the tool axis away from this base joint, or check BASE and EFFECTOR";
    TorsionTooLarge = -27, "the strut is twisted by nearly half a turn (degrees shown), where its nut correction jumps by one lead",
        "rotate back, or change the program to avoid this pose";
    ConstraintSingular = -29, "on the way from the reference pose the constraints cease to determine the dependent coordinates (share of the way shown)",
        "stay nearer to the reference pose, or check the tool offset";
    // The arguments of forward.
    JointNotFinite = -20, "the joint value is NaN or infinite",
        "check the feedback of this joint";
    JointNotPositive = -21, "the joint value makes the strut length zero or negative",
        "home the joint, or check its OFFSET and feedback scale";
    SeedMissing = -22, "the start pose is NaN or infinite, and no earlier pose is known",
        "home the machine";
    JointAngleTooLarge = -23, "the arm is more than 180 degrees away from its zero position",
        "jog the joint back, or check its OFFSET and feedback scale";
    SeedOutOfReach = -24, "the rod does not reach the start pose: too short by this length (too long if negative)",
        "home the machine; if it is already homed, check [TRAJ]HOME";
    DeadPoint = -26, "the rod is nearly perpendicular to the motion of its lower end (dead point; cosine shown)",
        "stay away from this end of the rod's range, where SIDE would flip";
    // The forward solver.
    Singular = -30, "the legs do not constrain the platform at this pose (singular Jacobian)",
        "move a joint away from this pose in joint mode";
    NearlySingular = -31, "the pose is too close to a singularity for a certain result",
        "move a joint away from this pose in joint mode";
    NotCertified = -32, "the pose found is not proved to be connected with the last pose",
        "move back in joint mode, in smaller steps";
    PathStalled = -33, "no pose is reached from the last pose: the legs do not close, or a singularity lies between",
        "jog the joints back to their last good values";
    TooManySubSteps = -34, "the joint values are too far from the last known pose",
        "jog back, or home again";
    TooManyIterations = -35, "forward kinematics did not converge within limit-iterations",
        "raise limit-iterations (at most 288)";
    NotConverged = -36, "the residual of a leg stays above convergence-criterion",
        "raise convergence-criterion, or check the geometry";
    LimitIterationsInvalid = -37, "limit-iterations must be 1 to 288",
        "set pkmkins.limit-iterations between 1 and 288";
    CriterionInvalid = -38, "convergence-criterion must be a positive number",
        "set pkmkins.convergence-criterion to a length such as 1e-9";
    ResidualLimitInvalid = -39, "residual-limit must be a positive number, or 0 for 5e-3 of the platform radius",
        "set pkmkins.residual-limit to a length, or 0";
    JointsInconsistent = -40, "the joint values contradict each other by this length; without the joint named, if any, the others agree with the last pose",
        "check feedback and homing, or raise residual-limit";
    SingularPassed = -41, "the commanded motion passed a singularity; the joints also fit another pose (distance shown)",
        "command it back; or jog to the reference pose in joint mode, unhome and home again";
    NotAsCommanded = -42, "the pose of the joints is not connected with the commanded pose (distance shown)",
        "command it back; or jog to the reference pose in joint mode, unhome and home again";
    ConstraintPassed = -43, "beyond a constraint singularity: the commanded coordinates of these joints belong to another pose (distance shown)",
        "jog the joints back in joint mode";
    // The geometry to be frozen.
    GeometryNotFinite = -50, "the geometry of the leg contains NaN or infinity",
        "correct the values of this leg";
    LegsCoincide = -51, "both legs connect the same two points",
        "give every leg its own anchors";
    AxisZero = -52, "the leg has a LEAD, but a cardan axis of zero length",
        "set BASE_N and PLATFORM_N to directions";
    PlatformDegenerate = -53, "the platform anchors are collinear or coincide, so the platform can rotate freely",
        "check the PLATFORM anchors";
    HomeNotFinite = -54, "the reference pose is incomplete, NaN or infinite",
        "set all six home pins, or none";
    SingularAtHome = -55, "the legs do not constrain the platform at the reference pose",
        "check the anchors: the geometry is singular there";
    FoldUndefined = -56, "at the reference pose the cardan joints are near a quarter turn, so the sign of the nut correction is undefined",
        "rotate BASE_N or PLATFORM_N";
    StrutZeroAtHome = -57, "the strut length is zero at the reference pose",
        "check BASE, PLATFORM and the reference pose";
    GuideZero = -58, "the guide direction is zero",
        "set GUIDE to a direction";
    RodNotPositive = -59, "the rod length must be more than 0",
        "set ROD to a positive length";
    SideInvalid = -60, "the side of the leg must be 1 or -1",
        "set SIDE to 1 or -1";
    ArmZero = -61, "the crank axis is zero, or its arm is parallel to it",
        "set AXIS to a direction, and ARM to a vector not parallel to it";
    CentreNotFinite = -62, "the center contains NaN or infinity",
        "correct CENTRE";
    LengthTooLarge = -63, "a length of the leg (anchor, rod, arm or lead) is beyond 1e30",
        "correct the values of this leg";
    OffsetTooLarge = -64, "the joint offset of the leg is beyond a million times the machine's size (crank: 1e6 degrees)",
        "correct OFFSET";
    CentreTooFar = -65, "the center is beyond a million times the machine's size",
        "correct CENTRE";
    RingNegative = -67, "the radius of the ring must be 0 or more",
        "set EFFECTOR to radius and height, with radius >= 0";
    HomeHeld = -66, "the reference pose has a nonzero coordinate that no joint moves or that follows from others",
        "set the coordinates of HOME that cannot be commanded to 0";
    // The constraints of the platform.
    ConstraintAxisZero = -120, "a direction of the constraint is zero",
        "set NORMAL, or PLATFORM_AXIS and BASE_AXIS, to directions";
    ConstraintNotFinite = -121, "the constraint contains NaN or infinity",
        "correct the values of this constraint";
    ConstraintTooFar = -122, "a point of the constraint is beyond a million times the machine's size",
        "correct BASE and PLATFORM of this constraint";
    ConstraintRedundant = -123, "the constraint repeats others, and freedoms of the platform remain (number shown)",
        "replace it by one that prevents another motion";
    ConstraintContradicts = -124, "the constraint repeats others at the reference pose, but contradicts them there or near it (value shown)",
        "correct its vectors, or remove it";
    ConstraintsFree = -125, "it, or more than it, is left free by constraints and legs (number of freedoms shown)",
        "add a constraint for each freedom";
    ConstraintsTooMany = -126, "with this constraint there are more equations than coordinates (number of constraints needed shown)",
        "remove constraints that are independent of the others, or legs";
    ConstraintsFix = -127, "the constraints fix it at the reference pose, and leave a dependent coordinate free",
        "choose other coordinates=, or a reference pose that is not singular";
    HomeOffConstraints = -118, "the reference pose, with 0 in the dependent coordinates, is too far from one that meets the constraints (largest value shown)",
        "check the vectors of the constraints, and [TRAJ]HOME";
    ConstraintsNeedHome = -119, "constraints need a reference pose",
        "set all six home pins";
    // The axes that carry workpiece, tool or legs.
    ChainUnknown = -110, "the axis carries an unknown part",
        "set CARRIES to WORK, TOOL or LEGS (its pin to 1, 2 or 3; 0 for none)";
    ChainAxisZero = -111, "the axis direction is zero",
        "set AXIS of its [CHAIN_L] to a direction";
    ChainNotFinite = -112, "the axis contains NaN or infinity",
        "correct AXIS and POINT of its [CHAIN_L]";
    ChainTooFar = -113, "the point on the axis is beyond a million times the machine's size",
        "correct POINT of its [CHAIN_L]";
    HolderNotFinite = -114, "the position of the fixed tool holder is incomplete, NaN or infinite",
        "correct WORK_ON_PLATFORM, or remove it";
    HolderTooFar = -115, "the fixed tool holder is beyond a million times the machine's size",
        "correct WORK_ON_PLATFORM";
    ChainConstrained = -116, "beside constraints, axes carry something only if X Y Z are commanded or on a table; the platform carries no work",
        "name X Y Z in coordinates= or table=, or remove [CHAIN_L] or WORK_ON_PLATFORM";
    // The module around the kinematics.
    NoGeometry = -70, "there is no valid geometry",
        "correct the geometry, then set pkmkins.apply to 1 with the machine off";
    ApplyWhileOn = -71, "a new geometry was applied while the machine is on; the old one stays",
        "switch the machine off, then set pkmkins.apply to 0 and to 1";
    KinematicsTypeUnknown = -72, "unknown kinematics type (0 = machine, 1 = identity)",
        "switch to type 0 or 1";
    NullPointer = -73, "a null pointer was passed",
        "report this bug: LinuxCNC never passes one";
    IdentityImpossible = -75, "identity kinematics need a letter for every joint, but this machine has more legs than coordinates",
        "keep kinematics type 0";
    NotHomed = -74, "all joints are 0, as before homing, and no pose matches",
        "home the machine";
    PoseUnknown = -77, "no pose was found for the joints in joint mode, or since the kinematics were switched",
        "move the joints in joint mode, or in kinematics type 1, until the legs close";
    ToolChangeDisturbed = -76, "the machine moved during a change of the tool offset at a tilt",
        "switch on again (applies the new offset); net pkmkins.feed-inhibit to motion.feed-inhibit; avoid M49 and M50 P0";
    // Limits ahead of the motion, found by the monitor.
    JointLimitAhead = -90, "the joint reaches the end of its range (joint value shown)",
        "stop, and change the program to avoid this pose";
    BaseConeAhead = -91, "the leg reaches the edge of its base joint's cone (degrees shown)",
        "stop, and change the program to avoid this pose";
    PlatformConeAhead = -92, "the leg reaches the edge of its platform joint's cone (degrees shown)",
        "stop, and change the program to avoid this pose";
    ConditioningAhead = -93, "the motion approaches a singularity (conditioning shown)",
        "if the feed is stopped: abort, move away, and change the program to avoid this pose";
    LegsNear = -94, "the legs come too close to each other (distance shown)",
        "stop, and change the program to avoid this pose";
    JointTooFast = -95, "the joint would exceed its speed limit (speed shown)",
        "if the feed is stopped: abort, and change the program to avoid this pose";
    TiltAhead = -96, "the tool axis reaches its tilt limit (degrees shown)",
        "stop, and change the program to avoid this pose";
    BasePyramidAhead = -97, "the leg reaches the edge of its base joint's pyramid (degrees shown)",
        "stop, and change the program to avoid this pose";
    PlatformPyramidAhead = -98, "the leg reaches the edge of its platform joint's pyramid (degrees shown)",
        "stop, and change the program to avoid this pose";
    MechanismsNear = -99, "the two mechanisms come too close to each other (distance shown)",
        "if the feed is stopped: abort, and move one of them away";
    // Coordinates that no joint moves, and those that follow from others.
    DependentGiven = -88, "the pose has another value than 0 there",
        "remove its letter from the program, and set its work offset to 0";
    HeldX = -80, "the pose has a nonzero X, but no joint moves X",
        "remove X from the program, and set its work offset to 0";
    HeldY = -81, "the pose has a nonzero Y, but no joint moves Y",
        "remove Y from the program, and set its work offset to 0";
    HeldZ = -82, "the pose has a nonzero Z, but no joint moves Z",
        "remove Z from the program, and set its work offset to 0";
    HeldA = -83, "the pose has a nonzero A, but no joint moves A",
        "remove A from the program, and set its work offset to 0";
    HeldB = -84, "the pose has a nonzero B, but no joint moves B",
        "remove B from the program, and set its work offset to 0";
    HeldC = -85, "the pose has a nonzero C, but no joint moves C",
        "remove C from the program, and set its work offset to 0";
    // The start without a seed.
    Searching = -100, "the search for the pose of the joints is running",
        "wait a few cycles";
    OutsideBoxes = -101, "no pose in the workspace boxes has these joint values",
        "with the machine off choose joint mode (AXIS: $); switch on, jog into the workspace, choose world mode";
    TwoPoses = -102, "two legal poses have these joint values (distance shown)",
        "with the machine off choose joint mode (AXIS: $); switch on, jog to a position with only one legal pose";
    BoxInvalid = -103, "a workspace box is empty, NaN or infinite, or its steps are not 1 to 4096 (box number shown unless 0)",
        "run pkm boxes --write to make the [BOX_K] sections again";
    BoxOfOther = -104, "a workspace box was proved for another geometry (box number shown unless 0)",
        "run pkm boxes --write to make the [BOX_K] sections again, or remove them";
}

impl Cause {
    /// Returns the refusal of a nonzero value of a constant coordinate.
    pub(crate) const fn held(letter: Letter) -> Self {
        match letter {
            Letter::X => Self::HeldX,
            Letter::Y => Self::HeldY,
            Letter::Z => Self::HeldZ,
            Letter::A => Self::HeldA,
            Letter::B => Self::HeldB,
            Letter::C => Self::HeldC,
        }
    }
}

/// Largest value of a constant coordinate that counts as 0: degrees, or shares of the size.
const HELD_TOLERANCE: f64 = 1e-9;

impl Letter {
    /// Refuses a value of this letter, constant at 0 on a machine of `size`, that exceeds
    /// rounding.
    ///
    /// # Errors
    /// The cause of the letter, [`Cause::HeldX`] to [`Cause::HeldC`].
    pub fn check_held(self, value: f64, size: f64) -> Result<(), Fault> {
        let unit = if self.is_angle() { 1.0 } else { size };
        if value.abs() <= HELD_TOLERANCE * unit {
            return Ok(());
        }
        Err(Fault::with_value(Cause::held(self), value))
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::layout::Layout;
    use crate::letters::Letters;
    use std::format;

    #[test]
    fn codes_are_negative_and_unique() {
        for (i, a) in CAUSES.iter().enumerate() {
            assert!(a.code() < 0);
            assert!(CAUSES[..i].iter().all(|b| b.code() != a.code()), "{a:?}");
        }
    }

    #[test]
    fn a_value_of_0_that_says_nothing_is_not_shown() {
        let text = |value| format!("{}", Fault::of_leg(Cause::GeometryNotFinite, 1, value));
        assert!(!text(0.0).contains("(value"));
        assert!(text(0.5).contains("(value 0.5)"));
    }

    #[test]
    fn a_message_names_a_leg_two_legs_a_joint_or_a_table_axis_and_the_pins_its_number() {
        let letters = |text: &[u8]| Letters::parse(text).unwrap();
        let layout = Layout::new(4, letters(b"ZABC"), letters(b"XY")).unwrap();
        let joint = |i| Fault::of_joint(Cause::JointNotFinite, &layout, i, 0.0);
        for (fault, name, number) in [
            (Fault::of_leg(Cause::StrutTooShort, 2, 0.0), "leg 2: both ends", 2),
            (Fault::of_legs(Cause::LegsNear, [3, 0], 1.5), "legs 3 and 0: the legs", 3),
            (joint(3), "joint 3: the joint", 3),
            (joint(4), "joint 4 (table X): the joint", 4),
            (joint(5), "joint 5 (table Y): the joint", 5),
        ] {
            assert!(format!("{fault}").starts_with(name), "{fault}");
            assert_eq!(fault.number(), Some(number));
        }
        assert_eq!(Fault::from(Cause::NotHomed).number(), None);
        let of_second = |fault: Fault| fault.counted_from(4, 6).number();
        assert_eq!(of_second(Fault::of_legs(Cause::LegsNear, [3, 0], 1.5)), Some(7));
        assert_eq!((of_second(joint(3)), of_second(Cause::NotHomed.into())), (Some(9), None));
    }

    #[test]
    fn a_message_is_shown_whole() {
        let letters = |text: &[u8]| Letters::parse(text).unwrap();
        let layout = Layout::new(7, letters(b"Z"), letters(b"X")).unwrap();
        // LinuxCNC truncates messages to the operator at 254 characters, including the prefix "pkmkins: ".
        for cause in CAUSES {
            for value in [-0.123_456_789_012_345_68, -1e300, 1e-300, f64::MAX, f64::NEG_INFINITY] {
                let text = format!("pkmkins: {}", Fault::of_joint(*cause, &layout, 7, value));
                assert!(text.chars().count() <= 254, "{text}: {} characters", text.len());
                assert!(text.ends_with(&format!("[code {}]", cause.code())), "{text}");
            }
        }
    }
}
