// SPDX-License-Identifier: GPL-2.0-or-later
//! The pins from which the kinematics of a mechanism are computed: in real time those of HAL, outside real time the
//! values of a parameter block.

use super::Given;
use super::chain::ChainPins;
use super::constraint::ConstraintPins;
use super::leg::LegPins;
use super::maker::{Maker, Pose6, Source, Vector};
use crate::hal::{Direction, HalError, Pin};
use crate::outside::Table;
use Direction::In;
use kinematics::leg::Kind;
use kinematics::{
    ChainGeometry, Geometry, Load, MAX_CONSTRAINTS, MAX_LEGS, Method, PerLeg, Solver, text,
};

#[repr(C)]
pub struct MachinePins {
    legs: [LegPins; MAX_LEGS],
    constraints: [ConstraintPins; MAX_CONSTRAINTS],
    screw_lead: Pin<f64>,
    home: Pose6,
    centre: Vector,
    spindle_offset: Pin<f64>,
    pub(super) tool_offset: Pin<f64>,
    convergence_criterion: Pin<f64>,
    limit_iterations: Pin<u32>,
    residual_limit: Pin<f64>,
    chain: ChainPins,
    /// In HAL an output, in a parameter block an input.
    pub kinematics_hash: Pin<u32>,
}

impl MachinePins {
    /// Adds the pins to a table of parameters. Returns whether the necessary ones fit; cardan axes, `centre` and the chain
    /// are left out if they do not fit, and then a machine that has them has another hash.
    pub fn describe(&mut self, table: &'static Table, make: &Maker, load: &Load) -> bool {
        let made = self
            .create_legs(make, load)
            .and_then(|()| self.create_hash(make, In))
            .and_then(|()| self.create_common(make))
            .and_then(|()| self.create_pose(make));
        table.mark_tool();
        // Only legs beyond the coordinates can contradict each other.
        if load.layout.is_redundant() {
            let _ = self.create_residual_limit(make);
        }
        if !table.has_room_for(0) {
            return false;
        }
        let struts = load.kinds().iter().filter(|kind| **kind == Kind::Strut).count();
        if table.has_room_for(6 * struts) {
            let _ = self.create_axes(make, load);
        }
        if table.has_room_for(self.centre.len()) {
            let _ = self.create_centre(make);
        }
        if table.has_room_for(ChainPins::count(load)) {
            let _ = self.chain.create(make, load);
        }
        made.is_ok()
    }

    /// Creates the pins of cardan axes.
    pub(super) fn create_axes(&mut self, make: &Maker, load: &Load) -> Result<(), HalError> {
        let legs = self.legs.iter_mut().zip(load.kinds()).enumerate();
        legs.into_iter().try_for_each(|(n, (leg, kind))| leg.create_axes(make, n, *kind))
    }

    /// Creates the pins of legs without those of cardan axes, and of constraints.
    pub(super) fn create_legs(&mut self, make: &Maker, load: &Load) -> Result<(), HalError> {
        let legs = self.legs.iter_mut().zip(load.kinds()).enumerate();
        legs.into_iter().try_for_each(|(n, (leg, kind))| leg.create(make, n, *kind))?;
        let constraints = self.constraints.iter_mut().enumerate();
        constraints.take(load.layout.constraints()).try_for_each(|(n, pins)| pins.create(make, n))
    }

    /// Creates the reference pose, and the offsets of spindle and tool, that of the tool last.
    pub(super) fn create_pose(&mut self, make: &Maker) -> Result<(), HalError> {
        let name = |name: &str| text![make.stem(), name];
        make.letters(&mut self.home, In, name("home."), [f64::NAN; 6])?;
        make.one(&mut self.spindle_offset, In, name("spindle-offset"), 0.0)?;
        make.one(&mut self.tool_offset, In, name("tool-offset"), 0.0)
    }

