// SPDX-License-Identifier: GPL-2.0-or-later
//! The page's data of generated machines, decoded as on the page.

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use machine::read::machine::MachineConfig;
use page_core::Described;
use serde_json::{Value, json};
use test_support::generated::{ALL, generated};
use view::data::Data;

#[test]
fn the_page_has_every_mechanism_with_its_numbers_limits_and_units() {
    for seed in ALL {
        let drawn = generated(seed);
        let folder = tempfile::tempdir().unwrap();
        let config = MachineConfig::read(&drawn.write(folder.path())).unwrap();
        let data: Value = serde_json::from_str(&Data::new(&config, false).json()).unwrap();
        assert_eq!((&data["title"], &data["is_live"]), (&json!(drawn.name), &json!(false)));
        let mechanisms = data["mechanisms"].as_array().unwrap();
        assert_eq!(mechanisms.len(), drawn.mechanisms.len());
        let unit = if drawn.unit == 1.0 { "mm" } else { "inch" };
        for (page, built) in mechanisms.iter().zip(&drawn.mechanisms) {
            // Numbers in JSON are read with an error of up to one unit in the last place.
            let off = page["tool"][2].as_f64().unwrap() / built.spindle_offset - 1.0;
            assert!(off.abs() < 1e-15, "{}: {}", drawn.name, page["tool"]);
            let bytes = BASE64_STANDARD.decode(page["numbers"].as_str().unwrap()).unwrap();
            let numbers: Vec<f64> = bytes
                .chunks_exact(8)
                .map(|bytes| f64::from_le_bytes(bytes.try_into().unwrap()))
                .collect();
            let read = Described::read(&numbers).unwrap();
            assert_eq!(read.geometry, built.geometry, "{}", drawn.name);
            assert_eq!(read.offsets[..built.offsets.len()], built.offsets, "{}", drawn.name);
            let limits = read.limits;
            assert_eq!(limits.tilt, drawn.tilt_limit.unwrap(), "{}", drawn.name);
            let named = page["limits"].as_object().unwrap();
            let has = |part: &str, limit: &str, unit: &str| {
                let is_it = |named: &&Value| named["part"] == part && named["limit"] == limit;
                let found = named.values().find(is_it);
                let found = found.unwrap_or_else(|| panic!("{}: {limit} of {part}", drawn.name));
                assert_eq!(found["unit"], unit, "{}: {limit} of {part}", drawn.name);
            };
            let joints = page["scene"]["joints"].as_array().unwrap();
            assert_eq!(joints.len(), built.joints.len());
            for (i, (joint, own)) in built.joints.iter().zip(joints).enumerate() {
                let [correction, rate] = joint.correction;
                let range = [joint.min + correction, joint.max - correction];
                assert_eq!([limits.min[i], limits.max[i]], range, "{} {i}", drawn.name);
                assert_eq!(limits.speed[i], joint.velocity - rate, "{} {i}", drawn.name);
                assert_eq!(own["number"], built.first_joint + i, "{}", drawn.name);
                let unit = if joint.is_angular { "degrees" } else { unit };
                let name = own["name"].as_str().unwrap();
                has(name, kinematics::Limit::JointRange.name(), unit);
                let speed = format!("the speed of {name}");
                has(&speed, kinematics::Limit::JointSpeed.name(), &format!("{unit}/s"));
            }
            for k in 0..6 {
                let Some(letter) = built.letters[k] else { continue };
                let unit = if k < 3 { unit } else { "degrees" };
                has(&format!("axis {letter}"), kinematics::Limit::Axis.name(), unit);
            }
        }
    }
}
