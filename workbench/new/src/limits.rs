// SPDX-License-Identifier: GPL-2.0-or-later
//! Proved limits of the axes, and the resulting requirements on the drives.

use crate::carried::Carried;
use crate::ini::Plan;
use crate::values::Refusal;
use crate::wrist::Wrist;
use check::findings::Finding;
use check::usual::AWAY;
use check::wiring::at_key;
use kinematics::{Joints, Letter, leg};
use machine::limits::sentence;
use machine::proof::axis_box::{self, AxisBox, FARTHEST, ray};
use machine::proof::reach::{Reach, Stop};
use machine::read::diagnostic::Severity;
use machine::read::mechanism::Mechanism;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;

/// Largest angle that is tested by default, degrees, and the share of the possible range of X, Y and Z that must
/// remain.
const TILT: f64 = 15.0;
const ENOUGH: f64 = 0.25;

/// Smallest width of the limits: share of the machine's size, and degrees.
const NARROWEST: [f64; 2] = [0.01, 1.0];

/// Poses sampled for the speeds of drives.
const DRAWN: usize = 400;

/// Steps of finite differences: share of the machine's size, and degrees.
const STEP: [f64; 2] = [1e-4, 0.01];

/// Factor on the speeds and accelerations of the sampled poses.
const ROOM: f64 = 1.2;

/// Share of a drive's acceleration that constant speed of the tool may need.
const FOR_BENDS: f64 = 0.5;

/// Factor on accelerations: those of two blended motions add up.
const BLENDED: f64 = 2.0;

/// Returns a proved box of legal poses about home.
///
/// # Errors
/// Home is outside the limits, or there is no room around it.
pub fn proved(
    config: &Mechanism,
    plan: &Plan,
    progress: impl FnMut(f64),
) -> Result<AxisBox, Refusal> {
    let misfit = |stop: Stop| {
        let why = shown(config, stop);
        let way = if is_of_two_units(config, plan) {
            format!(
                "check that all struts and joints are in {}: the struts are more than {AWAY} times \
                 longer than any distance of a joint from its origin",
                config.length_unit()
            )
        } else {
            "change dimensions, or choose another position with --home".into()
        };
        Refusal::Misfit(format!("at home {why}: {way}"))
    };
    if let Some(tilt) = tilt(plan).filter(|tilt| *tilt < NARROWEST[1] / 2.0) {
        let text = format!("--tilt {tilt}: expected at least {} degrees", NARROWEST[1] / 2.0);
        return Err(Refusal::Input(text));
    }
    refuse_limits(config, plan)?;
    let reach = Reach::new(config).map_err(|fault| misfit(Stop::Fault(fault)))?;
    reach.check(&config.home).map_err(misfit)?;
    let within = extents(config, &reach, plan)?;
    let enough = if tilt(plan).is_some() { 0.0 } else { ENOUGH };
    let is_asked = Letter::ALL.map(|letter| asked(plan, letter).is_some());
    let found = axis_box::in_one_proof(config, &within, is_asked, enough, progress);
    let Some(found) = found.map_err(misfit)? else {
        return Err(unproved(config, &reach, plan));
    };
    let found = found.rounded().with_ends(&within, is_asked);
    let mut others = plan.letters().into_iter().filter(|letter| asked(plan, *letter).is_none());
    match others.find(|letter| is_narrow(config, &found, *letter)) {
        None => Ok(found),
        Some(letter) => Err(Refusal::Misfit(format!(
            "no travel around home can be proved along {}: use {}other dimensions, or another position with --home",
            letter.name(),
            if plan.tilts() { "less --tilt, " } else { "" }
        ))),
    }
}

/// Returns whether strut lengths suggest another unit.
fn is_of_two_units(config: &Mechanism, plan: &Plan) -> bool {
    plan.kind.leg == leg::Kind::Strut && plan.range()[1] > AWAY * config.machine.size()
}

