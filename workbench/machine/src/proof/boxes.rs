// SPDX-License-Identifier: GPL-2.0-or-later
//! Pose boxes for the start without a seed: constructed for the axis limits of a machine, and proved.

use crate::digits::plain;
use crate::proof::choose;
use crate::proof::one_to_one::{Doubt, Prover};
use crate::read::boxes::{BoxSection, Claim};
use crate::read::mechanism::Mechanism;
use kinematics::{Letter, MAX_BOXES};
use nalgebra::DMatrix;

/// Most cells of a proof.
pub const MOST_CELLS: usize = 2_000_000;

/// Widening of a box as a share of the range, so that poses on an axis limit are not on its faces.
const WIDENED: f64 = 1e-3;

/// Returns the axis limits of the coordinates that the legs move, slightly widened.
///
/// # Errors
/// A limit is missing.
pub fn workspace(config: &Mechanism) -> Result<([f64; 6], [f64; 6]), Doubt> {
    let (mut low, mut high) = ([0.0; 6], [0.0; 6]);
    for letter in config.machine.layout().coordinates().as_slice() {
        let (k, axis) = (letter.index(), &config.axes[letter.index()]);
        let margin = WIDENED * (axis.max - axis.min);
        if !margin.is_finite() {
            return Err(Doubt::Malformed(
                "an axis that the legs move has no MIN_LIMIT or MAX_LIMIT; add both",
            ));
        }
        (low[k], high[k]) = (axis.min - margin, axis.max + margin);
    }
    Ok((low, high))
}

/// Returns proved boxes that contain all poses within the axis limits, and the number of cells of each proof. `progress`
/// receives the completed share.
///
/// # Errors
/// Why there are none.
pub fn found(
    config: &Mechanism,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Vec<(BoxSection, usize)>, Doubt> {
    let prover = Prover::new(&config.machine, &config.geometry);
    let (low, high) = workspace(config)?;
    refuse_singular(config, &prover, [low, high])?;
    let mut claims =
        choose::claims(&prover, low, high, MAX_BOXES).map_err(|doubt| explained(config, doubt))?;
    // Before the proof, which is for the numbers in the file.
    for Claim { region, .. } in &mut claims {
        (region.low, region.high) = (region.low.map(plain), region.high.map(plain));
    }
    let count = claims.len() as f64;
    let proved = |(k, claim): (usize, Claim)| {
        let all = |share: f64| progress((k as f64 + share) / count);
        let prover = Prover::new(&config.machine, &config.geometry).with_progress(&all);
        let cells = prover.prove(&claim, MOST_CELLS)?;
        Ok((BoxSection { claim, geometry: config.hash }, cells))
    };
    claims.into_iter().enumerate().map(proved).collect()
}

/// What to do if no boxes cover the axis limits.
const WAY_OUT: &str = "make the axis limits smaller; pkm check ends with limits that are proved";

/// Refuses axis limits with singular poses, where no box can be one-to-one: a search would find none, after minutes. The
/// determinant of ∂q/∂X has another sign at a sampled pose than at home, so it is 0 between.
fn refuse_singular(
    config: &Mechanism,
    prover: &Prover,
    [low, high]: [[f64; 6]; 2],
) -> Result<(), Doubt> {
    let active = prover.active();
    let sign = |pose: &[f64; 6]| {
        let rows = prover.jacobian(pose).ok()?;
        let square = DMatrix::from_fn(active.len(), active.len(), |i, j| rows[(i, active[j])]);
        Some(square.determinant().signum())
    };
    let home = if active.len() == config.legs() { sign(&config.home) } else { None };
    let is_beyond = |pose: &[f64; 6]| home.zip(sign(pose)).is_some_and(|(home, own)| home != own);
    match choose::poses(active, &low, &high).into_iter().find(is_beyond) {
        None => Ok(()),
        Some(pose) => Err(Doubt::Limits(format!(
            "the axis limits contain singular poses, where no box can be one-to-one: there is one between home and {}; {WAY_OUT}",
            words(config, &pose)
        ))),
    }
}

/// Returns the cause for which no boxes cover the axis limits, and the way out.
fn explained(config: &Mechanism, doubt: Doubt) -> Doubt {
    match doubt {
        Doubt::Exceeded(pose, norm) => Doubt::Limits(format!(
            "the axis limits are too wide for {MAX_BOXES} boxes: two poses near {} may have the same joint values (norm \
             {norm:.4}, must be below 1); {WAY_OUT}",
            words(config, &pose)
        )),
        Doubt::Reach(pose, fault) => Doubt::Limits(format!(
            "the axis limits contain poses that the machine cannot reach: at {}: {}; {WAY_OUT}",
            words(config, &pose),
            config.place.counted(fault)
        )),
        other => other,
    }
}

fn words(config: &Mechanism, pose: &[f64; 6]) -> String {
    let word = |letter: &Letter| {
        format!("{}{:.3}", config.place.letter(*letter), pose[letter.index()] + 0.0)
    };
    let moved = config.machine.layout().coordinates().as_slice();
    moved.iter().map(word).collect::<Vec<_>>().join(" ")
}

/// Proves a section again and returns the number of cells. `progress` receives the completed share.
/// # Errors
/// It belongs to another geometry, or is not proved.
pub fn prove(
    config: &Mechanism,
    section: &BoxSection,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<usize, Doubt> {
    if section.geometry != config.hash {
        return Err(Doubt::Malformed(
            "GEOMETRY is the hash of another geometry; run pkm boxes --write",
        ));
    }
    let prover = Prover::new(&config.machine, &config.geometry).with_progress(progress);
    prover.prove(&section.claim, MOST_CELLS)
}
