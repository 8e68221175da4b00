// SPDX-License-Identifier: GPL-2.0-or-later
//! The core with arbitrary geometry, pose, seed, joints, tool and settings: nothing panics,
//! no success has a value that is not finite, and results satisfy the equations.

use crate::Bytes;
use crate::common::Case;
use crate::common::machines::{declared, genhexkins_case, with_legs};
use crate::common::reference::Tracker;
use kinematics::{
    Fault, Geometry, Joints, LegGeometry, LegKind, Machine, Method, Pose, Solver, Vector3,
};
use std::cell::LazyCell;

thread_local! {
    static MACHINES: LazyCell<Vec<Case>> = LazyCell::new(|| {
        let mut machines = declared();
        machines.push(genhexkins_case());
        machines
    });
}

/// Beyond this many sizes, rounding of the joints of a pose is significant relative to the size.
const FAR: f64 = 100.0;

/// Tolerance of a round trip, relative to size: a pose that is not refused as nearly
/// singular amplifies the rounding of joints (1e-14 of FAR sizes) by 1e6 at most.
const ROUND_TRIP: f64 = 1e-6;

/// Changes some values of the geometry.
fn changed(given: &Geometry, bytes: &mut Bytes) -> Geometry {
    let mut legs = given.legs().to_vec();
    let (mut centre, mut home) = (given.centre, given.home);
    for _ in 0..bytes.below(6) {
        let count = legs.len();
        let which = bytes.below(count + 2);
        let component = bytes.below(13);
        match legs.get_mut(which) {
            Some(leg) => change_leg(leg, component, bytes),
            None if which == count => change(&mut centre[component % 3], bytes),
            None if component == 12 => home = None,
            None => home.iter_mut().for_each(|home| change(&mut home[component % 6], bytes)),
        }
    }
    let mut geometry = with_legs(given, &legs);
    (geometry.centre, geometry.home) = (centre, home);
    geometry
}

fn change(value: &mut f64, bytes: &mut Bytes) {
    *value = bytes.number(*value, 100.0);
}

fn change_leg(leg: &mut LegGeometry, component: usize, bytes: &mut Bytes) {
    let k = component % 3;
    match (component / 3, &mut leg.kind) {
        (0, _) => change(&mut leg.base[k], bytes),
        (1, _) => change(&mut leg.platform[k], bytes),
        (2, LegKind::Strut(strut)) => change(&mut strut.base_axis[k], bytes),
        (3, LegKind::Strut(strut)) => change(&mut strut.platform_axis[k], bytes),
        (_, LegKind::Strut(strut)) => change(&mut strut.lead, bytes),
        (2, LegKind::Slider(slider)) => change(&mut slider.guide[k], bytes),
        (3, LegKind::Slider(slider)) => slider.side = bytes.below(5) as i32 - 2,
        (_, LegKind::Slider(slider)) => change(&mut slider.rod, bytes),
        (2, LegKind::Crank(crank)) => change(&mut crank.axis[k], bytes),
        (3, LegKind::Crank(crank)) => change(&mut crank.arm[k], bytes),
        (_, LegKind::Crank(crank)) if k == 0 => crank.side = bytes.below(5) as i32 - 2,
        (_, LegKind::Crank(crank)) => change(&mut crank.rod, bytes),
        (_, LegKind::Ring(ring)) => change(&mut ring.radius, bytes),
    }
}

fn pose(usual: &Pose, size: f64, bytes: &mut Bytes) -> Pose {
    let usual = usual.to_degrees();
    let spread = |k: usize| if k < 3 { 0.1 * size } else { 20.0 };
    Pose::from_degrees(std::array::from_fn(|k| bytes.number(usual[k], spread(k))))
}

fn tool(size: f64, bytes: &mut Bytes) -> Vector3<f64> {
    match bytes.byte() {
        0..=127 => Vector3::zeros(),
        _ => Vector3::from_fn(|_, _| bytes.number(0.0, 0.1 * size)),
    }
}

fn solver(bytes: &mut Bytes) -> Solver {
    let mut solver = Solver::default();
    match bytes.byte() {
        0..=191 => {}
        192..=207 => solver.convergence_criterion = bytes.number(1e-9, 1.0),
        208..=223 => solver.limit_iterations = bytes.below(400) as u32,
        224..=239 => solver.residual_limit = bytes.number(0.0, 1.0),
        _ => solver.method = Method::PlainNewton,
    }
    solver
}

