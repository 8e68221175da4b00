// SPDX-License-Identifier: GPL-2.0-or-later
//! Keys of the constraints' sections of machines whose passive joints couple coordinates.
//!
//! Each joint is an equation of `docs/reference/layouts.md`. Anchors may come from a table, so that the constraints of a
//! strut or rod are derived from its anchors.

use crate::anchors::Leg;
use crate::values::Values;
use keys::{Key, constraint as key, leg as of_leg};

/// A constraint's section.
#[derive(Clone, Debug)]
pub struct Constraint {
    /// The joint, for a comment.
    pub about: &'static str,
    /// Word of its kind.
    pub kind: &'static str,
    /// Keys and numbers.
    pub numbers: Vec<(&'static Key, [f64; 3])>,
}

/// Returns no constraints.
pub fn none(_: &Values, _: &[Leg]) -> Vec<Constraint> {
    vec![]
}

/// Returns a plane of the platform with this normal that contains a point of base.
fn plane(about: &'static str, platform: [f64; 3], normal: [f64; 3], base: [f64; 3]) -> Constraint {
    let numbers = vec![(&key::PLATFORM, platform), (&key::NORMAL, normal), (&key::BASE, base)];
    Constraint { about, kind: "plane-through-point", numbers }
}

fn square(about: &'static str, platform: [f64; 3], base: [f64; 3]) -> Constraint {
    let numbers = vec![(&key::PLATFORM_AXIS, platform), (&key::BASE_AXIS, base)];
    Constraint { about, kind: "square", numbers }
}

/// Axes of base or platform.
const X: [f64; 3] = [1.0, 0.0, 0.0];
const Y: [f64; 3] = [0.0, 1.0, 0.0];

/// Returns the passive leg of a tricept: its axis passes through the joint, whose axes are perpendicular.
pub fn tricept(values: &Values, _: &[Leg]) -> Vec<Constraint> {
    let (on_leg, joint) =
        ([0.0; 3], [0.0, 0.0, values.number("height") + values.number("joint-rise")]);
    vec![
        plane(
            "The axis of the passive leg passes through its joint in the base.",
            on_leg,
            Y,
            joint,
        ),
        plane("", on_leg, X, joint),
        square(
            "The axes of this joint are perpendicular: Y of the platform and X of the base.",
            Y,
            X,
        ),
    ]
}

/// Returns the joints of an exechon. The last but one of the common plane follows from the others, as on the real machine.
pub fn exechon(_: &Values, legs: &[Leg]) -> Vec<Constraint> {
    let of = |i: usize, about, normal| {
        let leg = legs.get(i).cloned().unwrap_or_default();
        plane(about, leg.numbers(&of_leg::PLATFORM), normal, leg.numbers(&of_leg::BASE))
    };
    vec![
        of(0, "The hinges of the first two struts keep them in a plane of the platform.", Y),
        of(1, "", Y),
        square("This plane turns about the line through their base joints.", Y, X),
        of(2, "The hinge of the third strut keeps it in a plane of the platform.", X),
    ]
}

/// Returns the hinges of a head on three legs: each keeps its leg in the plane through the middle and the leg's base joint.
pub fn head(_: &Values, legs: &[Leg]) -> Vec<Constraint> {
    let hinge = |(i, leg): (usize, &Leg)| {
        let [x, y, _] = leg.numbers(&of_leg::BASE);
        // Of the plane through Z and the base joint; any length will do.
        let normal = [0.0 - y, x, 0.0];
        let about = match i {
            0 => {
                "The hinge of each leg keeps its platform joint in a vertical plane through the middle."
            }
            _ => "",
        };
        let platform = (&key::PLATFORM, leg.numbers(&of_leg::PLATFORM));
        let numbers = vec![platform, (&key::BASE, [0.0; 3]), (&key::NORMAL, normal)];
        Constraint { about, kind: "point-in-plane", numbers }
    };
    legs.iter().enumerate().map(hinge).collect()
}
