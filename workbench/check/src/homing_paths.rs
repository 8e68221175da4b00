// SPDX-License-Identifier: GPL-2.0-or-later
//! Homing from any pose at switch-off: the path of every sequence in time, checked with
//! forward kinematics, and an order in which the legs keep their limits.
//!
//! Start poses are sampled within the axis limits, so the result is a sample, not a proof.
//! A joint moves to its switch at HOME_SEARCH_VEL and from there to HOME at HOME_FINAL_VEL; the overrun of the
//! switch, the backoff and the second approach are omitted. With a negative HOME_SEQUENCE the joints of
//! a sequence wait at their switches for each other.

use crate::sequence;
use crate::wiring::at_key;
use kinematics::{Joints, Letter, Pose};
use machine::limits;
use machine::proof::axis_box;
use machine::proof::reach::Reach;
use machine::read::ini::{Ini, IniError};
use machine::read::mechanism::Mechanism;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use std::collections::HashMap;

/// Number of sampled poses at switch-off.
const STARTS: usize = 200;

/// Largest number of random poses for them.
const DRAWS: usize = 20 * STARTS;

/// Poses sampled on the path of a sequence.
const STEPS: u32 = 40;

/// How a joint finds its position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HomingMethod {
    /// It moves to its switch, or to an index, at a speed.
    Search {
        /// Position there, HOME_OFFSET.
        switch: f64,
        /// Speed, joint units per second.
        speed: f64,
        /// The end of its travel to which a search for a switch moves.
        end: Option<f64>,
    },
    /// It is assumed to be at HOME_OFFSET.
    Known(f64),
    /// Its encoder is absolute, and it moves to HOME or stays.
    Absolute {
        /// HOME_ABSOLUTE_ENCODER = 1.
        moves: bool,
    },
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    pub method: HomingMethod,
    /// HOME_SEQUENCE; `None` if Home All does not home it.
    pub sequence: Option<i64>,
    /// Speed to HOME, joint units per second.
    speed: f64,
    home: f64,
}

/// Joints that home together.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Group {
    /// Their numbers in the mechanism.
    pub joints: Vec<usize>,
    /// Whether they leave their switches together.
    pub waits: bool,
}

/// A violation of the legs' limits by homing.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Broken {
    /// Start pose.
    pub start: [f64; 6],
    pub group: usize,
    /// Description.
    pub what: String,
}

/// Result of an order.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Outcome {
    /// Number of start poses.
    pub starts: usize,
    /// Number of those from which a limit is violated on the path.
    pub broken: usize,
    pub first: Option<Broken>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Moment {
    /// Seconds since the start.
    pub at: f64,
    /// Number of the moving group.
    pub group: usize,
    pub joints: Joints,
    /// Pose, x y z a b c in machine units and degrees; `None` if the joints have none.
    pub pose: Option<[f64; 6]>,
    /// Description of a violation there.
    pub broken: Option<String>,
}

#[derive(Clone, Debug)]
pub struct Homing<'a> {
    config: &'a Mechanism,
    pub joints: Vec<Joint>,
    /// Start poses, with their joint values.
    starts: Vec<([f64; 6], Joints)>,
}

impl<'a> Homing<'a> {
    /// Creates it from the INI file; `None` if axes carry something, which is not supported here.
    ///
    /// # Errors
    /// A value that is not a number.
    pub fn new(config: &'a Mechanism) -> Result<Option<Self>, IniError> {
        if !config.chain.is_empty() {
            return Ok(None);
        }
        let joints = (0..config.joints.len())
            .map(|i| joint(&config.ini, config, i))
            .collect::<Result<Vec<_>, _>>()?;
        let mut homing = Self { config, joints, starts: vec![] };
        homing.starts = homing.drawn();
        Ok(Some(homing))
    }

    /// Returns random legal poses within the axis limits, with the joints that are known to be
    /// elsewhere there.
    fn drawn(&self) -> Vec<([f64; 6], Joints)> {
        let Ok(reach) = Reach::new(self.config) else { return vec![] };
        let within = axis_box::range(self.config);
        let mut rng = Pcg64::seed_from_u64(3);
        let poses = (0..DRAWS).map(|_| within.at(std::array::from_fn(|_| rng.random())));
        let taken = poses.filter(|pose| reach.check(pose).is_ok());
        let started = taken.filter_map(|pose| {
            let (machine, spindle) = (&self.config.machine, &self.config.spindle);
            let mut joints = machine.inverse(&Pose::from_degrees(pose), spindle).ok()?;
            for (value, joint) in joints.iter_mut().zip(&self.joints) {
                if let HomingMethod::Known(at) = joint.method {
                    *value = at;
                }
            }
            self.moment(0.0, 0, joints, &mut Pose::from_degrees(pose))
                .broken
                .is_none()
                .then_some((pose, joints))
        });
        started.take(STARTS).collect()
    }

