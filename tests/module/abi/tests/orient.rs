// SPDX-License-Identifier: GPL-2.0-or-later
//! The inverse of the tool frame, against the frames themselves.

use abi_tests::carrying::carrying;
use abi_tests::geometry::{Vector, cross, dot, minus, norm, plus, rotation, scaled, unit};
use abi_tests::machines::{paper_004, paper_004_pose};
use abi_tests::module::{Columns, Joints, Module, Pose};
use abi_tests::random::{Random, cases};
use abi_tests::subjects::{Subject, subjects};

/// Error of a direction, radians: that of forward's poses, 1e-10 of the size, on a platform of a hundredth of it.
const DIRECTION: f64 = 1e-7;

/// Returns the tool's axes in the workpiece.
fn tool_in_work(module: &Module, joints: &Joints) -> Columns {
    let (tool, work) = (module.tool_frame(joints).unwrap(), module.work_frame(joints).unwrap());
    tool.map(|axis| std::array::from_fn(|k| dot(work[k], axis)))
}

/// Returns a module at a pose, and the joints there.
fn at(subject: &Subject, pose: &Pose) -> (Module, Joints) {
    let module = subject.machine.module();
    let joints = module.inverse(pose).expect("a pose of the workspace");
    module.forward_from(&joints, &subject.home());
    (module, joints)
}

fn close(one: Vector, other: Vector) -> bool {
    norm(minus(one, other)) <= DIRECTION
}

/// Returns the number of angles of a machine.
fn angles(subject: &Subject) -> usize {
    (3..6).filter(|k| subject.machine.moves(*k)).count()
}

#[test]
fn the_tool_points_where_it_was_asked_to() {
    let mut random = Random::new(51);
    for subject in subjects() {
        for _ in 0..cases(20) {
            let (from, to) = ((subject.sample)(&mut random), (subject.sample)(&mut random));
            let (module, joints) = at(&subject, &from);
            let [_, _, axis] = columns(&to);
            // Any length.
            let answer = module.tool_frame_inverse(scaled(axis, 3.0), None, &joints, 0);
            let (found, free, spin) = answer.unwrap_or_else(|n| panic!("{}: {n}", subject.name));
            assert!(close(tool_in_work(&module, &found)[2], axis), "{}: {to:?}", subject.name);
            assert_eq!((free, spin), (angles(&subject).saturating_sub(2), 0.0), "{}", subject.name);
            let there = module.forward(&found, &from).expect("a pose nearby");
            let way: f64 = norm(std::array::from_fn(|k| there[k] - from[k]));
            assert!(way <= 1e-9 * subject.machine.size(), "{}: X Y Z move {way}", subject.name);
        }
    }
}

/// Returns the axes of the platform.
fn columns(pose: &Pose) -> Columns {
    let rows = rotation(pose);
    std::array::from_fn(|axis| std::array::from_fn(|k| rows[k][axis]))
}

#[test]
fn tool_x_is_reached_by_three_angles_and_left_to_the_spin_by_fewer() {
    let mut random = Random::new(52);
    for subject in subjects() {
        for _ in 0..cases(20) {
            let (from, to) = ((subject.sample)(&mut random), (subject.sample)(&mut random));
            let (module, joints) = at(&subject, &from);
            let turned = Pose::from([0.0, 0.0, 0.0, to[3], to[4], to[5] + 20.0, 0.0, 0.0, 0.0]);
            let [_, _, axis] = columns(&to);
            let [x, _, _] = columns(&if angles(&subject) == 3 { to } else { turned });
            // A part along the axis is removed.
            let x = unit(minus(x, scaled(axis, dot(axis, x))));
            let asked = plus(x, scaled(axis, 0.2));
            let answer = module.tool_frame_inverse(axis, Some(asked), &joints, 0);
            let (found, free, spin) = answer.unwrap_or_else(|n| panic!("{}: {n}", subject.name));
            let [own, _, z] = tool_in_work(&module, &found);
            assert!(close(z, axis), "{}: {to:?}", subject.name);
            let spun = plus(scaled(own, spin.cos()), scaled(cross(z, own), spin.sin()));
            assert!(close(spun, x), "{}: {spun:?} is not {x:?}", subject.name);
            assert_eq!((free, spin == 0.0), (0, angles(&subject) == 3), "{}", subject.name);
        }
    }
}

