// SPDX-License-Identifier: GPL-2.0-or-later
//! Home position of the platform: at the center of its drives' travel, by the kinematics.

use crate::ini::Plan;
use crate::kinds::PlatformSide;
use crate::values::Refusal;
use machine::read::error::MachineError;
use machine::read::ini::Ini;
use machine::read::machine::{Lenient, MachineConfig};

use keys::leg as key;
use kinematics::{Pose, Vector3, leg};
use std::path::Path;

/// Least number of positions tested along the reach of a leg.
const PLACES: f64 = 50.0;

/// A position and its quality.
struct Found {
    home: [f64; 3],
    config: MachineConfig,
    /// Smallest share of a drive's distance from the end of its travel to the center; below 0 beyond the end.
    share: f64,
    /// The leg with this share, and its value.
    worst: (usize, f64),
    score: f64,
}

/// Returns the best position, and the machine there.
///
/// # Errors
/// No position is within the drives' ranges, or the values describe no machine.
pub fn found(plan: &Plan) -> Result<([f64; 3], MachineConfig), Refusal> {
    let places = match plan.values.list::<3>("home") {
        Some(home) => vec![home],
        None => places(plan),
    };
    let mut best: Option<Found> = None;
    let mut refused = None;
    for home in &places {
        match judged(plan, *home) {
            Ok(found) if best.as_ref().is_none_or(|best| found.score > best.score) => {
                best = Some(found);
            }
            Ok(_) => {}
            Err(MachineError::Ini(errors)) => {
                let lines: Vec<String> = errors.iter().map(|error| error.0.message()).collect();
                return Err(Refusal::Input(lines.join("\n")));
            }
            Err(error @ MachineError::Geometry(..)) => refused = Some((*home, fault(&error))),
        }
    }
    match best {
        Some(found) if found.share > 0.0 => Ok((found.home, found.config)),
        Some(found) => Err(Refusal::Misfit(beyond(plan, &found))),
        None => Err(Refusal::Misfit(out_of_reach(&places, refused))),
    }
}

fn fault(error: &MachineError) -> String {
    match error {
        MachineError::Geometry(_, fault, _) => fault.to_string(),
        MachineError::Ini(_) => String::new(),
    }
}

/// Evaluates the machine with its home at a position, read from its text like any other.
pub(crate) fn standing(plan: &Plan, home: [f64; 3]) -> Result<MachineConfig, MachineError> {
    let plan = Plan { home, ..plan.clone() };
    let ini = Ini::parse(Path::new(&format!("{}.ini", plan.name)), &plan.text())?;
    MachineConfig::leniently(&ini, Some(Lenient::Constraints))
}

/// Judges the machine at a home position.
fn judged(plan: &Plan, home: [f64; 3]) -> Result<Found, MachineError> {
    let machine = standing(plan, home)?;
    let config = machine.first();
    let refused = |fault| MachineError::of_geometry(&config.ini, &config.place, fault);
    let at =
        config.machine.at(&Pose::from_degrees(config.home), &config.spindle).map_err(refused)?;
    let share = |n: usize, value: f64| {
        let (min, max) = (config.joints[n].min, config.joints[n].max);
        2.0 * (value - min).min(max - value) / (max - min)
    };
    let shares = at.joints().iter().copied().enumerate().take(plan.legs.len());
    let worst = shares.min_by(|a, b| share(a.0, a.1).total_cmp(&share(b.0, b.1)));
    let worst = worst.unwrap_or_default();
    let share = share(worst.0, worst.1);
    // Struts depend on the height; carriages may be at the center of their rails at any height.
    let firmness = match plan.kind.leg {
        leg::Kind::Slider | leg::Kind::Crank if share > 0.0 => at.smallest_singular_value(),
        _ => 1.0,
    };
    Ok(Found { home, share, worst, score: share * firmness, config: machine })
}

