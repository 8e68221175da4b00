// SPDX-License-Identifier: GPL-2.0-or-later
//! The rigid machine of the sequence tests (`tests/module/truth/truth.c`), in long double.

use crate::carrying::Carrying;
use crate::module::{Joints, Pose};
use crate::parallel::{Kind, LETTERS, Parallel};
use crate::stub::{self, function};
use std::ffi::c_int;
use std::path::Path;
use std::sync::OnceLock;

/// Center point D and angles of a mechanism: machine units and degrees.
pub type Platform = [f64; 6];

#[repr(C)]
#[derive(Clone, Copy, Default)]
struct CLeg {
    kind: f64,
    base: [f64; 3],
    platform: [f64; 3],
    first: [f64; 3],
    second: [f64; 3],
    rod: f64,
    side: f64,
    lead: f64,
}

#[repr(C)]
#[derive(Clone, Copy, Default)]
struct CMachine {
    legs: f64,
    size: f64,
    radius: f64,
    letters: [f64; 6],
    centre: [f64; 3],
    leg: [CLeg; 8],
    fold: [f64; 8],
}

/// Distance of a pose from singular poses and from the ends of the legs.
#[repr(C)]
#[derive(Clone, Copy, Default, Debug)]
pub struct Look {
    /// Smallest singular value of the rows of the legs, angles at the platform's radius.
    pub sigma: f64,
    /// Its slope in the direction of steepest descent.
    pub curvature: f64,
    /// First-order distance of the singular pose.
    pub distance: f64,
    /// Least margin of a leg to its end (dead point, axis of a joint, ring): 1 is comfortable.
    pub margin: f64,
    /// Sign of the determinant; 0 for more legs than coordinates.
    pub sign: f64,
}

/// Least distances along a path of joints.
#[repr(C)]
#[derive(Clone, Copy, Default, Debug)]
pub struct Followed {
    /// Least distance of a singular pose.
    pub distance: f64,
    /// Least margin of a leg.
    pub margin: f64,
    /// Length of the platform's path.
    pub length: f64,
    pub steps: f64,
}

#[repr(C)]
#[derive(Clone, Copy, Default)]
struct CLink {
    place: f64,
    carries: f64,
    axis: [f64; 3],
    point: [f64; 3],
}

#[repr(C)]
#[derive(Clone, Copy, Default)]
struct CChain {
    count: f64,
    tool: [f64; 3],
    has_holder: f64,
    holder: [f64; 3],
    link: [CLink; 6],
}

type InverseFn = unsafe extern "C" fn(*const CMachine, *const f64, *mut f64, *mut f64) -> c_int;
type FoldFn = unsafe extern "C" fn(*mut CMachine, *const f64);
type LookFn = unsafe extern "C" fn(*const CMachine, *const f64, *const f64, *mut Look);
type SignFn = unsafe extern "C" fn(*const CMachine, *const f64, *const f64) -> c_int;
type MisfitFn = unsafe extern "C" fn(*const CMachine, *const f64, *const f64, *mut f64, *mut f64);
type DistanceFn = unsafe extern "C" fn(*const CMachine, *const f64, *const f64) -> f64;
type FollowFn =
    unsafe extern "C" fn(*const CMachine, *const f64, *mut f64, *const f64, *mut Followed) -> c_int;
type NearFn = unsafe extern "C" fn(*const CMachine, *mut f64, *const f64, f64) -> c_int;
type PoseFn =
    unsafe extern "C" fn(*const CMachine, *const CChain, *const f64, *const f64, *mut f64);

struct Library {
    inverse: InverseFn,
    fold_at: FoldFn,
    look: LookFn,
    sign: SignFn,
    misfit: MisfitFn,
    distance: DistanceFn,
    follow: FollowFn,
    near: NearFn,
    pose: PoseFn,
}

