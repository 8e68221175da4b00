// SPDX-License-Identifier: GPL-2.0-or-later
//! The reference tracker: finds the right pose in the slow way.
//!
//! Follows the straight joint path from the seed in 1000 steps with Newton's method at
//! each, and gives up if the Jacobian changes its sign or a rod passes its dead point.
//! Equations, frames and solver are independent: from the core it uses only the numbers of a
//! [`Geometry`] and the pose of the seed. (Joints of the seed come from inverse, which the
//! tests of the legs' equations check.)

use super::tolerances::WRONG;
use super::{NO_OFFSET, NO_TOOL};
use kinematics::{Geometry, Joints, LegGeometry, LegKind, Letter, Machine, Pose, Solver, Vector3};
use nalgebra::{Matrix3, Rotation3, SMatrix, SVector};

const STEPS: usize = 1000;

/// Steps of the second, closer tracking if the first one found no path.
const CLOSE_STEPS: usize = 20_000;

/// Shortest step of the closer tracking, as a fraction of the path: next to a singular pose a step is halved.
const SHORTEST: f64 = 1e-8;

/// Newton's steps at one point of the path: with the exact rows two are enough.
const CORRECTIONS: usize = 40;

/// Newton's step, relative to size, that ends the correction at the end of the path: ten
/// rounding errors of the joints; the remaining error is at most a tenth of it.
const EXACT: f64 = 1e-12;

/// The same within the path, relative to the platform's motion between two poses: the error left
/// by such a step is its square, and does not accumulate, because every pose is corrected anew.
const ON_THE_WAY: f64 = 1e-2;

/// Residuals, relative to size, that are rounding errors: near a singular pose they keep Newton's
/// step above any limit.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// Steps after which the gradient of the nut correction, by differences, is added to the rows of
/// the first tracking; the closer one includes it from the start.
const PLAIN: usize = 15;

pub type Row = SVector<f64, 6>;

/// A leg in the equations at given joints.
pub struct Rod {
    pub anchor: Vector3<f64>,
    pub length: f64,
    /// Unit vector along the lower end's motion, times −side; zero for a strut.
    pub onwards: Vector3<f64>,
}

/// The platform's position: the center as in the legs' equations, and the orientation.
#[derive(Clone, Copy)]
pub struct State {
    pub centre: Vector3<f64>,
    pub rotation: Matrix3<f64>,
    pub angles: Vector3<f64>,
}

/// A machine based only on its equations.
pub struct Tracker<'a> {
    geometry: &'a Geometry,
    machine: Machine,
    /// Coordinates that the legs move.
    active: [bool; 6],
    /// The sign of the nut correction's fold for each leg.
    hands: [f64; 8],
}

impl<'a> Tracker<'a> {
    /// Creates it for a geometry with a reference pose.
    pub fn new(geometry: &'a Geometry) -> Self {
        let machine = Machine::freeze(geometry, &NO_OFFSET).expect("a machine");
        let coordinates = geometry.layout().coordinates();
        let active = Letter::ALL.map(|letter| coordinates.contains(letter));
        let mut tracker = Self { geometry, machine, active, hands: [1.0; 8] };
        let state = tracker.home();
        for (i, leg) in geometry.legs().iter().enumerate() {
            if let Some((_, cosine)) = torsion(leg, &state.rotation, &tracker.span(leg, &state)) {
                tracker.hands[i] = cosine.signum();
            }
        }
        tracker
    }

    /// Returns the platform's position at the reference pose.
    pub fn home(&self) -> State {
        self.state(&Pose::from_degrees(self.geometry.home.expect("a reference pose")))
    }

    pub fn size(&self) -> f64 {
        self.machine.size()
    }

    pub fn radius(&self) -> f64 {
        self.machine.radius()
    }

    pub fn is_active(&self, k: usize) -> bool {
        self.active[k]
    }

    pub fn turns_freely(&self) -> bool {
        (3..6).all(|k| self.is_active(k))
    }