/// Returns the requested limits for a letter.
fn asked(plan: &Plan, letter: Letter) -> Option<[f64; 2]> {
    plan.values.limits().iter().find(|(of, _)| *of == letter).map(|(_, ends)| *ends)
}

/// Refuses limits for a letter that does not move, or that exclude home.
fn refuse_limits(config: &Mechanism, plan: &Plan) -> Result<(), Refusal> {
    for (letter, [low, high]) in plan.values.limits() {
        let (name, home) = (letter.name(), config.home[letter.index()]);
        let why = if !plan.letters().contains(letter) {
            let moved: String = plan.letters().into_iter().map(Letter::name).collect();
            format!("the machine moves {moved}, but not {name}")
        } else if !(*low <= home && home <= *high) {
            format!(
                "home is at {name} {home}: use limits that include it, or another position with --home"
            )
        } else {
            continue;
        };
        return Err(Refusal::Input(format!("--limits {name} {low} {high}: {why}")));
    }
    Ok(())
}

/// Returns the refusal of unproved requested limits, with an illegal corner pose, if any.
fn unproved(config: &Mechanism, reach: &Reach, plan: &Plan) -> Refusal {
    let limits = plan.values.limits();
    let words: Vec<String> =
        limits.iter().map(|(l, [low, high])| format!("{} {low} {high}", l.name())).collect();
    let corner = |n: usize| {
        let mut pose = config.home;
        for (bit, (letter, ends)) in limits.iter().enumerate() {
            pose[letter.index()] = ends[n >> bit & 1];
        }
        pose
    };
    let stopped = (0..1 << limits.len()).map(corner).find_map(|pose| {
        let place = limits.iter().map(|(l, _)| format!("{}{}", l.name(), pose[l.index()]));
        let place = place.collect::<Vec<_>>().join(" ");
        Some(format!("at {place} {}", shown(config, reach.check(&pose).err()?)))
    });
    let why = stopped.unwrap_or_else(|| {
        "the corners are reachable, but a pose between them is not, or the proof takes too long"
            .into()
    });
    Refusal::Misfit(format!(
        "--limits {}: not proved for every pose within: {why}; use smaller limits, other dimensions, or another position with --home",
        words.join(", ")
    ))
}

/// Returns the requested tilt, degrees.
fn tilt(plan: &Plan) -> Option<f64> {
    plan.values.list::<1>("tilt").map(|[tilt]| tilt)
}

/// Returns findings for limits that are smaller than the requested tilt.
pub fn short_of_tilt(config: &Mechanism, plan: &Plan, limits: &AxisBox) -> Vec<Finding> {
    let Some(tilt) = tilt(plan) else { return vec![] };
    let is_short = |letter: &Letter| {
        let k = letter.index();
        letter.is_angle()
            && asked(plan, *letter).is_none()
            && limits.low[k].abs().min(limits.high[k].abs()) < tilt
    };
    let finding = |letter: Letter| {
        let [low, high] = [limits.low, limits.high].map(|ends| ends[letter.index()]);
        let text = format!(
            "--tilt {tilt}: only {low} to {high} degrees can be proved around home; see pkm workspace \
             for the limit, or change dimensions"
        );
        let section = config.place.axis_section(letter);
        let problem = *at_key(&config.ini, &section, "MAX_LIMIT", &text).0;
        Finding { severity: Severity::Warning, problem }
    };
    plan.letters().into_iter().filter(is_short).map(finding).collect()
}

fn is_narrow(config: &Mechanism, part: &AxisBox, letter: Letter) -> bool {
    let k = letter.index();
    let least = if letter.is_angle() { NARROWEST[1] } else { NARROWEST[0] * config.machine.size() };
    !(part.high[k] - part.low[k] >= least)
}

fn shown(config: &Mechanism, stop: Stop) -> String {
    match stop {
        Stop::Fault(fault) => fault.to_string(),
        Stop::Limit(margin) => sentence(config, &margin),
    }
}

