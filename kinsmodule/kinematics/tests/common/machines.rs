// SPDX-License-Identifier: GPL-2.0-or-later
//! Machines with their declared workspaces.

use super::{Case, Sample, uniform, within};
use kinematics::leg::{CrankGeometry, RingGeometry, SliderGeometry, StrutGeometry};
use kinematics::{
    ConstraintGeometry, Geometry, Layout, LegGeometry, LegKind, Letters, Pose, Vector3,
};
use rand::Rng;
use rand_pcg::Pcg64;

/// 0.5 mm in inches.
const INCH_STEP: f64 = 0.5 / 25.4;

pub fn letters(text: &str) -> Letters {
    Letters::parse(text.as_bytes()).expect("letters of the pose, each once")
}

pub fn on_circle(radius: f64, degrees: f64, z: f64) -> [f64; 3] {
    let angle = degrees.to_radians();
    [radius * angle.cos(), radius * angle.sin(), z]
}

/// Creates a machine of `legs` with a reference pose.
pub fn geometry(
    legs: &[LegGeometry],
    coordinates: &str,
    table: &str,
    home: Option<[f64; 6]>,
) -> Geometry {
    let mut geometry = Geometry::new(legs, letters(coordinates), letters(table)).expect("layout");
    geometry.home = home;
    geometry
}

/// Creates a hexapod from anchors, and from axes and lead if the struts are screws.
pub fn hexapod(
    base: [[f64; 3]; 6],
    platform: [[f64; 3]; 6],
    struts: [StrutGeometry; 6],
    home: Option<[f64; 6]>,
) -> Geometry {
    let legs: [_; 6] = std::array::from_fn(|i| LegGeometry::strut(base[i], platform[i], struts[i]));
    geometry(&legs, "XYZABC", "", home)
}

/// Returns the same machine with other legs.
pub fn with_legs(given: &Geometry, legs: &[LegGeometry]) -> Geometry {
    let layout = given.layout();
    let mut other = Geometry::new(legs, *layout.coordinates(), *layout.table()).expect("layout");
    other.centre = given.centre;
    other.home = given.home;
    other
}

/// Returns the same machine with each leg changed.
pub fn changed_legs(given: &Geometry, change: impl Fn(usize, &mut LegGeometry)) -> Geometry {
    let mut legs = given.legs().to_vec();
    for (i, leg) in legs.iter_mut().enumerate() {
        change(i, leg);
    }
    with_legs(given, &legs)
}

pub fn strut(base: [f64; 3], platform: [f64; 3]) -> LegGeometry {
    LegGeometry::strut(base, platform, StrutGeometry::default())
}

pub fn slider(
    base: [f64; 3],
    platform: [f64; 3],
    guide: [f64; 3],
    rod: f64,
    side: i32,
) -> LegGeometry {
    LegGeometry { base, platform, kind: LegKind::Slider(SliderGeometry { guide, rod, side }) }
}

/// Returns the machine of paper 004 (machine a of the configurations): inverted, lead 10 mm.
pub fn paper_004(lead: f64) -> Geometry {
    let base = [-15.0, 15.0, 105.0, 135.0, 225.0, 255.0].map(|t| on_circle(560.0, t, 1250.0));
    let platform = [-45.0, 45.0, 75.0, 165.0, 195.0, 285.0].map(|t| on_circle(200.0, t, 150.0));
    let home = [0.0, 0.0, 250.0, 0.0, 0.0, 0.0];
    let struts = std::array::from_fn(|i| {
        let n = Vector3::from(platform[i]) + Vector3::new(0.0, 0.0, 250.0) - Vector3::from(base[i]);
        let axis = Vector3::z().cross(&n).normalize();
        StrutGeometry { base_axis: axis.into(), platform_axis: (-axis).into(), lead }
    });
    hexapod(base, platform, struts, Some(home))
}

fn paper_004_pose(rng: &mut Pcg64) -> Pose {
    let radius = 150.0 * rng.random::<f64>().sqrt();
    let around = uniform(rng, 0.0, std::f64::consts::TAU);
    let tilt = (30.0 * rng.random::<f64>().sqrt()).to_radians();
    let azimuth = uniform(rng, 0.0, std::f64::consts::TAU);
    let z = [tilt.sin() * azimuth.cos(), tilt.sin() * azimuth.sin(), tilt.cos()];
    Pose {
        position: Vector3::new(
            radius * around.cos(),
            radius * around.sin(),
            uniform(rng, 100.0, 400.0),
        ),
        angles: Vector3::new(-z[1].asin(), z[0].atan2(z[2]), 0.0),
    }
}