    /// Computes D = t + R center, as in the legs' equations.
    pub fn state(&self, pose: &Pose) -> State {
        let rotation = pose.rotation();
        let centre = Vector3::from(self.geometry.centre);
        let mut d = pose.position + rotation * centre;
        for k in 0..3 {
            if !self.is_active(k) {
                d[k] = 0.0;
            }
        }
        State { centre: d, rotation, angles: pose.angles }
    }

    fn lever(&self, leg: &LegGeometry, state: &State) -> Vector3<f64> {
        let arm = Vector3::from(leg.platform) - Vector3::from(self.geometry.centre);
        let anchor = state.centre + state.rotation * arm;
        anchor + along_ring(leg, &anchor, &state.rotation) - state.centre
    }

    /// Returns the vector from base anchor to platform anchor.
    pub fn span(&self, leg: &LegGeometry, state: &State) -> Vector3<f64> {
        state.centre + self.lever(leg, state) - Vector3::from(leg.base)
    }

    /// Computes the length that the nut rotation adds to strut `i`.
    pub fn correction(&self, i: usize, leg: &LegGeometry, state: &State) -> f64 {
        let LegKind::Strut(strut) = leg.kind else { return 0.0 };
        let Some((s, c)) = torsion(leg, &state.rotation, &self.span(leg, state)) else {
            return 0.0;
        };
        let h = self.hands[i];
        h * strut.lead / std::f64::consts::TAU * (h * s).atan2(h * c)
    }

    /// Returns residuals and rows in (v, ω) about the center; `None` if a rod is not on its side.
    fn equations(&self, joints: &Joints, state: &State) -> Option<([f64; 8], [Row; 8])> {
        let (residuals, rows, on_side) = self.of_any_side(joints, state);
        on_side.then_some((residuals, rows))
    }

    /// Returns the same for any sides of the rods, and whether each is on its own.
    pub fn of_any_side(&self, joints: &Joints, state: &State) -> ([f64; 8], [Row; 8], bool) {
        let (mut residuals, mut rows) = ([0.0; 8], [Row::zeros(); 8]);
        let mut on_side = true;
        for (i, leg) in self.geometry.legs().iter().enumerate() {
            let rod = rod(leg, joints[i]);
            let lever = self.lever(leg, state);
            let span = state.centre + lever - rod.anchor;
            let n = span.normalize();
            on_side &= rod.onwards == Vector3::zeros() || n.dot(&rod.onwards) > 0.0;
            residuals[i] = span.norm() + self.correction(i, leg, state) - rod.length;
            let moment = lever.cross(&n);
            rows[i] = Row::new(n.x, n.y, n.z, moment.x, moment.y, moment.z);
        }
        (residuals, rows, on_side)
    }

    /// Converts rows to the coordinates of the solver: angles if not all of them are active.
    pub fn charted(&self, rows: &[Row; 8], state: &State) -> [Row; 8] {
        let map = match self.turns_freely() {
            true => Matrix3::identity(),
            false => axes_of(&state.angles).transpose(),
        } / self.machine.radius();
        rows.map(|row| {
            let moment = map * row.fixed_rows::<3>(3);
            let mut row = Row::new(row[0], row[1], row[2], moment.x, moment.y, moment.z);
            for k in 0..6 {
                if !self.is_active(k) {
                    row[k] = 0.0;
                }
            }
            row
        })
    }

    pub fn moved(&self, state: &State, step: &Row) -> State {
        let centre = state.centre + Vector3::new(step[0], step[1], step[2]);
        let turn = Vector3::new(step[3], step[4], step[5]) / self.machine.radius();
        if self.turns_freely() {
            let rotation = Rotation3::new(turn).matrix() * state.rotation;
            return State { centre, rotation, angles: state.angles };
        }
        let angles = state.angles + turn;
        let rotation = Pose { position: centre, angles }.rotation();
        State { centre, rotation, angles }
    }