    pub fn moves(&self) -> bool {
        self.joints.iter().any(|joint| match joint.method {
            HomingMethod::Search { .. } | HomingMethod::Absolute { moves: true } => true,
            HomingMethod::Known(at) => at != joint.home,
            HomingMethod::Absolute { moves: false } => false,
        })
    }

    /// Returns the share of the start poses in which the switch of joint `i` must be closed already: the joint is
    /// between the switch and the end to which its search moves. `None` if it searches no switch.
    pub fn share_closed(&self, i: usize) -> Option<f64> {
        let HomingMethod::Search { switch, end: Some(end), .. } = self.joints.get(i)?.method else {
            return None;
        };
        let is_closed =
            |(_, joints): &&([f64; 6], Joints)| (joints[i] - switch) * (end - switch) > 0.0;
        let count = self.starts.iter().filter(is_closed).count();
        (!self.starts.is_empty()).then(|| count as f64 / self.starts.len() as f64)
    }

    /// Returns the groups in the order of the INI file.
    pub fn order(&self) -> Vec<Group> {
        let mut numbers: Vec<i64> = self.joints.iter().filter_map(|joint| joint.sequence).collect();
        numbers.sort_by_key(|number| number.abs());
        numbers.dedup_by_key(|number| number.abs());
        let of = |number: i64| {
            let is_in =
                |i: &usize| self.joints[*i].sequence.is_some_and(|s| s.abs() == number.abs());
            let joints: Vec<usize> = (0..self.joints.len()).filter(is_in).collect();
            let waits = joints.iter().any(|i| self.joints[*i].sequence < Some(0));
            Group { joints, waits }
        };
        numbers.into_iter().map(of).collect()
    }

    /// Returns the result of an order from all start poses.
    pub fn judge(&self, order: &[Group]) -> Outcome {
        let mut outcome = Outcome { starts: self.starts.len(), broken: 0, first: None };
        for (pose, joints) in &self.starts {
            let way = self.follow(order, pose, *joints);
            let Some(moment) = way.iter().find(|moment| moment.broken.is_some()) else { continue };
            outcome.broken += 1;
            let what = moment.broken.clone().unwrap_or_default();
            outcome.first.get_or_insert(Broken { start: *pose, group: moment.group, what });
        }
        outcome
    }

    /// Returns the path from the start with a violation, or from the one that takes longest.
    pub fn track(&self, order: &[Group]) -> Vec<Moment> {
        let ways = self.starts.iter().map(|(pose, joints)| self.follow(order, pose, *joints));
        let breaks = |way: &[Moment]| way.last().is_some_and(|moment| moment.broken.is_some());
        let duration = |way: &[Moment]| way.last().map_or(0.0, |moment| moment.at);
        let worse = |a: &Vec<Moment>, b: &Vec<Moment>| {
            breaks(a).cmp(&breaks(b)).then(duration(a).total_cmp(&duration(b)))
        };
        ways.max_by(worse).unwrap_or_default()
    }

    /// Returns an order in as few sequences as possible, whose joints wait for each other, that keeps all limits from
    /// every start; `None` if none exists.
    pub fn safe_order(&self) -> Option<Vec<Group>> {
        if self.starts.is_empty() {
            return None;
        }
        let all = (1_usize << self.joints.len()) - 1;
        let mut before: HashMap<usize, usize> = HashMap::from([(0, 0)]);
        let mut reached = vec![0_usize];
        while !before.contains_key(&all) {
            let mut next = vec![];
            for homed in reached {
                // The largest groups first.
                let mut groups: Vec<usize> = (1..=all).filter(|group| group & homed == 0).collect();
                groups.sort_by_key(|group| std::cmp::Reverse(group.count_ones()));
                for group in groups {
                    let state = homed | group;
                    if !before.contains_key(&state) && self.keeps(homed, group) {
                        before.insert(state, homed);
                        next.push(state);
                    }
                }
            }
            if next.is_empty() {
                return None;
            }
            reached = next;
        }
        let mut order = vec![];
        let mut state = all;
        while state != 0 {
            order.push(Group { joints: self.members(state & !before[&state]), waits: true });
            state = before[&state];
        }
        order.reverse();
        Some(order)
    }

