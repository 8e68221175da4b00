// SPDX-License-Identifier: GPL-2.0-or-later
//! A beam on two elastic supports, against closed forms.

use std::f64::consts::{PI, TAU};
use studies::stability::spindle::{NoSpindle, Nose};
use studies::study::file::Study;
use studies::study::number::{NotNegative, Positive};
use studies::study::spindle::{ShaftJoint, Spindle};
use test_support::stability::close;

/// Forces at the ends of elements are exact except for rounding, with a matrix whose condition number is 1e10.
const STATIC: f64 = 1e-6;
/// Cubic elements of a 48th of the length: an error of the sixth power of their share of a wavelength.
const FREQUENCY: f64 = 1e-6;

/// N/mm², kg/m³, mm.
const E: f64 = 210_000.0;
const DENSITY: f64 = 7850.0;
const D: f64 = 40.0;

fn bending() -> f64 {
    E * PI / 64.0 * D.powi(4)
}

/// Returns the mass per length, t/mm.
fn density() -> f64 {
    DENSITY * 1e-12 * PI / 4.0 * D * D
}

/// Returns a shaft of one diameter; each bearing: position, um/N, rad/(N m) or none, N s/mm.
fn spindle(lengths: &[f64], bearings: [(f64, f64, Option<f64>, f64); 2]) -> Spindle {
    let mut text = format!(
        "[spindle]\nyoungs_n_per_mm2 = {E}\ndensity_kg_per_m3 = {DENSITY}\ndamping_ratio = 0\n"
    );
    for length in lengths {
        text += &format!("[[spindle.sections]]\nlength_mm = {length}\ndiameter_mm = {D}\n");
    }
    for (at, linear, angular, damping) in bearings {
        text += &format!(
            "[[spindle.bearings]]\nat_mm = {at}\ncompliance_um_per_n = {linear}\n\
             damping_n_s_per_mm = {damping}\n"
        );
        if let Some(angular) = angular {
            text += &format!("angular_rad_per_n_m = {angular}\n");
        }
    }
    Study::parse(&text).unwrap().spindle.unwrap()
}

fn nose(spindle: &Spindle) -> Nose {
    spindle.nose().unwrap()
}

#[test]
fn the_nose_yields_as_the_formula_of_a_beam_on_two_springs_says() {
    let (span, over) = (300.0, 90.0);
    for (rear, front) in [(0.0, 0.0), (0.02, 0.01), (0.5, 0.0)] {
        let shaft = spindle(&[span, over], [(0.0, rear, None, 0.0), (span, front, None, 0.0)]);
        let beam = over * over * (span + over) / (3.0 * bending());
        let ratio = over / span;
        let springs = (1.0 + ratio).powi(2) * front * 1e-3 + ratio.powi(2) * rear * 1e-3;
        close(nose(&shaft).compliance, beam + springs, STATIC);
    }
    // A bearing that also fixes the angle makes the overhang a cantilever.
    let shaft = spindle(&[span, over], [(0.0, 0.0, None, 0.0), (span, 0.0, Some(0.0), 0.0)]);
    close(nose(&shaft).compliance, over.powi(3) / (3.0 * bending()), STATIC);
    // With an angular compliance c, and the rear end free: a cantilever on a hinge.
    let hinge = 1e-5;
    let shaft = spindle(&[span, over], [(0.0, 1e12, None, 0.0), (span, 0.0, Some(hinge), 0.0)]);
    let cantilever = over.powi(3) / (3.0 * bending()) + over * over * hinge * 1e-3;
    close(nose(&shaft).compliance, cantilever, STATIC);
}

#[test]
fn a_shaft_of_two_diameters_yields_as_the_energy_of_its_moments_says() {
    let (span, over, thin) = (300.0, 90.0, 25.0_f64);
    let mut shaft = spindle(&[span, over], [(0.0, 0.0, None, 0.0), (span, 0.0, None, 0.0)]);
    shaft.sections[1].diameter_mm.0 = thin;
    shaft.sections[1].bore_mm.0 = 10.0;
    let tip = E * PI / 64.0 * (thin.powi(4) - 1e4);
    let expected = over * over * span / (3.0 * bending()) + over.powi(3) / (3.0 * tip);
    close(nose(&shaft).compliance, expected, STATIC);
}

