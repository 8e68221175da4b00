// SPDX-License-Identifier: GPL-2.0-or-later
//! The pins of a leg: the values of its kind, and the correction of a strut.

use super::maker::{Maker, Source, Vector};
use crate::hal::{Direction, HalError, Pin};
use kinematics::leg::{CrankGeometry, Kind, RingGeometry, SliderGeometry, StrutGeometry};
use kinematics::{LegGeometry, LegKind};

/// Anchors and axes of genhexkins (inches): base, platform, base axis, platform axis.
#[allow(clippy::approx_constant, reason = "genhexkins' own rounding")]
const GENHEXKINS: [[[f64; 3]; 4]; 6] = {
    const D: f64 = 0.707107;
    const P: f64 = 0.866025;
    [
        [[-22.95, 13.25, 0.0], [-1.0, 11.5, 0.0], [D, 0.0, D], [-1.0, 0.0, 0.0]],
        [[22.95, 13.25, 0.0], [1.0, 11.5, 0.0], [0.0, -D, D], [P, 0.5, 0.0]],
        [[22.95, 13.25, 0.0], [10.459, -4.884, 0.0], [-D, 0.0, D], [P, 0.5, 0.0]],
        [[0.0, -26.5, 0.0], [9.459, -6.616, 0.0], [-D, 0.0, D], [P, -0.5, 0.0]],
        [[0.0, -26.5, 0.0], [-9.459, -6.616, 0.0], [0.0, D, D], [P, -0.5, 0.0]],
        [[-22.95, 13.25, 0.0], [-10.459, -4.884, 0.0], [D, 0.0, D], [-1.0, 0.0, 0.0]],
    ]
};

/// Base anchors of pentakins (mm), and radius and height of the rings.
const PENTAKINS: [([f64; 3], [f64; 2]); 5] = [
    ([-418.03, 324.56, 895.56], [80.32, -185.5]),
    ([417.96, 324.56, 895.56], [80.32, -159.5]),
    ([-418.03, -325.44, 895.56], [80.32, -67.5]),
    ([417.96, -325.44, 895.56], [80.32, -41.5]),
    ([-0.06, -492.96, 895.56], [80.32, -14.0]),
];

/// Pins of one leg; those that its kind does not have are not created and never read.
#[repr(C)]
pub(super) struct LegPins {
    base: Vector,
    platform: Vector,
    pub(super) offset: Pin<f64>,
    // Strut.
    base_axis: Vector,
    platform_axis: Vector,
    lead: Pin<f64>,
    pub(super) correction: Pin<f64>,
    // Slider.
    guide: Vector,
    // Crank.
    axis: Vector,
    arm: Vector,
    // Slider and crank.
    rod: Pin<f64>,
    side: Pin<i32>,
    // Ring, instead of the platform anchor: its radius, and its height along the tool axis.
    effector: [Pin<f64>; 2],
}

/// Returns the default anchors and axes: those of genhexkins' machine if it has such a leg, so that its HAL files work.
fn strut_defaults(make: &Maker, n: usize, kind: Kind) -> [[f64; 3]; 4] {
    let drop_in = (kind == Kind::Strut).then(|| make.drop_in(&GENHEXKINS, n)).flatten();
    drop_in.copied().unwrap_or_default()
}