fn library() -> &'static Library {
    static LIBRARY: OnceLock<Library> = OnceLock::new();
    LIBRARY.get_or_init(|| {
        let object = stub::open(Path::new(env!("TRUTH_SO")), false).expect("the library opens");
        macro_rules! find {
            ($($field:ident),*) => {
                Library { $($field: function!(object, concat!("truth_", stringify!($field)), _)
                    .expect(concat!("truth_", stringify!($field)))),* }
            };
        }
        find!(inverse, fold_at, look, sign, misfit, distance, follow, near, pose)
    })
}

/// One mechanism.
#[derive(Clone)]
pub struct Truth {
    machine: CMachine,
    chain: CChain,
}

impl Truth {
    /// Copies the geometry; nut corrections have the folds of its reference pose, or none.
    pub fn new(machine: &Parallel) -> Self {
        let mut own = CMachine {
            legs: machine.legs.len() as f64,
            size: machine.size(),
            // A single leg, or anchors in one point, have no radius: no angle moves then.
            radius: Some(machine.radius()).filter(|r| *r > 0.0).unwrap_or(machine.size()),
            letters: std::array::from_fn(|k| {
                let letter = LETTERS[k].to_uppercase();
                let of_table = if machine.table.contains(&letter) { 2.0 } else { 0.0 };
                if machine.coordinates.contains(&letter) { 1.0 } else { of_table }
            }),
            centre: machine.centre,
            fold: [1.0; 8],
            ..CMachine::default()
        };
        for (to, leg) in own.leg.iter_mut().zip(&machine.legs) {
            let (base, platform) = (leg.base, leg.platform);
            *to = match leg.kind {
                Kind::Strut { base_axis: first, platform_axis: second, lead } => {
                    CLeg { kind: 0.0, base, platform, first, second, lead, ..CLeg::default() }
                }
                Kind::Slider { guide: first, rod, side } => {
                    let side = f64::from(side);
                    CLeg { kind: 1.0, base, platform, first, rod, side, ..CLeg::default() }
                }
                Kind::Crank { axis: first, arm: second, rod, side } => {
                    let side = f64::from(side);
                    CLeg { kind: 2.0, base, platform, first, second, rod, side, ..CLeg::default() }
                }
                Kind::Ring { radius: rod } => {
                    CLeg { kind: 3.0, base, platform, rod, ..CLeg::default() }
                }
            };
        }
        let [x, y, z] = machine.tool;
        let tool = [x, y, z + machine.spindle_offset];
        let mut truth = Self { machine: own, chain: CChain { tool, ..CChain::default() } };
        if let Some(home) = machine.home {
            truth.fold_at(&truth.platform(&home, &[]));
        }
        truth
    }

    /// Adds the axes that carry something.
    pub fn carry(&mut self, carrying: &Carrying) {
        let chain = &mut self.chain;
        let links = carrying.axes.iter().filter(|k| **k > 2);
        let links = links.map(|k| (*k, carrying.given.links[k - 3]));
        for (to, (place, link)) in
            chain.link.iter_mut().zip(links.filter(|(_, link)| link.carries != 0))
        {
            let (carries, axis, point) = (f64::from(link.carries), link.axis, link.point);
            *to = CLink { place: place as f64, carries, axis, point };
            chain.count += 1.0;
        }
        if let Some(holder) = carrying.given.holder {
            (chain.has_holder, chain.holder) = (1.0, holder);
        }
    }

    /// Fixes the folds of the nut corrections at a pose.
    pub fn fold_at(&mut self, pose: &Platform) {
        // SAFETY: both are live and of the library's layout.
        unsafe { (library().fold_at)(&mut self.machine, pose.as_ptr()) }
    }

    pub fn size(&self) -> f64 {
        self.machine.size
    }

    pub fn joints(&self) -> usize {
        let tables = self.machine.letters.iter().filter(|kind| **kind == 2.0).count();
        self.machine.legs as usize + tables
    }

    /// Returns whether legs or a table move a letter.
    pub fn moves(&self, letter: usize) -> bool {
        self.machine.letters[letter] != 0.0
    }

    /// Returns whether it has more legs than coordinates.
    pub fn is_redundant(&self) -> bool {
        let active = self.machine.letters.iter().filter(|kind| **kind == 1.0).count();
        self.machine.legs as usize > active
    }

