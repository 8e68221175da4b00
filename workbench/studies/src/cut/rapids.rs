// SPDX-License-Identifier: GPL-2.0-or-later
//! Rapid moves through the material of `[stock]`, along the commanded path.

use crate::cut::program::stance;
use crate::dynamics::layer::{Coarse, Stock, UPRIGHT};
use crate::study::file::Study;
use kinematics::{Letter, Vector3};
use machine::read::mechanism::Mechanism;
use program::motion::{Move, MoveKind};

/// Largest depth of a rapid in the material that is rounding of an end point, mm.
const TOUCHES: f64 = 1e-6;

/// Returns the lines of rapid moves that pass through the material that earlier feed moves have left, in order, each once.
///
/// # Errors
/// Returns why this was not examined.
pub fn through_stock(
    config: &Mechanism,
    study: &Study,
    moves: &[Move],
) -> Result<Vec<u32>, String> {
    let stock = study.stock.as_ref().ok_or("the study has no [stock]")?;
    let run = study.milling.as_ref().ok_or("the study has no diameter_mm in [milling]")?;
    if !config.chain.is_empty() {
        return Err("an axis carries the tool or the work, with which [stock] does not move".into());
    }
    let tilts = |letter: &Letter| [Letter::A, Letter::B].contains(letter);
    if config.dependent().iter().any(tilts) {
        return Err(
            "the tool tilts as it moves, but [stock] is a map of heights for a vertical tool"
                .into(),
        );
    }
    let radius = run.diameter_mm.0 / 2.0;
    Coarse::check(stock, radius).map_err(|error| error.to_string())?;
    let mut material = Stock::from(stock);
    let mut lines: Vec<u32> = vec![];
    for pair in moves.windows(2) {
        let [from, to] = [&pair[0], &pair[1]];
        // A move starts with its own tool offset.
        let start = Move { end: from.end, extra_end: from.extra_end, ..*to };
        let [start, end] = [&start, to].map(|step| stance(config, step));
        let (Ok(start), Ok(end)) = (start, end) else {
            return Err(format!("line {}: the machine does not reach the pose", to.line));
        };
        let tips = [&start, &end].map(|stance| {
            (Vector3::from_fn(|k, _| stance.pose[k]) - stance.tool) / config.units_per_mm
        });
        if !(tips.iter().any(|tip| tip.z < stock.top_mm)) {
            continue;
        }
        let upright = start.rotation[(2, 2)].min(end.rotation[(2, 2)]);
        if upright < UPRIGHT {
            return Err(format!(
                "line {}: the tool is inclined by {:.2} degrees, but [stock] is a map of heights for a vertical tool",
                to.line,
                upright.clamp(-1.0, 1.0).acos().to_degrees()
            ));
        }
        // Cells at the border of an earlier cut may remain.
        let narrow = radius - 2.0 * stock.cell_mm;
        let places: Vec<Vector3<f64>> = material.along(&tips).collect();
        let is_in = |tip: &Vector3<f64>| material.depth_under(tip, narrow) > TOUCHES;
        if to.kind == MoveKind::Rapid && !lines.contains(&to.line) && places.iter().any(is_in) {
            lines.push(to.line);
        }
        // A rapid through material also leaves a groove.
        places.iter().for_each(|tip| material.cut(tip, radius));
    }
    Ok(lines)
}
