// SPDX-License-Identifier: GPL-2.0-or-later
//! Extra axes that carry the work, the tool or the legs: conversion between LinuxCNC's pose and the
//! machine's pose.
//!
//! A pose t of LinuxCNC is the position of the tool tip on the *work*, plus the tool vector o: X Y Z
//! are in the frame of the work, and each rotary letter is the angle of the part that it rotates. The
//! machine of legs and table needs the pose of its platform. The axes of the chain connect the two.
//! An axis moves a point x that it carries to
//! ```text
//! G(x) = c + rot(a, e) (x − c)   (rotary: direction a, point c, angle e),   G(x) = x + a e   (linear)
//! ```
//!
//! With the axes in the order of `axes=`, from the carrier outwards, and R the orientation of
//! the platform, the tip on the work, the tip at the platform and the position of the platform are
//!
//! ```text
//! w = G₁ G₂ … (t − o)                 axes that carry the work
//! o' = −G₁ G₂ … (−o)                  axes that carry the tool
//! P = (G₁ G₂ …)⁻¹ (w) + R o'          axes that carry the legs; tools on the platform, work in base
//! P = (G₁ G₂ …)⁻¹ (c₀ − o') − R w     the work on the platform, tools in base with their holder at c₀
//! ```
//!
//! With constraints, R may depend on P. Then the pose whose tool vector is o' gives R first, see the module `carried`.
//!
//! At e = 0 every G is the identity, and a machine without such axes needs no conversion:
//! its control point is at t = P + o − R o. The machine receives that pair (control point, o) also
//! if no axis carries the tool and the tools are on the platform; otherwise it receives (P, 0).

mod given;
mod link;

pub use given::{Carries, ChainGeometry, LinkGeometry};
pub use link::Link;

use crate::extra::{ExtraAxes, POSE_LETTERS};
use crate::fault::{Cause, Fault, MachinePart};
use crate::geometry::FARTHEST;
use crate::lanes::are_within;
use crate::layout::Layout;
use crate::leg::direction;
use crate::letters::Letter;
use crate::pose::Pose;
use crate::trig::{MAX_ANGLE_DEG, RADIANS};
pub(crate) use link::Moving;
use nalgebra::{Matrix3, SMatrix, Vector3};

/// A pose of LinuxCNC: X Y Z A B C U V W, machine units and degrees.
pub type World = [f64; 9];

/// Derivatives of the machine's pose (rows X … C) by every letter of LinuxCNC's pose, angles in degrees.
pub type WorldRates = SMatrix<f64, 6, 9>;

/// Largest number of axes in a chain: A B C rotate, U V W slide. X Y Z are the tool tip.
pub const MAX_LINKS: usize = 6;

/// Index of the first of them among [`POSE_LETTERS`].
const FIRST: usize = 3;

/// Returns whether the letter at an index of [`POSE_LETTERS`] is an angle.
const fn is_rotary(place: usize) -> bool {
    place < FIRST + 3
}

/// The quantity that changes at a rate of 1.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Varied {
    Nothing,
    /// A letter of LinuxCNC's pose, in radians if rotary.
    Letter(usize),
    /// A component of the tool vector.
    Tool(usize),
}

impl Varied {
    fn letter(self, place: usize) -> f64 {
        if self == Self::Letter(place) { 1.0 } else { 0.0 }
    }

    /// Returns the rate of the tip's position on the work, t − o.
    fn of_tip(self) -> Vector3<f64> {
        match self {
            Self::Letter(k) if k < 3 => unit(k),
            Self::Tool(k) => -unit(k),
            _ => Vector3::zeros(),
        }
    }

    fn of_tool(self) -> Vector3<f64> {
        match self {
            Self::Tool(k) => unit(k),
            _ => Vector3::zeros(),
        }
    }
}

fn unit(k: usize) -> Vector3<f64> {
    Vector3::from_fn(|i, _| if i == k { 1.0 } else { 0.0 })
}

