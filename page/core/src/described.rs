// SPDX-License-Identifier: GPL-2.0-or-later
//! A machine with its limits as a row of numbers.

use kinematics::leg::{CrankGeometry, RingGeometry, SliderGeometry, StrutGeometry};
use kinematics::{
    ConstraintGeometry, Geometry, Layout, LegGeometry, LegKind, Letter, Letters, Limits,
    MAX_CONSTRAINTS, MAX_LEGS, Machine, PerLeg,
};

/// The data to freeze a machine and to judge its poses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Described {
    /// The geometry as given.
    pub geometry: Geometry,
    /// Joint offsets.
    pub offsets: PerLeg,
    /// The limits.
    pub limits: Limits,
}

/// Kinds of legs as numbers.
const STRUT: f64 = 1.0;
const SLIDER: f64 = 2.0;
const CRANK: f64 = 3.0;
const RING: f64 = 4.0;

impl Described {
    /// Writes the numbers in order.
    pub fn write(&self, mut put: impl FnMut(f64)) {
        let mut all = |values: &[f64]| values.iter().for_each(|value| put(*value));
        let layout = self.geometry.layout();
        for letters in [layout.coordinates(), layout.table()] {
            all(&[letters.len() as f64]);
            letters.as_slice().iter().for_each(|letter| all(&[letter.index() as f64]));
        }
        all(&[self.geometry.legs().len() as f64]);
        for LegGeometry { base, platform, kind } in self.geometry.legs() {
            all(base);
            all(platform);
            match kind {
                LegKind::Strut(strut) => {
                    all(&[STRUT, strut.lead]);
                    all(&strut.base_axis);
                    all(&strut.platform_axis);
                }
                LegKind::Slider(slider) => {
                    all(&[SLIDER, slider.rod, f64::from(slider.side)]);
                    all(&slider.guide);
                }
                LegKind::Crank(crank) => {
                    all(&[CRANK, crank.rod, f64::from(crank.side)]);
                    all(&crank.axis);
                    all(&crank.arm);
                }
                LegKind::Ring(ring) => all(&[RING, ring.radius]),
            }
        }
        all(&[self.geometry.constraints().len() as f64]);
        for constraint in self.geometry.constraints() {
            all(&[f64::from(constraint.kind())]);
            for vector in vectors(constraint) {
                all(&vector);
            }
        }
        all(&self.geometry.centre);
        all(&[f64::from(u8::from(self.geometry.home.is_some()))]);
        all(&self.geometry.home.unwrap_or_default());
        all(&self.offsets);
        self.write_limits(all);
    }

    fn write_limits(&self, mut all: impl FnMut(&[f64])) {
        let limits = &self.limits;
        limits.axis.iter().for_each(|range| all(range));
        for joints in [&limits.min, &limits.max, &limits.speed, &limits.acceleration] {
            all(joints);
        }
        for legs in [&limits.base_cone, &limits.platform_cone] {
            all(legs);
        }
        for most in limits.base_pyramid.iter().chain(&limits.platform_pyramid) {
            all(most);
        }
        all(&[limits.tilt, limits.conditioning, limits.clearance]);
    }

    /// Reads a machine that [`Described::write`] wrote; `None` for invalid numbers.
    pub fn read(numbers: &[f64]) -> Option<Self> {
        let mut from = Numbers(numbers);
        let (coordinates, table) = (from.letters()?, from.letters()?);
        let count = from.count(MAX_LEGS)?;
        let mut legs = [None; MAX_LEGS];
        for leg in legs.iter_mut().take(count) {
            *leg = Some(from.leg()?);
        }
        let given = legs.map(|leg| leg.or(legs[0]));
        let mut all = [given[0]?; MAX_LEGS];
        all.iter_mut().zip(given.iter().flatten()).for_each(|(to, leg)| *to = *leg);
        let count_constraints = from.count(MAX_CONSTRAINTS)?;
        let mut constraints = [None; MAX_CONSTRAINTS];
        for constraint in constraints.iter_mut().take(count_constraints) {
            *constraint = Some(from.constraint()?);
        }
        let layout = Layout::new(count, coordinates, table).ok()?;
        let layout = layout.with_constraints(count_constraints).ok()?;
        let mut geometry = Geometry::of_layout(layout, |i| all[i]);
        if let Some(first) = constraints[0] {
            geometry = geometry.with_constraints(|i| constraints[i].unwrap_or(first));
        }
        geometry.centre = from.next()?;
        let has_home = from.one()? == 1.0;
        let home = from.next()?;
        geometry.home = has_home.then_some(home);
        let (offsets, limits) = (from.next()?, from.limits()?);
        from.0.is_empty().then_some(Self { geometry, offsets, limits })
    }