/// The inputs of all calculations of a machine.
struct Question<'a> {
    machine: &'a Machine,
    tool: Vector3<f64>,
    solver: Solver,
}

impl Question<'_> {
    /// Checks all calculations without a seed.
    fn at(&self, pose: &Pose) -> Result<Joints, Fault> {
        let (machine, tool) = (self.machine, &self.tool);
        let joints = machine.inverse(pose, tool)?;
        assert!(joints.iter().all(|q| q.is_finite()), "{joints:?}");
        let at = machine.at(pose, tool)?;
        let corrections = at.corrections();
        assert!(corrections.iter().all(|c| c.is_finite()), "{corrections:?}");
        for rows in [at.inverse_jacobian(), at.pose_jacobian()] {
            assert!(rows.is_ok_and_finite(), "{rows:?} at {pose:?} with {tool:?}");
        }
        let _ = (at.segments(), at.assembly());
        Ok(joints)
    }

    /// Runs forward, and checks its result against the equations of the reference tracker.
    fn back(&self, joints: &Joints, seed: &Pose, tracker: Option<&Tracker>) -> Option<Pose> {
        let found = self.machine.forward(joints, seed, &self.tool, &self.solver).ok()?;
        assert!(found.pose.is_finite(), "{found:?}");
        assert!(found.residual.is_finite(), "{found:?}");
        let usual = self.solver == Solver::default() && self.tool == Vector3::zeros();
        let square = !self.machine.layout().is_redundant();
        if let Some(tracker) = tracker.filter(|_| usual && square) {
            let fit = tracker.holds(&found.pose, joints);
            assert!(fit, "{joints:?} do not fit {found:?} from {seed:?}");
        }
        Some(found.pose)
    }
}

trait Finite {
    /// Returns whether it is refused, or all elements are finite.
    fn is_ok_and_finite(&self) -> bool;
}

impl Finite for Result<kinematics::Jacobian, Fault> {
    fn is_ok_and_finite(&self) -> bool {
        self.as_ref().map_or(true, |rows| rows.iter().all(|x| x.is_finite()))
    }
}

fn ask(case: &Case, bytes: &mut Bytes) {
    let geometry = changed(&case.geometry, bytes);
    let offset = match bytes.byte() {
        0..=223 => [0.0; 8],
        // Larger ones would absorb the digits of the joint that they are added to.
        _ => std::array::from_fn(|_| bytes.number(0.0, 1.0).clamp(-FAR, FAR)),
    };
    let Ok(machine) = Machine::freeze(&geometry, &offset) else { return };
    let size = machine.size();
    // The tracker needs a reference pose, supports no offsets, and defines all poses
    // about the center.
    let centred = geometry.centre.iter().all(|c| c.abs() <= FAR * size);
    let tracked = geometry.home.is_some() && offset == [0.0; 8] && centred;
    let tracker = tracked.then(|| Tracker::new(&geometry));
    let question = Question { machine: &machine, tool: tool(size, bytes), solver: solver(bytes) };
    let pose = pose(&case.home, case.machine.size(), bytes);
    if let Ok(joints) = question.at(&pose) {
        let near = pose.position.norm().max(question.tool.norm()) <= FAR * size
            && joints.iter().take(geometry.legs().len()).all(|q| q.abs() <= FAR * size);
        let certified = question.solver.method == Method::Certified;
        let found = question.back(&joints, &pose, tracker.as_ref());
        if let Some(found) = found.filter(|_| near && certified) {
            let apart = found.distance(&pose, machine.radius()) / size;
            assert!(apart <= ROUND_TRIP, "{apart:e} from {pose:?} to {found:?}");
        }
        question.back(&joints, &case.home, tracker.as_ref());
    }
    let usual = case.joints(&case.home);
    let joints: Joints = std::array::from_fn(|i| bytes.number(usual[i], 0.05 * size));
    question.back(&joints, &pose, tracker.as_ref());
    question.back(&joints, &case.home, tracker.as_ref());
}

/// Tests one machine with inputs from the bytes.
pub fn run(data: &[u8]) {
    let mut bytes = Bytes::new(data);
    MACHINES.with(|machines| ask(&machines[bytes.below(machines.len())], &mut bytes));
}