    fn members(&self, set: usize) -> Vec<usize> {
        (0..self.joints.len()).filter(|i| set >> i & 1 == 1).collect()
    }

    /// Returns whether a group keeps all limits from every start, with some joints homed already.
    fn keeps(&self, homed: usize, group: usize) -> bool {
        let group = Group { joints: self.members(group), waits: true };
        self.starts.iter().all(|(pose, joints)| {
            let mut at = *joints;
            self.members(homed).into_iter().for_each(|i| at[i] = self.after(i, at[i]));
            // From the pose of the start to the pose after homing those joints.
            let mut seed = Pose::from_degrees(*pose);
            let is_kept = |from: &Joints, to: &Joints, seed: &mut Pose| {
                (1..=STEPS).all(|step| {
                    let share = f64::from(step) / f64::from(STEPS);
                    let at = std::array::from_fn(|i| from[i] + share * (to[i] - from[i]));
                    self.config
                        .machine
                        .forward(&at, seed, &self.config.spindle, &self.config.solver)
                        .map(|solution| *seed = solution.pose)
                        .is_ok()
                })
            };
            if homed != 0 && !is_kept(joints, &at, &mut seed) {
                return false;
            }
            let way = self.group_moments(&group, 0, 0.0, &mut at, &mut seed);
            way.last().is_none_or(|moment| moment.broken.is_none())
        })
    }

    /// Returns the position of a joint after homing.
    fn after(&self, i: usize, before: f64) -> f64 {
        match self.joints[i].method {
            HomingMethod::Absolute { moves: false } => before,
            _ => self.joints[i].home,
        }
    }

    /// Returns the moments of homing, up to the first violation.
    fn follow(&self, order: &[Group], pose: &[f64; 6], mut joints: Joints) -> Vec<Moment> {
        let mut seed = Pose::from_degrees(*pose);
        let mut moments = vec![self.moment(0.0, 0, joints, &mut seed)];
        for (number, group) in order.iter().enumerate() {
            let at = moments.last().map_or(0.0, |moment| moment.at);
            moments.extend(self.group_moments(group, number, at, &mut joints, &mut seed));
            if moments.last().is_some_and(|moment| moment.broken.is_some()) {
                break;
            }
        }
        moments
    }

    /// Returns the moments of a group, which begin at a given time.
    fn group_moments(
        &self,
        group: &Group,
        number: usize,
        from: f64,
        joints: &mut Joints,
        seed: &mut Pose,
    ) -> Vec<Moment> {
        let start = *joints;
        let searched = group.joints.iter().map(|i| self.search_time(*i, start[*i]));
        let waited = if group.waits { searched.fold(0.0, f64::max) } else { 0.0 };
        let duration =
            group.joints.iter().map(|i| self.end(*i, start[*i], waited)).fold(0.0, f64::max);
        let mut moments = vec![];
        // A path without motion takes no time.
        let steps = if duration > 0.0 { STEPS } else { 0 };
        for step in 1..=steps {
            let t = duration * f64::from(step) / f64::from(steps);
            group.joints.iter().for_each(|i| joints[*i] = self.value(*i, start[*i], waited, t));
            moments.push(self.moment(from + t, number, *joints, seed));
            if moments.last().is_some_and(|moment| moment.broken.is_some()) {
                break;
            }
        }
        moments
    }

    fn search_time(&self, i: usize, from: f64) -> f64 {
        match self.joints[i].method {
            HomingMethod::Search { switch, speed, .. } => (switch - from).abs() / speed,
            _ => 0.0,
        }
    }

    /// Returns the start of the path to HOME.
    fn found(&self, i: usize, from: f64) -> f64 {
        match self.joints[i].method {
            HomingMethod::Search { switch, .. } => switch,
            _ => from,
        }
    }

    fn end(&self, i: usize, from: f64, waited: f64) -> f64 {
        let (found, joint) = (self.found(i, from), &self.joints[i]);
        let way = (self.after(i, found) - found).abs();
        self.search_time(i, from).max(waited) + way / joint.speed
    }

    fn value(&self, i: usize, from: f64, waited: f64, t: f64) -> f64 {
        let toward =
            |from: f64, to: f64, way: f64| from + (to - from).signum() * way.min((to - from).abs());
        let (found, joint) = (self.found(i, from), &self.joints[i]);
        let searched = self.search_time(i, from);
        if t < searched {
            return from + (found - from) * t / searched;
        }
        toward(found, self.after(i, found), joint.speed * (t - searched.max(waited)).max(0.0))
    }