/// The checked, frozen chain.
#[derive(Clone, Debug, PartialEq)]
pub struct Chain {
    axes: ExtraAxes,
    links: [Link; MAX_LINKS],
    count: usize,
    holder: Option<Vector3<f64>>,
    /// Whether the machine's own tool vector is 0.
    is_bare: bool,
    /// Whether axes carry the tool on a platform whose orientation depends on its position.
    follows: bool,
}

impl Chain {
    /// Creates a chain of extra axes that carry nothing.
    pub const fn none(axes: ExtraAxes) -> Self {
        Self {
            axes,
            links: [Link::NONE; MAX_LINKS],
            count: 0,
            holder: None,
            is_bare: false,
            follows: false,
        }
    }

    /// Checks what the extra axes of a machine with this layout and size carry, and freezes the chain.
    ///
    /// # Errors
    /// [`Cause::ChainUnknown`], [`Cause::ChainAxisZero`], [`Cause::ChainNotFinite`],
    /// [`Cause::ChainTooFar`] with the axis named; as [`ChainGeometry::check_holder`], and
    /// [`Cause::HolderTooFar`]; [`Cause::ChainConstrained`] for work on a platform with constraints, and for axes that
    /// carry something where constraints determine X, Y or Z and no table compensates it: the frames of work and legs
    /// need the position of the tip.
    pub fn freeze(
        given: &ChainGeometry,
        axes: &ExtraAxes,
        layout: &Layout,
        size: f64,
    ) -> Result<Self, Fault> {
        ChainGeometry::check_holder(given.holder)?;
        let mut chain = Self::none(*axes);
        if layout.constraints() > 0 && given.holder.is_some() {
            return Err(Cause::ChainConstrained.into());
        }
        for (n, place) in axes.places().enumerate() {
            let refused = |cause, value| {
                let letter = POSE_LETTERS.get(place).map_or(0, |letter| *letter as u8);
                let part = Some(MachinePart::ExtraAxis((layout.joints() + n) as u8, letter));
                Err(Fault { cause, part, value })
            };
            let Some(given) = given.link(place).filter(|given| given.carries != 0) else {
                continue;
            };
            let is_open = [Letter::X, Letter::Y, Letter::Z].into_iter().any(|l| layout.is_held(l));
            if layout.constraints() > 0 && is_open {
                return refused(Cause::ChainConstrained, 0.0);
            }
            let Some(carries) =
                usize::try_from(given.carries - 1).ok().and_then(|i| Carries::ALL.get(i))
            else {
                return refused(Cause::ChainUnknown, f64::from(given.carries));
            };
            let point =
                if is_rotary(place) { Vector3::from(given.point) } else { Vector3::zeros() };
            if !given.axis.iter().chain(point.iter()).all(|value| value.is_finite()) {
                return refused(Cause::ChainNotFinite, 0.0);
            }
            let Some(axis) = direction(&given.axis) else {
                return refused(Cause::ChainAxisZero, 0.0);
            };
            if !(point.amax() <= FARTHEST * size) {
                return refused(Cause::ChainTooFar, point.amax());
            }
            if let Some(free) = chain.links.get_mut(chain.count) {
                *free = Link { place, carries: *carries, axis, point };
                chain.count += 1;
            }
        }
        chain.holder = checked_holder(given.holder, size)?;
        chain.is_bare = chain.holder.is_some() || chain.of(Carries::Tool).next().is_some();
        chain.follows = layout.constraints() > 0 && chain.is_bare;
        Ok(chain)
    }

    /// Returns whether LinuxCNC's pose equals the machine's, except for axes that pass through.
    pub fn is_empty(&self) -> bool {
        self.count == 0 && self.holder.is_none()
    }

    /// Returns its axes, in joint order.
    pub fn links(&self) -> &[Link] {
        self.links.get(..self.count).unwrap_or(&self.links)
    }

    /// Returns the axes that carry `carried`, from the carrier outwards.
    pub fn of(&self, carried: Carries) -> impl DoubleEndedIterator<Item = &Link> {
        self.links().iter().filter(move |link| link.carries == carried)
    }

