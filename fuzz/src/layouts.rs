// SPDX-License-Identifier: GPL-2.0-or-later
//! Load parameters of arbitrary text, carrying axes at arbitrary positions, and two mechanisms at arbitrary poses:
//! nothing panics, accepted parameters have every letter and every joint once, and results are finite and consistent.

use crate::Bytes;
use crate::common::Case;
use crate::common::machines::declared;
use kinematics::{
    Body, Chain, ChainGeometry, ExtraAxes, Gap, Letter, LinkGeometry, Load, LoadError, MAX_LINKS,
    Matrix3, Pose, Vector3, World,
};
use std::cell::LazyCell;

thread_local! {
    static MACHINES: LazyCell<Vec<Case>> = LazyCell::new(declared);
}

/// Poses and axis points beyond this many sizes lose digits that are significant relative to the size.
const FAR: f64 = 100.0;

/// Tolerance of a rotation and its inverse, as a fraction of the largest length: some rotations, each with an error of
/// 2⁻⁵², of vectors of up to FAR sizes.
const THERE_AND_BACK: f64 = 1e-12;

const LINUXCNC_JOINTS: usize = 16;

/// Words of load parameters, in addition to single characters.
const WORDS: [&str; 12] = [
    "strut:6", "slider:4", "crank:3", "ring:5", ",", "XYZ", "XYZB", "XYZABC", "UVW", "C", "A", "1",
];

fn text(bytes: &mut Bytes) -> Vec<u8> {
    let mut text = vec![];
    for _ in 0..bytes.below(5) {
        match bytes.byte() {
            0..=199 => text.extend(WORDS[bytes.below(WORDS.len())].bytes()),
            _ => text.push(bytes.byte()),
        }
    }
    text
}

fn loaded(bytes: &mut Bytes) -> Result<Load, LoadError> {
    let all: [Vec<u8>; 7] = std::array::from_fn(|_| text(bytes));
    let [legs, coordinates, table, second, of_second, angles, axes] =
        all.each_ref().map(|text| Some(text.as_slice()));
    let load = Load::parse(legs, coordinates, table)?;
    load.with_second(second, of_second, angles)?.with_axes(axes)
}

/// Checks that every moved letter occurs once, and that the joints have room.
fn parameters(bytes: &mut Bytes) {
    let Ok(load) = loaded(bytes) else { return };
    assert!(load.joints() <= LINUXCNC_JOINTS, "{load:?}");
    let own = Letter::ALL.iter().filter(|letter| !load.layout.is_held(**letter));
    let others = load.second().into_iter().flat_map(|second| second.places());
    let all = own.map(|letter| letter.index()).chain(others).chain(load.extra.places());
    let mut taken = [false; 9];
    for place in all {
        assert!(!std::mem::replace(&mut taken[place], true), "letter {place} twice: {load:?}");
    }
}

fn link(size: f64, bytes: &mut Bytes) -> LinkGeometry {
    LinkGeometry {
        carries: bytes.below(6) as i32 - 1,
        axis: std::array::from_fn(|_| bytes.number(1.0, 1.0)),
        point: std::array::from_fn(|_| bytes.number(0.0, size)),
    }
}

fn given(size: f64, bytes: &mut Bytes) -> ChainGeometry {
    let mut given = ChainGeometry::NONE;
    for _ in 0..bytes.below(5) {
        given.links[bytes.below(MAX_LINKS)] = link(size, bytes);
    }
    if bytes.byte() < 64 {
        given.holder = Some(std::array::from_fn(|_| bytes.number(0.0, size)));
    }
    given
}

fn is_rotation(matrix: &Matrix3<f64>) -> bool {
    let off = matrix.transpose() * matrix - Matrix3::identity();
    off.iter().all(|x| x.abs() < 1e-9)
}