    fn moment(&self, at: f64, group: usize, joints: Joints, seed: &mut Pose) -> Moment {
        let config = self.config;
        let (pose, broken) =
            match config.machine.forward(&joints, seed, &config.spindle, &config.solver) {
                Err(fault) => (None, Some(fault.to_string())),
                Ok(solution) => {
                    *seed = solution.pose;
                    let check = config.machine.at(seed, &config.spindle);
                    let broken = match check.map(|at| at.check(&limits::of_homing(config))) {
                        Ok(Ok(())) => None,
                        Ok(Err(margin)) => Some(limits::sentence(config, &margin)),
                        Err(fault) => Some(fault.to_string()),
                    };
                    (Some(seed.to_degrees()), broken)
                }
            };
        Moment { at, group, joints, pose, broken }
    }
}

fn joint(ini: &Ini, config: &Mechanism, i: usize) -> Result<Joint, IniError> {
    let section = config.place.joint_section(i);
    let number = |key, default| ini.number_or(&section, key, default);
    let [search, latch] = [number("HOME_SEARCH_VEL", 0.0)?, number("HOME_LATCH_VEL", 0.0)?];
    let place = number("HOME_OFFSET", 0.0)?;
    let own = &config.joints[i];
    // No joint moves faster, regardless of its keys.
    let speed = if search == 0.0 { latch } else { search }.abs().min(own.max_velocity);
    let method = match number("HOME_ABSOLUTE_ENCODER", 0.0)? {
        0.0 if speed > 0.0 => {
            // A switch may be beyond the travel of programs.
            let end = if search < 0.0 { own.min.min(place) } else { own.max.max(place) };
            HomingMethod::Search { switch: place, speed, end: (search != 0.0).then_some(end) }
        }
        0.0 => HomingMethod::Known(place),
        kind => HomingMethod::Absolute { moves: kind == 1.0 },
    };
    let back = number("HOME_FINAL_VEL", 0.0)?;
    Ok(Joint {
        method,
        sequence: sequence::of(ini, &section)?,
        speed: if back > 0.0 { back.min(own.max_velocity) } else { own.max_velocity },
        home: own.home,
    })
}

/// Returns HOME_SEQUENCE of every joint for an order: starting with -1, so that the joints of a sequence wait.
pub fn sequences(order: &[Group]) -> Vec<i64> {
    let count = order.iter().map(|group| group.joints.len()).sum();
    let mut numbers = vec![0; count];
    for (number, group) in order.iter().enumerate() {
        group.joints.iter().for_each(|i| numbers[*i] = -1 - number as i64);
    }
    numbers
}

/// Formats a pose in the letters that the machine moves.
pub fn shown(config: &Mechanism, pose: &[f64; 6]) -> String {
    let moved = Letter::ALL.iter().filter(|letter| !config.machine.layout().is_held(**letter));
    let word =
        |letter: &Letter| format!("{}{:.2}", config.place.letter(*letter), pose[letter.index()]);
    moved.map(word).collect::<Vec<_>>().join(" ")
}

/// Returns the line of the report, and the problem of the order if a better one exists.
///
/// # Errors
/// A value that is not a number.
pub(crate) fn summary(
    ini: &Ini,
    config: &Mechanism,
) -> Result<(String, Option<IniError>), IniError> {
    let Some(homing) = Homing::new(config)? else {
        return Ok((
            "judged only from HOME, because axes carry the work, the tool or the legs".into(),
            None,
        ));
    };
    // This is reported already.
    if homing.joints.iter().any(|joint| joint.sequence.is_none()) {
        return Ok(("judged only from HOME, because not all joints are homed".into(), None));
    }
    if !homing.moves() {
        return Ok(("moves nothing: all encoders are absolute".into(), None));
    }
    let Outcome { starts, broken, first } = homing.judge(&homing.order());
    if starts == 0 {
        return Ok(("not judged: no legal pose was found within the axis limits".into(), None));
    }
    let kept = starts - broken;
    let fact = format!(
        "keeps the limits of the legs from {kept} of {starts} sampled poses; see pkm homing"
    );
    let better = first.and_then(|first| Some((first, homing.safe_order()?)));
    let error = better.map(|(first, order)| {
        let numbers: Vec<String> = sequences(&order).iter().map(i64::to_string).collect();
        let section = config.place.joint_section(0);
        let text = format!(
            "from {} {}: set HOME_SEQUENCE from {section} on to {}, which avoids this from all {starts} \
             poses",
            shown(config, &first.start),
            first.what,
            numbers.join(" ")
        );
        at_key(ini, &section, "HOME_SEQUENCE", &text)
    });
    Ok((fact, error))
}