    /// Returns the joint's unit as a length: a degree of a crank is an arc of its arm.
    pub fn unit(&self, joint: usize) -> f64 {
        match self.machine.leg.get(joint) {
            Some(leg) if joint < self.machine.legs as usize && leg.kind == 2.0 => {
                let [x, y, z] = leg.second;
                x.hypot(y).hypot(z).to_radians()
            }
            _ => 1.0,
        }
    }

    /// Returns center point and angles at one of LinuxCNC's poses; `extra` are indices of extra axes.
    pub fn platform(&self, world: &Pose, extra: &[usize]) -> Platform {
        let angles: [f64; 3] =
            std::array::from_fn(|k| if extra.contains(&(3 + k)) { 0.0 } else { world[3 + k] });
        let mut pose = [0.0; 6];
        // SAFETY: all are live and of the library's layout.
        unsafe {
            let (m, c) = (&self.machine, &self.chain);
            (library().pose)(m, c, world.as_ptr(), angles.as_ptr(), pose.as_mut_ptr());
        }
        pose
    }

    /// Returns the joints of a pose, and the least margin of a leg; `None` if a leg does not reach.
    pub fn inverse(&self, pose: &Platform) -> Option<([f64; 11], f64)> {
        let (mut joints, mut margin) = ([0.0; 11], 0.0);
        // SAFETY: as above; eight legs and three table axes at most.
        let code = unsafe {
            (library().inverse)(&self.machine, pose.as_ptr(), joints.as_mut_ptr(), &mut margin)
        };
        (code == 0 && joints.iter().all(|q| q.is_finite())).then_some((joints, margin))
    }

    /// Returns the pose's distance from singular poses.
    pub fn look(&self, pose: &Platform, joints: &Joints) -> Look {
        let mut look = Look::default();
        // SAFETY: as above.
        unsafe { (library().look)(&self.machine, pose.as_ptr(), joints.as_ptr(), &mut look) };
        look
    }

    /// Returns the sign of the determinant; 1 for least squares.
    pub fn sign(&self, pose: &Platform, joints: &Joints) -> i32 {
        // SAFETY: as above.
        unsafe { (library().sign)(&self.machine, pose.as_ptr(), joints.as_ptr()) }
    }

    /// Returns the largest residual of a leg, and the length of the next Newton step.
    pub fn misfit(&self, pose: &Platform, joints: &Joints) -> (f64, f64) {
        let (mut most, mut next) = (f64::NAN, f64::NAN);
        // SAFETY: as above.
        unsafe {
            let (pose, joints) = (pose.as_ptr(), joints.as_ptr());
            (library().misfit)(&self.machine, pose, joints, &mut most, &mut next);
        }
        (most, next)
    }

    /// Returns the distance of two poses as a length.
    pub fn distance(&self, one: &Platform, other: &Platform) -> f64 {
        // SAFETY: as above.
        unsafe { (library().distance)(&self.machine, one.as_ptr(), other.as_ptr()) }
    }

    /// Follows the straight line of joints from a pose at `from` to `to`; `None` if it does not arrive.
    pub fn follow(
        &self,
        from: &Joints,
        pose: &Platform,
        to: &Joints,
    ) -> (Option<Platform>, Followed) {
        let (mut pose, mut followed) = (*pose, Followed::default());
        // SAFETY: as above.
        let code = unsafe {
            let (from, to, pose) = (from.as_ptr(), to.as_ptr(), pose.as_mut_ptr());
            (library().follow)(&self.machine, from, pose, to, &mut followed)
        };
        ((code == 1).then_some(pose), followed)
    }

    /// Finds the pose of the joints by Newton's method, at most `most` away.
    pub fn near(&self, pose: &Platform, joints: &Joints, most: f64) -> Option<Platform> {
        let mut pose = *pose;
        // SAFETY: as above.
        let code =
            unsafe { (library().near)(&self.machine, pose.as_mut_ptr(), joints.as_ptr(), most) };
        (code == 1).then_some(pose)
    }
}
