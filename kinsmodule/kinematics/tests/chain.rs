// SPDX-License-Identifier: GPL-2.0-or-later
//! Axes that carry workpiece, tool or legs: LinuxCNC's pose and the machine's.

use crate::common::{cases, rng};
use kinematics::{
    Cause, Chain, ChainGeometry, ExtraAxes, Fault, Layout, Letters, LinkGeometry, MachinePart,
    POSE_LETTERS, Pose, Vector3, World,
};
use nalgebra::{Isometry3, Point3, Translation3, Unit, UnitQuaternion};
use rand::Rng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64;

const WORK: i32 = 1;
const TOOL: i32 = 2;
const LEGS: i32 = 3;

/// Rounding errors of positions up to some thousand, through a dozen rotations.
const PLACE: f64 = 1e-10;

/// Returns the layout of a machine whose legs move X Y Z and those of A B C that are not axes.
fn layout(axes: &str) -> Layout {
    let left: String = "XYZABC".chars().filter(|letter| !axes.contains(*letter)).collect();
    Layout::new(6, Letters::parse(left.as_bytes()).unwrap(), Letters::NONE).unwrap()
}

fn frozen(axes: &str, given: &ChainGeometry) -> Result<Chain, Fault> {
    let layout = layout(axes);
    let axes = ExtraAxes::parse(axes.as_bytes(), &layout).unwrap();
    Chain::freeze(given, &axes, &layout, 1000.0)
}

fn link(carries: i32, axis: [f64; 3], point: [f64; 3]) -> LinkGeometry {
    LinkGeometry { carries, axis, point }
}

/// Returns a chain in which only this letter carries something.
fn one(letter: char, link: LinkGeometry) -> ChainGeometry {
    let mut given = ChainGeometry::NONE;
    given.links["ABCUVW".find(letter).unwrap()] = link;
    given
}

fn three(rng: &mut Pcg64, size: f64) -> [f64; 3] {
    std::array::from_fn(|_| rng.random_range(-size..size))
}

/// Arbitrary axes that carry arbitrary parts, sometimes with the workpiece on the platform.
struct Drawn {
    axes: String,
    given: ChainGeometry,
    chain: Chain,
}

fn drawn(rng: &mut Pcg64) -> Drawn {
    let mut letters: Vec<char> = "ABCUVW".chars().collect();
    letters.shuffle(rng);
    let axes: String = letters[..rng.random_range(1..=6)].iter().collect();
    let mut given = ChainGeometry::NONE;
    for letter in axes.chars() {
        let place = "ABCUVW".find(letter).unwrap();
        let (axis, point) = (three(rng, 1.0), three(rng, 500.0));
        given.links[place] = link(rng.random_range(0..=3), axis, point);
    }
    given.holder = rng.random_bool(0.3).then(|| three(rng, 500.0));
    let chain = frozen(&axes, &given).unwrap();
    Drawn { axes, given, chain }
}

fn world(rng: &mut Pcg64) -> World {
    std::array::from_fn(|k| match k {
        3..6 => rng.random_range(-80.0..80.0),
        _ => rng.random_range(-300.0..300.0),
    })
}

impl Drawn {
    /// Returns the frame, by nalgebra in the order of the letters, from the carrier outward.
    fn frame(&self, carries: i32, world: &World) -> Isometry3<f64> {
        let mut frame = Isometry3::identity();
        for letter in self.axes.chars() {
            let link = self.given.links["ABCUVW".find(letter).unwrap()];
            if link.carries != carries {
                continue;
            }
            let value = world[POSE_LETTERS.iter().position(|l| *l == letter).unwrap()];
            let axis = Unit::new_normalize(Vector3::from(link.axis));
            frame *= match "ABC".contains(letter) {
                false => Translation3::from(axis.into_inner() * value).into(),
                true => {
                    let turn = UnitQuaternion::from_axis_angle(&axis, value.to_radians());
                    let to = Translation3::from(Vector3::from(link.point));
                    to * turn * to.inverse()
                }
            };
        }
        frame
    }

    /// Returns the machine's angles: those of letters that are not axes.
    fn angles(&self, world: &World) -> [f64; 3] {
        let own = |k: usize| if self.axes.contains(POSE_LETTERS[k]) { 0.0 } else { world[k] };
        [own(3), own(4), own(5)]
    }

