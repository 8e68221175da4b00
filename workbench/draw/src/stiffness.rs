// SPDX-License-Identifier: GPL-2.0-or-later
//! The smallest stiffness over a plane, and as a function of the size of the platform.

use crate::contour::{contoured, plane_of};
use crate::lines::{Line, drawn_lines};
use crate::plot::{DrawError, Plot};
use crate::sheet::Frame;
use kinematics::Letter;
use machine::read::mechanism::Mechanism;
use studies::study::map::Map;

/// Caption and name in the file of each map.
const MAPS: [(&str, &str); 8] = [
    ("Smallest stiffness of translation", "translation"),
    ("Smallest stiffness of rotation", "rotation"),
    ("Stiffness along X", "x"),
    ("Stiffness along Y", "y"),
    ("Stiffness along Z", "z"),
    ("Stiffness about X", "about-x"),
    ("Stiffness about Y", "about-y"),
    ("Stiffness about Z", "about-z"),
];

/// Draws maps of the smallest stiffness of translation and of rotation in one plane, and of the stiffness along and
/// about each axis, unless that is rigid everywhere.
///
/// # Errors
/// As [`DrawError`].
pub fn of_stiffness(config: &Mechanism, map: &Map<8>) -> Result<Vec<Plot>, DrawError> {
    let letters = map.plane.map(|k| Letter::ALL[k].name());
    let (plane, length) = (plane_of(config, map), config.length_unit());
    let of = |k: usize| -> Result<Plot, DrawError> {
        let (name, what) = MAPS[k];
        let is_push = matches!(k, 0 | 2..=4);
        let (unit, scale) = if is_push { ("N/µm", 1e-3) } else { ("kN m/rad", 1e-6) };
        let values: Vec<f64> = map.values.iter().map(|own| own[k] * scale).collect();
        let caption = format!("{name} in {unit}, {plane}");
        let frame = Frame {
            title: &caption,
            x: &format!("{} in {}", letters[0], length),
            y: &format!("{} in {}", letters[1], length),
            limits: vec![],
        };
        let svg = contoured(&frame, unit, &map.sides, &values, &["unlimited"])?;
        let file =
            format!("stiffness-{what}-{}.svg", letters.iter().collect::<String>().to_lowercase());
        Ok(Plot { file, caption: caption.clone(), svg })
    };
    let yields = |k: &usize| *k < 2 || map.values.iter().any(|own| own[*k].is_finite());
    (0..MAPS.len()).filter(yields).map(of).collect()
}

/// Draws the smallest stiffness as a function of the size of the platform.
///
/// # Errors
/// As [`DrawError`].
pub fn of_platform_sizes(sizes: &[(f64, [f64; 2])]) -> Result<Plot, DrawError> {
    let whole = sizes.iter().find(|(factor, _)| *factor == 1.0).map_or([1.0; 2], |own| own.1);
    let line = |k: usize, name: &str| Line {
        name: name.into(),
        points: sizes.iter().map(|(factor, least)| (*factor, least[k] / whole[k])).collect(),
    };
    let lines = [line(0, "translation"), line(1, "rotation")];
    let caption = "Smallest stiffness by the size of the platform";
    let frame = Frame {
        title: caption,
        x: "size of the platform, as a share of this one",
        y: "stiffness, as a share of this machine's",
        limits: vec![],
    };
    let svg = drawn_lines(&frame, &lines)?;
    Ok(Plot { file: "platform-sizes.svg".into(), caption: caption.into(), svg })
}
