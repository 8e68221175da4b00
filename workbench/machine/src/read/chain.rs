// SPDX-License-Identifier: GPL-2.0-or-later
//! The loads of the extra axes, `[CHAIN_L]` and `[PKM]WORK_ON_PLATFORM`, and the resulting range of poses.

use crate::read::error::{Errors, chain_section};
use crate::read::ini::{Ini, IniError};
use crate::read::joints::{Axis, ExtraAxis};
use keys::{chain as of_chain, machine as of_machine};
use kinematics::{
    Carries, Chain, ChainGeometry, Layout, Letter, Link, LinkGeometry, Load, MAX_LINKS,
    POSE_LETTERS, Vector3,
};

/// Parts into which a turn is divided to enclose the swept region: half a degree of a whole turn.
const PARTS: u32 = 720;

/// Returns the letters of the axes that can carry something.
fn letters() -> impl Iterator<Item = char> {
    POSE_LETTERS.into_iter().skip(POSE_LETTERS.len() - MAX_LINKS)
}

/// Returns the chain as given.
pub(super) fn geometry(ini: &Ini, load: &Load, errors: &mut Errors) -> Option<ChainGeometry> {
    errors.of(check_sections(ini, load));
    let holder = errors.of(ini.values("PKM", &of_machine::WORK_ON_PLATFORM));
    let link = |n: usize, errors: &mut Errors| {
        let letter = letters().nth(n)?;
        let is_given = ini.sections().any(|name| name == chain_section(letter));
        if !is_given || !load.extra.letters().any(|extra| extra == letter) {
            return Some(LinkGeometry::PASSING);
        }
        link(ini, letter, load, errors)
    };
    let links = errors.each(MAX_LINKS, link);
    Some(ChainGeometry { links: links?.try_into().ok()?, holder: holder? })
}

/// Refuses a chain for two mechanisms.
pub(super) fn refuse(ini: &Ini) -> Result<(), IniError> {
    if let Some(name) = ini.sections().find(|name| name.starts_with("CHAIN_")) {
        return Err(ini.refuse_section(
            name,
            "extra section: with two mechanisms axes carry nothing; remove it",
        ));
    }
    match ini.first("PKM", of_machine::WORK_ON_PLATFORM.name) {
        Some(entry) => {
            Err(ini
                .refuse(entry, "remove this key: with two mechanisms no platform carries the work"))
        }
        None => Ok(()),
    }
}

/// Checks that only extra axes other than X Y Z, the tool tip, carry anything.
fn check_sections(ini: &Ini, load: &Load) -> Result<(), IniError> {
    for name in ini.sections().filter(|name| name.starts_with("CHAIN_")) {
        let is_it = |letter: &char| name == chain_section(*letter);
        if !load.extra.letters().filter(is_it).any(|letter| letters().any(|l| l == letter)) {
            let expected = "extra section: remove it, or add its letter (A B C U V W) to axes= in \
                            [KINS]KINEMATICS";
            return Err(ini.refuse_section(name, expected));
        }
    }
    Ok(())
}

fn link(ini: &Ini, letter: char, load: &Load, errors: &mut Errors) -> Option<LinkGeometry> {
    let section = chain_section(letter);
    errors.of(ini.check_keys(&section, keys::of_axis(letter)));
    let carries = errors.of(ini.require_word(&section, &of_chain::CARRIES));
    let axis = errors.of(ini.require_values(&section, &of_chain::AXIS));
    let point = match keys::of_axis(letter).any(|key| *key == of_chain::POINT) {
        true => errors.of(ini.require_values(&section, &of_chain::POINT)),
        false => Some([0.0; 3]),
    };
    errors.of(check_home(ini, letter, load));
    Some(LinkGeometry { carries: carries? as i32, axis: axis?, point: point? })
}

/// Checks that every axis of the chain is at 0 in `[TRAJ]HOME`.
fn check_home(ini: &Ini, letter: char, load: &Load) -> Result<(), IniError> {
    let n = load.extra.letters().position(|extra| extra == letter).unwrap_or(0);
    let section = format!("JOINT_{}", load.layout.joints() + n);
    if ini.number_or(&section, "HOME", 0.0)? == 0.0 {
        return Ok(());
    }
    let expected =
        format!("expected 0, because [TRAJ]HOME is the pose with [{}] at 0", chain_section(letter));
    Err(ini.refuse(ini.require(&section, "HOME", &expected)?, &expected))
}

/// An axis-aligned region of points.
#[derive(Clone, Copy)]
struct Region {
    low: Vector3<f64>,
    high: Vector3<f64>,
}

impl Region {
    fn about(middle: Vector3<f64>, half: Vector3<f64>) -> Self {
        Self { low: middle - half, high: middle + half }
    }

    fn middle(&self) -> Vector3<f64> {
        (self.low + self.high) / 2.0
    }

    fn half(&self) -> Vector3<f64> {
        (self.high - self.low) / 2.0
    }

    fn with(self, other: &Self) -> Self {
        Self { low: self.low.inf(&other.low), high: self.high.sup(&other.high) }
    }

