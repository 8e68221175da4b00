// SPDX-License-Identifier: GPL-2.0-or-later
//! Offsets of joints and of the spindle, of all machines, separate for each mechanism: no shipped machine has any.

use abi_tests::control::{Control, controls};
use abi_tests::module::Module;
use abi_tests::random::{Random, cases};

/// Returns the prefixes of the first mechanism's pins, and of the second one's if it exists.
fn stems(control: &Control) -> &'static [&'static str] {
    match control {
        Control::Pair(..) => &["", "second."],
        _ => &[""],
    }
}

fn applied(control: &Control, set: &dyn Fn(&Module)) -> Module {
    let module = control.loaded();
    control.wire(&module);
    set(&module);
    module.apply();
    assert!(module.is_on("geometry-ok"), "{}: {:?}", control.name(), module.messages());
    module
}

#[test]
fn the_offset_of_a_leg_is_taken_from_its_joint_alone_and_the_pose_stays() {
    let mut random = Random::new(411);
    for control in controls() {
        let legs: Vec<usize> = control.mechanisms().iter().map(|m| m.legs.len()).collect();
        let joints: Vec<usize> = control.mechanisms().iter().map(|m| m.joints()).collect();
        let offsets: Vec<f64> =
            (0..legs.iter().sum()).map(|_| control.size() * random.within(1.0)).collect();
        let plain = control.module();
        let module = applied(&control, &|module| {
            let each = offsets.iter().enumerate();
            each.for_each(|(n, offset)| module.set(&format!("offset.{n}"), *offset));
        });
        // Joints of a table and of extra axes have no offset.
        let mut of_joint = [0.0; 16];
        let (mut joint, mut leg) = (0, 0);
        for (legs, joints) in legs.iter().zip(&joints) {
            of_joint[joint..joint + legs].copy_from_slice(&offsets[leg..leg + legs]);
            (joint, leg) = (joint + joints, leg + legs);
        }
        for _ in 0..cases(20) {
            let pose = control.sample(&mut random);
            let expected = plain.inverse(&pose).expect("a pose of the workspace");
            let found = module.inverse(&pose).expect("the same pose");
            for n in 0..16 {
                // One subtraction.
                let off = (found[n] - (expected[n] - of_joint[n])).abs();
                assert!(off <= 4.0 * f64::EPSILON * expected[n].abs().max(of_joint[n].abs()));
            }
            let back = module.forward(&found, &pose).expect("its own joints");
            let plain = plain.forward(&expected, &pose).expect("its own joints");
            for (own, plain) in back.iter().zip(plain) {
                // Forward ends at its criterion, 1e-9 of a length; angles are degrees of some machine sizes.
                assert!((own - plain).abs() <= 1e-7 * (1.0 + plain.abs()), "{}", control.name());
            }
        }
    }
}

#[test]
fn the_offset_of_a_spindle_lengthens_the_tool_of_its_mechanism() {
    let mut random = Random::new(412);
    for control in controls() {
        let change = 0.05 * control.size() * random.between(0.1, 1.0);
        for stem in stems(&control) {
            let (spindle, tool) = (format!("{stem}spindle-offset"), format!("{stem}tool-offset"));
            let by_spindle =
                applied(&control, &|module| module.set(&spindle, module.get(&spindle) + change));
            let by_tool =
                applied(&control, &|module| module.set(&tool, module.get(&tool) + change));
            let plain = control.module();
            let mut moved = 0;
            for _ in 0..cases(20) {
                let pose = control.sample(&mut random);
                let found = by_spindle.inverse(&pose);
                assert_eq!(found, by_tool.inverse(&pose), "{} {stem}", control.name());
                moved += usize::from(found != plain.inverse(&pose));
            }
            // A tool that stays upright moves no joint.
            let tilts = control.mechanisms().iter().any(|m| m.moves(3) || m.moves(4));
            assert!(moved > 0 || !tilts, "{} {stem}: an offset moves nothing", control.name());
            for module in [&by_spindle, &by_tool] {
                let given = [&spindle, &tool].map(|pin| module.get(pin));
                module.monitor();
                assert_eq!(module.get(&format!("{stem}tool-offset-eff-z")), given[0] + given[1]);
            }
        }
    }
}