/// Returns the distance that every single coordinate can move from home; angles up to the requested one.
fn extents(config: &Mechanism, reach: &Reach, plan: &Plan) -> Result<AxisBox, Refusal> {
    let mut extents = AxisBox { low: config.home, high: config.home };
    for letter in plan.letters() {
        let k = letter.index();
        let carried = plan.carried.as_ref();
        let carried = carried.and_then(|carried| carried.axis(letter.name())?.limits);
        // Limits that exclude home do not apply to this machine.
        let cap = carried.filter(|[low, high]| (*low..=*high).contains(&config.home[k]));
        if let Some([low, high]) = asked(plan, letter) {
            (extents.low[k], extents.high[k]) = (low, high);
            continue;
        }
        let far = match letter.is_angle() {
            true => tilt(plan).unwrap_or(TILT),
            false => FARTHEST * config.machine.size(),
        };
        let [(low, before), (high, behind)] =
            [-1.0, 1.0].map(|way| ray(config, reach, k, way * far));
        let [least, most] = cap.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        (extents.low[k], extents.high[k]) = (low.max(least), high.min(most));
        if let Some(stop) = before.or(behind).filter(|_| is_narrow(config, &extents, letter)) {
            return Err(Refusal::Misfit(format!(
                "the machine cannot leave home along {}: {}",
                letter.name(),
                shown(config, stop)
            )));
        }
    }
    Ok(extents)
}

/// Returns the largest speed and acceleration that every joint needs within the limits, if the tool moves at its
/// largest speed along X Y Z while all angles change at theirs, and both accelerate fully.
pub fn speeds(config: &Mechanism, plan: &Plan, limits: &AxisBox) -> Vec<[f64; 2]> {
    let Ok(reach) = Reach::new(config) else { return vec![] };
    let mut rng = Pcg64::seed_from_u64(3);
    let mut most = vec![[0.0_f64; 2]; plan.all_joints()];
    for n in 0..DRAWN {
        // The corners first.
        let shares = std::array::from_fn(|k| match n {
            0..64 => (n >> k & 1) as f64,
            _ => rng.random(),
        });
        let way = std::array::from_fn(|_| 2.0 * rng.random::<f64>() - 1.0);
        let Some(found) = at_pose(&reach, config, plan, &limits.at(shares), way) else { continue };
        for (most, found) in most.iter_mut().zip(found) {
            *most = [most[0].max(found[0]), most[1].max(found[1])];
        }
    }
    most.into_iter().map(|found| found.map(|value| rounded_up(ROOM * value))).collect()
}

/// Computes speeds and accelerations of the tool, along X Y Z and of angles, that the drives of an older configuration
/// can follow anywhere within the limits: its own, or less.
pub fn slowed(config: &Mechanism, plan: &Plan, limits: &AxisBox) -> [[f64; 2]; 2] {
    let Some(carried) = &plan.carried else { return plan.motion() };
    let needed = |share: f64| {
        let motion = carried.motion.map(|[speed, acceleration]| [speed, share * acceleration]);
        let carried = Carried { motion, ..carried.clone() };
        speeds(config, &Plan { carried: Some(carried), ..plan.clone() }, limits)
    };
    // The rest is what joints need at constant speed of the tool.
    let (whole, bends) = (needed(1.0), needed(f64::MIN_POSITIVE));
    let drives = || carried.joints.iter().map(|joint| joint.motion).zip(whole.iter().zip(&bends));
    let least = |shares: &mut dyn Iterator<Item = f64>| shares.fold(1.0, f64::min);
    let speed = least(&mut drives().map(|([most, _], ([speed, _], _))| most / speed));
    let bend = least(&mut drives().map(|([_, most], (_, [_, bend]))| FOR_BENDS * most / bend));
    let speed = speed.min(bend.sqrt());
    let acceleration = least(&mut drives().map(|([_, most], ([_, whole], [_, bend]))| {
        (most - speed * speed * bend) / (whole - bend)
    }));
    carried.motion.map(|[own_speed, own_acceleration]| {
        [rounded_down(speed, own_speed), rounded_down(acceleration, own_acceleration)]
    })
}

