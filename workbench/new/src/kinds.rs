// SPDX-License-Identifier: GPL-2.0-or-later
//! The kinds of machines that can be created, and their values.

use crate::anchors::{self, Leg};
use crate::constraints::{self, Constraint};
use crate::parameters::*;
use crate::values::Values;
use kinematics::leg;

/// Direction to the platform along the line through the center of the legs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlatformSide {
    /// Larger coordinates.
    More,
    /// Smaller with the tool down, larger with the tool up.
    WithTool,
    /// Either direction from the origin.
    AboutOrigin,
}

/// How drives find their position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Homing {
    /// With absolute encoders.
    Absolute,
    /// With a switch near the upper end of the travel.
    AtEnd,
    /// With a switch slightly beyond home.
    BeyondHome,
}

#[derive(Clone, Copy, Debug)]
pub struct MachineKind {
    pub name: &'static str,
    /// Description in one line.
    pub text: &'static str,
    /// Location of its frame and meaning of its pose.
    pub frame: &'static str,
    pub leg: leg::Kind,
    /// Number of legs; 0: as many as the table of anchors has.
    pub legs: usize,
    /// Letters that the legs move; empty: as given.
    pub coordinates: &'static str,
    /// Letters that the table moves, if the machine has one.
    pub table: &'static str,
    pub own: &'static [Parameter],
    /// Direction of the tool.
    pub tool: Parameter,
    pub anchors: fn(&Values) -> Vec<Leg>,
    /// Constraints of the platform by passive joints.
    pub constraints: fn(&Values, &[Leg]) -> Vec<Constraint>,
    /// The axis X Y Z along which home is searched, 0 to 2.
    pub axis: usize,
    pub side: PlatformSide,
    /// How its drives find their position.
    pub homing: Homing,
    /// Whether boxes for the start without a seed are proved by default; empty: beside constraints, never.
    pub boxes: &'static str,
}

const PYRAMID: &[Parameter] = &[
    FOOT_RADIUS,
    TOP_RADIUS,
    GUIDE_RISE,
    Parameter { default: "120", ..PLATFORM_RADIUS },
    Parameter { default: "550", ..ROD },
    Parameter { default: "0 1118", ..CARRIAGE },
    TABLE,
    Parameter { default: "200", ..HEIGHT },
    Parameter { default: "150", ..NOSE },
];

const IN_THE_MIDDLE: &str = "World origin: the center of the base seen from above, Z up. Pose: the spindle nose, which is the tip of a tool of zero length.";
const PYRAMID_FRAME: &str = "World origin: the center between the feet of the guides seen from above, Z up; the height of the feet is their Z. Pose: the spindle nose; table motion is relative to the work. A column or slide must constrain the letters that the legs do not move, at the platform point CENTRE.";
const RAILS_FRAME: &str = "World origin: the middle of the carriage travel and of the rails, Z up, rails along X. Pose: the spindle nose. A joint value is the position of a carriage on its rail.";
const HEAD_FRAME: &str = "World origin: the center of the base seen from above, Z up. Pose: the spindle nose. Z A B are commanded; X, Y and C of the platform follow from them. With --table, a table or gantry moves X and Y and compensates the platform's own motion, so that the tip stays in place while the head tilts; without one, programs have no X and Y, and the tip moves sideways as the head tilts.";
const LATHE_FRAME: &str = "World origin: between the rails at carriage position 0, Z along the rails and the spindle, X across them. Pose: the center of the platform joints; the tool table has the positions of tips from there. The kinematics do not need the X and Y of the spindle: touch off the work offset (G54).";

