// SPDX-License-Identifier: GPL-2.0-or-later
//! Writes the random machines into a folder: `cargo run -p test-support --example machines -- FOLDER`.

use std::path::Path;
use test_support::generated::{ALL, generated};

fn main() {
    let folder = std::env::args_os().nth(1).expect("a folder");
    for seed in ALL {
        let own = Path::new(&folder).join(seed.to_string());
        std::fs::create_dir_all(&own).expect("a folder");
        generated(seed).write(&own);
    }
}
