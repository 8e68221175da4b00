// SPDX-License-Identifier: GPL-2.0-or-later
//! The module's C entry points through the stub HAL, with arbitrary values on its pins and in its
//! arguments: it writes only where it may, and success means finite numbers.

use crate::Bytes;
use abi_tests::control::{Control, controls};
use abi_tests::module::{Joints, Module, Pose};
use abi_tests::stub::PinDir;
use std::cell::LazyCell;

/// Value of memory that a call must leave unchanged.
const UNTOUCHED: f64 = -7777.75;

struct Loaded {
    control: Control,
    module: Module,
    /// Input pins, in order.
    inputs: Vec<String>,
}

thread_local! {
    static LOADED: LazyCell<Vec<Loaded>> = LazyCell::new(|| controls().into_iter().map(load).collect());
}

fn load(control: Control) -> Loaded {
    let module = control.module();
    let inputs =
        module.pins().iter().filter(|p| p.dir == PinDir::In).map(|p| p.name.clone()).collect();
    Loaded { control, module, inputs }
}

fn inverse(module: &Module, pose: &Pose, count: usize) -> Joints {
    let mut joints = [UNTOUCHED; 16];
    let code = module.inverse_into(pose, &mut joints);
    let (own, rest) = joints.split_at(count);
    assert!(rest.iter().all(|q| *q == UNTOUCHED), "wrote beyond its joints: {joints:?}");
    match code {
        0 => assert!(own.iter().all(|q| q.is_finite()), "{joints:?}"),
        _ => assert!(own.iter().all(|q| *q == UNTOUCHED), "code {code}, and {joints:?}"),
    }
    joints
}

/// Calls forward. U V W that no joint moves are ignored.
fn forward(Loaded { control, module, .. }: &Loaded, joints: &Joints, seed: &Pose) {
    let mut pose = *seed;
    let others = || (6..9).filter(|k| !control.moves(*k));
    others().for_each(|k| pose[k] = UNTOUCHED);
    let code = module.forward_into(joints, &mut pose);
    assert!(others().all(|k| pose[k] == UNTOUCHED), "wrote to u, v, w: {pose:?}");
    others().for_each(|k| pose[k] = 0.0);
    if code == 0 {
        assert!(pose.iter().all(|x| x.is_finite()), "{pose:?}");
    }
}

fn jacobian(module: &Module, joints: &Joints, pose: &Pose) {
    if let Ok(rows) = module.jacobian(joints, pose) {
        assert!(rows.iter().flatten().all(|x| x.is_finite()), "{rows:?}");
    }
    if let Ok(columns) = module.tool_frame(joints) {
        assert!(columns.iter().flatten().all(|x| x.is_finite()), "{columns:?}");
    }
}

/// Makes one call of a kind that the bytes choose.
fn call(loaded: &Loaded, pose: &mut Pose, joints: &mut Joints, bytes: &mut Bytes) {
    let module = &loaded.module;
    match bytes.byte() % 8 {
        0 => {
            let pin = &loaded.inputs[bytes.below(loaded.inputs.len())];
            module.set(pin, bytes.number(module.get(pin), 10.0));
        }
        1 => module.apply(),
        2 => module.monitor(),
        3 => {
            let is_asked = |k: &usize| *k < 6 || loaded.control.moves(*k);
            (0..9).filter(is_asked).for_each(|k| pose[k] = bytes.number(pose[k], 10.0));
        }
        4 => joints.iter_mut().for_each(|q| *q = bytes.number(*q, 10.0)),
        5 => *joints = inverse(module, pose, loaded.control.joints()),
        6 => forward(loaded, joints, pose),
        _ if bytes.byte() < 32 => {
            module.switch(i32::from(bytes.byte()) - 1);
        }
        _ => jacobian(module, joints, pose),
    }
}

/// Makes the calls chosen by the bytes.
pub fn run(data: &[u8]) {
    let mut bytes = Bytes::new(data);
    LOADED.with(|all| {
        let loaded = &all[bytes.below(all.len())];
        // Reset the state, whatever the last run was.
        loaded.module.switch(0);
        loaded.control.apply(&loaded.module);
        let mut pose = loaded.control.home();
        let mut joints = loaded.module.inverse(&pose).unwrap_or([0.0; 16]);
        for _ in 0..64 {
            if bytes.is_empty() {
                break;
            }
            call(loaded, &mut pose, &mut joints, &mut bytes);
        }
        loaded.module.clear_messages();
    });
}