#[test]
fn frequencies_are_those_of_beams_with_closed_forms() {
    let length: f64 = 600.0;
    let unit = (bending() / density()).sqrt() / (length * length);
    // On rigid supports at both ends: (kπ)². A nose at the end would not move, so the shaft
    // has a negligible overhang.
    let pinned = spindle(&[length, 1e-3], [(0.0, 0.0, None, 0.0), (length, 0.0, None, 0.0)]);
    for (k, mode) in nose(&pinned).modes.iter().enumerate() {
        let order = (k + 1) as f64 * PI;
        close(mode.omega, order * order * unit, 2e-5);
    }
    // Clamped at its front bearing: the cantilever's 1.875, 4.694, 7.855 (cos x cosh x = -1). The
    // other support has negligible stiffness.
    let clamped = spindle(&[length], [(0.0, 0.0, Some(0.0), 0.0), (1.0, 1e12, None, 0.0)]);
    let roots = [1.875_104_068_711_961, 4.694_091_132_974_175, 7.854_757_438_237_613];
    let found = nose(&clamped);
    for (mode, root) in found.modes.iter().zip(roots) {
        close(mode.omega, root * root * unit, FREQUENCY);
        // At the tip the shape is 2 and the mean of its square 1.
        close(mode.nose.abs(), 2.0 / (density() * length).sqrt(), FREQUENCY);
    }
    // Three modes have all but a thousandth of the compliance: Σ 12/x⁴ is nearly 1.
    let share: f64 = roots.iter().map(|root| 12.0 / root.powi(4)).sum();
    close(found.share(), share, FREQUENCY);
}

#[test]
fn a_rigid_shaft_on_soft_bearings_swings_and_loses_as_two_springs_say() {
    let length: f64 = 100.0;
    // 100 um/N is 10 N/mm at each end: the shaft translates and rotates. Bending contributes about
    // 1e-5 of that.
    let (soft, damping) = (100.0, 0.02);
    const RIGID: f64 = 3e-5;
    let shaft = spindle(&[length], [(0.0, soft, None, damping), (length, soft, None, damping)]);
    let found = nose(&shaft);
    let mass = density() * length;
    let [up, turn] = [(20.0 / mass).sqrt(), (60.0 / mass).sqrt()];
    close(found.modes[0].omega, up, RIGID);
    close(found.modes[1].omega, turn, RIGID);
    close(found.modes[0].zeta, 2.0 * damping / (2.0 * mass * up), RIGID);
    // The decrement by its definition: neighboring peaks of the damped motion.
    let mode = found.modes[0];
    let decay = mode.zeta * mode.omega * TAU / (mode.omega * (1.0 - mode.zeta.powi(2)).sqrt());
    close(mode.decrement(), decay, 1e-12);
    close(found.compliance, 0.1, RIGID);
    // The damping ratio of the shaft itself is added.
    let mut own = shaft;
    own.damping_ratio.0 = 0.01;
    close(nose(&own).modes[0].zeta, mode.zeta + 0.01, 1e-12);
}

/// Returns a joint: mm, um/N, rad/(N m).
fn joint(at: f64, linear: f64, angular: f64) -> ShaftJoint {
    ShaftJoint {
        at_mm: Positive(at),
        compliance_um_per_n: NotNegative(linear),
        angular_rad_per_n_m: NotNegative(angular),
    }
}

#[test]
fn joints_add_their_displacement_and_their_rotation_times_the_arm() {
    let (span, over) = (300.0, 90.0);
    let rigid = spindle(&[span, over], [(0.0, 0.01, None, 0.0), (span, 0.02, None, 0.0)]);
    let mut shaft = rigid.clone();
    // Arbor in front of the nose, tool 40 mm before the tip.
    let (arbor, tool) = (joint(span + 20.0, 0.003, 2e-6), joint(span + 50.0, 0.0, 5e-6));
    shaft.joints = vec![arbor, tool];
    let added = 0.003e-3 + 2e-9 * 70.0 * 70.0 + 5e-9 * 40.0 * 40.0;
    close(nose(&shaft).compliance, nose(&rigid).compliance + added, STATIC);
    shaft.joints = vec![joint(span + 20.0, 0.001, 2e-6), joint(span + 20.0, 0.002, 0.0), tool];
    close(nose(&shaft).compliance, nose(&rigid).compliance + added, STATIC);
    // A joint stays with the shaft if the last cylinder grows: its arm grows.
    let longer = nose(&shaft.with_overhang(120.0)).compliance;
    let added = 0.003e-3 + 2e-9 * 100.0 * 100.0 + 5e-9 * 70.0 * 70.0;
    close(longer, nose(&rigid.with_overhang(120.0)).compliance + added, STATIC);
    // Other elements: rounding, as STATIC.
    close(nose(&shaft.without_joints()).compliance, nose(&rigid).compliance, STATIC);
}

