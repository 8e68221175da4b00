// SPDX-License-Identifier: GPL-2.0-or-later
//! Workspaces of two mechanisms, each alone and with the other one.

use test_support::shipped::ini;

const LATHE: &str = "lathe-mirrored";

#[test]
fn workspace_shows_each_alone_and_beside_the_other() {
    let lathe = ini(LATHE);
    let pkm = |arguments: &[&str]| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_pkm"));
        let done = command.arg("workspace").args(arguments).output().unwrap();
        (
            done.status.code(),
            String::from_utf8(done.stdout).unwrap(),
            String::from_utf8(done.stderr).unwrap(),
        )
    };
    let lathe = lathe.to_str().unwrap();
    let coarse = ["--bands", "8", "--grid", "20"];
    let (code, out, err) = pkm(&[&[lathe, "--format", "json"], &coarse[..]].concat());
    assert_eq!(code, Some(0), "{err}");
    let found: serde_json::Value = serde_json::from_str(&out).unwrap();
    let [first, second] = found["mechanisms"].as_array().unwrap().as_slice() else {
        panic!("{found}")
    };
    for mechanism in [first, second] {
        let volume = |found: &serde_json::Value| found["volume_by_grid"].as_f64().unwrap();
        let shares = [&mechanism["beside_home"], &mechanism["beside_anywhere"]]
            .map(|beside| volume(beside) / volume(mechanism));
        assert!(shares[0] < 0.95 && shares[1] < 0.8 * shares[0], "{shares:?}");
        assert!(mechanism["beside_home"]["ended_by_the_other"].as_f64().unwrap() > 0.0);
    }
    // They are mirror images, and so are their remaining workspaces.
    let apart = first["beside_home"]["volume_by_boundary"].as_f64().unwrap()
        / second["beside_home"]["volume_by_boundary"].as_f64().unwrap();
    assert!((apart - 1.0).abs() < 0.02, "{apart}");
    let one = ini("four-rod-lathe");
    for (arguments, reported) in [
        (vec![lathe, "--csv", "any.csv"], "add --mechanism 1"),
        (vec![lathe, "--beside", "home"], "--mechanism"),
        (
            vec![one.to_str().unwrap(), "--mechanism", "1", "--beside", "home"],
            "the file has only one mechanism",
        ),
    ] {
        let (code, _, err) = pkm(&arguments);
        assert!(code == Some(2) && err.contains(reported), "{arguments:?}: {err}");
    }
}
