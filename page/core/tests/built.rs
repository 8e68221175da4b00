// SPDX-License-Identifier: GPL-2.0-or-later
//! The built file `page/built/kinematics.wasm`, run by node, compared with the core.

use super::{mechanisms, numbers};
use machine::limits;
use machine::proof::axis_box::range;
use page_core::{Described, Drawn, NUMBERS};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use std::path::Path;
use std::process::Command;

/// Number of poses of each mechanism.
const POSES: usize = 200;

/// Pose and tool vector of a question.
type Asked = [f64; 9];

/// Returns the answers of the built file: for every question a code and the block of numbers.
fn answers(questions: &[f64]) -> Vec<f64> {
    let folder = std::env::temp_dir().join(format!("pkmkins-page-core-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let [asked, answered] = ["asked", "answered"].map(|name| folder.join(name));
    let bytes: Vec<u8> = questions.iter().flat_map(|value| value.to_le_bytes()).collect();
    std::fs::write(&asked, bytes).unwrap();
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let wasm = here.join("../built/kinematics.wasm");
    let done = Command::new("node")
        .arg(here.join("tests/ask.mjs"))
        .args([&wasm, &asked, &answered])
        .output()
        .expect("node runs the built kinematics: make setup-page installs it");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let bytes = std::fs::read(&answered).unwrap();
    std::fs::remove_dir_all(&folder).unwrap();
    bytes.chunks_exact(8).map(|value| f64::from_le_bytes(value.try_into().unwrap())).collect()
}

#[test]
fn the_built_kinematics_answer_with_the_bits_of_the_core() {
    let mut rng = Pcg64::seed_from_u64(55);
    let (mut questions, mut expected) = (vec![], vec![]);
    for config in mechanisms() {
        let (geometry, offsets) = (config.geometry, config.offsets);
        let described = Described { geometry, offsets, limits: limits::of(&config) };
        let machine = described.freeze().unwrap();
        let given = numbers(&described);
        questions.push(given.len() as f64);
        questions.extend(given);
        questions.push(POSES as f64);
        let (whole, reach) = (range(&config), 0.1 * config.machine.size());
        for n in 0..POSES {
            let mut pose = whole.at(std::array::from_fn(|_| rng.random_range(-0.2..1.2)));
            if n % 50 == 0 {
                pose[0] = f64::NAN;
            }
            let tool: [f64; 3] = std::array::from_fn(|_| rng.random_range(-reach..reach));
            let asked: Asked = std::array::from_fn(|k| if k < 6 { pose[k] } else { tool[k - 6] });
            questions.extend(asked);
            let centre = described.geometry.centre;
            let drawn = Drawn::new(&machine, centre, &described.limits, pose, tool);
            expected.push((config.file.clone(), asked, drawn));
        }
    }
    let found = answers(&questions);
    assert_eq!(found.len(), expected.len() * (1 + NUMBERS));
    let mut reached = 0;
    for ((file, asked, drawn), answer) in expected.iter().zip(found.chunks(1 + NUMBERS)) {
        let place = format!("{}, {asked:?}: run cargo xtask page-core", file.display());
        match drawn {
            Err(fault) => assert_eq!(answer[0], f64::from(fault.cause.code()), "{place}"),
            Ok(drawn) => {
                let mut own = vec![0.0];
                drawn.write(|value| own.push(value));
                // The bits of a NaN depend on the processor.
                let bits = |value: &f64| if value.is_nan() { u64::MAX } else { value.to_bits() };
                let differs = own.iter().zip(answer).position(|(a, b)| bits(a) != bits(b));
                assert_eq!(differs, None, "{place}");
                reached += 1;
            }
        }
    }
    assert!(reached > expected.len() / 2, "{reached} of {} poses are reached", expected.len());
    assert!(reached < expected.len());
}