    /// Returns the position in base of the fixed tool holder's control point, if the work is on the platform.
    pub fn holder(&self) -> Option<&Vector3<f64>> {
        self.holder.as_ref()
    }

    /// Returns whether the machine's own tool vector is 0, so that its pose is that of the platform.
    pub fn is_bare(&self) -> bool {
        self.is_bare
    }

    /// Returns the tool vector of the machine's poses.
    pub fn machine_tool(&self, tool: &Vector3<f64>) -> Vector3<f64> {
        if self.is_bare { Vector3::zeros() } else { *tool }
    }

    /// Returns whether the machine's pose also depends on the orientation that its constraints determine: then
    /// [`crate::Machine::pose_of_world`] and its counterparts convert poses.
    pub fn follows(&self) -> bool {
        self.follows
    }

    /// Converts LinuxCNC's pose `world` with tool vector `tool` to the machine's pose, angles in degrees.
    ///
    /// # Errors
    /// [`Cause::PoseNotFinite`], [`Cause::AngleTooLarge`]; [`Cause::ChainConstrained`] if the chain
    /// [follows](Self::follows) the machine's orientation.
    #[inline(always)]
    pub fn to_machine(&self, world: &World, tool: &Vector3<f64>) -> Result<[f64; 6], Fault> {
        let own = self.checked(world)?;
        if self.is_empty() {
            return Ok(own);
        }
        if self.follows {
            return Err(Cause::ChainConstrained.into());
        }
        let pose = self.angles(world);
        let place = self.placed(world, tool, &pose, Varied::Nothing).at;
        let [_, _, _, a, b, c] = pose.degrees;
        Ok([place.x, place.y, place.z, a, b, c])
    }

    /// Writes X Y Z and the angles of LinuxCNC's pose that correspond to the machine's pose; `world`
    /// contains the values of the extra axes.
    ///
    /// # Errors
    /// As [`Self::to_machine`].
    pub fn to_world(
        &self,
        machine: &[f64; 6],
        world: &mut World,
        tool: &Vector3<f64>,
    ) -> Result<(), Fault> {
        self.write(machine, world);
        if self.is_empty() {
            return Ok(());
        }
        if self.follows {
            return Err(Cause::ChainConstrained.into());
        }
        let rotation = Pose::from_degrees(*machine).rotation();
        self.write_world(machine, &rotation, world, tool)
    }

    /// Writes LinuxCNC's pose for the position of the machine's pose and this orientation of the platform.
    pub(crate) fn write_world(
        &self,
        machine: &[f64; 6],
        rotation: &Matrix3<f64>,
        world: &mut World,
        tool: &Vector3<f64>,
    ) -> Result<(), Fault> {
        self.write(machine, world);
        self.checked(world)?;
        let position = Vector3::new(machine[0], machine[1], machine[2]);
        let mut tip = match &self.holder {
            None => {
                let tip = match self.is_bare {
                    true => {
                        position - rotation * self.carried_tool(world, tool, Varied::Nothing).at
                    }
                    false => position - tool,
                };
                self.of(Carries::Legs).rev().fold(tip, |tip, link| link.out(&tip, world))
            }
            Some(holder) => {
                let tip = holder - self.carried_tool(world, tool, Varied::Nothing).at;
                let tip = self.of(Carries::Legs).fold(tip, |tip, link| link.into(&tip, world));
                rotation.tr_mul(&(tip - position))
            }
        };
        tip = self.of(Carries::Work).fold(tip, |tip, link| link.into(&tip, world)) + tool;
        self.write(&[tip.x, tip.y, tip.z], world);
        Ok(())
    }

