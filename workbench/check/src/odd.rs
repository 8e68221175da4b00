// SPDX-License-Identifier: GPL-2.0-or-later
//! A leg that differs from all others: this shows a wrong sign or digit of one anchor, even if every HOME was computed
//! from it; and a limit of its joint that no other has.

use crate::findings::Report;
use crate::wiring::at_key;
use kinematics::At;
use machine::digits::plain;
use machine::limits;
use machine::read::diagnostic::Severity;
use machine::read::joints::Joint;
use machine::read::mechanism::Mechanism;

/// Least number of equal legs for reporting another one: of three legs, two close together and one
/// opposite are an ordinary layout.
const ALIKE: usize = 3;

/// Largest difference of equal legs, and smallest of a different one, as shares of the machine's size:
/// the first is more than the effect of calibration, the second less than that of a wrong sign.
const SAME: f64 = 2e-3;
const OTHER: f64 = 1e-2;

/// Ratio of similar values, and of values in different units: a minute, an inch.
const NEAR: f64 = 2.0;
const FAR: f64 = 10.0;

/// Reads the value of a key of a joint.
type Read = fn(&Joint) -> f64;

/// Keys that are usually equal for joints of legs of the same kind, and their values.
const KEYS: [(&str, Read); 4] = [
    ("MIN_LIMIT", |joint| joint.min),
    ("MAX_LIMIT", |joint| joint.max),
    ("MAX_VELOCITY", |joint| joint.max_velocity),
    ("MAX_ACCELERATION", |joint| joint.max_acceleration),
];

/// A quantity that every leg has.
struct Quantity {
    name: &'static str,
    unit: &'static str,
    /// Keys of the leg that may contain the mistake, the likeliest first.
    keys: [&'static str; 2],
    /// Scale of `SAME` and `OTHER`.
    scale: f64,
    values: Vec<f64>,
}

/// Reports the first leg that differs from all others, by the first quantity that shows it.
pub(super) fn check(report: &mut Report, config: &Mechanism, at: &At) {
    let found = quantities(config, at).into_iter().find_map(|quantity| {
        let leg = odd(&quantity.values, quantity.scale)?;
        Some((quantity, leg))
    });
    let Some((Quantity { name, unit, keys, values, .. }, leg)) = found else { return };
    let other = values[if leg == 0 { 1 } else { 0 }];
    let text = format!(
        "leg {} differs from the {} others: {name} is {} {unit}, theirs {}; check signs, digits and the order of \
         the anchors, unless the machine is built like that",
        config.place.first_leg + leg,
        values.len() - 1,
        limits::shown(values[leg]),
        limits::shown(other)
    );
    let section = config.place.leg_section(leg);
    let is_given = |key: &&str| config.ini.first(&section, key).is_some();
    let key = keys.into_iter().find(is_given).unwrap_or(keys[0]);
    report.finding(Severity::Warning, at_key(&config.ini, &section, key, &text));
}

/// Reports every key with a unique value at one joint, if those of all other legs are equal.
pub(super) fn keys(report: &mut Report, config: &Mechanism) {
    let joints = &config.joints[..config.legs()];
    if joints.iter().any(|joint| joint.kind != joints[0].kind) {
        return;
    }
    for (key, of) in KEYS {
        let values: Vec<f64> = joints.iter().map(of).collect();
        let Some(leg) = apart(&values) else { continue };
        let text = format!(
            "{} differs from the {} others, which have {}; check digits and unit, unless the machine is built \
             like that",
            joints[leg].name,
            values.len() - 1,
            others(&values, leg)
        );
        let section = config.place.joint_section(leg);
        report.finding(Severity::Warning, at_key(&config.ini, &section, key, &text));
    }
}

/// Formats the values of all other legs.
pub(crate) fn others(values: &[f64], leg: usize) -> String {
    match beside(values, leg).map(plain) {
        [low, high] if low == high => low.to_string(),
        [low, high] => format!("{low} to {high}"),
    }
}

/// Returns the value that differs from all others, which are equal; or that is many times as large or small as all
/// others, which are similar.
pub(crate) fn apart(values: &[f64]) -> Option<usize> {
    (values.len() > ALIKE).then_some(())?;
    (0..values.len()).find(|leg| {
        let ([low, high], own) = (beside(values, *leg), values[*leg]);
        let is_far = low > 0.0 && high <= NEAR * low && (own > FAR * high || own * FAR < low);
        (low == high && own != low) || is_far
    })
}

fn quantities(config: &Mechanism, at: &At) -> Vec<Quantity> {
    let (legs, size) = (config.geometry.legs(), config.machine.size());
    let unit = config.length_unit();
    let length = |name, keys, values| Quantity { name, unit, keys, scale: size, values };
    let platform = legs.iter().map(|leg| leg.platform[2]).collect();
    let base = legs.iter().map(|leg| leg.base[2]).collect();
    let mut all = vec![
        length("the height of its platform joint", ["PLATFORM", "EFFECTOR"], platform),
        length("the height of its base anchor", ["BASE", "GUIDE"], base),
    ];
    let kind = config.joints[0].kind;
    if config.joints[..legs.len()].iter().all(|joint| joint.kind == kind) {
        let scale = if config.unit(kind) == unit { size } else { 1.0_f64.to_degrees() };
        let values = at.joints()[..legs.len()].to_vec();
        let name = "its joint's value at home";
        all.push(Quantity {
            name,
            unit: config.unit(kind),
            keys: ["BASE", "PLATFORM"],
            scale,
            values,
        });
    }
    all
}

/// Returns the leg that differs from all others, which do not differ from each other.
fn odd(values: &[f64], scale: f64) -> Option<usize> {
    (0..values.len()).find(|leg| {
        let [low, high] = beside(values, *leg);
        let away = (low - values[*leg]).max(values[*leg] - high);
        values.len() > ALIKE && high - low <= SAME * scale && away > OTHER * scale
    })
}

/// Returns the least and largest value of all other legs.
fn beside(values: &[f64], leg: usize) -> [f64; 2] {
    let others = values.iter().enumerate().filter(|(i, _)| *i != leg);
    others
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], (_, x)| [low.min(*x), high.max(*x)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_of_many_is_odd_and_pairs_are_not() {
        assert_eq!(odd(&[9.0, 9.0, 9.5, 9.0], 10.0), Some(2));
        assert_eq!(odd(&[9.5, 9.0, 9.001, 9.0], 10.0), Some(0));
        assert_eq!(odd(&[9.0, 9.0, 9.05, 9.0], 10.0), None);
        assert_eq!(odd(&[9.0, 5.0, 9.0, 5.0], 10.0), None);
        assert_eq!(odd(&[5.0, 5.0, 9.0], 10.0), None);
    }

    #[test]
    fn one_value_is_apart_where_all_others_are_equal() {
        assert_eq!(apart(&[9.0, 9.0, 9.5, 9.0]), Some(2));
        assert_eq!(apart(&[9.5, 9.0, 9.0, 9.0]), Some(0));
        assert_eq!(apart(&[9.5, 9.0, 9.0, 9.1]), None);
        assert_eq!(apart(&[9.0, 9.0, 9.0, 9.0]), None);
        assert_eq!(apart(&[9.0, 9.0, 9.5]), None);
        assert_eq!(apart(&[4.4, 282.0, 4.7, 4.5]), Some(1));
        assert_eq!(apart(&[4.4, 8.2, 4.7, 4.5]), None);
    }
}
