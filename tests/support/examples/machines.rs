// SPDX-License-Identifier: GPL-2.0-or-later
//! Writes the random machines, and one with a wrist beside constraints, into a folder: `cargo run -p test-support --example machines -- FOLDER`.

use std::path::Path;
use test_support::drawn_constraints;
use test_support::generated::{ALL, generated};

fn main() {
    let folder = std::env::args_os().nth(1).expect("a folder");
    let own = |name: String| {
        let own = Path::new(&folder).join(name);
        std::fs::create_dir_all(&own).expect("a folder");
        own
    };
    for seed in ALL {
        generated(seed).write(&own(seed.to_string()));
    }
    for seed in drawn_constraints::ALL {
        drawn_constraints::write(seed, &own(format!("constrained-{seed}")));
    }
    let name = "tricept-wrist.ini";
    let file = test_support::shipped::root().join("tests/cases/ini/constraints").join(name);
    std::fs::copy(file, own("wrist".into()).join(name)).expect("a copy");
}