/// Returns the determinant whose zeros x = βL are the natural frequencies of a cantilever on springs against
/// displacement and rotation at its root, L³/(c EI) and L/(γ EI): the shape is a cosh + b sinh + c cos + d sin.
#[rustfmt::skip]
fn on_springs(x: f64, linear: f64, angular: f64) -> f64 {
    let (ch, sh, c, s) = (x.cosh(), x.sinh(), x.cos(), x.sin());
    // At the root w''' = -linear w and w'' = angular w', at the tip w'' = w''' = 0, with L = 1.
    let (x2, x3) = (x * x, x * x * x);
    nalgebra::Matrix4::new(
        linear, x3, linear, -x3,
        x2, -angular * x, -x2, -angular * x,
        ch, sh, -c, -s,
        sh, ch, s, -c,
    )
    .determinant()
}

#[test]
fn frequencies_with_a_joint_are_those_of_a_cantilever_on_springs() {
    let (length, stub): (f64, f64) = (400.0, 50.0);
    let unit = (bending() / density()).sqrt() / (length * length);
    for (linear, angular) in [(0.01, 1e-5), (0.5, 1e-7), (0.02, 3e-5)] {
        // Clamped at the joint by its bearing.
        let mut shaft =
            spindle(&[stub, length], [(0.0, 0.0, None, 0.0), (stub, 0.0, Some(0.0), 0.0)]);
        shaft.joints = vec![joint(stub, linear, angular)];
        let of = |x: f64| {
            let root = length.powi(3) / (linear * 1e-3 * bending());
            on_springs(x, root, length / (angular * 1e-3 * bending()))
        };
        let mut expected = vec![];
        let mut low = 0.1;
        while expected.len() < 3 {
            let high = low + 0.01;
            if of(low) * of(high) < 0.0 {
                let (mut a, mut b) = (low, high);
                for _ in 0..60 {
                    let middle = (a + b) / 2.0;
                    *(if of(a) * of(middle) <= 0.0 { &mut b } else { &mut a }) = middle;
                }
                expected.push(a);
            }
            low = high;
        }
        for (mode, x) in nose(&shaft).modes.iter().zip(&expected) {
            // As for beams without a joint, with elements of a 43rd of the cantilever.
            close(mode.omega, x * x * unit, 2.0 * FREQUENCY);
        }
        assert!(expected[0] < 0.99 * 1.875_104_068_711_961, "{expected:?}: no effect");
    }
}

#[test]
fn finer_elements_are_not_needed_and_a_longer_overhang_yields_more() {
    let shaft = spindle(&[74.0, 312.0, 70.0], [(74.0, 0.01, None, 0.1), (386.0, 0.005, None, 0.1)]);
    let [short, long] = [70.0, 140.0].map(|length| nose(&shaft.with_overhang(length)));
    assert!(long.compliance > 2.0 * short.compliance);
    assert!(long.modes[0].omega < short.modes[0].omega);
    // The same shaft with a cylinder divided in two.
    let mut cut = shaft.clone();
    cut.sections[1].length_mm.0 = 100.0;
    cut.sections.insert(2, cut.sections[1]);
    cut.sections[2].length_mm.0 = 212.0;
    close(nose(&cut).compliance, short.compliance, STATIC);
    for (a, b) in nose(&cut).modes.iter().zip(&short.modes) {
        close(a.omega, b.omega, FREQUENCY);
    }
}

#[test]
fn a_spindle_that_is_none_is_refused() {
    let good = spindle(&[100.0], [(0.0, 0.0, None, 0.0), (50.0, 0.0, None, 0.0)]);
    let refused = |change: fn(&mut Spindle)| {
        let mut other = good.clone();
        change(&mut other);
        other.nose().unwrap_err()
    };
    let beside = refused(|s| s.bearings[1].at_mm.0 = 101.0);
    assert_eq!(beside, NoSpindle::Beside { at: 101.0, length: 100.0 });
    assert_eq!(refused(|s| s.bearings[1].at_mm.0 = 0.0), NoSpindle::Together(0.0));
    let bore = refused(|s| s.sections[0].bore_mm.0 = 40.0);
    assert_eq!(bore, NoSpindle::Bore { bore: 40.0, outer: 40.0 });
    assert_eq!(refused(|s| s.joints.push(joint(50.0, 0.0, 0.0))), NoSpindle::Rigid(50.0));
    let at_the_nose = refused(|s| s.joints.push(joint(100.0, 0.1, 0.0)));
    assert_eq!(at_the_nose, NoSpindle::Joint { at: 100.0, length: 100.0 });
    assert_eq!(refused(|s| s.sections.clear()), NoSpindle::Empty);
    assert_eq!(refused(|s| s.modes = 0), NoSpindle::Modeless);
}