    pub(super) fn create_centre(&mut self, make: &Maker) -> Result<(), HalError> {
        make.letters(&mut self.centre, In, text![make.stem(), "centre."], [0.0; 3])
    }

    /// Creates pins that a module has once, regardless of the number of mechanisms.
    pub(super) fn create_common(&mut self, make: &Maker) -> Result<(), HalError> {
        make.one(&mut self.screw_lead, In, text!["pkmkins.screw-lead"], 0.0)?;
        let criterion = &mut self.convergence_criterion;
        make.one(criterion, In, text!["pkmkins.convergence-criterion"], 1e-9)?;
        make.one(&mut self.limit_iterations, In, text!["pkmkins.limit-iterations"], 120)
    }

    pub(super) fn create_residual_limit(&mut self, make: &Maker) -> Result<(), HalError> {
        make.one(&mut self.residual_limit, In, text!["pkmkins.residual-limit"], 0.0)
    }

    pub(super) fn create_chain(&mut self, make: &Maker, load: &Load) -> Result<(), HalError> {
        self.chain.create(make, load)
    }

    pub(super) fn create_hash(
        &mut self,
        make: &Maker,
        direction: Direction,
    ) -> Result<(), HalError> {
        let name = text![make.stem(), "kinematics-hash"];
        make.one(&mut self.kinematics_hash, direction, name, 0)
    }

    /// Uses the pins that both mechanisms share, from those of the first.
    pub(super) fn share(&self, first: &Self) {
        self.screw_lead.share(&first.screw_lead);
        self.convergence_criterion.share(&first.convergence_criterion);
        self.residual_limit.share(&first.residual_limit);
        self.limit_iterations.share(&first.limit_iterations);
    }

    /// Reads the pins that affect the joint values, except the tool.
    #[inline(always)]
    pub fn given(&self, load: &Load, from: &impl Source) -> Given {
        let common_lead = from.get(&self.screw_lead);
        let kind = |i: usize| load.kinds().get(i).copied().unwrap_or(Kind::Strut);
        let mut geometry = Geometry::of_layout(load.layout, |i| {
            self.legs[i.min(MAX_LEGS - 1)].given(kind(i), common_lead, from)
        });
        if load.layout.constraints() > 0 {
            geometry = geometry
                .with_constraints(|i| self.constraints[i.min(MAX_CONSTRAINTS - 1)].given(from));
        }
        geometry.centre = from.row(&self.centre);
        // All NaN is the default and means that no reference pose was given.
        let home = from.row(&self.home);
        let home = (!home.iter().all(|v| v.is_nan())).then_some(home);
        let holder = self.chain.holder(from);
        geometry.home = home.map(|home| ChainGeometry::machine_home(holder, home));
        let mut offset = [0.0; MAX_LEGS];
        for (value, leg) in offset.iter_mut().zip(&self.legs).take(load.layout.legs()) {
            *value = from.get(&leg.offset);
        }
        Given { geometry, offset, spindle_offset: from.get(&self.spindle_offset) }
    }

    /// Reads what the extra axes carry.
    pub fn chain(&self, load: &Load, from: &impl Source) -> ChainGeometry {
        self.chain.given(load, from)
    }

    pub(super) fn give_chain(&self, frozen: &ChainGeometry, load: &Load) -> bool {
        self.chain.give(frozen, load)
    }

    /// Reads the solver settings.
    pub fn solver(&self, from: &impl Source) -> Solver {
        Solver {
            convergence_criterion: from.get(&self.convergence_criterion),
            limit_iterations: from.get(&self.limit_iterations),
            residual_limit: from.get(&self.residual_limit),
            method: Method::Certified,
        }
    }

    pub(super) fn show_corrections(&self, load: &Load, corrections: &PerLeg) {
        for ((leg, kind), value) in self.legs.iter().zip(load.kinds()).zip(corrections) {
            if *kind == Kind::Strut {
                leg.correction.set(*value);
            }
        }
    }
}