    /// Returns the platform's position by the loop of frames: the tip has the same position in base through
    /// the workpiece and through the tool.
    fn platform(&self, world: &World, tool: &Vector3<f64>) -> Vector3<f64> {
        let [a, b, c] = self.angles(world).map(f64::to_radians);
        let turn = UnitQuaternion::from_euler_angles(a, b, c);
        let tip = Point3::from(Vector3::new(world[0], world[1], world[2]) - tool);
        let (on_work, on_tool) =
            (self.frame(WORK, world) * tip, self.frame(TOOL, world) * Point3::from(-tool));
        let legs = self.frame(LEGS, world);
        match self.given.holder {
            // legs (P + R tip on the platform) = holder + tip on the tool.
            Some(holder) => legs.inverse() * (on_tool + Vector3::from(holder)) - turn * on_work,
            // legs (P + R tip on the tool) = tip on the work.
            None => legs.inverse() * on_work - turn * on_tool,
        }
    }
}

#[test]
fn the_tip_is_on_the_work_where_the_program_says_by_either_way_round() {
    let mut rng = rng(190);
    for _ in 0..cases(3000) {
        let (drawn, tool) = (drawn(&mut rng), Vector3::from(three(&mut rng, 100.0)));
        let world = world(&mut rng);
        let machine = drawn.chain.to_machine(&world, &tool).unwrap();
        assert_eq!(machine[3..], drawn.angles(&world));
        let pose = Pose::from_degrees(machine);
        let of_machine = drawn.chain.machine_tool(&tool);
        let platform = pose.position - of_machine + pose.rotation() * of_machine;
        let expected = drawn.platform(&world, &tool);
        assert!((platform - expected).norm() < PLACE, "{} {:?}", drawn.axes, drawn.given);
    }
}

#[test]
fn a_machines_pose_and_its_axes_give_linuxcncs_pose_back() {
    let mut rng = rng(191);
    for _ in 0..cases(3000) {
        let (drawn, tool) = (drawn(&mut rng), Vector3::from(three(&mut rng, 100.0)));
        let asked = world(&mut rng);
        let machine = drawn.chain.to_machine(&asked, &tool).unwrap();
        let mut found = asked;
        // Forward does not use them: everything except the axes.
        for (k, value) in found.iter_mut().enumerate().take(6) {
            if !drawn.axes.contains(POSE_LETTERS[k]) {
                *value = f64::NAN;
            }
        }
        drawn.chain.to_world(&machine, &mut found, &tool).unwrap();
        for (a, b) in found.iter().zip(asked) {
            assert!((a - b).abs() < PLACE, "{found:?} {asked:?}");
        }
    }
}

#[test]
fn rates_and_the_shift_of_the_tool_are_differences() {
    const STEP: f64 = 1e-4;
    let mut rng = rng(192);
    // Differences: error h² times positions of some thousand, and rounding over h.
    const OFF: f64 = 1e-5;
    for _ in 0..cases(500) {
        let (drawn, tool) = (drawn(&mut rng), Vector3::from(three(&mut rng, 100.0)));
        let at = world(&mut rng);
        let rates = drawn.chain.rates(&at, &tool);
        let moved = |k: usize, by: f64| {
            let mut moved = at;
            moved[k] += by;
            drawn.chain.to_machine(&moved, &tool).unwrap()
        };
        for letter in 0..9 {
            let (more, less) = (moved(letter, STEP), moved(letter, -STEP));
            for k in 0..6 {
                let difference = (more[k] - less[k]) / (2.0 * STEP);
                assert!(
                    (rates[(k, letter)] - difference).abs() < OFF,
                    "{letter} {k}: {difference}"
                );
            }
        }
        let shift = drawn.chain.tool_shift(&at, &tool);
        for k in 0..3 {
            let with = |by: f64| drawn.platform(&at, &(tool + Vector3::ith(k, by)));
            let difference = (with(STEP) - with(-STEP)) / (2.0 * STEP);
            assert!((shift.column(k) - difference).norm() < OFF, "{:?}", drawn.given);
        }
    }
}

