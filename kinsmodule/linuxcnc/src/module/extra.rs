// SPDX-License-Identifier: GPL-2.0-or-later
//! Extra axes: joints that pass a coordinate of LinuxCNC's pose through, and may carry workpiece, tool or
//! legs. The state between calls is in the machine's own poses; LinuxCNC's are converted here.

use super::Module;
use crate::guard::Programmed;
use kinematics::{
    Cause, Chain, ChainGeometry, ExtraAxes, Fault, Load, MAX_JOINTS, Machine, Matrix3, Pose,
    Vector3, World,
};

/// The frozen chain, and LinuxCNC's poses kept for it.
pub(super) struct Carrying {
    pub(super) chain: Chain,
    given: ChainGeometry,
    /// The pose commanded last, and whether it differs from the one before.
    commanded: World,
    before: World,
    pub(super) has_moved: bool,
    /// The shift of the platform per change of the tool vector, during a tool change.
    pub(super) shift: Matrix3<f64>,
}

impl Carrying {
    /// Creates an empty chain.
    pub(super) fn new(axes: ExtraAxes) -> Self {
        Self::of(Chain::none(axes), ChainGeometry::NONE)
    }

    /// Checks what the extra axes of a machine of this size carry.
    pub(super) fn freeze(given: ChainGeometry, load: &Load, size: f64) -> Result<Self, Fault> {
        Ok(Self::of(Chain::freeze(&given, &load.extra, &load.layout, size)?, given))
    }

    fn of(chain: Chain, given: ChainGeometry) -> Self {
        Self {
            chain,
            given,
            commanded: [0.0; 9],
            before: [0.0; 9],
            has_moved: true,
            shift: Matrix3::zeros(),
        }
    }

    /// Converts LinuxCNC's pose to the machine's, with a tool offset; `machine` is the frozen one, if any.
    #[inline(always)]
    pub(super) fn pose_of(
        &self,
        machine: Option<&Machine>,
        world: &World,
        tool: &Vector3<f64>,
    ) -> Result<Pose, Fault> {
        let pose = match machine {
            Some(machine) => machine.pose_of_world(&self.chain, world, tool),
            None => self.chain.to_machine(world, tool),
        };
        pose.map(Pose::from_degrees)
    }

    /// Computes how far the platform moves if the tool offset changes and the commanded pose stays, for a machine with
    /// constraints whose axes carry something; `None` for any other.
    pub(super) fn travel(
        &self,
        machine: &Machine,
        from: &Vector3<f64>,
        to: &Vector3<f64>,
    ) -> Option<f64> {
        if self.chain.is_empty() || machine.layout().constraints() == 0 {
            return None;
        }
        let place = |tool: &Vector3<f64>| {
            let pose = self.pose_of(Some(machine), &self.commanded, tool)?;
            let own = self.chain.machine_tool(tool);
            let full = machine.full_pose(&pose, &own)?;
            let rotation = full.rotation();
            Ok::<_, Fault>((full.position - own + rotation * own, rotation))
        };
        let (Ok(one), Ok(other)) = (place(from), place(to)) else { return Some(f64::INFINITY) };
        Some((one.0 - other.0).norm() + machine.radius() * (one.1 - other.1).norm())
    }

    /// Keeps a commanded pose.
    #[inline(always)]
    pub(super) fn note(&mut self, world: &World) {
        self.has_moved = self.commanded != *world;
        self.before = self.commanded;
        self.commanded = *world;
    }

    /// Returns LinuxCNC's motion in this cycle, including axes that carry nothing.
    pub(super) fn programmed(&self, period: f64, axes: &ExtraAxes) -> Programmed {
        Programmed::between(&self.before, &self.commanded, period, axes)
    }

    /// Computes the shift of the platform per change of the tool vector at the commanded pose.
    pub(super) fn see_shift(&mut self, pose: &Pose, tool: &Vector3<f64>) {
        self.shift = match self.chain.is_empty() {
            true => pose.rotation() - Matrix3::identity(),
            false => self.tool_shift(tool),
        };
    }

    /// Computes the same with a chain.
    pub(super) fn tool_shift(&self, tool: &Vector3<f64>) -> Matrix3<f64> {
        self.chain.tool_shift(&self.commanded, tool)
    }
}

/// Writes the joints of the extra axes into LinuxCNC's pose.
pub fn write_extra(load: &Load, extra: &[f64], world: &mut World) {
    for (place, value) in load.extra.places().zip(extra) {
        world.get_mut(place).into_iter().for_each(|coordinate| *coordinate = *value);
    }
}

/// Refuses joints of extra axes, the last ones, that are NaN or infinite.
pub fn check_extra(load: &Load, joints: &[f64]) -> Result<(), Fault> {
    match joints.iter().enumerate().find(|(_, value)| !value.is_finite()) {
        None => Ok(()),
        Some((i, value)) => {
            let number = load.first_extra_joint() + i;
            Err(Fault::of_joint(Cause::JointNotFinite, &load.layout, number, *value))
        }
    }
}

/// Writes the joints of the extra axes at LinuxCNC's pose, those beyond legs and tables.
pub fn write_extra_joints(load: &Load, world: &World, joints: &mut [f64]) {
    let extra = joints.iter_mut().skip(load.first_extra_joint()).zip(load.extra.places());
    for (joint, place) in extra {
        *joint = world.get(place).copied().unwrap_or(0.0);
    }
}

/// Writes the derivatives of the joints of the extra axes: 1 for the letter of each.
pub fn write_extra_rows(load: &Load, rows: &mut [World]) {
    let extra = rows.iter_mut().skip(load.first_extra_joint()).zip(load.extra.places());
    extra.filter_map(|(row, place)| row.get_mut(place)).for_each(|rate| *rate = 1.0);
}

/// Returns ∂q/∂(x … w) of legs and table, joint units per machine unit and per degree, row by row.
pub fn pose_rows(
    machine: &Machine,
    chain: &Chain,
    world: &World,
    tool: &Vector3<f64>,
) -> Result<[World; MAX_JOINTS], Fault> {
    let mut rows = [World::default(); MAX_JOINTS];
    let pose = Pose::from_degrees(machine.pose_of_world(chain, world, tool)?);
    let at = machine.at(&pose, &chain.machine_tool(tool))?;
    let (jacobian, rates) = (at.pose_jacobian()?, machine.world_rates(chain, world, tool)?);
    for (to, row) in rows.iter_mut().zip(jacobian.row_iter()) {
        for (to, column) in to.iter_mut().zip(rates.column_iter()) {
            *to = row.iter().zip(column.iter()).map(|(value, rate)| value * rate).sum();
        }
    }
    Ok(rows)
}

impl Module {
    /// Returns whether the pins give the chain that is in force.
    pub(super) fn has_chain_of_pins(&self) -> bool {
        self.pins.give_chain(&self.carrying.given, &self.load)
    }
}
