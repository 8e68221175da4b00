// SPDX-License-Identifier: GPL-2.0-or-later
//! Least distance of two mechanisms of a machine, at home and within their axis limits.

use crate::findings::Report;
use crate::suggestion::shown_pose;
use crate::wiring::at_key;
use kinematics::Gap;
use machine::limits;
use machine::proof::axis_box;
use machine::proof::reach::Reach;
use machine::read::diagnostic::Severity;
use machine::read::error::MachineError;
use machine::read::machine::MachineConfig;
use machine::read::mechanism::Mechanism;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;

/// Pairs of poses sampled within the axis limits.
const DRAWN: usize = 20_000;

/// Checks the two mechanisms of a machine together; `None` for a single one.
///
/// # Errors
/// The reference pose of a mechanism is not legal.
pub fn check(config: &MachineConfig) -> Result<Option<Report>, MachineError> {
    let [first, second] = config.mechanisms.as_slice() else { return Ok(None) };
    let configs = [first, second];
    let at_home = configs.map(|config| {
        let at = config.machine.at(&config.home_pose(), &config.spindle);
        at.map_err(|fault| MachineError::of_geometry(&config.ini, &config.place, fault))
    });
    let [one, other] = at_home;
    let (one, other) = (one?, other?);
    let mut found = Report::new(first);
    let gap = Gap::between(&one, &other);
    let reported = |gap: &Gap| shown(configs, gap);
    found.fact("nearest parts", format!("{} at home", reported(&gap)));
    let least = limits::least_distance_between(first);
    if gap.distance < least {
        let text = format!(
            "{}, but MECHANISM_CLEARANCE requires {}; move HOME of one mechanism away",
            reported(&gap),
            limits::shown(least)
        );
        found.finding(Severity::Error, at_key(&config.ini, "TRAJ", "HOME", &text));
    }
    if let Some((gap, poses)) = nearest(configs) {
        let [one, other] = [0, 1].map(|i| shown_pose(configs[i], &poses[i]));
        let (apart, place) = (reported(&gap), format!("{one} and {other}"));
        found.fact(
            "",
            format!("{apart}, the smallest sampled within the axis limits of both, at {place}"),
        );
        if config.mechanism_clearance.is_none() {
            let (severity, text) = match gap.distance < least {
                true => (
                    Severity::Error,
                    format!(
                        "{apart} at {place}: they meet within the axis limits, and nothing stops them: set this key, or narrow the limits"
                    ),
                ),
                false => (
                    Severity::Warning,
                    "the thickness of rods, platforms and carriages is unknown: set the minimum \
                     distance between the lines of the two mechanisms"
                        .into(),
                ),
            };
            let error = at_key(&config.ini, "PKM", "MECHANISM_CLEARANCE", &text);
            found.finding(severity, error);
        }
    }
    Ok(Some(found))
}

fn shown(configs: [&Mechanism; 2], gap: &Gap) -> String {
    let name = limits::between(configs, gap.bodies);
    format!("{name} is {} {}", limits::shown(gap.distance), configs[0].length_unit())
}

/// Returns the nearest parts at poses sampled within the axis limits, legal for both mechanisms.
fn nearest(configs: [&Mechanism; 2]) -> Option<(Gap, [[f64; 6]; 2])> {
    let mut rng = Pcg64::seed_from_u64(3);
    let reaches = [Reach::new(configs[0]).ok()?, Reach::new(configs[1]).ok()?];
    let within = configs.map(axis_box::range);
    let mut nearest: Option<(Gap, [[f64; 6]; 2])> = None;
    for _ in 0..DRAWN {
        let mut drawn =
            || [0, 1].map(|i: usize| within[i].at(std::array::from_fn(|_| rng.random())));
        let poses = drawn();
        let (Ok(one), Ok(other)) = (reaches[0].at(&poses[0]), reaches[1].at(&poses[1])) else {
            continue;
        };
        let gap = Gap::between(&one, &other);
        if nearest.is_none_or(|(least, _)| gap.distance < least.distance) {
            nearest = Some((gap, poses));
        }
    }
    nearest
}