/// Rounds a share of a value down to two digits; a share of 1 or more leaves the value unchanged.
fn rounded_down(share: f64, value: f64) -> f64 {
    if !(share < 1.0) {
        return value;
    }
    let grid = 10_f64.powi(1 - (share * value).max(f64::MIN_POSITIVE).log10().floor() as i32);
    (share * value * grid).floor() / grid
}

/// Returns the speeds and accelerations at a pose; the second derivative is along one path through it.
fn at_pose(
    reach: &Reach,
    config: &Mechanism,
    plan: &Plan,
    pose: &[f64; 6],
    way: [f64; 6],
) -> Option<Vec<[f64; 2]>> {
    let [mut linear, angular] = plan.motion();
    if let Some(wrist) = Wrist::of(plan) {
        let of_platform = wrist.of_platform();
        linear = std::array::from_fn(|k| linear[k] + of_platform[k]);
    }
    let joints = |step: &[f64; 6], factor: f64| -> Option<Joints> {
        reach.joints(&std::array::from_fn(|k| pose[k] + factor * step[k])).ok()
    };
    let count = plan.all_joints();
    let mut sums = vec![[0.0_f64; 2]; count];
    for letter in plan.letters() {
        let mut step = [0.0; 6];
        let size = step_of(config, letter);
        step[letter.index()] = size;
        let (before, behind) = (joints(&step, -1.0)?, joints(&step, 1.0)?);
        for (i, sum) in sums.iter_mut().enumerate() {
            let rate = (behind[i] - before[i]).abs() / (2.0 * size);
            if letter.is_angle() { sum[1] += rate } else { sum[0] += rate * rate }
        }
    }
    let bend = bends(config, plan, way, joints)?;
    let of_joint = |(sum, bend): ([f64; 2], f64)| {
        let lengths = sum[0].sqrt();
        let speed = lengths * linear[0] + sum[1] * angular[0];
        // LinuxCNC allows X, Y and Z the same acceleration each.
        let acceleration = lengths * 3.0_f64.sqrt() * linear[1] + sum[1] * angular[1];
        [speed, BLENDED * acceleration + bend]
    };
    Some(sums.into_iter().zip(bend).map(of_joint).collect())
}

/// Returns the accelerations of the joints if the pose moves along a path at the largest speeds.
fn bends(
    config: &Mechanism,
    plan: &Plan,
    way: [f64; 6],
    joints: impl Fn(&[f64; 6], f64) -> Option<Joints>,
) -> Option<Vec<f64>> {
    let [[feed, _], [turn, _]] = plan.motion();
    let length = way[..3].iter().map(|x| x * x).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
    let mut rate = [0.0; 6];
    for letter in plan.letters() {
        let k = letter.index();
        rate[k] = if letter.is_angle() { turn * way[k].signum() } else { feed * way[k] / length };
    }
    // A time in which the tool moves by a few steps.
    let time = 10.0 * step_of(config, Letter::X) / feed;
    let (before, here, behind) = (joints(&rate, -time)?, joints(&rate, 0.0)?, joints(&rate, time)?);
    let bend = |i: usize| ((before[i] - 2.0 * here[i] + behind[i]) / (time * time)).abs();
    Some((0..plan.all_joints()).map(bend).collect())
}

fn step_of(config: &Mechanism, letter: Letter) -> f64 {
    if letter.is_angle() { STEP[1] } else { STEP[0] * config.machine.size() }
}

/// Rounds up to two digits.
fn rounded_up(value: f64) -> f64 {
    let grid = value.max(f64::MIN_POSITIVE).log10().floor() as i32 - 1;
    match grid {
        0.. => (value / 10_f64.powi(grid)).ceil() * 10_f64.powi(grid),
        _ => (value * 10_f64.powi(-grid)).ceil() / 10_f64.powi(-grid),
    }
}