    /// Runs Newton's (Gauss-Newton's) method at one point of the path; the sign of det JᵀJ is
    /// meaningless, that of a square J is not.
    fn corrected(
        &self,
        joints: &Joints,
        mut state: State,
        plain: usize,
        enough: f64,
    ) -> Option<(State, f64)> {
        for count in 0..CORRECTIONS {
            let (residuals, rows) = self.equations(joints, &state)?;
            let mut rows = self.charted(&rows, &state);
            if count >= plain {
                self.add_corrections(&mut rows, &state);
            }
            let (step, sign) = self.newton_step(&rows, &residuals)?;
            state = self.moved(&state, &step);
            let rounded = residuals.iter().all(|r| r.abs() <= ROUNDING * self.size());
            if step.norm() <= enough || rounded {
                return Some((state, sign));
            }
        }
        // Inconsistent joints of a redundant machine converge slowly.
        self.geometry.layout().is_redundant().then_some((state, 1.0))
    }

    fn add_corrections(&self, rows: &mut [Row; 8], state: &State) {
        let step = 1e-6 * self.machine.size();
        for (i, leg) in self.geometry.legs().iter().enumerate() {
            for k in (0..6).filter(|k| self.is_active(*k)) {
                let at = |by: f64| {
                    let mut x = Row::zeros();
                    x[k] = by;
                    self.correction(i, leg, &self.moved(state, &x))
                };
                rows[i][k] += (at(step) - at(-step)) / (2.0 * step);
            }
        }
    }

    pub fn newton_step(&self, rows: &[Row; 8], residuals: &[f64; 8]) -> Option<(Row, f64)> {
        let layout = self.geometry.layout();
        // Coordinates that do not move get a separate equation, x = 0.
        let mut a = SMatrix::<f64, 6, 6>::identity();
        let mut b = Row::zeros();
        let active = || (0..6).filter(|k| self.is_active(*k));
        if layout.is_redundant() {
            for j in active() {
                for k in active() {
                    a[(j, k)] = rows.iter().map(|row| row[j] * row[k]).sum();
                }
                b[j] = rows.iter().zip(residuals).map(|(row, r)| row[j] * r).sum();
            }
        } else {
            for (i, j) in active().enumerate() {
                for k in 0..6 {
                    a[(j, k)] = rows[i][k];
                }
                b[j] = residuals[i];
            }
        }
        let lu = a.lu();
        let sign = if layout.is_redundant() { 1.0 } else { lu.determinant().signum() };
        Some((-lu.solve(&b)?, sign))
    }

    /// Returns the right pose, or `None` if the path meets a singular pose or a dead point.
    pub fn follow(&self, seed: &Pose, joints: &Joints) -> Option<Pose> {
        self.follow_in(STEPS, seed, joints)
    }

    /// Returns the same by closer tracking, for paths on which steps of a thousandth are too long.
    pub fn follow_closely(&self, seed: &Pose, joints: &Joints) -> Option<Pose> {
        self.follow_in(CLOSE_STEPS, seed, joints)
    }

    fn follow_in(&self, steps: usize, seed: &Pose, joints: &Joints) -> Option<Pose> {
        let from = self.machine.inverse(seed, &NO_TOOL).ok()?;
        let is_close = steps != STEPS;
        let plain = if is_close { 0 } else { PLAIN };
        let exact = EXACT * self.size().max(self.radius());
        let mut seen = None;
        let mut state = self.state(seed);
        let mut last = state;
        let whole = 1.0 / steps as f64;
        let (mut done, mut length, mut before) = (0.0, whole, whole);
        while done < 1.0 {
            // The last step ends at the end, regardless of the sum of those before it.
            let is_last = done + 1.5 * length > 1.0;
            let to = if is_last { 1.0 } else { done + length };
            let at = std::array::from_fn(|i| from[i] + to * (joints[i] - from[i]));
            let guess = self.onwards(&last, &state, (to - done) / before);
            let on_the_way = if is_last { 0.0 } else { ON_THE_WAY };
            let enough = exact.max(on_the_way * self.apart(&state, &last));
            // A Newton step that leaves the neighborhood follows another path.
            let far = 50.0 * self.machine.radius() * length;
            let next = self.corrected(&at, guess, plain, enough).filter(|(next, sign)| {
                *seen.get_or_insert(*sign) == *sign && self.apart(next, &guess) <= far
            });
            match next {
                Some((next, _)) => {
                    (before, done) = (to - done, to);
                    (last, state) = (state, next);
                    length = whole.min(2.0 * length);
                }
                // Next to a singular pose the platform moves ever farther in a step of the joints.
                None if is_close && length > SHORTEST => length /= 2.0,
                None => return None,
            }
        }
        Some(self.pose(&state, joints))
    }

