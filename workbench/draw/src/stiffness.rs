// SPDX-License-Identifier: GPL-2.0-or-later
//! The smallest stiffness over a plane, and as a function of the size of the platform.

use crate::contour::contoured;
use crate::lines::{Line, drawn_lines};
use crate::plot::{DrawError, Plot};
use crate::sheet::Frame;
use kinematics::Letter;
use studies::study::map::Map;

/// Draws maps of the smallest stiffness of translation and of rotation in one plane.
///
/// # Errors
/// As [`DrawError`].
pub fn of_stiffness(length: &str, map: &Map) -> Result<[Plot; 2], DrawError> {
    let letters = map.plane.map(|k| Letter::ALL[k].name());
    let plane: String = letters.iter().collect();
    let of = |k: usize, what: &str, unit: &str, scale: f64| -> Result<Plot, DrawError> {
        let values: Vec<f64> = map.values.iter().map(|least| least[k] * scale).collect();
        let caption = format!("Smallest stiffness of {what} in the plane {plane}, in {unit}");
        let frame = Frame {
            title: &caption,
            x: &format!("{} in {}", letters[0], length),
            y: &format!("{} in {}", letters[1], length),
            limits: vec![],
        };
        let svg = contoured(&frame, unit, &map.sides, &values, &["unlimited"])?;
        let file = format!("stiffness-{what}-{}.svg", plane.to_lowercase());
        Ok(Plot { file, caption: caption.clone(), svg })
    };
    Ok([of(0, "translation", "N/µm", 1e-3)?, of(1, "rotation", "kN m/rad", 1e-6)?])
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
