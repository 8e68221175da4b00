// SPDX-License-Identifier: GPL-2.0-or-later
//! Many poses at once against one by one.

use kinematics::{Cause, Pose, Vector3};
use pkm::read::machine::MachineConfig;
use pkm::study::batch;
use std::num::NonZero;
use std::path::Path;

#[test]
fn any_number_of_threads_gives_the_joints_and_refusals_of_single_calls_in_their_order() {
    let ini = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/hexapod/hexapod.ini");
    let config = MachineConfig::read(&ini).unwrap();
    let home = config.home_pose();
    let poses: Vec<Pose> = (0..1000)
        .map(|k| {
            let mut pose = home;
            pose.position.x += f64::from(k) * 0.01;
            if k % 100 == 99 {
                pose.position.z = f64::NAN;
            }
            pose
        })
        .collect();
    let tool = Vector3::zeros();
    let single: Vec<_> = poses.iter().map(|pose| config.machine.inverse(pose, &tool)).collect();
    let refused = |result: &Result<_, kinematics::Fault>| {
        result.as_ref().is_err_and(|fault| fault.cause == Cause::PoseNotFinite)
    };
    assert_eq!(single.iter().filter(|result| refused(result)).count(), 10);
    for threads in [1, 2, 3, 7, 2000] {
        let threads = NonZero::new(threads).unwrap();
        assert_eq!(batch::inverse(&config.machine, &poses, &tool, threads), single, "{threads}");
    }
    assert!(batch::inverse(&config.machine, &[], &tool, NonZero::new(2).unwrap()).is_empty());
}
