// SPDX-License-Identifier: GPL-2.0-or-later
//! Extra axes: joints that pass a coordinate of LinuxCNC's pose through, and may carry work, tool or
//! legs. State between calls is of the machine's own poses; LinuxCNC's are translated here.

use super::forward::is_blank;
use super::{Module, is_zero, nanoseconds_if};
use crate::guard::Programmed;
use crate::hal::nanoseconds;
use kinematics::{
    Cause, Chain, ChainGeometry, ExtraAxes, Fault, Jacobian, Joints, Matrix3, Pose, Vector3, World,
    WorldRates,
};

/// What is frozen of the chain, and what is remembered of LinuxCNC's poses where there is one.
pub(super) struct Carrying {
    pub(super) chain: Chain,
    given: ChainGeometry,
    /// The pose commanded last, and whether it differs from the one before.
    commanded: World,
    before: World,
    pub(super) has_moved: bool,
    /// How the platform shifts with the tool vector, while that changes.
    pub(super) shift: Matrix3<f64>,
}

impl Carrying {
    pub(super) fn new(axes: ExtraAxes) -> Self {
        Self {
            chain: Chain::none(axes),
            given: ChainGeometry::NONE,
            commanded: [0.0; 9],
            before: [0.0; 9],
            has_moved: true,
            shift: Matrix3::zeros(),
        }
    }

    fn note(&mut self, world: &World) {
        self.has_moved = self.commanded != *world;
        self.before = self.commanded;
        self.commanded = *world;
    }

    /// LinuxCNC's motion in this cycle, where it is not the machine's own.
    pub(super) fn programmed(&self, period: f64) -> Option<Programmed> {
        let is_other = !self.chain.is_empty();
        is_other.then(|| Programmed::between(&self.before, &self.commanded, period))
    }

    /// Finds how the platform shifts with the tool vector at the commanded pose.
    pub(super) fn see_shift(&mut self, pose: &Pose, tool: &Vector3<f64>) {
        self.shift = match self.chain.is_empty() {
            true => pose.rotation() - Matrix3::identity(),
            false => self.tool_shift(tool),
        };
    }

    /// The same where there is a chain.
    pub(super) fn tool_shift(&self, tool: &Vector3<f64>) -> Matrix3<f64> {
        self.chain.tool_shift(&self.commanded, tool)
    }
}

impl Module {
    /// The extra axes.
    #[inline(always)]
    pub fn extra(&self) -> &ExtraAxes {
        &self.load.extra
    }

    /// Whether LinuxCNC's pose is known to be the machine's.
    #[inline(always)]
    pub fn is_plain(&self) -> bool {
        self.is_plain
    }

    /// The hash of the geometry offered, with what the chain adds.
    #[inline(never)]
    pub(super) fn offered_hash(&self, of_geometry: u32) -> u32 {
        self.pins.chain(&self.load).hash(&self.load.extra, of_geometry)
    }

    /// Refuses what the pins give of the chain. Its frame is gone before it is read again to be taken.
    #[inline(never)]
    pub(super) fn check_chain(&self, size: f64) -> Result<(), Fault> {
        self.offered_chain(size).map(|_| ())
    }

    /// Takes the chain of the pins, which was checked.
    #[inline(never)]
    pub(super) fn take_chain(&mut self, size: f64) {
        self.carrying = Carrying::new(self.load.extra);
        self.carrying.given = self.pins.chain(&self.load);
        if let Ok(chain) = self.offered_chain(size) {
            self.carrying.chain = chain;
        }
        self.is_plain = self.load.is_plain() && self.carrying.chain.is_empty();
        self.tool.set_bare(self.carrying.chain.is_bare());
    }

    fn offered_chain(&self, size: f64) -> Result<Chain, Fault> {
        let given = self.pins.chain(&self.load);
        Chain::freeze(&given, &self.load.extra, &self.load.layout, size)
    }

    /// Whether the pins give the chain that is in force.
    pub(super) fn has_chain_of_pins(&self) -> bool {
        self.pins.give_chain(&self.carrying.given, &self.load)
    }

    /// Takes the coordinates of extra axes and of a second mechanism out of the pose of the tool, where
    /// legs and table hold them at 0. One of an extra axis that is no number leaves a pose that is none,
    /// which is refused as such.
    #[inline(never)]
    pub fn without_extra(&self, world: &World) -> [f64; 6] {
        let mut pose = [world[0], world[1], world[2], world[3], world[4], world[5]];
        for place in self.load.other_places() {
            if let Some(value) = pose.get_mut(place) {
                *value = 0.0;
            }
        }
        let values = self.extra().places().filter_map(|place| world.get(place));
        pose[0] += values.map(|value| value * 0.0).sum::<f64>();
        pose
    }