/// Returns the laboratory machine of paper 001: platform on top, no lead.
pub fn paper_001() -> Geometry {
    let base = [
        (400.0, 78.0),
        (400.0, 102.0),
        (372.0, 198.0),
        (372.0, 222.0),
        (372.0, 318.0),
        (372.0, 342.0),
    ]
    .map(|(r, t)| on_circle(r, t, 0.0));
    let platform = [42.0, 138.0, 162.0, 258.0, 282.0, 378.0].map(|t| on_circle(140.0, t, 0.0));
    hexapod(base, platform, [StrutGeometry::default(); 6], Some([0.0, 0.0, 640.0, 0.0, 0.0, 0.0]))
}

/// Returns the default geometry of LinuxCNC's genhexkins (inches), axes included.
#[allow(clippy::approx_constant, reason = "genhexkins' own rounding")]
pub fn genhexkins_default(lead: f64) -> Geometry {
    let (x, y) = (22.95, 13.25);
    let base = [
        [-x, y, 0.0],
        [x, y, 0.0],
        [x, y, 0.0],
        [0.0, -26.5, 0.0],
        [0.0, -26.5, 0.0],
        [-x, y, 0.0],
    ];
    let platform = [
        [-1.0, 11.5, 0.0],
        [1.0, 11.5, 0.0],
        [10.459, -4.884, 0.0],
        [9.459, -6.616, 0.0],
        [-9.459, -6.616, 0.0],
        [-10.459, -4.884, 0.0],
    ];
    let d = 0.707107;
    let base_axis =
        [[d, 0.0, d], [0.0, -d, d], [-d, 0.0, d], [-d, 0.0, d], [0.0, d, d], [d, 0.0, d]];
    let (p, q) = (0.866025, 0.5);
    let platform_axis =
        [[-1.0, 0.0, 0.0], [p, q, 0.0], [p, q, 0.0], [p, -q, 0.0], [p, -q, 0.0], [-1.0, 0.0, 0.0]];
    let struts = std::array::from_fn(|i| StrutGeometry {
        base_axis: base_axis[i],
        platform_axis: platform_axis[i],
        lead,
    });
    hexapod(base, platform, struts, Some([0.0, 0.0, 20.0, 0.0, 0.0, 0.0]))
}

/// Returns the two hexapods of papers 004 and 001 over their declared workspaces.
pub fn hexapods() -> [Case; 2] {
    let lab =
        within([-60.0, -60.0, 520.0, -15.0, -15.0, -15.0], [60.0, 60.0, 800.0, 15.0, 15.0, 15.0]);
    [
        Case::new("hexapod (paper 004)", paper_004(10.0), Box::new(paper_004_pose), 0.5),
        Case::new("lab-hexapod (paper 001)", paper_001(), lab, 0.5),
    ]
}

/// Returns genhexkins' default geometry with ±20° in every angle.
pub fn genhexkins_case() -> Case {
    genhexkins_tilted("genhexkins default, ±20°", 20.0)
}

/// Returns the same with larger angles; from ±40° singular poses lie between.
pub fn genhexkins_tilted(name: &'static str, most: f64) -> Case {
    let sample =
        within([-5.0, -5.0, 15.0, -most, -most, -most], [5.0, 5.0, 25.0, most, most, most]);
    Case::new(name, genhexkins_default(0.0), sample, INCH_STEP)
}

const ALONG_Z: [f64; 3] = [0.0, 0.0, 1.0];

/// Returns the four-rod lathe of paper 003 (machine c).
pub fn four_rod_lathe() -> Case {
    let rod = |x: f64, z: f64, side| slider([3.0 * x, 0.0, 0.0], [x, 0.0, z], ALONG_Z, 700.0, side);
    let legs =
        [rod(150.0, -60.0, -1), rod(150.0, 60.0, 1), rod(-150.0, -60.0, -1), rod(-150.0, 60.0, 1)];
    let home = Some([0.0, 450.0, 1000.0, 0.0, 0.0, 0.0]);
    let sample =
        within([-120.0, 380.0, 600.0, 0.0, -20.0, 0.0], [120.0, 520.0, 1400.0, 0.0, 20.0, 0.0]);
    Case::new("four-rod-lathe (paper 003)", geometry(&legs, "XYZB", "", home), sample, 0.5)
}