/// Returns positions along the line through the center of the legs, at round numbers.
fn places(plan: &Plan) -> Vec<[f64; 3]> {
    let k = plan.kind.axis;
    let (middle, reach) = (middle(plan), reach(plan));
    let grid = 10_f64.powf((reach / PLACES).log10().floor());
    let sides: &[f64] = match plan.kind.side {
        PlatformSide::More => &[1.0],
        PlatformSide::WithTool if plan.is_up() => &[1.0],
        PlatformSide::WithTool => &[-1.0],
        PlatformSide::AboutOrigin => &[-1.0, 1.0],
    };
    let round = |value: f64| {
        // Multiples of a grid below 1 are inexact, those of its inverse are exact.
        let steps = (value / grid).round();
        if grid < 1.0 { steps / (1.0 / grid).round() } else { steps * grid }
    };
    let count = (reach / grid) as usize;
    let on_line = |n: usize, side: f64| {
        let mut place = middle;
        place[k] += side * n as f64 * grid;
        place.map(|x| round(x) + 0.0)
    };
    sides.iter().flat_map(|side| (0..=count).map(move |n| on_line(n, *side))).collect()
}

/// Returns the center of the base joints with their drives at the center of their travel; along the line, starting
/// where the platform joints are level with them.
fn middle(plan: &Plan) -> [f64; 3] {
    let k = plan.kind.axis;
    if plan.kind.side == PlatformSide::AboutOrigin {
        return [0.0; 3];
    }
    let [low, high] = plan.range();
    let count = plan.legs.len() as f64;
    let mut middle = Vector3::zeros();
    for leg in &plan.legs {
        let mut base = Vector3::from(leg.numbers::<3>(&key::BASE));
        if let Some(guide) = Vector3::from(leg.numbers::<3>(&key::GUIDE)).try_normalize(0.0) {
            base += guide * 0.5 * (low + high);
        }
        base[k] -= leg.numbers::<3>(&key::PLATFORM)[k];
        middle += base / count;
    }
    if !plan.constraints().is_empty() {
        // The platform is level on the machine's axis.
        (0..3).filter(|other| *other != k).for_each(|other| middle[other] = 0.0);
    }
    middle.into()
}

/// Returns the largest distance of the platform from there.
fn reach(plan: &Plan) -> f64 {
    let of_leg = |leg: &crate::anchors::Leg| {
        let [rod] = leg.numbers::<1>(&key::ROD);
        rod + Vector3::from(leg.numbers::<3>(&key::ARM)).norm()
    };
    match plan.kind.leg {
        leg::Kind::Slider | leg::Kind::Crank => plan.legs.iter().map(of_leg).fold(0.0, f64::max),
        _ => plan.range()[1].abs(),
    }
}

/// Names the leg that is farthest beyond its range, the distance, and a possible remedy.
fn beyond(plan: &Plan, found: &Found) -> String {
    let joint = &found.config.first().joints[found.worst.0];
    let unit = found.config.first().unit(joint.kind);
    let [x, y, z] = found.home;
    let value = found.worst.1;
    let is_given = plan.values.list::<3>("home").is_some();
    let way_out = match plan.kind.leg {
        leg::Kind::Slider => "change rods or rails, or choose another position with --home",
        leg::Kind::Crank => "change arms, rods or angles, or choose another position with --home",
        _ if is_given && value > joint.max => "move home nearer to the base, or use longer struts",
        _ if is_given => "move home farther from the base, or use shorter struts",
        _ if value > joint.max => "use longer struts, or more similar radii of base and platform",
        _ => "use shorter struts, or less similar radii of base and platform",
    };
    let where_from = if is_given { "at the given home" } else { "at the best home position found" };
    let what = match joint.kind.quantity() {
        "length" => format!("would be {value:.1} {unit} long"),
        "angle" => format!("would be at {value:.1} {unit}"),
        _ => format!("would be at {value:.1} {unit}"),
    };
    format!(
        "{where_from}, X{x} Y{y} Z{z}, {} {what}; {} to {} is possible: {way_out}",
        joint.name, joint.min, joint.max
    )
}

fn out_of_reach(places: &[[f64; 3]], refused: Option<([f64; 3], String)>) -> String {
    let Some(([x, y, z], text)) = refused else { return "no home position exists".into() };
    match places.len() {
        1 => format!("the machine cannot be at the given home, X{x} Y{y} Z{z}: {text}"),
        count => format!(
            "the machine cannot be at any of {count} positions along the line through the middle of its \
             legs; at the last one, X{x} Y{y} Z{z}: {text}. Check the dimensions, or choose a position \
             with --home"
        ),
    }
}