    /// As [`Module::inverse`], of a machine with extra axes or a work on its platform; joints of extra
    /// axes are not written.
    #[inline(never)]
    pub fn inverse_of(&mut self, world: &World, joints: &mut [f64]) -> Result<(), Fault> {
        let timed = self.is_monitored && self.calls.awaits_command();
        let begin = nanoseconds_if(timed);
        let mut pose = Pose::from_degrees([f64::NAN; 6]);
        let result = match self.prepared(|| !is_zero(world)) {
            Ok(()) if self.pose_is_unknown => Err(Cause::PoseUnknown.into()),
            Ok(()) => self.carried_joints(world, joints, &mut pose),
            Err(fault) => Err(fault),
        };
        if self.calls.awaits_command() {
            self.carrying.note(world);
        }
        self.calls.note_inverse(&pose);
        if timed {
            self.guard.timed_inverse(nanoseconds().wrapping_sub(begin));
        }
        self.answered(result)
    }

    /// Joints of legs and table, and the machine's pose.
    fn carried_joints(
        &self,
        world: &World,
        joints: &mut [f64],
        pose: &mut Pose,
    ) -> Result<(), Fault> {
        let machine = &self.frozen()?.machine;
        let (chain, tool) = (&self.carrying.chain, self.tool_in_effect()?);
        *pose = Pose::from_degrees(chain.to_machine(world, &tool)?);
        machine.inverse_into(pose, &chain.machine_tool(&tool), joints)?;
        self.add_to(joints)
    }

    /// As [`Module::forward`], of a machine with extra axes or a work on its platform: over the seed in
    /// `world`, which may hold NaN. `extra` are the joints of the extra axes.
    #[inline(never)]
    pub fn forward_of(
        &mut self,
        joints: &[f64],
        extra: &[f64],
        world: &mut World,
        address: usize,
    ) -> Result<(), Fault> {
        // A drop-in freezes in its first call, before there is anything to translate with; if it
        // cannot, forward says so.
        let given = self.without_extra(world);
        let _ = self.prepared(|| !(is_zero(joints) && is_blank(&given)));
        let mut pose = match self.frozen() {
            Ok(_) => self.seed_in(world),
            Err(_) => given,
        };
        self.forward(joints, &mut pose, address)?;
        self.write_extra(extra, world);
        let result = self.carrying.chain.to_world(&pose, world, &self.tool.offset());
        if result.is_err() {
            self.note_refusal(address);
        }
        self.recorded(result)
    }

    /// Writes the joints of the extra axes into LinuxCNC's pose.
    pub(super) fn write_extra(&self, extra: &[f64], world: &mut World) {
        for (place, value) in self.load.extra.places().zip(extra) {
            if let Some(coordinate) = world.get_mut(place) {
                *coordinate = *value;
            }
        }
    }

    /// The machine's pose that LinuxCNC's seed is.
    fn seed_in(&self, world: &World) -> [f64; 6] {
        let seed = self.carrying.chain.to_machine(world, &self.tool.offset());
        seed.unwrap_or([f64::NAN; 6])
    }

    /// ∂q/∂(x … c) of legs and table at a pose of LinuxCNC's, with the change of the machine's pose
    /// (x … c) with LinuxCNC's.
    pub fn jacobian_of(&self, world: &World) -> Result<(Jacobian, WorldRates), Fault> {
        let (chain, tool) = (&self.carrying.chain, self.tool_in_effect()?);
        let pose = Pose::from_degrees(chain.to_machine(world, &tool)?);
        let at = self.frozen()?.machine.at(&pose, &chain.machine_tool(&tool))?;
        Ok((at.pose_jacobian()?, chain.rates(world, &tool)))
    }

    /// Orientations of tool and work in base: no state changes, no fault is recorded.
    pub fn frames(&self, joints: &Joints, extra: &[f64]) -> Result<[Matrix3<f64>; 2], Fault> {
        let mut world = [0.0; 9];
        self.write_extra(extra, &mut world);
        let pose = self.pose_of(joints)?.to_degrees();
        Ok(self.carrying.chain.frames(&pose, &world))
    }

    /// Whether joints of extra axes, those behind all others, are numbers.
    pub fn check_extra(&mut self, joints: &[f64], address: usize) -> Result<(), Fault> {
        let Some(i) = joints.iter().position(|value| !value.is_finite()) else { return Ok(()) };
        let number = self.load.first_extra_joint() + i;
        let fault = Fault::of_joint(Cause::JointNotFinite, self.layout(), number, joints[i]);
        self.skip_forward(address);
        self.recorded(Err(fault))
    }

    /// A forward call that is refused for what is not the mechanism's.
    pub fn skip_forward(&mut self, address: usize) {
        self.begin_forward();
        self.has_found = false;
        self.note_refusal(address);
    }

    /// Forward was refused: LinuxCNC may hand its NaN over to inverse.
    pub fn note_refusal(&mut self, address: usize) {
        self.seeds.refuse(address);
        self.refused = true;
        self.pins.fwd_kins_fail.set(true);
    }
}