    /// Returns the distance of two positions, a length.
    fn apart(&self, one: &State, other: &State) -> f64 {
        (one.centre - other.centre).norm() + self.radius() * (one.rotation - other.rotation).norm()
    }

    /// Returns the next position if the last step is repeated this many times.
    fn onwards(&self, last: &State, state: &State, times: f64) -> State {
        let centre = state.centre + (state.centre - last.centre) * times;
        if self.turns_freely() {
            // By a rotation vector: repeated products would lose orthogonality.
            let turn = rotation_vector(&(state.rotation * last.rotation.transpose())) * times;
            let rotation = Rotation3::new(turn).matrix() * state.rotation;
            return State { centre, rotation, angles: state.angles };
        }
        let angles = state.angles + (state.angles - last.angles) * times;
        State { centre, rotation: Pose { position: centre, angles }.rotation(), angles }
    }

    /// Computes t = D − R center, held coordinates 0.
    pub fn pose(&self, state: &State, joints: &Joints) -> Pose {
        let layout = self.geometry.layout();
        let mut d = state.centre;
        for (i, letter) in layout.table().as_slice().iter().enumerate() {
            d[letter.index()] = joints[layout.legs() + i];
        }
        let centre = Vector3::from(self.geometry.centre);
        let mut position = d - state.rotation * centre;
        for letter in [Letter::X, Letter::Y, Letter::Z] {
            if layout.is_held(letter) {
                position[letter.index()] = 0.0;
            }
        }
        let angles = match self.turns_freely() {
            false => state.angles,
            true => {
                let r = &state.rotation;
                let b = (-r[(2, 0)]).atan2(r[(0, 0)].hypot(r[(1, 0)]));
                Vector3::new(r[(2, 1)].atan2(r[(2, 2)]), b, r[(1, 0)].atan2(r[(0, 0)]))
            }
        };
        Pose { position, angles }
    }

    /// Returns whether every leg fits a pose to the tolerance by which poses count as equal.
    pub fn fits(&self, pose: &Pose, joints: &Joints) -> bool {
        let limit = WRONG * self.machine.size();
        let fits = |residuals: [f64; 8]| residuals.iter().all(|r| r.abs() <= limit);
        self.equations(joints, &self.state(pose)).is_some_and(|(residuals, _)| fits(residuals))
    }

    /// Returns the same to the tolerance that forward guarantees for any machine, however badly conditioned: its limit
    /// of a residual, and the rounding errors of the lengths whose difference it is.
    pub fn holds(&self, pose: &Pose, joints: &Joints) -> bool {
        let limit = self.machine.largest_residual(&Solver::default());
        let state = self.state(pose);
        let (residuals, _, on_side) = self.of_any_side(joints, &state);
        let scale = |i: usize| {
            let leg = &self.geometry.legs()[i];
            let rod = rod(leg, joints[i]);
            let centre = Vector3::from(self.geometry.centre);
            [rod.anchor.norm(), state.centre.norm(), centre.norm(), rod.length, joints[i].abs()]
                .into_iter()
                .fold(self.size(), f64::max)
        };
        let fits = |i: usize| residuals[i].abs() <= limit + 1e3 * f64::EPSILON * scale(i);
        on_side && (0..self.geometry.legs().len()).all(fits)
    }