impl LegPins {
    /// Creates its pins without those of a strut's cardan axes.
    pub(super) fn create(&mut self, make: &Maker, n: usize, kind: Kind) -> Result<(), HalError> {
        use Direction::{In, Out};
        let [base, platform, ..] = strut_defaults(make, n, kind);
        if kind != Kind::Ring {
            make.letters(&mut self.base, In, make.of_leg("base", n, "."), base)?;
            make.letters(&mut self.platform, In, make.of_leg("platform", n, "."), platform)?;
        }
        make.one(&mut self.offset, In, make.of_leg("offset", n, ""), 0.0)?;
        match kind {
            Kind::Ring => self.create_ring(make, n),
            Kind::Strut => {
                make.one(&mut self.lead, In, make.of_leg("lead", n, ""), 0.0)?;
                make.one(&mut self.correction, Out, make.of_leg("correction", n, ""), 0.0)
            }
            Kind::Slider => {
                make.letters(&mut self.guide, In, make.of_leg("guide", n, "."), [0.0; 3])?;
                self.create_rod(make, n)
            }
            Kind::Crank => {
                make.letters(&mut self.axis, In, make.of_leg("axis", n, "."), [0.0; 3])?;
                make.letters(&mut self.arm, In, make.of_leg("arm", n, "."), [0.0; 3])?;
                self.create_rod(make, n)
            }
        }
    }

    /// Creates the pins of a strut's cardan axes.
    pub(super) fn create_axes(
        &mut self,
        make: &Maker,
        n: usize,
        kind: Kind,
    ) -> Result<(), HalError> {
        if kind != Kind::Strut {
            return Ok(());
        }
        let [.., base, platform] = strut_defaults(make, n, kind);
        make.letters(&mut self.base_axis, Direction::In, make.of_leg("base-n", n, "."), base)?;
        let axis = &mut self.platform_axis;
        make.letters(axis, Direction::In, make.of_leg("platform-n", n, "."), platform)
    }

    fn create_ring(&mut self, make: &Maker, n: usize) -> Result<(), HalError> {
        use Direction::In;
        // pentakins' machine, so that its HAL files work.
        let (base, effector) = *make.drop_in(&PENTAKINS, n).unwrap_or(&([0.0; 3], [0.0; 2]));
        make.letters(&mut self.base, In, make.of_leg("base", n, "."), base)?;
        let [radius, height] = &mut self.effector;
        make.one(radius, In, make.of_leg("effector", n, ".r"), effector[0])?;
        make.one(height, In, make.of_leg("effector", n, ".z"), effector[1])
    }

    fn create_rod(&mut self, make: &Maker, n: usize) -> Result<(), HalError> {
        use Direction::In;
        make.one(&mut self.rod, In, make.of_leg("rod", n, ""), 0.0)?;
        make.one(&mut self.side, In, make.of_leg("side", n, ""), 0)
    }

    /// Reads the leg from the pins; `common_lead` is that of all struts.
    #[inline(always)]
    pub(super) fn given(&self, kind: Kind, common_lead: f64, from: &impl Source) -> LegGeometry {
        // A ring has no platform anchor pins.
        let (base, platform) = (from.row(&self.base), || from.row(&self.platform));
        match kind {
            Kind::Ring => self.ring(base, from),
            Kind::Strut => LegGeometry::strut(base, platform(), self.strut(common_lead, from)),
            Kind::Slider => {
                let guide = from.row(&self.guide);
                let (rod, side) = (from.get(&self.rod), from.get(&self.side));
                let kind = LegKind::Slider(SliderGeometry { guide, rod, side });
                LegGeometry { base, platform: platform(), kind }
            }
            Kind::Crank => {
                let (axis, arm) = (from.row(&self.axis), from.row(&self.arm));
                let (rod, side) = (from.get(&self.rod), from.get(&self.side));
                let kind = LegKind::Crank(CrankGeometry { axis, arm, rod, side });
                LegGeometry { base, platform: platform(), kind }
            }
        }
    }

    fn ring(&self, base: [f64; 3], from: &impl Source) -> LegGeometry {
        let [radius, height] = from.row(&self.effector);
        let kind = LegKind::Ring(RingGeometry { radius });
        LegGeometry { base, platform: [0.0, 0.0, height], kind }
    }

    fn strut(&self, common_lead: f64, from: &impl Source) -> StrutGeometry {
        let own = from.get(&self.lead);
        StrutGeometry {
            base_axis: from.row(&self.base_axis),
            platform_axis: from.row(&self.platform_axis),
            lead: if own == 0.0 { common_lead } else { own },
        }
    }
}