    /// Computes the derivatives of the machine's pose by every letter of LinuxCNC's.
    pub fn rates(&self, world: &World, tool: &Vector3<f64>) -> WorldRates {
        let pose = self.angles(world);
        let mut rates = WorldRates::zeros();
        for letter in 0..POSE_LETTERS.len() {
            let turns = (FIRST..FIRST + 3).contains(&letter);
            let unit = if turns { RADIANS } else { 1.0 };
            let rate = self.placed(world, tool, &pose, Varied::Letter(letter)).rate * unit;
            for (k, value) in rate.iter().enumerate() {
                if let Some(place) = rates.get_mut((k, letter)) {
                    *place = *value;
                }
            }
            if turns
                && !self.is_extra(letter)
                && let Some(place) = rates.get_mut((letter, letter))
            {
                *place = 1.0;
            }
        }
        rates
    }

    /// Computes how the platform shifts, without rotation, for a change of the tool vector.
    pub fn tool_shift(&self, world: &World, tool: &Vector3<f64>) -> Matrix3<f64> {
        let pose = self.angles(world);
        let mut shift = Matrix3::zeros();
        for k in 0..3 {
            let mut rate = self.placed(world, tool, &pose, Varied::Tool(k)).rate;
            if !self.is_bare {
                rate += pose.rotation * unit(k) - unit(k);
            }
            shift.set_column(k, &rate);
        }
        shift
    }

    /// Returns the orientations in base of the tool and of the work, at a pose of the machine and the values
    /// of the extra axes in `world`.
    pub fn frames(&self, machine: &Pose, world: &World) -> [Matrix3<f64>; 2] {
        let of = |carried| {
            let links = self.of(carried);
            links.fold(Matrix3::identity(), |rotation, link| rotation * link.rotation(world))
        };
        let platform = of(Carries::Legs) * machine.rotation();
        let [tool, work] = [of(Carries::Tool), of(Carries::Work)];
        match self.holder {
            None => [platform * tool, work],
            Some(_) => [tool, platform * work],
        }
    }

    /// Returns the tool tip's part of LinuxCNC's pose, with the coordinates of extra axes set to 0. Refuses
    /// values that are not finite or too large.
    #[inline(always)]
    fn checked(&self, world: &World) -> Result<[f64; 6], Fault> {
        let own = self.own(world);
        // U V W that are not axes are ignored.
        let mut extra = self.axes.places().filter_map(|place| world.get(place));
        if !(are_within(&own, f64::MAX) && extra.all(|value| value.is_finite())) {
            return Err(Cause::PoseNotFinite.into());
        }
        let angles = self.links().iter().filter(|link| link.is_rotary());
        match angles.map(|link| link.value(world)).find(|angle| !(angle.abs() <= MAX_ANGLE_DEG)) {
            Some(angle) => Err(Fault::with_value(Cause::AngleTooLarge, angle)),
            None => Ok(own),
        }
    }

    /// Returns whether the letter at an index of [`POSE_LETTERS`] is an extra axis.
    pub fn is_extra(&self, place: usize) -> bool {
        self.axes.has(place)
    }

    #[inline(always)]
    fn own(&self, world: &World) -> [f64; 6] {
        core::array::from_fn(|place| match world.get(place) {
            Some(value) if !self.is_extra(place) => *value,
            _ => 0.0,
        })
    }

    fn angles(&self, world: &World) -> Angles {
        let degrees = self.own(world);
        let trigonometry = Pose::from_degrees(degrees).trigonometry();
        let rates = trigonometry.rate_map();
        let turns = core::array::from_fn(|i| rates.column(i).into_owned());
        Angles { degrees, rotation: trigonometry.rotation(), turns }
    }

    /// Writes the first coordinates of a pose, except those of extra axes.
    fn write(&self, pose: &[f64], world: &mut World) {
        for (place, (to, value)) in world.iter_mut().zip(pose).enumerate() {
            if !self.is_extra(place) {
                *to = *value;
            }
        }
    }

    /// Returns the tip's part of a pose of LinuxCNC for a machine with tool vector o', and their rates: the position w + o'
    /// of the pose, o', and the angles.
    ///
    /// # Errors
    /// As [`Self::to_machine`].
    pub(crate) fn commanded(
        &self,
        world: &World,
        tool: &Vector3<f64>,
        varied: Varied,
    ) -> Result<([Moving; 2], [f64; 6]), Fault> {
        let own = self.checked(world)?;
        let (tip, carried) = self.tip_and_tool(world, tool, &own, varied);
        let at = Moving { at: tip.at + carried.at, rate: tip.rate + carried.rate };
        Ok(([at, carried], own))
    }