pub const KINDS: &[MachineKind] = &[
    MachineKind {
        name: "hexapod",
        text: "six telescopic struts, X Y Z A B C",
        frame: IN_THE_MIDDLE,
        leg: leg::Kind::Strut,
        legs: 6,
        coordinates: "XYZABC",
        table: "",
        own: &[
            BASE_RADIUS,
            BASE_HALF_ANGLE,
            PLATFORM_RADIUS,
            PLATFORM_HALF_ANGLE,
            STRUT,
            LEAD,
            HANDS,
            HEIGHT,
            NOSE,
        ],
        tool: TOOL,
        anchors: anchors::hexapod,
        constraints: constraints::none,
        axis: 2,
        side: PlatformSide::WithTool,
        homing: Homing::Absolute,
        boxes: "no",
    },
    MachineKind {
        name: "tripod",
        text: "three telescopic struts that meet in a point, X Y Z",
        frame: IN_THE_MIDDLE,
        leg: leg::Kind::Strut,
        legs: 3,
        coordinates: "XYZ",
        table: "",
        own: &[BASE_RADIUS, STRUT, HEIGHT, NOSE],
        tool: TOOL_UP,
        anchors: anchors::tripod,
        constraints: constraints::none,
        axis: 2,
        side: PlatformSide::WithTool,
        homing: Homing::Absolute,
        boxes: "yes",
    },
    MachineKind {
        name: "struts",
        text: "telescopic struts between the anchors of a table",
        frame: "World origin and frame: as in the table of anchors. Pose: the origin of its platform columns.",
        leg: leg::Kind::Strut,
        legs: 0,
        coordinates: "",
        table: "",
        own: &[STRUT, COORDINATES, LEAD, HANDS],
        tool: TOOL,
        anchors: anchors::none,
        constraints: constraints::none,
        axis: 2,
        side: PlatformSide::WithTool,
        homing: Homing::Absolute,
        boxes: "no",
    },
    MachineKind {
        name: "pentapod",
        text: "five struts from a wall to rings around the spindle, X Y Z A B",
        frame: "World origin: on the spindle axis at home seen from above, Z along it. Pose: the spindle nose; A and B tilt it. C is the rotation of the spindle itself and stays 0.",
        leg: leg::Kind::Ring,
        legs: 5,
        coordinates: "XYZAB",
        table: "",
        own: &[
            anchor(
                "wall-distance",
                Measure::Length,
                "500",
                "Distance from the spindle axis at home to the plane of the base joints",
            ),
            anchor(
                "wall-width",
                Measure::Length,
                "836",
                "Distance between the left and right base joints",
            ),
            anchor("lowest", Measure::Place, "-310", "Z of the base joint in the middle"),
            anchor("lower", Measure::Place, "-140", "Z of the lower pair of base joints"),
            anchor("upper", Measure::Place, "510", "Z of the upper pair of base joints"),
            anchor(
                "ring-radius",
                Measure::Distance,
                "80.3",
                "Distance from the spindle axis to the joint of a ring",
            ),
            anchor(
                "ring-heights",
                Measure::Places(5),
                "87 114.5 140.5 232.5 258.5",
                "Distance of every ring from the spindle nose, away from the tool: for the lower left strut, lower right, middle, upper right, upper left",
            ),
            Parameter { default: "450 820", ..STRUT },
        ],
        tool: TOOL,
        anchors: anchors::pentapod,
        constraints: constraints::none,
        axis: 2,
        side: PlatformSide::AboutOrigin,
        homing: Homing::Absolute,
        boxes: "yes",
    },
    MachineKind {
        name: "linear-delta",
        text: "three carriages on vertical rails, pairs of rods, X Y Z",
        frame: "World origin: the center between the rails, Z up. Pose: the nozzle tip. A joint value is the height of the joints of a carriage above the zero of its rail.",
        leg: leg::Kind::Slider,
        legs: 3,
        coordinates: "XYZ",
        table: "",
        own: &[
            Parameter { default: "163", ..BASE_RADIUS },
            Parameter { default: "33", ..PLATFORM_RADIUS },
            Parameter { default: "270", ..ROD },
            Parameter { default: "0 400", ..CARRIAGE },
            HEIGHT,
            NOSE,
        ],
        tool: TOOL,
        anchors: anchors::linear_delta,
        constraints: constraints::none,
        axis: 2,
        side: PlatformSide::WithTool,
        homing: Homing::AtEnd,
        boxes: "yes",
    },
    MachineKind {
        name: "rotary-delta",
        text: "three arms on rotary drives, pairs of rods, X Y Z",
        frame: "World origin: the center of the arm axes, Z up. Pose: the center of the effector joints, or the nose beyond them. A joint value is the angle of an arm in degrees: 0 level and outwards, positive downwards.",
        leg: leg::Kind::Crank,
        legs: 3,
        coordinates: "XYZ",
        table: "",
        own: &[
            Parameter { default: "250", ..BASE_RADIUS },
            Parameter { default: "125", ..PLATFORM_RADIUS },
            ARM,
            Parameter { default: "450", ..ROD },
            ANGLE,
            HEIGHT,
            NOSE,
        ],
        tool: TOOL,
        anchors: anchors::rotary_delta,
        constraints: constraints::none,
        axis: 2,
        side: PlatformSide::WithTool,
        homing: Homing::Absolute,
        boxes: "yes",
    },
    MachineKind {
        name: "rotary-hexapod",
        text: "six arms on rotary drives, six rods, X Y Z A B C",
        frame: "World origin: the center of the base seen from above, Z up. Pose: the spindle nose. A joint value is the angle of an arm in degrees: 0 level, positive downwards.",
        leg: leg::Kind::Crank,
        legs: 6,
        coordinates: "XYZABC",
        table: "",
        own: &[
            Parameter { default: "250", ..BASE_RADIUS },
            BASE_HALF_ANGLE,
            Parameter { default: "125", ..PLATFORM_RADIUS },
            PLATFORM_HALF_ANGLE,
            Parameter { default: "150", ..ARM },
            optional(
                "arm-turn",
                Measure::Turn,
                "0",
                "Direction of an arm at 0, seen from above: 0 outwards, 90 away from the other arm of its pair, -90 towards it",
            ),
            Parameter { default: "450", ..ROD },
            Parameter {
                text: "Smallest and largest angle of an arm: 0 level, positive downwards",
                ..ANGLE
            },
            HEIGHT,
            NOSE,
        ],
        tool: TOOL,
        anchors: anchors::rotary_hexapod,
        constraints: constraints::none,
        axis: 2,
        side: PlatformSide::WithTool,
        homing: Homing::Absolute,
        boxes: "no",
    },
    MachineKind {
        name: "five-bar",
        text: "two arms on rotary drives in a plane, two rods that meet, X Y",
        frame: "World origin: between the axes of the arms, X from the left axis to the right one, Y towards the tool. Pose: the tip of a tool of zero length. A joint value is the angle of an arm in degrees: 0 outwards along X, positive towards larger Y. Joint 0 is the right arm.",
        leg: leg::Kind::Crank,
        legs: 2,
        coordinates: "XY",
        table: "",
        own: &[
            anchor(
                "axis-distance",
                Measure::Distance,
                "200",
                "Distance between the axes of the two arms",
            ),
            Parameter { default: "200", ..ARM },
            Parameter { default: "300", ..ROD },
            Parameter {
                default: "-30 120",
                text: "Smallest and largest angle of an arm: 0 outwards along X, positive towards larger Y",
                ..ANGLE
            },
            Parameter {
                text: "Distance from the plane of arms and rods to the tip of a tool of zero length, along the tool",
                ..NOSE
            },
        ],
        tool: TOOL_BESIDE,
        anchors: anchors::five_bar,
        constraints: constraints::none,
        axis: 1,
        side: PlatformSide::More,
        homing: Homing::Absolute,
        boxes: "yes",
    },
    MachineKind {
        name: "triaglide",
        text: "three carriages on parallel horizontal rails, pairs of rods, X Y Z",
        frame: RAILS_FRAME,
        leg: leg::Kind::Slider,
        legs: 3,
        coordinates: "XYZ",
        table: "",
        own: &[
            RAIL_SPACING,
            Parameter { default: "240", ..PLATFORM_WIDTH },
            PLATFORM_LENGTH,
            Parameter { default: "800", ..ROD },
            Parameter { default: "50 2400", ..CARRIAGE },
            HEIGHT,
            NOSE,
        ],
        tool: TOOL,
        anchors: anchors::triaglide,
        constraints: constraints::none,
        axis: 2,
        side: PlatformSide::WithTool,
        homing: Homing::BeyondHome,
        boxes: "yes",
    },
    MachineKind {
        name: "hexaglide",
        text: "six carriages on three parallel horizontal rails, X Y Z A B C",
        frame: RAILS_FRAME,
        leg: leg::Kind::Slider,
        legs: 6,
        coordinates: "XYZABC",
        table: "",
        own: &[
            Parameter { default: "450", ..RAIL_SPACING },
            Parameter { default: "320", ..PLATFORM_WIDTH },
            Parameter { default: "200", ..PLATFORM_LENGTH },
            anchor(
                "middle-length",
                Measure::Length,
                "120",
                "The same for the two platform joints whose rods go to the middle rail",
            ),
            anchor(
                "middle-offset",
                Measure::Place,
                "-160",
                "Y of these two joints from the center of the platform",
            ),
            anchor(
                "middle-rise",
                Measure::Place,
                "150",
                "Distance of these two joints from the others, towards the rails",
            ),
            Parameter { default: "900", ..ROD },
            Parameter { default: "100 2700", ..CARRIAGE },
            HEIGHT,
            NOSE,
        ],
        tool: TOOL,
        anchors: anchors::hexaglide,
        constraints: constraints::none,
        axis: 2,
        side: PlatformSide::WithTool,
        homing: Homing::Absolute,
        boxes: "yes",
    },
    MachineKind {
        name: "linapod",
        text: "six carriages on vertical rails at three columns, X Y Z A B C",
        frame: "World origin: the center between the columns, Z up. Pose: the spindle nose. A joint value is the height of a carriage above the zero of its rail.",
        leg: leg::Kind::Slider,
        legs: 6,
        coordinates: "XYZABC",
        table: "",
        own: &[
            Parameter { default: "600", ..BASE_RADIUS },
            Parameter { default: "10", ..BASE_HALF_ANGLE },
            Parameter { default: "150", ..PLATFORM_RADIUS },
            Parameter { default: "20", ..PLATFORM_HALF_ANGLE },
            Parameter { default: "750", ..ROD },
            Parameter { default: "400 1300", ..CARRIAGE },
            HEIGHT,
            NOSE,
        ],
        tool: TOOL,
        anchors: anchors::linapod,
        constraints: constraints::none,
        axis: 2,
        side: PlatformSide::WithTool,
        homing: Homing::Absolute,
        boxes: "yes",
    },
    MachineKind {
        name: "pyramid",
        text: "four carriages on the edges of a pyramid over a cross table, Z A B and X Y of the table",
        frame: PYRAMID_FRAME,
        leg: leg::Kind::Slider,
        legs: 4,
        coordinates: "ZAB",
        table: "XY",
        own: PYRAMID,
        tool: TOOL,
        anchors: anchors::pyramid,
        constraints: constraints::none,
        axis: 2,
        side: PlatformSide::WithTool,
        homing: Homing::Absolute,
        boxes: "yes",
    },
    MachineKind {
        name: "pyramid-cross",
        text: "four carriages on the edges of a pyramid over a table, X Z A and Y of the table",
        frame: PYRAMID_FRAME,
        leg: leg::Kind::Slider,
        legs: 4,
        coordinates: "XZA",
        table: "Y",
        own: PYRAMID,
        tool: TOOL,
        anchors: anchors::pyramid,
        constraints: constraints::none,
        axis: 2,
        side: PlatformSide::WithTool,
        homing: Homing::Absolute,
        boxes: "yes",
    },
    MachineKind {
        name: "four-rod-lathe",
        text: "lathe: two rails, two carriages on each, four rods, X Y Z B",
        frame: LATHE_FRAME,
        leg: leg::Kind::Slider,
        legs: 4,
        coordinates: "XYZB",
        table: "",
        own: &[
            RAIL_DISTANCE,
            PLATFORM_WIDTH,
            PLATFORM_LENGTH,
            ROD,
            Parameter { default: "-100 2100", ..CARRIAGE },
        ],
        tool: LATHE_SIDE,
        anchors: anchors::four_rod_lathe,
        constraints: constraints::none,
        axis: 1,
        side: PlatformSide::WithTool,
        homing: Homing::BeyondHome,
        boxes: "yes",
    },
    MachineKind {
        name: "six-rod-lathe",
        text: "lathe: four rails, six carriages, six rods, X Y Z A B C",
        frame: LATHE_FRAME,
        leg: leg::Kind::Slider,
        legs: 6,
        coordinates: "XYZABC",
        table: "",
        own: &[
            RAIL_DISTANCE,
            PLATFORM_WIDTH,
            PLATFORM_LENGTH,
            anchor(
                "third-rail-distance",
                Measure::Length,
                "1200",
                "Distance between the left and right rail of the third rods",
            ),
            anchor(
                "third-width",
                Measure::Length,
                "200",
                "Distance between the left and right platform joint of the third rods",
            ),
            anchor(
                "third-depth",
                Measure::Length,
                "150",
                "Distance by which these two joints are nearer to the rails than the others",
            ),
            ROD,
            Parameter { default: "-100 2100", ..CARRIAGE },
        ],
        tool: LATHE_SIDE,
        anchors: anchors::six_rod_lathe,
        constraints: constraints::none,
        axis: 1,
        side: PlatformSide::WithTool,
        homing: Homing::Absolute,
        boxes: "yes",
    },
    MachineKind {
        name: "tricept",
        text: "three telescopic struts around a passive leg, X Y Z",
        frame: "World origin: the center of the base seen from above, Z up. Pose: the spindle nose. A B C of the platform follow from X Y Z, because a passive leg fixed to it slides through a universal joint in the base. This joint's base-fixed axis is X, its platform-fixed axis Y.",
        leg: leg::Kind::Strut,
        legs: 3,
        coordinates: "XYZ",
        table: "",
        own: &[
            BASE_RADIUS,
            Parameter { default: "150", ..PLATFORM_RADIUS },
            optional(
                "joint-rise",
                Measure::Place,
                "0",
                "Z of the passive leg's universal joint above the base joints of the struts",
            ),
            Parameter { default: "650 1300", ..STRUT },
            HEIGHT,
            NOSE,
            WRIST,
            WRIST_TURN,
        ],
        tool: TOOL,
        anchors: anchors::tricept,
        constraints: constraints::tricept,
        axis: 2,
        side: PlatformSide::WithTool,
        homing: Homing::Absolute,
        boxes: "",
    },
    MachineKind {
        name: "exechon",
        text: "two struts in a plane that turns, one strut with a hinge at the platform, X Y Z",
        frame: "World origin: midway between the base joints of the two struts with a common plane, seen from above; X through both, the third strut at larger Y, Z up. Pose: the spindle nose. A B C of the platform follow from X Y Z: hinges keep the first two struts in a plane of the platform that turns about X, and the third strut in the plane X = 0 of the platform.",
        leg: leg::Kind::Strut,
        legs: 3,
        coordinates: "XYZ",
        table: "",
        own: &[
            anchor(
                "base-width",
                Measure::Length,
                "700",
                "Distance between the base joints of the two struts with a common plane",
            ),
            anchor(
                "platform-width",
                Measure::Length,
                "300",
                "Distance between their joints at the platform",
            ),
            anchor(
                "base-depth",
                Measure::Length,
                "450",
                "Distance of the third strut's base joint from the line through the other two",
            ),
            anchor(
                "platform-depth",
                Measure::Length,
                "160",
                "Distance of the third strut's joint at the platform from the line through the other two",
            ),
            Parameter { default: "600 1400", ..STRUT },
            HEIGHT,
            NOSE,
            WRIST,
            WRIST_TURN,
        ],
        tool: TOOL,
        anchors: anchors::exechon,
        constraints: constraints::exechon,
        axis: 2,
        side: PlatformSide::WithTool,
        homing: Homing::Absolute,
        boxes: "",
    },
    MachineKind {
        name: "z3-head",
        text: "head on three carriages whose rods have a hinge at the carriage (3-PRS), Z A B",
        frame: HEAD_FRAME,
        leg: leg::Kind::Slider,
        legs: 3,
        coordinates: "ZAB",
        table: "XY",
        own: &[
            Parameter { default: "320", ..BASE_RADIUS },
            Parameter { default: "200", ..PLATFORM_RADIUS },
            Parameter { default: "500", ..ROD },
            Parameter {
                default: "20 480",
                text: "Travel of a carriage on its rail, from its zero in the base towards the work",
                ..CARRIAGE
            },
            HEAD_TABLE,
            HEIGHT,
            NOSE,
        ],
        tool: TOOL,
        anchors: anchors::z3_head,
        constraints: constraints::head,
        axis: 2,
        side: PlatformSide::WithTool,
        homing: Homing::Absolute,
        boxes: "",
    },
    MachineKind {
        name: "a3-head",
        text: "head on three telescopic struts with a hinge in the base (3-RPS), Z A B",
        frame: HEAD_FRAME,
        leg: leg::Kind::Strut,
        legs: 3,
        coordinates: "ZAB",
        table: "XY",
        own: &[
            Parameter { default: "320", ..BASE_RADIUS },
            Parameter { default: "200", ..PLATFORM_RADIUS },
            STRUT,
            HEAD_TABLE,
            HEIGHT,
            NOSE,
        ],
        tool: TOOL,
        anchors: anchors::a3_head,
        constraints: constraints::head,
        axis: 2,
        side: PlatformSide::WithTool,
        homing: Homing::Absolute,
        boxes: "",
    },
];

impl MachineKind {
    /// Returns whether a lathe: the tool table has the directions of its tools.
    pub fn is_lathe(&self) -> bool {
        self.name.ends_with("-lathe")
    }

    /// Returns whether all motion is in a plane, with joints that turn about its normal only.
    pub fn is_planar(&self) -> bool {
        self.coordinates == "XY"
    }

    /// Returns all parameters of this kind, in the order of questions.
    pub fn parameters(&self) -> Vec<Parameter> {
        let tilts = self.coordinates.is_empty() || self.coordinates.contains(['A', 'B', 'C']);
        let mut all = vec![UNIT, ANCHORS];
        if self.legs == 0 {
            all[1].need = Need::Needed;
        }
        all.extend(self.own);
        all.push(self.tool);
        if !self.is_planar() {
            all.push(JOINT_ANGLE);
        }
        all.extend([DIAMETER, HOME, FEED, ACCEL]);
        if tilts {
            all.extend([TURN, TILT]);
        }
        all.push(LIMITS);
        if !self.boxes.is_empty() {
            all.push(Parameter { default: self.boxes, ..BOXES });
        }
        all
    }
}
