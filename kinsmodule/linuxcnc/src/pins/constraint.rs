// SPDX-License-Identifier: GPL-2.0-or-later
//! The pins of a constraint of the platform, and of the coordinates that constraints determine.

use super::maker::{LETTERS, Maker, Pose6, Source, Vector};
use crate::hal::{Direction, HalError, Pin};
use kinematics::{ConstraintGeometry, Letter, Load, Pose, text};

/// Pins of one constraint; those of other kinds are ignored.
#[repr(C)]
pub(super) struct ConstraintPins {
    kind: Pin<i32>,
    platform: Vector,
    base: Vector,
    normal: Vector,
    platform_axis: Vector,
    base_axis: Vector,
}

impl ConstraintPins {
    pub(super) fn create(&mut self, make: &Maker, n: usize) -> Result<(), HalError> {
        use Direction::In;
        make.one(&mut self.kind, In, text!["pkmkins.constraint.", n, ".kind"], 0)?;
        for (pins, name) in [
            (&mut self.platform, ".platform."),
            (&mut self.base, ".base."),
            (&mut self.normal, ".normal."),
            (&mut self.platform_axis, ".platform-axis."),
            (&mut self.base_axis, ".base-axis."),
        ] {
            make.letters(pins, In, text!["pkmkins.constraint.", n, name], [0.0; 3])?;
        }
        Ok(())
    }

    /// Reads the constraint from the pins; an unknown kind becomes one without directions, which is refused.
    pub(super) fn given(&self, from: &impl Source) -> ConstraintGeometry {
        let [platform, base, normal] =
            [&self.platform, &self.base, &self.normal].map(|pins| from.row(pins));
        match from.get(&self.kind) {
            1 => ConstraintGeometry::PointInPlane { platform, base, normal },
            2 => ConstraintGeometry::PlaneThroughPoint { platform, normal, base },
            3 => ConstraintGeometry::Square {
                platform_axis: from.row(&self.platform_axis),
                base_axis: from.row(&self.base_axis),
            },
            _ => ConstraintGeometry::Square { platform_axis: [0.0; 3], base_axis: [0.0; 3] },
        }
    }
}

/// Outputs of the dependent coordinates; those of other letters are not created.
#[repr(C)]
pub(super) struct DependentPins(Pose6);

impl DependentPins {
    fn each<'a>(&'a self, load: &'a Load) -> impl Iterator<Item = (Letter, &'a Pin<f64>)> {
        let all = Letter::ALL.into_iter().zip(&self.0);
        all.filter(|(letter, _)| load.layout.is_dependent(*letter))
    }

    pub(super) fn create(&mut self, make: &Maker, load: &Load) -> Result<(), HalError> {
        for ((letter, name), pin) in Letter::ALL.into_iter().zip(LETTERS).zip(&mut self.0) {
            if load.layout.is_dependent(letter) {
                make.one(pin, Direction::Out, text!["pkmkins.dependent.", name], 0.0)?;
            }
        }
        Ok(())
    }

    pub(super) fn show(&self, load: &Load, pose: &Pose) {
        let pose = pose.to_degrees();
        for (letter, pin) in self.each(load) {
            pin.set(pose.get(letter.index()).copied().unwrap_or(f64::NAN));
        }
    }
}