    /// Computes the tool vector as moved by the axes that carry it.
    fn carried_tool(&self, world: &World, tool: &Vector3<f64>, varied: Varied) -> Moving {
        let tip = Moving { at: -tool, rate: -varied.of_tool() };
        let links = self.of(Carries::Tool).rev();
        let tip = links.fold(tip, |tip, link| link.moved(tip, world, varied.letter(link.place)));
        Moving { at: -tip.at, rate: -tip.rate }
    }

    /// Computes the tip as moved by the axes that carry the work.
    #[inline(always)]
    fn tip(&self, world: &World, tool: &Vector3<f64>, own: &[f64; 6], varied: Varied) -> Moving {
        let [x, y, z, ..] = *own;
        let at = Vector3::new(x, y, z) - tool;
        let rate = varied.of_tip();
        let work = self.of(Carries::Work).rev();
        work.fold(Moving { at, rate }, |tip, link| {
            link.moved(tip, world, varied.letter(link.place))
        })
    }

    /// Computes the tip as seen from the base of the legs, and the tool vector as moved by the axes that carry it.
    fn tip_and_tool(
        &self,
        world: &World,
        tool: &Vector3<f64>,
        own: &[f64; 6],
        varied: Varied,
    ) -> (Moving, Moving) {
        let tip = self.of(Carries::Legs).fold(self.tip(world, tool, own, varied), |tip, link| {
            link.seen(tip, world, varied.letter(link.place))
        });
        (tip, self.carried_tool(world, tool, varied))
    }

    /// Computes the position of the machine's pose.
    fn placed(&self, world: &World, tool: &Vector3<f64>, pose: &Angles, varied: Varied) -> Moving {
        let tip = self.tip(world, tool, &pose.degrees, varied);
        let seen_from_legs = |tip| {
            let legs = self.of(Carries::Legs);
            legs.fold(tip, |tip, link| link.seen(tip, world, varied.letter(link.place)))
        };
        let tool_now = self.carried_tool(world, tool, varied);
        if let Some(holder) = &self.holder {
            let tip_now = Moving { at: holder - tool_now.at, rate: -tool_now.rate };
            let (place, arm) = (seen_from_legs(tip_now), pose.turned(tip, varied, self));
            return Moving { at: place.at - arm.at, rate: place.rate - arm.rate };
        }
        let tip = seen_from_legs(tip);
        if !self.is_bare {
            return Moving { at: tip.at + tool, rate: tip.rate + varied.of_tool() };
        }
        let arm = pose.turned(tool_now, varied, self);
        Moving { at: tip.at + arm.at, rate: tip.rate + arm.rate }
    }
}

/// The machine's angles.
struct Angles {
    degrees: [f64; 6],
    rotation: Matrix3<f64>,
    /// Axes about which A, B and C rotate.
    turns: [Vector3<f64>; 3],
}

impl Angles {
    /// Rotates a vector of the platform into base.
    fn turned(&self, vector: Moving, varied: Varied, chain: &Chain) -> Moving {
        let at = self.rotation * vector.at;
        let mut rate = self.rotation * vector.rate;
        for (k, axis) in self.turns.iter().enumerate() {
            if varied == Varied::Letter(FIRST + k) && !chain.is_extra(FIRST + k) {
                rate += axis.cross(&at);
            }
        }
        Moving { at, rate }
    }
}

fn checked_holder(given: Option<[f64; 3]>, size: f64) -> Result<Option<Vector3<f64>>, Fault> {
    let Some(holder) = given.map(Vector3::from) else { return Ok(None) };
    match holder.amax() <= FARTHEST * size {
        true => Ok(Some(holder)),
        false => Err(Fault::with_value(Cause::HolderTooFar, holder.amax())),
    }
}