/// Converts LinuxCNC's pose to the machine's and back.
fn chain(case: &Case, bytes: &mut Bytes) {
    let (layout, size) = (case.machine.layout(), case.machine.size());
    let free: Vec<u8> = b"ABCUVW"
        .iter()
        .copied()
        .filter(|c| bytes.byte() < 128 && ExtraAxes::parse(&[*c], layout).is_ok())
        .collect();
    let axes = ExtraAxes::parse(&free, layout).expect("free letters");
    let given = given(size, bytes);
    let Ok(chain) = Chain::freeze(&given, &axes, layout, size) else { return };
    let home = case.home.to_degrees();
    let usual = |k: usize| home.get(k).copied().unwrap_or(0.0);
    let spread = |k: usize| if (3..6).contains(&k) { 60.0 } else { 0.3 * size };
    let world: World = std::array::from_fn(|k| bytes.number(usual(k), spread(k)));
    let tool = Vector3::from_fn(|_, _| bytes.number(0.0, 0.1 * size));
    let Ok(own) = chain.to_machine(&world, &tool) else { return };
    let points =
        given.links.iter().flat_map(|link| link.point).chain(given.holder.into_iter().flatten());
    let lengths = world.iter().enumerate().filter(|(k, _)| !(3..6).contains(k)).map(|(_, x)| *x);
    let largest =
        lengths.chain(points).chain(tool.iter().copied()).fold(size, |most, x| most.max(x.abs()));
    // An invalid tool is refused earlier.
    if !(largest <= FAR * size) || tool.iter().any(|x| !x.is_finite()) {
        return;
    }
    assert!(own.iter().all(|x| x.is_finite()), "{own:?} of {world:?}");
    let mut back = world;
    chain.to_world(&own, &mut back, &tool).expect("the same values of the axes");
    let own_letter = |k: usize| Letter::ALL.get(k).is_some_and(|letter| !layout.is_held(*letter));
    for k in (0..9).filter(|k| own_letter(*k) || axes.places().any(|place| place == *k)) {
        let most = if (3..6).contains(&k) { 1e-9 } else { THERE_AND_BACK * largest };
        assert!((back[k] - world[k]).abs() <= most, "letter {k}: {back:?} of {world:?}, {given:?}");
    }
    for frame in chain.frames(&Pose::from_degrees(own), &world) {
        assert!(is_rotation(&frame), "{frame} at {world:?}, {given:?}");
    }
    let shift = chain.tool_shift(&world, &tool);
    assert!(shift.iter().all(|x| x.is_finite()), "{shift}");
    let rates = chain.rates(&world, &tool);
    assert!(rates.iter().all(|x| x.is_finite()), "{rates}");
}

/// Checks that the distance of two machines at two poses is symmetric.
fn pair(one: &Case, other: &Case, bytes: &mut Bytes) {
    let mut pose = |case: &Case| {
        let (home, size) = (case.home.to_degrees(), case.machine.size());
        let spread = |k: usize| if k < 3 { size } else { 60.0 };
        Pose::from_degrees(std::array::from_fn(|k| bytes.number(home[k], spread(k))))
    };
    let poses = [pose(one), pose(other)];
    let none = Vector3::zeros();
    let (Ok(first), Ok(second)) =
        (one.machine.at(&poses[0], &none), other.machine.at(&poses[1], &none))
    else {
        return;
    };
    let (there, back) = (Gap::between(&first, &second), Gap::between(&second, &first));
    if !there.distance.is_finite() {
        // At such distances the squares of lengths overflow.
        return;
    }
    let size = one.machine.size().max(other.machine.size());
    let largest = poses.iter().map(|pose| pose.position.norm()).fold(size, f64::max);
    assert!(there.distance >= 0.0);
    assert!((there.distance - back.distance).abs() <= 1e-7 * largest, "{there:?} {back:?}");
    for (body, case) in there.bodies.into_iter().zip([one, other]) {
        assert!(!matches!(body, Body::Leg(i) if i >= case.machine.layout().legs()), "{there:?}");
    }
}

/// Runs one of the three with inputs from the bytes.
pub fn run(data: &[u8]) {
    let mut bytes = Bytes::new(data);
    MACHINES.with(|machines| match bytes.byte() % 3 {
        0 => parameters(&mut bytes),
        1 => chain(&machines[bytes.below(machines.len())], &mut bytes),
        _ => {
            let [one, other] = [0, 1].map(|_| &machines[bytes.below(machines.len())]);
            pair(one, other, &mut bytes);
        }
    });
}