    /// Returns the sign of the square Jacobian's determinant over the active coordinates.
    pub fn handedness(&self, pose: &Pose, joints: &Joints) -> Option<bool> {
        let state = self.state(pose);
        let (residuals, rows) = self.equations(joints, &state)?;
        let (_, sign) = self.newton_step(&self.charted(&rows, &state), &residuals)?;
        Some(sign > 0.0)
    }
}

/// Returns axis times angle of a rotation by less than half a turn, exact for small ones too.
fn rotation_vector(r: &Matrix3<f64>) -> Vector3<f64> {
    let difference = r - r.transpose();
    let sine = Vector3::new(difference[(2, 1)], difference[(0, 2)], difference[(1, 0)]) / 2.0;
    let length = sine.norm();
    match length > 0.0 {
        true => sine * (length.atan2((r.trace() - 1.0) / 2.0) / length),
        false => sine,
    }
}

/// Returns the axes of A, B and C in base: columns of ω = E (Ȧ, Ḃ, Ċ).
fn axes_of(angles: &Vector3<f64>) -> Matrix3<f64> {
    let turn = |axis: Vector3<f64>| Rotation3::new(axis);
    let about_c = turn(Vector3::z() * angles.z);
    let about_b = about_c * turn(Vector3::y() * angles.y);
    Matrix3::from_columns(&[about_b * Vector3::x(), about_c * Vector3::y(), Vector3::z()])
}

/// Returns the unit vector of a direction of any length, even denormal.
fn direction(given: [f64; 3]) -> Vector3<f64> {
    let given = Vector3::from(given);
    (given / given.amax()).normalize()
}

/// Returns the vector from the center of a leg's ring, at `centre` in base, to the strut's end on it; 0 for a leg
/// without ring. The ring's own X and Y rotate toward the base anchor.
pub fn along_ring(
    leg: &LegGeometry,
    centre: &Vector3<f64>,
    rotation: &Matrix3<f64>,
) -> Vector3<f64> {
    let LegKind::Ring(ring) = leg.kind else { return Vector3::zeros() };
    let seen = rotation.transpose() * (Vector3::from(leg.base) - centre);
    let turn = seen.y.atan2(seen.x);
    rotation * (Vector3::new(turn.cos(), turn.sin(), 0.0) * ring.radius)
}

/// Returns the anchor and length that a joint value sets.
pub fn rod(leg: &LegGeometry, q: f64) -> Rod {
    let g = Vector3::from(leg.base);
    match leg.kind {
        LegKind::Strut(_) | LegKind::Ring(_) => {
            Rod { anchor: g, length: q, onwards: Vector3::zeros() }
        }
        LegKind::Slider(s) => {
            let e = direction(s.guide);
            Rod { anchor: g + e * q, length: s.rod, onwards: e * -f64::from(s.side) }
        }
        LegKind::Crank(c) => {
            let k = direction(c.axis);
            let arm = Rotation3::new(k * q.to_radians()) * Vector3::from(c.arm);
            let onwards = direction(k.cross(&arm).into()) * -f64::from(c.side);
            Rod { anchor: g + arm, length: c.rod, onwards }
        }
    }
}

/// Returns sine and cosine of a screw's torsion; `None` for a leg without a lead.
fn torsion(leg: &LegGeometry, rotation: &Matrix3<f64>, span: &Vector3<f64>) -> Option<(f64, f64)> {
    let LegKind::Strut(strut) = leg.kind else { return None };
    if strut.lead == 0.0 {
        return None;
    }
    let n = span.normalize();
    let a = direction(strut.base_axis);
    let b = rotation * direction(strut.platform_axis);
    Some((n.dot(&a.cross(&b)), a.dot(&b) - a.dot(&n) * b.dot(&n)))
}