#[test]
fn axes_that_carry_tool_or_workpiece_stay() {
    let mut random = Random::new(53);
    let mut answered = 0;
    for subject in subjects() {
        for _ in 0..cases(10) {
            let carrying = carrying(&subject, &mut random);
            let (module, chain) = (carrying.module(), carrying.chain());
            let [from, to] = [(); 2].map(|()| (subject.sample)(&mut random));
            let world = carrying.world(&from, &chain, &mut random);
            let Ok(joints) = module.inverse(&world) else { continue };
            if module.forward_from(&joints, &world) != 0 {
                continue;
            }
            let there = carrying.world(&to, &chain, &mut random);
            // The same values of the axes, the other angles.
            let mut other = world;
            (3..6).filter(|k| subject.machine.moves(*k)).for_each(|k| other[k] = there[k]);
            let Ok(goal) = module.inverse(&other) else { continue };
            let Ok(tool) = module.tool_frame(&goal) else { continue };
            let Ok(work) = module.work_frame(&goal) else { continue };
            let axis = std::array::from_fn(|k| dot(work[k], tool[2]));
            let held = (subject.machine.joints()..subject.machine.joints() + carrying.axes.len())
                .fold(0, |held, n| held | 1 << n);
            let answer = module.tool_frame_inverse(axis, None, &joints, held);
            let Ok((found, free, _)) = answer else { continue };
            answered += 1;
            assert!(close(tool_in_work(&module, &found)[2], axis), "{}", subject.name);
            let behind = subject.machine.joints()..;
            assert_eq!(found[behind.clone()], joints[behind], "{}", subject.name);
            assert!(free <= 1, "{free}");
        }
    }
    assert!(answered >= cases(30), "{answered}");
}

#[test]
fn what_is_no_request_or_cannot_be_reached_has_no_solution() {
    let mut random = Random::new(54);
    let hexapod = Subject { name: "hexapod", machine: paper_004().into(), sample: paper_004_pose };
    let (module, joints) = at(&hexapod, &paper_004_pose(&mut random));
    let z = [0.0, 0.0, 1.0];
    for (axis, x) in [
        ([0.0; 3], None),
        ([f64::NAN, 0.0, 1.0], None),
        (z, Some([0.0; 3])),
        (z, Some([1e-7, 0.0, 1.0])),
        (z, Some([f64::INFINITY, 0.0, 0.0])),
    ] {
        assert_eq!(module.tool_frame_inverse(axis, x, &joints, 0), Err(-1), "{axis:?} {x:?}");
    }
    assert_eq!(module.tool_frame_inverse(z, None, &[f64::NAN; 16], 0), Err(-1));
    // The tool could turn about its axis, but not with a leg that must not move.
    let [_, _, axis] = tool_in_work(&module, &joints);
    for (held, free) in [(0, 1), (1, 0), (0x3f, 0)] {
        let (found, left, _) = module.tool_frame_inverse(axis, None, &joints, held).unwrap();
        assert_eq!(left, free, "{held:#x}");
        assert!(close(tool_in_work(&module, &found)[2], axis));
    }
    // Upside down, and with a leg that must not move.
    assert_eq!(module.tool_frame_inverse([0.0, 0.0, -1.0], None, &joints, 0), Err(0));
    assert_eq!(module.tool_frame_inverse([0.3, 0.0, 1.0], None, &joints, 1 << 2), Err(0));
    let own = tool_in_work(&module, &joints)[2];
    let (found, ..) = module.tool_frame_inverse(own, None, &joints, 0b11_1111).expect("the seed");
    assert!((0..6).all(|n| (found[n] - joints[n]).abs() < 1e-6), "{found:?}");
    // The lathe rotates about Y alone.
    let lathe = subjects().into_iter().find(|s| s.name == "four-rod lathe").unwrap();
    let (lathe, joints) = at(&lathe, &lathe.home());
    assert_eq!(lathe.tool_frame_inverse([0.1, 0.1, 1.0], None, &joints, 0), Err(0));
    assert!(lathe.tool_frame_inverse([0.1, 0.0, 1.0], None, &joints, 0).is_ok());
    assert_eq!(module.switch(1), 0);
    assert_eq!(module.tool_frame_inverse(z, None, &joints, 0), Err(-1), "the identity");
    let fresh = Module::pkmkins(&[]);
    assert_eq!(fresh.tool_frame_inverse(z, None, &[1.0; 16], 0), Err(-1), "nothing is frozen");
}