/// Returns the six-rod lathe of paper 003 (machine d).
pub fn six_rod_lathe() -> Case {
    let rod = |x: f64, z: f64, side| slider([3.0 * x, 0.0, 0.0], [x, 0.0, z], ALONG_Z, 700.0, side);
    let third = |x: f64| slider([6.0 * x, 0.0, 0.0], [x, -150.0, 0.0], ALONG_Z, 700.0, 1);
    let legs = [
        rod(150.0, -60.0, -1),
        rod(150.0, 60.0, 1),
        third(100.0),
        rod(-150.0, -60.0, -1),
        rod(-150.0, 60.0, 1),
        third(-100.0),
    ];
    let home = Some([0.0, 450.0, 1000.0, 0.0, 0.0, 0.0]);
    let sample =
        within([-70.0, 410.0, 600.0, -12.0, -12.0, -12.0], [70.0, 480.0, 1400.0, 12.0, 12.0, 12.0]);
    Case::new("six-rod-lathe (paper 003)", geometry(&legs, "XYZABC", "", home), sample, 0.5)
}

/// Returns the pyramid of paper 000 (machine e): inclined guides, cross table, one carriage more
/// than the platform has coordinates.
pub fn pyramid_geometry() -> Geometry {
    let legs: [_; 4] = std::array::from_fn(|i| {
        let (s, c) = [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)][i];
        let guide = [-500.0 * c, -500.0 * s, 1000.0];
        slider([700.0 * c, 700.0 * s, 200.0], [120.0 * c, 120.0 * s, 150.0], guide, 550.0, 1)
    });
    let mut given = geometry(&legs, "ZAB", "XY", Some([0.0, 0.0, 270.0, 0.0, 0.0, 0.0]));
    given.centre = [0.0, 0.0, 150.0];
    given
}

pub fn pyramid() -> Case {
    let sample =
        within([-150.0, -150.0, 150.0, -20.0, -20.0, 0.0], [150.0, 150.0, 390.0, 20.0, 20.0, 0.0]);
    Case::new("pyramid (paper 000)", pyramid_geometry(), sample, 0.5)
}

/// Returns the pyramid with longer rods whose platform moves X, Z and A, and the table Y.
pub fn pyramid_cross() -> Case {
    let of = changed_legs(&pyramid_geometry(), |_, leg| {
        if let LegKind::Slider(slider) = &mut leg.kind {
            slider.rod = 650.0;
        }
    });
    let mut given = geometry(of.legs(), "XZA", "Y", of.home);
    given.centre = of.centre;
    let sample =
        within([-80.0, -150.0, 160.0, -20.0, 0.0, 0.0], [80.0, 150.0, 340.0, 20.0, 0.0, 0.0]);
    Case::new("pyramid-cross", given, sample, 0.5)
}

/// Returns six rods on carriages that all run along X, two on each of three rails.
pub fn hexaglide() -> Case {
    let [outer, middle] = [[100.0, 160.0, 150.0], [60.0, -160.0, 300.0]];
    let legs: [_; 6] = std::array::from_fn(|i| {
        let (side, rail) = ([-1, 1][i % 2], i / 2);
        let (y, [px, py, pz]) = ([-450.0, 0.0, 450.0][rail], [outer, middle, outer][rail]);
        let platform = [f64::from(side) * px, if rail == 0 { -py } else { py }, pz];
        slider([-1400.0, y, 1000.0], platform, [1.0, 0.0, 0.0], 900.0, side)
    });
    let home = Some([0.0, 0.0, 250.0, 0.0, 0.0, 0.0]);
    let sample = within(
        [-250.0, -100.0, 150.0, -10.0, -10.0, -10.0],
        [250.0, 100.0, 300.0, 10.0, 10.0, 10.0],
    );
    Case::new("hexaglide", geometry(&legs, "XYZABC", "", home), sample, 0.2)
}