#[test]
fn frames_of_tool_and_work_are_those_of_the_loop() {
    let mut rng = rng(193);
    for _ in 0..cases(500) {
        let drawn = drawn(&mut rng);
        let at = world(&mut rng);
        let machine = drawn.chain.to_machine(&at, &Vector3::zeros()).unwrap();
        let [a, b, c] = drawn.angles(&at).map(f64::to_radians);
        let platform = drawn.frame(LEGS, &at).rotation * UnitQuaternion::from_euler_angles(a, b, c);
        let [tool, work] = [TOOL, WORK].map(|carried| drawn.frame(carried, &at).rotation);
        let expected = match drawn.given.holder {
            None => [platform * tool, work],
            Some(_) => [tool, platform * work],
        };
        for (found, expected) in
            drawn.chain.frames(&Pose::from_degrees(machine), &at).iter().zip(expected)
        {
            // Some rounding errors of directions.
            assert!((found - expected.to_rotation_matrix().matrix()).norm() < 1e-13);
        }
    }
}

#[test]
fn signs_are_those_of_the_sketch() {
    let tool = Vector3::new(0.0, 0.0, 50.0);
    let at = |place: usize, value: f64| {
        let mut world = [10.0, 20.0, 30.0 + tool.z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        world[place] = value;
        world
    };
    let found = |letter: char, given: LinkGeometry, value: f64| {
        let place = POSE_LETTERS.iter().position(|l| *l == letter).unwrap();
        let chain = frozen(&letter.to_string(), &one(letter, given)).unwrap();
        chain.to_machine(&at(place, value), &tool).unwrap().map(|v| (v * 1e9).round() / 1e9)
    };
    let up = [0.0, 0.0, 7.0];
    // A table rotated by a quarter turn moves a point from (10, 20) to (−20, 10), the tool with it.
    let turned = found('C', link(WORK, up, [0.0; 3]), 90.0);
    assert_eq!(turned, [-20.0, 10.0, 80.0, 0.0, 0.0, 0.0]);
    // The same about the point (10, 0): a point 20 beside it along Y moves to 20 beside it along −X.
    assert_eq!(found('C', link(WORK, up, [10.0, 0.0, 5.0]), 90.0)[..3], [-10.0, 0.0, 80.0]);
    // A slide that lifts the workpiece lifts the tip with it; one that lifts the legs lowers them relative to it.
    assert_eq!(found('W', link(WORK, up, [0.0; 3]), 4.0)[2], 84.0);
    assert_eq!(found('W', link(LEGS, up, [0.0; 3]), 4.0)[2], 76.0);
    // A turret about Y of the platform, whose pivot is the platform's origin: a tool that extends 50
    // down points along −X after a quarter turn, and the platform is 50 beside the tip.
    let turret = found('B', link(TOOL, [0.0, 1.0, 0.0], [0.0; 3]), 90.0);
    assert_eq!(turret[..3], [60.0, 20.0, 30.0]);
    // A workpiece on the platform: the tip at (10, 20, 30) of it is at the holder minus the tool.
    let given = ChainGeometry { holder: Some([100.0, 200.0, 300.0]), ..ChainGeometry::NONE };
    let chain = frozen("W", &given).unwrap();
    let pose = chain.to_machine(&at(8, 5.0), &tool).unwrap();
    assert_eq!(pose, [90.0, 180.0, 220.0, 0.0, 0.0, 0.0]);
    let home = ChainGeometry::machine_home(given.holder, [10.0, 20.0, 80.0, 0.0, 0.0, 0.0]);
    assert_eq!(home, pose);
}

#[test]
fn what_carries_nothing_leaves_the_pose_alone_to_the_last_bit() {
    let mut rng = rng(194);
    let chain = frozen("CW", &ChainGeometry::NONE).unwrap();
    assert!(chain.is_empty() && chain.links().is_empty());
    let tool = Vector3::new(1.0, 2.0, 3.0);
    let asked = world(&mut rng);
    let machine = chain.to_machine(&asked, &tool).unwrap();
    assert_eq!(machine, [asked[0], asked[1], asked[2], asked[3], asked[4], 0.0]);
    let mut found = [0.0, 0.0, 0.0, 0.0, 0.0, asked[5], asked[6], asked[7], asked[8]];
    chain.to_world(&machine, &mut found, &tool).unwrap();
    assert_eq!(found, asked);
    assert_eq!(ChainGeometry::NONE.hash(&ExtraAxes::NONE, 17), 17);
}

#[test]
fn what_cannot_be_is_refused_with_its_axis() {
    let good = link(WORK, [0.0, 0.0, 1.0], [1.0, 2.0, 3.0]);
    let refused = |link: LinkGeometry| frozen("WC", &one('C', link)).unwrap_err();
    let part = Some(MachinePart::ExtraAxis(7, b'C'));
    for (carries, value) in [(-1, -1.0), (4, 4.0), (i32::MAX, f64::from(i32::MAX))] {
        let fault = refused(LinkGeometry { carries, ..good });
        assert_eq!((fault.cause, fault.part, fault.value), (Cause::ChainUnknown, part, value));
    }
    assert_eq!(refused(LinkGeometry { axis: [0.0; 3], ..good }).cause, Cause::ChainAxisZero);
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for k in 0..3 {
            let mut given = good;
            given.axis[k] = bad;
            assert_eq!(refused(given).cause, Cause::ChainNotFinite);
            given = good;
            given.point[k] = bad;
            assert_eq!(refused(given).cause, Cause::ChainNotFinite);
            let mut holder = [0.0; 3];
            holder[k] = bad;
            let given = ChainGeometry { holder: Some(holder), ..ChainGeometry::NONE };
            assert_eq!(frozen("WC", &given).unwrap_err().cause, Cause::HolderNotFinite);
        }
    }
    let far = [0.0, 1.1e9, 0.0];
    assert_eq!(refused(LinkGeometry { point: far, ..good }).cause, Cause::ChainTooFar);
    let given = ChainGeometry { holder: Some(far), ..ChainGeometry::NONE };
    assert_eq!(frozen("WC", &given).unwrap_err().cause, Cause::HolderTooFar);
    // Links that carry nothing, and points that are not used, are ignored.
    let mut given = one('C', LinkGeometry { carries: 0, axis: [f64::NAN; 3], point: far });
    given.links[5] = link(LEGS, [1.0, 0.0, 0.0], [f64::NAN; 3]);
    assert_eq!(frozen("WC", &given).unwrap().links().len(), 1);
    assert!(
        refused(LinkGeometry { axis: [0.0; 3], ..good })
            .to_string()
            .starts_with("joint 7 (axis C): ")
    );
}

