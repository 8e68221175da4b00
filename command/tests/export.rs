// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm export` and `pkm joints --passive` from the user's view.

use crate::commands::Bench;
use snapbox::{assert_data_eq, str};

#[test]
fn a_model_goes_into_its_folder_and_not_over_another() {
    let bench = Bench::new().with("other/README.md", "# My notes\n").with("old/arm.urdf", "");
    assert_data_eq!(
        bench.answer("export linear-delta.ini --mjcf model --urdf model --sdf model", ""),
        str![[r#"
model/README.md
model/linear-delta.loops.json
model/linear-delta.sdf
model/linear-delta.urdf
model/linear-delta.xml
model/scene.xml
masses: solid steel bars, because no study was given
left out: cones of the legs' joints: pkm check and preflight judge them
exit 0

"#]]
    );
    // The same machine again.
    assert!(bench.answer("export linear-delta.ini --mjcf model", "").ends_with("exit 0\n"));
    assert_data_eq!(
        bench.answer("export linear-delta.ini --mjcf other", ""),
        str![[r#"
pkm: other: contains README.md, which is not a file of this model; give another folder
exit 2

"#]]
    );
    assert_data_eq!(
        bench.answer("export linear-delta.ini --mjcf old", ""),
        str![[r#"
pkm: old: contains arm.urdf, which is not a file of this model; give another folder
exit 2

"#]]
    );
    assert!(bench.answer("export linear-delta.ini", "").contains("--mjcf <FOLDER>"));
}

#[test]
fn a_refused_machine_and_a_missing_shape_write_no_model() {
    let bench = Bench::new().spoilt("ROD = ", "ROD = -");
    let refused = bench.answer("export linear-delta.ini --mjcf model", "");
    assert!(refused.contains("ROD") && refused.ends_with("exit 2\n"), "{refused}");
    let bench = Bench::new().spoilt("[PKM]\n", "[PKM]\nPLATFORM_MODEL = none.stl mm\n");
    assert_data_eq!(
        bench.answer("export linear-delta.ini --mjcf model", ""),
        str![[r#"
pkm: platform shape: none.stl: No such file or directory (os error 2); correct the key, or remove it
exit 2

"#]]
    );
    assert!(!bench.0.path().join("model").exists());
}

#[test]
fn values_of_the_joints_are_in_meters_and_radians() {
    let bench = Bench::new();
    assert_data_eq!(
        bench.answer("joints linear-delta.ini --passive --pose X10", ""),
        str![[r#"
platform_x = 0.01
platform_y = 0
platform_z = 0.09
joint_0 = 0.325150882[..]
leg_0_base_1 = -0.000382825[..]
leg_0_base_2 = 0.037183288[..]
joint_1 = 0.320304019[..]
leg_1_base_1 = -0.037290595[..]
leg_1_base_2 = -0.018588431[..]
joint_2 = 0.329899840[..]
leg_2_base_1 = 0.036348444[..]
leg_2_base_2 = -0.018588431[..]
exit 0

"#]]
    );
    // Beyond the reach of a rod.
    let far = bench.answer("joints linear-delta.ini --passive", "x,y,z,a,b,c\n900,0,90,0,0,0\n");
    assert!(far.contains("standard input:2: ") && far.ends_with("exit 1\n"), "{far}");
    let missing = bench.answer("joints linear-delta.ini --passive", "x,y\n0,0\n");
    assert!(missing.contains("no column z") && missing.ends_with("exit 2\n"), "{missing}");
}