/// Returns six rods on carriages on upright guides, two at each of three columns.
pub fn linapod() -> Case {
    let legs: [_; 6] = std::array::from_fn(|i| {
        let (column, side) = (90.0 + 120.0 * (i / 2) as f64, [-1.0, 1.0][i % 2]);
        let base = on_circle(600.0, column + 10.0 * side, 0.0);
        let platform = on_circle(150.0, column + 40.0 * side, 120.0);
        slider(base, platform, ALONG_Z, 750.0, 1)
    });
    let home = Some([0.0, 0.0, 250.0, 0.0, 0.0, 0.0]);
    let sample = within(
        [-100.0, -100.0, 150.0, -15.0, -15.0, -15.0],
        [100.0, 100.0, 350.0, 15.0, 15.0, 15.0],
    );
    Case::new("linapod", geometry(&legs, "XYZABC", "", home), sample, 0.5)
}

/// Returns three rods on carriages that all run along X.
pub fn triaglide() -> Case {
    let legs = [(-350.0, -60.0, -120.0, -1), (0.0, 60.0, 0.0, 1), (350.0, -60.0, 120.0, -1)].map(
        |(rail, x, y, side)| {
            slider([-1200.0, rail, 900.0], [x, y, 120.0], [1.0, 0.0, 0.0], 800.0, side)
        },
    );
    let home = Some([0.0, 0.0, 250.0, 0.0, 0.0, 0.0]);
    let sample =
        within([-350.0, -120.0, 120.0, 0.0, 0.0, 0.0], [350.0, 120.0, 400.0, 0.0, 0.0, 0.0]);
    Case::new("triaglide", geometry(&legs, "XYZ", "", home), sample, 0.5)
}

/// Returns three upright guides; the default of LinuxCNC's lineardeltakins.
pub fn linear_delta() -> Case {
    let legs = [90.0, 210.0, 330.0]
        .map(|t| slider(on_circle(163.25, t, 0.0), on_circle(33.0, t, 0.0), ALONG_Z, 269.0, 1));
    let home = Some([0.0, 0.0, 90.0, 0.0, 0.0, 0.0]);
    let sample = within([-80.0, -80.0, 0.0, 0.0, 0.0, 0.0], [80.0, 80.0, 100.0, 0.0, 0.0, 0.0]);
    Case::new("linear-delta", geometry(&legs, "XYZ", "", home), sample, 0.5)
}

/// Returns three arms of 10 in with rods of 18 in; the default of LinuxCNC's rotarydeltakins.
pub fn rotary_delta() -> Case {
    let legs = [-90.0, 30.0, 150.0].map(|t| {
        let axis = on_circle(1.0, t + 90.0, 0.0);
        let crank = CrankGeometry { axis, arm: on_circle(10.0, t, 0.0), rod: 18.0, side: -1 };
        LegGeometry {
            base: on_circle(10.0, t, 0.0),
            platform: on_circle(5.0, t, 0.0),
            kind: LegKind::Crank(crank),
        }
    });
    let home = Some([0.0, 0.0, -12.0, 0.0, 0.0, 0.0]);
    let sample = within([-4.0, -4.0, -18.0, 0.0, 0.0, 0.0], [4.0, 4.0, -10.0, 0.0, 0.0, 0.0]);
    Case::new("rotary-delta", geometry(&legs, "XYZ", "", home), sample, INCH_STEP)
}

