// SPDX-License-Identifier: GPL-2.0-or-later
//! The nearest legs, and the nearest limit.

use crate::findings::Report;
use crate::seen::Seen;
use crate::suggestion::shown_pose;
use crate::wiring::at_key;
use kinematics::{Margin, Nearest};
use machine::limits;
use machine::read::diagnostic::Severity;
use machine::read::ini::Ini;
use machine::read::mechanism::Mechanism;

/// Least remaining share of a limit at home: less is usually a mistake, and leaves no room for jogging.
const LEAST: f64 = 0.005;

/// Reports the nearest limit and the nearest legs at home.
pub(super) fn at_home(report: &mut Report, config: &Mechanism) {
    limit_at_home(report, config);
    legs_at_home(report, config);
}

/// Reports the limit with the smallest remaining share at home.
fn limit_at_home(report: &mut Report, config: &Mechanism) {
    let Ok(at) = config.machine.at(&config.home_pose(), &config.spindle) else { return };
    let mut nearest: Option<Margin> = None;
    limits::each(&at, &limits::of(config), |margin| {
        if nearest.is_none_or(|least| margin.share() < least.share()) {
            nearest = Some(margin);
        }
    });
    let Some(margin) = nearest.filter(|margin| margin.share().is_finite()) else { return };
    let text = format!(
        "{} at home: {} {}, {} allowed, {:.1} % margin; move [TRAJ]HOME if that is too little",
        limits::part(config, margin.limit, margin.part),
        limits::shown(margin.value),
        limits::unit(config, margin.limit, margin.part),
        limits::allowed(config, &margin),
        100.0 * margin.share()
    );
    report.fact("nearest limit", text.replace(" ,", ","));
    // A violation is reported at the line of the limit.
    if (0.0..LEAST).contains(&margin.share()) {
        let text =
            format!("the machine is at the edge of a limit there: {}", text.replace(" ,", ","));
        report.finding(Severity::Warning, at_key(&config.ini, "TRAJ", "HOME", &text));
    }
}

fn shown_nearest(config: &Mechanism, Nearest { distance, pair: [i, j] }: &Nearest) -> String {
    let (distance, unit) = (limits::shown(*distance), config.length_unit());
    let [i, j] = [i, j].map(|leg| config.place.first_leg + leg);
    format!("the center lines of legs {i} and {j} are {distance} {unit} apart")
}

/// Reports the nearest legs at home, and those whose distance is not checked.
fn legs_at_home(report: &mut Report, config: &Mechanism) {
    let at = config.machine.at(&config.home_pose(), &config.spindle);
    let nearest = at.ok().and_then(|at| at.nearest());
    if let Some(nearest) = nearest {
        report.fact("nearest legs", format!("{} at home", shown_nearest(config, &nearest)));
    }
    let meeting: Vec<String> = config
        .pairs()
        .into_iter()
        .filter(|pair| !config.machine.watch().is_watched(*pair))
        .map(|pair| pair.map(|leg| config.place.first_leg + leg))
        .map(|[i, j]| format!("{i} and {j}"))
        .collect();
    if !meeting.is_empty() {
        let name = if nearest.is_some() { "" } else { "nearest legs" };
        let text = format!("not judged, because they share an anchor: {}", meeting.join(", "));
        report.fact(name, text);
    }
}

/// Reports the nearest legs within the axis limits, and those that no limit keeps apart.
pub(super) fn seen(report: &mut Report, ini: &Ini, config: &Mechanism, seen: &Seen) {
    let Some((nearest, pose)) = &seen.nearest else { return };
    let (apart, place) = (shown_nearest(config, nearest), shown_pose(config, pose));
    report.more(
        "nearest legs",
        format!("{apart}, the smallest sampled within the axis limits, at {place}"),
    );
    if config.clearance.is_some() {
        return;
    }
    let (severity, text) = match nearest.distance < limits::beyond_axes(config).clearance {
        true => (
            Severity::Error,
            format!(
                "{apart} at {place}: they meet within the axis limits, and nothing stops them: set the \
                 minimum distance, narrow the axis limits, or check for swapped anchors"
            ),
        ),
        false => (
            Severity::Warning,
            "the thickness of the legs is unknown: set the minimum distance between center lines, their \
             diameter and some margin"
                .into(),
        ),
    };
    report.finding(severity, at_key(ini, "PKM", "ROD_CLEARANCE", &text));
}