    /// Freezes the machine; `None` if it is refused.
    pub fn freeze(&self) -> Option<Machine> {
        Machine::freeze(&self.geometry, &self.offsets).ok()
    }
}

/// Returns the vectors of a constraint: platform, base, and the normal, 0 for directions that stay square.
fn vectors(constraint: &ConstraintGeometry) -> [[f64; 3]; 3] {
    match *constraint {
        ConstraintGeometry::PointInPlane { platform, base, normal }
        | ConstraintGeometry::PlaneThroughPoint { platform, base, normal } => {
            [platform, base, normal]
        }
        ConstraintGeometry::Square { platform_axis, base_axis } => {
            [platform_axis, base_axis, [0.0; 3]]
        }
    }
}

/// Numbers that remain to be read.
struct Numbers<'a>(&'a [f64]);

impl Numbers<'_> {
    fn next<const N: usize>(&mut self) -> Option<[f64; N]> {
        let (first, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*first)
    }

    fn one(&mut self) -> Option<f64> {
        self.next::<1>().map(|[value]| value)
    }

    fn count(&mut self, most: usize) -> Option<usize> {
        let value = self.one()?;
        let count = value as usize;
        (count as f64 == value && count <= most).then_some(count)
    }

    fn letters(&mut self) -> Option<Letters> {
        let mut text = [0; Letter::ALL.len()];
        let count = self.count(text.len())?;
        for place in text.iter_mut().take(count) {
            let letter = Letter::ALL[self.count(Letter::ALL.len() - 1)?];
            *place = letter.name() as u8;
        }
        if count == 0 { Some(Letters::NONE) } else { Letters::parse(&text[..count]) }
    }

    fn leg(&mut self) -> Option<LegGeometry> {
        let (base, platform) = (self.next()?, self.next()?);
        let kind = self.one()?;
        let kind = if kind == STRUT {
            let lead = self.one()?;
            let (base_axis, platform_axis) = (self.next()?, self.next()?);
            LegKind::Strut(StrutGeometry { base_axis, platform_axis, lead })
        } else if kind == SLIDER {
            let (rod, side) = (self.one()?, self.one()? as i32);
            LegKind::Slider(SliderGeometry { guide: self.next()?, rod, side })
        } else if kind == CRANK {
            let (rod, side) = (self.one()?, self.one()? as i32);
            LegKind::Crank(CrankGeometry { axis: self.next()?, arm: self.next()?, rod, side })
        } else if kind == RING {
            LegKind::Ring(RingGeometry { radius: self.one()? })
        } else {
            return None;
        };
        Some(LegGeometry { base, platform, kind })
    }

    fn constraint(&mut self) -> Option<ConstraintGeometry> {
        let kind = self.one()?;
        let mut next = || self.next();
        let given = match kind {
            1.0 => {
                let (platform, base, normal) = (next()?, next()?, next()?);
                ConstraintGeometry::PointInPlane { platform, base, normal }
            }
            2.0 => {
                let (platform, base, normal) = (next()?, next()?, next()?);
                ConstraintGeometry::PlaneThroughPoint { platform, normal, base }
            }
            3.0 => {
                let (platform_axis, base_axis, _) = (next()?, next()?, next()?);
                ConstraintGeometry::Square { platform_axis, base_axis }
            }
            _ => return None,
        };
        Some(given)
    }

    fn pairs<const N: usize>(&mut self) -> Option<[[f64; 2]; N]> {
        let mut pairs = [[0.0; 2]; N];
        for pair in &mut pairs {
            *pair = self.next()?;
        }
        Some(pairs)
    }

    fn limits(&mut self) -> Option<Limits> {
        Some(Limits {
            axis: self.pairs()?,
            min: self.next()?,
            max: self.next()?,
            speed: self.next()?,
            acceleration: self.next()?,
            base_cone: self.next()?,
            platform_cone: self.next()?,
            base_pyramid: self.pairs()?,
            platform_pyramid: self.pairs()?,
            tilt: self.one()?,
            conditioning: self.one()?,
            clearance: self.one()?,
        })
    }
}