/// Returns three struts that meet in the control point.
pub fn tripod() -> Case {
    let legs = [[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [5.0, 7.071, 0.0]].map(|b| strut(b, [0.0; 3]));
    let home = Some([5.0, 1.768, 3.06, 0.0, 0.0, 0.0]);
    let sample = within([3.5, 0.5, 2.5, 0.0, 0.0, 0.0], [6.5, 3.0, 4.0, 0.0, 0.0, 0.0]);
    Case::new("tripod", geometry(&legs, "XYZ", "", home), sample, INCH_STEP)
}

/// Returns five struts whose upper ends lie on the tool axis, so that C has no effect.
pub fn pentapod() -> Case {
    let heights = [0.0, 0.0, 0.0, 600.0, 500.0];
    let legs: [_; 5] = std::array::from_fn(|i| {
        let around = [90.0, 210.0, 330.0, 30.0, 150.0][i];
        let level = if i < 3 { 0.0 } else { 1100.0 };
        strut(on_circle(700.0, around, level), [0.0, 0.0, heights[i]])
    });
    let home = Some([0.0, 0.0, 500.0, 0.0, 0.0, 0.0]);
    let sample =
        within([-60.0, -60.0, 430.0, -12.0, -12.0, 0.0], [60.0, 60.0, 570.0, 12.0, 12.0, 0.0]);
    Case::new("pentapod", geometry(&legs, "XYZAB", "", home), sample, 0.5)
}

/// Returns five struts on rings about the tool axis; the sample geometry of LinuxCNC's pentakins.
pub fn ring_pentapod() -> Case {
    let legs = [
        [-418.0, 500.0, -140.0, 87.0],
        [418.0, 500.0, -140.0, 114.5],
        [0.0, 500.0, -310.0, 140.5],
        [418.0, 500.0, 510.0, 232.5],
        [-418.0, 500.0, 510.0, 258.5],
    ]
    .map(|[x, y, z, height]| LegGeometry {
        base: [x, y, z],
        platform: [0.0, 0.0, height],
        kind: LegKind::Ring(RingGeometry { radius: 80.3 }),
    });
    let sample =
        within([-80.0, -80.0, -80.0, -12.0, -10.0, 0.0], [80.0, 80.0, 80.0, 12.0, 10.0, 0.0]);
    // Twice the speed of its axes.
    Case::new("ring-pentapod", geometry(&legs, "XYZAB", "", Some([0.0; 6])), sample, 0.2)
}

/// Returns screws and carriages under one platform.
pub fn mixed() -> Case {
    let screws = paper_004(10.0);
    let legs: [_; 6] = std::array::from_fn(|i| match i % 2 {
        0 => screws.legs()[i],
        _ => {
            let leg = screws.legs()[i];
            let outwards = Vector3::new(leg.base[0], leg.base[1], 0.0).normalize();
            let guide = outwards * 0.6 + Vector3::z() * 0.8;
            slider(leg.base, leg.platform, guide.into(), 950.0, 1)
        }
    });
    let ordered = [legs[0], legs[2], legs[4], legs[1], legs[3], legs[5]];
    let home = Some([0.0, 0.0, 250.0, 0.0, 0.0, 0.0]);
    let sample =
        within([-80.0, -80.0, 180.0, -10.0, -10.0, -10.0], [80.0, 80.0, 320.0, 10.0, 10.0, 10.0]);
    Case::new("mixed", geometry(&ordered, "XYZABC", "", home), sample, 0.5)
}

/// Returns eight struts for six coordinates.
pub fn eight_struts() -> Case {
    let legs: [_; 8] = std::array::from_fn(|i| {
        let t = 45.0 * i as f64;
        let twist = if i % 2 == 0 { 25.0 } else { -25.0 };
        let lower = if i % 4 < 2 { 0.0 } else { 60.0 };
        strut(on_circle(500.0, t, lower), on_circle(180.0, t + twist, lower / 2.0))
    });
    let home = Some([0.0, 0.0, 600.0, 0.0, 0.0, 0.0]);
    let sample =
        within([-80.0, -80.0, 520.0, -15.0, -15.0, -15.0], [80.0, 80.0, 700.0, 15.0, 15.0, 15.0]);
    Case::new("eight-struts", geometry(&legs, "XYZABC", "", home), sample, 0.5)
}

/// Returns a platform that only rotates, about a point supported by a ball joint.
pub fn wrist() -> Case {
    let legs: [_; 3] = std::array::from_fn(|i| {
        let t = 120.0 * i as f64;
        strut(on_circle(200.0, t, -300.0), on_circle(150.0, t + 60.0, 40.0))
    });
    let sample = within([0.0, 0.0, 0.0, -25.0, -25.0, -25.0], [0.0, 0.0, 0.0, 25.0, 25.0, 25.0]);
    Case::new("wrist", geometry(&legs, "ABC", "", Some([0.0; 6])), sample, 0.5)
}

/// Creates a machine with constraints of the platform.
pub fn constrained(
    legs: &[LegGeometry],
    (coordinates, table): (&str, &str),
    constraints: &[ConstraintGeometry],
    home: [f64; 6],
) -> Geometry {
    let layout = Layout::new(legs.len(), letters(coordinates), letters(table))
        .and_then(|layout| layout.with_constraints(constraints.len()))
        .expect("layout");
    let mut geometry =
        Geometry::of_layout(layout, |i| legs[i]).with_constraints(|i| constraints[i]);
    geometry.home = Some(home);
    geometry
}

const X: [f64; 3] = [1.0, 0.0, 0.0];
const Y: [f64; 3] = [0.0, 1.0, 0.0];

pub fn point_in_plane(platform: [f64; 3], base: [f64; 3], normal: [f64; 3]) -> ConstraintGeometry {
    ConstraintGeometry::PointInPlane { platform, base, normal }
}

pub fn plane_through_point(
    platform: [f64; 3],
    normal: [f64; 3],
    base: [f64; 3],
) -> ConstraintGeometry {
    ConstraintGeometry::PlaneThroughPoint { platform, normal, base }
}

pub fn square(platform_axis: [f64; 3], base_axis: [f64; 3]) -> ConstraintGeometry {
    ConstraintGeometry::Square { platform_axis, base_axis }
}

/// Returns three struts about a passive leg that is fixed to the platform and slides through a universal joint.
pub fn tricept() -> Geometry {
    let legs: [_; 3] =
        [90.0, 210.0, 330.0].map(|t| strut(on_circle(400.0, t, 0.0), on_circle(150.0, t, 40.0)));
    let origin = [0.0; 3];
    let constraints = [
        plane_through_point(origin, Y, origin),
        plane_through_point(origin, X, origin),
        square(Y, X),
    ];
    constrained(&legs, ("XYZ", ""), &constraints, [0.0, 0.0, -900.0, 0.0, 0.0, 0.0])
}

/// Returns three rods on vertical guides, each kept in a plane by a revolute joint, with or without a table X Y.
pub fn z3_head(table: &str) -> Geometry {
    let angles = [90.0, 210.0, 330.0];
    let legs: [_; 3] = angles.map(|t| {
        slider(on_circle(320.0, t, 0.0), on_circle(200.0, t, 0.0), [0.0, 0.0, -1.0], 500.0, -1)
    });
    let constraints: [_; 3] = angles
        .map(|t| point_in_plane(on_circle(200.0, t, 0.0), [0.0; 3], on_circle(1.0, t + 90.0, 0.0)));
    constrained(&legs, ("ZAB", table), &constraints, [0.0, 0.0, -700.0, 0.0, 0.0, 0.0])
}

/// Returns two struts in a common plane that turns about X, and one with a revolute joint at the base; the plane of the
/// two is over-determined if it is also kept square.
pub fn exechon(is_square: bool) -> Geometry {
    let anchors = [
        ([-350.0, 0.0, 0.0], [-150.0, 0.0, 0.0]),
        ([350.0, 0.0, 0.0], [150.0, 0.0, 0.0]),
        ([0.0, 450.0, 0.0], [0.0, 160.0, 0.0]),
    ];
    let legs: [_; 3] = anchors.map(|(base, platform)| strut(base, platform));
    let [first, second, third] = anchors;
    let constraints = [
        plane_through_point(first.1, Y, first.0),
        plane_through_point(second.1, Y, second.0),
        square(Y, X),
        plane_through_point(third.1, X, third.0),
    ];
    let own = [constraints[0], constraints[1], constraints[3]];
    let constraints: &[_] = if is_square { &constraints } else { &own };
    constrained(&legs, ("XYZ", ""), constraints, [0.0, 0.0, -900.0, 0.0, 0.0, 0.0])
}

/// Returns every machine with a declared workspace.
pub fn declared() -> Vec<Case> {
    let [hexapod, lab_hexapod] = hexapods();
    vec![
        hexapod,
        lab_hexapod,
        four_rod_lathe(),
        six_rod_lathe(),
        pyramid(),
        linear_delta(),
        rotary_delta(),
        tripod(),
        pentapod(),
        mixed(),
        eight_struts(),
        wrist(),
        ring_pentapod(),
        pyramid_cross(),
        hexaglide(),
        linapod(),
        triaglide(),
    ]
}

/// Samples poses around home by up to this fraction of the size and these degrees, in every letter.
pub fn wild(case: &Case, share: f64, degrees: f64) -> Sample {
    let home = case.home.to_degrees();
    let length = share * case.machine.size();
    let spread = |k: usize| if k < 3 { length } else { degrees };
    let low = std::array::from_fn(|k| home[k] - spread(k));
    let high = std::array::from_fn(|k| home[k] + spread(k));
    within(low, high)
}
