// SPDX-License-Identifier: GPL-2.0-or-later
//! The inverse of the tool frame: the joints at which the tool points along a direction of the workpiece.
//!
//! Of a parallel machine all legs move together, so the answer is one pose: LinuxCNC's X Y Z and the extra axes stay,
//! and the platform's angles change as little as possible. It is not computed in the servo thread's cycle.

use kinematics::{Carries, Chain, Layout, Letter, Matrix3, Pose, Vector3, World};

/// Angle in radians below which two directions count as equal, and as parallel.
const SAME: f64 = 1e-6;

/// Largest error of a direction that counts as found, radians, and the one at which no step improves it.
pub const FOUND: f64 = 1e-9;
const EXACT: f64 = 1e-14;

/// Keeps steps short in directions that do not count: a share of 1e-8 of each step is left for the next one.
const DAMPING: f64 = 1e-8;

/// Largest number of steps, and their largest length in radians.
const MOST_STEPS: usize = 40;
const LONGEST_STEP: f64 = 0.5;

/// A requested orientation of the tool, in coordinates of the workpiece.
pub struct Request {
    axis: Vector3<f64>,
    x: Option<Vector3<f64>>,
}

/// An orientation that the platform can have.
pub struct Orientation {
    /// LinuxCNC's pose, with X Y Z and extra axes of the seed.
    pub world: World,
    /// Number of directions in which the platform could rotate on.
    pub free: usize,
    /// The rotation about the tool axis that remains to the requested tool X, radians.
    pub spin: f64,
}

impl Request {
    /// Normalizes a request; `None` if it is none: a zero vector, NaN, or a tool X along the axis.
    pub fn new(axis: Vector3<f64>, x: Option<Vector3<f64>>) -> Option<Self> {
        let axis = unit(axis)?;
        let x = match x {
            None => None,
            Some(x) => {
                let x = unit(x)?;
                let across = x - axis * axis.dot(&x);
                Some(unit(across).filter(|_| across.norm() > SAME)?)
            }
        };
        Some(Self { axis, x })
    }
}

fn unit(vector: Vector3<f64>) -> Option<Vector3<f64>> {
    let length = vector.norm();
    (length > 0.0 && length.is_finite()).then(|| vector / length)
}

/// Two directions that must become equal: of the platform, and of base.
type Pair = [Vector3<f64>; 2];

/// Returns the platform's orientation nearest to that of `pose`, or `None` if it cannot have a requested one. `world` is
/// LinuxCNC's pose.
pub fn oriented(
    (layout, chain): (&Layout, &Chain),
    pose: &Pose,
    world: &World,
    request: &Request,
) -> Option<Orientation> {
    let [tool, work] = chain.frames(pose, world);
    let legs = chain.of(Carries::Legs);
    let legs = legs.fold(Matrix3::identity(), |turned, link| turned * link.rotation(world));
    let platform: Matrix3<f64> = legs * pose.rotation();
    // The platform carries the tool, or the workpiece.
    let pair = |of_tool: Vector3<f64>, of_work: Vector3<f64>| match chain.holder() {
        None => [platform.tr_mul(&(tool * of_tool)), legs.tr_mul(&(work * of_work))],
        Some(_) => [platform.tr_mul(&(work * of_work)), legs.tr_mul(&(tool * of_tool))],
    };
    let axis = pair(Vector3::z(), request.axis);
    let x = request.x.map(|x| pair(Vector3::x(), x));
    let active =
        [Letter::A, Letter::B, Letter::C].map(|letter| layout.coordinates().contains(letter));
    // Where the joints can place X they do; only without all three angles it may remain away.
    let exact = x.and_then(|x| turned(pose.angles, active, axis, Some(x)));
    let spins = x.is_some() && exact.is_none();
    if spins && active.iter().all(|is_active| *is_active) {
        return None;
    }
    let (angles, rank) = match exact {
        Some(found) => found,
        None => turned(pose.angles, active, axis, None)?,
    };
    let count = active.iter().filter(|is_active| **is_active).count();
    let mut world = *world;
    let degrees = Pose { angles, ..*pose }.to_degrees();
    for (letter, is_active) in [Letter::A, Letter::B, Letter::C].into_iter().zip(active) {
        let to = world.get_mut(letter.index()).filter(|_| is_active);
        to.into_iter().zip(degrees.get(letter.index())).for_each(|(to, value)| *to = *value);
    }
    let spin = match x.filter(|_| spins) {
        None => 0.0,
        Some([of_platform, of_base]) => {
            let at = Pose { angles, ..*pose }.rotation() * of_platform;
            let [_, about] = axis;
            let spin = libm::atan2(about.dot(&at.cross(&of_base)), at.dot(&of_base));
            // Seen from the workpiece that the platform carries, the tool turns the other way.
            if chain.holder().is_some() { -spin } else { spin }
        }
    };
    Some(Orientation { world, free: count.saturating_sub(rank), spin })
}

/// Turns the platform until its directions are those of base. Returns the angles, and the number of independent
/// directions in which they must not change.
fn turned(
    start: Vector3<f64>,
    active: [bool; 3],
    axis: Pair,
    x: Option<Pair>,
) -> Option<(Vector3<f64>, usize)> {
    let (mut angles, mut found) = (start, None);
    for _ in 0..MOST_STEPS {
        let pose = Pose { position: Vector3::zeros(), angles };
        let (rotation, mut rates) = (pose.rotation(), pose.rate_map());
        let [of_platform, of_base] = axis;
        let mut away = towards(&(rotation * of_platform), &of_base)?;
        let free = match x {
            // Every rotation counts.
            Some([of_platform, of_base]) => {
                away += axis[1] * axis[1].dot(&towards(&(rotation * of_platform), &of_base)?);
                Vector3::zeros()
            }
            None => of_base,
        };
        for (k, is_active) in active.into_iter().enumerate() {
            let column = rates.column(k) - free * free.dot(&rates.column(k));
            rates.set_column(k, &(column * f64::from(u8::from(is_active))));
        }
        found = (away.norm() <= FOUND).then(|| (angles, rank(&rates)));
        if away.norm() <= EXACT {
            break;
        }
        // The shortest of the best steps.
        let normal = rates.tr_mul(&rates) + Matrix3::identity() * DAMPING;
        let step = normal.try_inverse()? * rates.tr_mul(&away);
        let length = step.norm();
        angles += if length > LONGEST_STEP { step * (LONGEST_STEP / length) } else { step };
    }
    found
}

/// Returns the rotation vector from one unit vector to another; `None` for opposite ones, which have no shortest.
fn towards(from: &Vector3<f64>, to: &Vector3<f64>) -> Option<Vector3<f64>> {
    let across = from.cross(to);
    let (sine, cosine) = (across.norm(), from.dot(to));
    if sine > 0.0 {
        return (cosine > 0.0 || sine > SAME).then(|| across * (libm::atan2(sine, cosine) / sine));
    }
    (cosine > 0.0).then(Vector3::zeros)
}

/// Returns the rank of columns of length 1 or less.
fn rank(columns: &Matrix3<f64>) -> usize {
    let [a, b, c] = [0, 1, 2].map(|k| columns.column(k).into_owned());
    if columns.determinant().abs() > SAME {
        3
    } else if [a.cross(&b), b.cross(&c), c.cross(&a)].iter().any(|across| across.norm() > SAME) {
        2
    } else {
        usize::from([a, b, c].iter().any(|column| column.norm() > SAME))
    }
}