#[test]
fn a_value_that_is_no_number_or_too_large_is_refused() {
    let chain = frozen("CW", &one('C', link(WORK, [0.0, 0.0, 1.0], [0.0; 3]))).unwrap();
    let cause = |place: usize, value: f64| {
        let mut world = [0.0; 9];
        world[place] = value;
        chain.to_machine(&world, &Vector3::zeros()).map_err(|fault| fault.cause)
    };
    for place in [0, 4, 5, 8] {
        assert_eq!(cause(place, f64::NAN), Err(Cause::PoseNotFinite), "{place}");
    }
    assert!(cause(6, f64::NAN).is_ok(), "U is unused");
    assert_eq!(cause(5, 1_000_001.0), Err(Cause::AngleTooLarge));
    assert!(cause(5, -999_999.0).is_ok() && cause(8, 1e9).is_ok());
}

#[test]
fn the_hash_knows_every_value_of_the_chain_and_the_order_of_its_axes() {
    let axes = |text: &str| ExtraAxes::parse(text.as_bytes(), &layout("ABC")).unwrap();
    let mut given = one('A', link(WORK, [1.0, 2.0, 3.0], [4.0, 5.0, 6.0]));
    given.links[2] = link(TOOL, [7.0, 8.0, 9.0], [10.0, 11.0, 12.0]);
    let mut seen = vec![1, given.hash(&axes("AC"), 1), given.hash(&axes("CA"), 1)];
    let changes: [fn(&mut ChainGeometry); 5] = [
        |given| given.links[0].carries = TOOL,
        |given| given.links[0].axis[1] += 1.0,
        |given| given.links[2].point[2] += 1.0,
        |given| given.links[2].carries = 0,
        |given| given.holder = Some([0.0; 3]),
    ];
    for change in changes {
        let mut other = given;
        change(&mut other);
        seen.push(other.hash(&axes("AC"), 1));
    }
    let count = seen.len();
    seen.sort_unstable();
    seen.dedup();
    assert_eq!(seen.len(), count);
    // Values of letters that carry nothing or are not axes are ignored.
    let mut other = given;
    other.links[1] = link(WORK, [1.0; 3], [1.0; 3]);
    other.links[5].axis = [1.0; 3];
    assert_eq!(other.hash(&axes("AC"), 1), given.hash(&axes("AC"), 1));
}