    /// Returns a region that contains all points carried by an axis over these values; `sign` −1 for the inverse.
    fn swept(self, link: &Link, range: [f64; 2], sign: f64) -> Self {
        if !link.is_rotary() {
            let ends = range.map(|value| {
                let shift = link.axis * (sign * value);
                Self { low: self.low + shift, high: self.high + shift }
            });
            return ends[0].with(&ends[1]);
        }
        // A whole turn covers everything.
        let width = (range[1] - range[0]).min(360.0);
        let step = width / f64::from(PARTS);
        let (half, arm) = (self.half(), self.middle() - link.point);
        // No point is farther from the axis than the farthest point of the region; nothing moves along the axis.
        let chord = (arm.norm() + half.norm()) * (step / 2.0).to_radians();
        let part = |n: u32| {
            let mut world = [0.0; 9];
            world[link.place] = sign * (range[0] + (f64::from(n) + 0.5) * step);
            let rotation = link.rotation(&world);
            Self::about(link.point + rotation * arm, rotation.abs() * half)
        };
        let all = (1..PARTS).fold(part(0), |all, n| all.with(&part(n)));
        let across = link.axis.map(|part| (1.0 - part * part).max(0.0).sqrt());
        Self::about(all.middle(), all.half() + across * chord)
    }
}

/// Computes limits of the machine's own coordinates from those of LinuxCNC's, without a tool: the
/// smallest region that is guaranteed to contain every pose.
pub(super) fn machine_axes(
    chain: &Chain,
    axes: &[Axis],
    extra: &[ExtraAxis],
    layout: &Layout,
    spindle: &Vector3<f64>,
) -> Vec<Axis> {
    if chain.is_empty() {
        return axes.to_vec();
    }
    let mut machine = axes.to_vec();
    let is_bounded = |axis: &Axis| axis.min.is_finite() && axis.max.is_finite();
    let range_of = |link: &Link| {
        let letter = POSE_LETTERS[link.place];
        let axis = extra.iter().find(|axis| axis.letter == letter);
        axis.map_or([0.0; 2], |axis| {
            [axis.axis.min.max(axis.joint.min), axis.axis.max.min(axis.joint.max)]
        })
    };
    let place = axes[..3].iter().all(is_bounded).then(|| {
        let ends = |of: fn(&Axis) -> f64| Vector3::from_fn(|k, _| of(&axes[k]));
        let tips = Region { low: ends(|axis| axis.min), high: ends(|axis| axis.max) };
        let tips = Region { low: tips.low - spindle, high: tips.high - spindle };
        let work = chain.of(Carries::Work).rev();
        let tips = work.fold(tips, |tips, link| tips.swept(link, range_of(link), 1.0));
        let seen_from_legs = |tips: Region| {
            chain.of(Carries::Legs).fold(tips, |tips, link| tips.swept(link, range_of(link), -1.0))
        };
        let point = Region { low: -spindle, high: -spindle };
        let tool = chain.of(Carries::Tool).rev();
        let point = tool.fold(point, |point, link| point.swept(link, range_of(link), 1.0));
        // The tool vector from there is −point.
        match chain.holder() {
            Some(holder) => {
                let place = seen_from_legs(Region::about(holder + point.middle(), point.half()));
                let arms = turned(tips, axes, layout);
                Region { low: place.low - arms.high, high: place.high - arms.low }
            }
            None if !chain.is_bare() => {
                let place = seen_from_legs(tips);
                Region { low: place.low + spindle, high: place.high + spindle }
            }
            None => {
                let (place, arms) = (seen_from_legs(tips), turned(point, axes, layout));
                Region { low: place.low - arms.high, high: place.high - arms.low }
            }
        }
    });
    for k in 0..3 {
        machine[k].min = place.map_or(f64::NEG_INFINITY, |place| place.low[k]);
        machine[k].max = place.map_or(f64::INFINITY, |place| place.high[k]);
    }
    machine
}

/// Returns the region swept by a region of the platform as A, B and C turn within their limits, successively
/// about the axes of base.
fn turned(region: Region, axes: &[Axis], layout: &Layout) -> Region {
    (0..3).fold(region, |region, k| {
        let (place, axis) = (k + 3, Vector3::ith(k, 1.0));
        let link = Link { place, carries: Carries::Tool, axis, point: Vector3::zeros() };
        let range = match axes[place] {
            _ if layout.is_dependent(Letter::ALL[place]) => [-180.0, 180.0],
            _ if layout.is_held(Letter::ALL[place]) => [0.0; 2],
            Axis { min, max, .. } if min.is_finite() && max.is_finite() => [min, max],
            _ => [-180.0, 180.0],
        };
        region.swept(&link, range, 1.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turn(place: usize, axis: [f64; 3], point: [f64; 3]) -> Link {
        Link { place, carries: Carries::Work, axis: axis.into(), point: point.into() }
    }

    #[test]
    fn what_a_turning_box_sweeps_is_enclosed_and_hardly_more() {
        let region = Region::about(Vector3::new(10.0, 0.0, 5.0), Vector3::new(30.0, 20.0, 1.0));
        let swept = region.swept(&turn(5, [0.0, 0.0, 1.0], [0.0; 3]), [-36_000.0, 36_000.0], 1.0);
        let radius = 40.0_f64.hypot(20.0);
        for k in 0..2 {
            // The enclosure exceeds the radius by at most a share of a whole turn's chord, 0.5 degrees of arc.
            assert!(swept.high[k] >= radius && swept.high[k] < 1.01 * radius, "{:?}", swept.high);
            assert!(swept.low[k] <= -radius && swept.low[k] > -1.01 * radius, "{:?}", swept.low);
        }
        let quarter = region.swept(&turn(5, [0.0, 0.0, 1.0], [0.0; 3]), [0.0, 90.0], 1.0);
        // x = 40 cos e + 20 sin e at most, and −20 (cos e + sin e) at least.
        assert!(quarter.high.x >= radius && quarter.low.x < -28.2 && quarter.low.x > -28.8);
        let slide = Link { place: 8, ..turn(8, [0.0, 0.0, 1.0], [0.0; 3]) };
        let slid = region.swept(&slide, [-3.0, 7.0], -1.0);
        assert_eq!([slid.low.z, slid.high.z], [4.0 - 7.0, 6.0 + 3.0]);
    }
}
