// SPDX-License-Identifier: GPL-2.0-or-later
//! Leads and hands of the screws.
//!
//! The sign of a lead gives the hand only together with the axes of the strut's two cardan joints: right-hand
//! screws are positive if these were entered in opposite directions, as seen along the strut at the reference pose.

use crate::findings::Report;
use crate::odd::{apart, others};
use crate::wiring::at_key;
use kinematics::leg::StrutGeometry;
use kinematics::{At, LegKind, Vector3};
use machine::digits::plain;
use machine::limits;
use machine::read::diagnostic::Severity;
use machine::read::mechanism::Mechanism;

/// Cosine of the angle between the two axes, as seen along the strut, below which directions are neither equal nor
/// opposite: the axes are those of one joint turned by 60 degrees or more.
const UNCLEAR: f64 = 0.5;

/// Travel per turn of a screw, as a share of a strut's travel, above which the unit of the lead is doubted: a
/// choice of this check, five turns from end to end.
const STEEP: f64 = 0.2;

struct Screw {
    leg: usize,
    lead: f64,
    /// Whether its axes were entered in opposite directions; `None` if undecided.
    is_opposite: Option<bool>,
}

impl Screw {
    fn is_right(&self) -> Option<bool> {
        self.is_opposite.map(|opposite| opposite == (self.lead > 0.0))
    }
}

/// Returns the hand of every leg's screw at home: `R`, `L`, or `?` if undecided; none for legs without a screw.
pub fn hands(config: &Mechanism, at: &At) -> Vec<Option<char>> {
    let mut hands = vec![None; config.legs()];
    for screw in screws(config, at) {
        hands[screw.leg] =
            Some(screw.is_right().map_or('?', |right| if right { 'R' } else { 'L' }));
    }
    hands
}

/// Reports leads and hands, and differing hands.
pub(super) fn check(report: &mut Report, config: &Mechanism, at: &At) {
    let is_strut = |leg: &kinematics::LegGeometry| matches!(leg.kind, LegKind::Strut(_));
    if !config.geometry.legs().iter().any(is_strut) {
        return;
    }
    let screws = screws(config, at);
    if screws.is_empty() {
        let text = "no strut has a lead (SCREW_LEAD, LEAD), so no screw turns with the pose, as with guided or locked rods";
        return report.fact("screws", text);
    }
    for (hand, is_right) in
        [("right-hand", Some(true)), ("left-hand", Some(false)), ("of unknown hand", None)]
    {
        let own: Vec<&Screw> = screws.iter().filter(|screw| screw.is_right() == is_right).collect();
        if own.is_empty() {
            continue;
        }
        let list: Vec<String> = own
            .iter()
            .map(|screw| format!("{} ({})", name(config, screw), plain(screw.lead.abs())))
            .collect();
        let text = format!(
            "{hand}, with the lead in {} per turn: strut {}; if that is wrong, change the sign of the lead or of one \
             of the two axes",
            config.length_unit(),
            list.join(", ")
        );
        report.fact("screws", text);
    }
    differing(report, config, &screws);
    odd_lead(report, config);
    if let Some(screw) = screws.iter().find(|screw| {
        let joint = &config.joints[screw.leg];
        screw.lead.abs() > STEEP * (joint.max - joint.min)
    }) {
        steep(report, config, screw);
    }
}

/// Reports a lead that differs from those of all other struts.
fn odd_lead(report: &mut Report, config: &Mechanism) {
    let legs = config.geometry.legs();
    let leads: Vec<f64> = legs.iter().map(|leg| leg.kind.screw().lead.abs()).collect();
    let Some(leg) = apart(&leads) else { return };
    let text = format!(
        "{} has a lead of {} {} per turn, the {} others {}; check digits and unit, unless its screw differs",
        config.joints[leg].name,
        plain(leads[leg]),
        config.length_unit(),
        leads.len() - 1,
        others(&leads, leg)
    );
    let (section, key) = place_of_lead(config, leg);
    report.finding(Severity::Warning, at_key(&config.ini, &section, key, &text));
}

/// Returns the section and key of a lead.
fn place_of_lead(config: &Mechanism, leg: usize) -> (String, &'static str) {
    let section = config.place.leg_section(leg);
    match config.ini.first(&section, "LEAD") {
        Some(_) => (section, "LEAD"),
        None => ("PKM".into(), "SCREW_LEAD"),
    }
}

/// Reports a lead with which few turns cover the strut's travel.
fn steep(report: &mut Report, config: &Mechanism, screw: &Screw) {
    let (joint, unit) = (&config.joints[screw.leg], config.length_unit());
    let text = format!(
        "{} moves through its {} {unit} of travel in {:.1} turns: expected {unit} per turn, as for all lengths",
        joint.name,
        limits::shown(joint.max - joint.min),
        (joint.max - joint.min) / screw.lead.abs()
    );
    let (section, key) = place_of_lead(config, screw.leg);
    report.finding(Severity::Warning, at_key(&config.ini, &section, key, &text));
}

fn name(config: &Mechanism, screw: &Screw) -> usize {
    config.place.first_leg + screw.leg
}

fn screws(config: &Mechanism, at: &At) -> Vec<Screw> {
    let strut = |(leg, geometry): (usize, &kinematics::LegGeometry)| {
        let strut = geometry.kind.screw();
        (strut.lead != 0.0).then(|| {
            let along = at.segments()[leg].span().normalize();
            Screw { leg, lead: strut.lead, is_opposite: is_opposite(&strut, &along) }
        })
    };
    config.geometry.legs().iter().enumerate().filter_map(strut).collect()
}

/// Compares the components of the axes normal to the strut; home is level, so the platform's axes are those of base.
fn is_opposite(strut: &StrutGeometry, along: &Vector3<f64>) -> Option<bool> {
    let square = |axis: [f64; 3]| {
        let axis = Vector3::from(axis);
        (axis - along * along.dot(&axis)).try_normalize(0.0)
    };
    let cosine = square(strut.base_axis)?.dot(&square(strut.platform_axis)?);
    (cosine.abs() > UNCLEAR).then_some(cosine < 0.0)
}

/// Reports differing hands: screws of one machine usually have the same.
fn differing(report: &mut Report, config: &Mechanism, screws: &[Screw]) {
    let of = |hand| screws.iter().filter(|screw| screw.is_right() == Some(hand)).count();
    let (right, left) = (of(true), of(false));
    if right == 0 || left == 0 {
        return;
    }
    let rarer = right < left;
    let (own, other) = if rarer { ("right", "left") } else { ("left", "right") };
    for screw in screws.iter().filter(|screw| screw.is_right() == Some(rarer)) {
        let senses = if screw.is_opposite == Some(true) { "opposite" } else { "equal" };
        let text = format!(
            "strut {} counts as {own}-hand, but {} others as {other}-hand: its lead is {}, and BASE_N and PLATFORM_N \
             have {senses} senses along the strut; reverse one of them or its LEAD, unless this screw is {own}-hand",
            name(config, screw),
            right.max(left),
            screw.lead,
        );
        let section = config.place.leg_section(screw.leg);
        let key = match config.ini.first(&section, "LEAD") {
            Some(_) => "LEAD",
            None => "PLATFORM_N",
        };
        report.finding(Severity::Warning, at_key(&config.ini, &section, key, &text));
    }
}
