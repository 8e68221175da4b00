// SPDX-License-Identifier: GPL-2.0-or-later
//! Poses at which to read a gauge: of many legal ones, those that reduce the uncertainty of the motion the most, and
//! a path through them that avoids the measured object.

use super::at_tool::{self, CONFIDENCE, Refused};
use super::fit::covariance;
use super::gauge::{Kind, Object, normal};
use super::log;
use super::model::{Model, Tolerance};
use super::plan::next_best;
use super::reading::Changed;
use super::setup::{Extent, Setup};
use super::shape::{self, Shape};
use super::sheet::Stop;
use kinematics::{Fault, Letter, Vector3};
use machine::read::mechanism::Mechanism;
use nalgebra::DMatrix;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;

/// Candidate poses per object.
const CANDIDATES: usize = 200;

/// Least share of a normal along which the machine moves: below it, the object is not measured.
const LEAST_ALONG: f64 = 0.1;

/// Intervals at whose ends a path is checked.
const PIECES: usize = 24;

/// Largest rotation of a bar about its ball between two moves, degrees.
const ARC: f64 = 15.0;

/// A move on the way to a pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// End of the move: the tip as LinuxCNC displays it.
    pub at: [f64; 6],
    /// Whether it moves to or from the object, slowly.
    pub is_slow: bool,
}

/// The proposed poses and motions.
#[derive(Clone, Debug)]
pub struct Proposal {
    /// The poses, in order.
    pub stops: Vec<Stop>,
    /// Moves to each pose, the last one to the pose itself.
    pub paths: Vec<Vec<Step>>,
    /// Moves home after the last pose.
    pub home: Vec<Step>,
    /// Standard deviation of a reading due to the drawing's tolerances, largest of all poses, in the gauge's unit.
    pub spread: f64,
    /// Error of the tip due to the drawing's tolerances alone.
    pub drawn: Shape,
    /// Error of the tip after these readings.
    pub measured: Shape,
}

/// Why no poses can be proposed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoProposal {
    #[error(transparent)]
    Fault(#[from] Fault),
    #[error("object {0}: the machine does not move along its Z: change its angles")]
    Across(String),
    #[error(
        "object {0}: no pose is within the machine's limits; without a tilt, {1}: check unit, place and \
         tool"
    )]
    OutOfReach(String, String),
    #[error(
        "only {found} of {wanted} poses are within the machine's limits: check the places of the \
         objects, or allow other tilts (tilt = {tilt})"
    )]
    TooFew { found: usize, wanted: usize, tilt: f64 },
    #[error(
        "no path within the machine's limits from {0} to the remaining poses: use a smaller tilt or clearance"
    )]
    NoWay(String),
}

#[derive(Clone, Debug)]
struct Candidate {
    stop: Stop,
    /// Retracted position.
    over: [f64; 6],
    /// Position at the height of transit; for a bar equal to `over`.
    high: [f64; 6],
}

/// Poses in their order, see [`Proposal`].
struct Route {
    stops: Vec<Stop>,
    paths: Vec<Vec<Step>>,
    home: Vec<Step>,
}

/// The machine and setup for which poses are generated.
struct Maker<'a> {
    config: &'a Mechanism,
    setup: &'a Setup,
    /// Letters that the machine moves, as indices of X to C.
    free: Vec<usize>,
}

/// Proposes poses for a setup, for a machine within this tolerance of its drawing; `progress` receives the share
/// done.
///
/// # Errors
/// See [`NoProposal`].
pub fn propose(
    config: &Mechanism,
    setup: &Setup,
    tolerance: &Tolerance,
    mut progress: impl FnMut(f64),
) -> Result<Proposal, NoProposal> {
    let layout = config.machine.layout();
    let letters = layout.coordinates().as_slice().iter().chain(layout.table().as_slice());
    let maker = Maker { config, setup, free: letters.map(|letter| letter.index()).collect() };
    let mut candidates = vec![];
    for object in 0..setup.objects.len() {
        candidates.extend(maker.candidates(object)?);
    }
    maker.raise(&mut candidates);
    let wanted = setup.count;
    if candidates.len() < wanted {
        return Err(NoProposal::TooFew { found: candidates.len(), wanted, tilt: setup.tilt });
    }
    let (chosen, spread, [drawn, measured]) =
        maker.chosen(&candidates, tolerance, &mut progress)?;
    let chosen: Vec<Candidate> = chosen.into_iter().map(|k| candidates[k].clone()).collect();
    let Route { stops, paths, home } = maker.ordered(chosen)?;
    progress(1.0);
    Ok(Proposal { stops, paths, home, spread, drawn, measured })
}

impl Maker<'_> {
    fn is_free(&self, k: usize) -> bool {
        self.free.contains(&k)
    }

    /// Projects a direction on the axes that the machine moves.
    fn movable(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        Vector3::from_fn(|k, _| if self.is_free(k) { direction[k] } else { 0.0 })
    }

    /// Returns legal poses at an object, the first one level at its middle if possible.
    fn candidates(&self, object: usize) -> Result<Vec<Candidate>, NoProposal> {
        let own = &self.setup.objects[object];
        let along = self.movable(&normal(own));
        if self.setup.gauge.kind != Kind::Bar && along.dot(&normal(own)) < LEAST_ALONG {
            return Err(NoProposal::Across(own.name.clone()));
        }
        let mut random = Pcg64::seed_from_u64(object as u64);
        let mut found: Vec<Candidate> = self.candidate(object, [0.0; 5]).into_iter().collect();
        // A machine with one legal pose in fifty still yields enough.
        for _ in 0..50 * CANDIDATES {
            if found.len() >= CANDIDATES {
                break;
            }
            let draw = std::array::from_fn(|_| random.random_range(-1.0..=1.0));
            found.extend(self.candidate(object, draw));
        }
        match found.is_empty() {
            true => Err(NoProposal::OutOfReach(own.name.clone(), self.refused(object))),
            false => Ok(found),
        }
    }

    /// Returns why the machine does not reach an object, at the first pose tried.
    fn refused(&self, object: usize) -> String {
        let own = &self.setup.objects[object];
        let Some(at) = self.posed(object, [0.0; 5]) else {
            return "the machine does not reach the position with the expected reading".into();
        };
        let over = self.away(own, &at).map_or(at, |away| self.drawn_back(at, &away));
        match self.judged(&at).and(self.judged(&over)) {
            Err(refused) => refused.sentence(self.config),
            Ok(()) => "no path leads to it".into(),
        }
    }

    /// Creates the pose for numbers from -1 to 1: two for the position on the object, three for the angles.
    fn candidate(&self, object: usize, draw: [f64; 5]) -> Option<Candidate> {
        let own = &self.setup.objects[object];
        let at = self.posed(object, draw)?;
        let expected = self.setup.gauge.expected(self.config, own, at)?;
        let stop = Stop { object, at, expected };
        let over = self.drawn_back(at, &self.away(own, &at)?);
        let is_legal = self.is_legal(&at) && self.is_legal(&over) && self.is_clear(&at, &over);
        is_legal.then_some(Candidate { stop, over, high: over })
    }

    /// Returns the tip for numbers from -1 to 1, as [`Self::candidate`].
    fn posed(&self, object: usize, [u, v, a, b, c]: [f64; 5]) -> Option<[f64; 6]> {
        let own = &self.setup.objects[object];
        let mut at = self.config.home;
        for (k, share) in [(3, a), (4, b), (5, c)] {
            let axis = &self.config.axes[k];
            if self.is_free(k) {
                let angle: f64 = share * self.setup.tilt;
                at[k] = angle.clamp(axis.min, axis.max);
            }
        }
        self.place(&mut at, own, self.setup.extents[object], [u, v])?;
        self.round(&mut at);
        Some(at)
    }

    /// Retracts the tip from an object in this direction.
    fn drawn_back(&self, mut at: [f64; 6], away: &Vector3<f64>) -> [f64; 6] {
        self.shift(&mut at, &(away * self.setup.clearance));
        self.round(&mut at);
        at
    }

    /// Moves the tip to the position at which the gauge shows the expected reading.
    fn place(
        &self,
        at: &mut [f64; 6],
        own: &Object,
        extent: Extent,
        [u, v]: [f64; 2],
    ) -> Option<()> {
        let (gauge, frame) = (&self.setup.gauge, &own.frame);
        let spindle = self.config.spindle;
        let length = gauge.length(self.config, self.setup.expected);
        let local = match extent {
            Extent::Plane([x, y]) => Vector3::new(u * x / 2.0, v * y / 2.0, 0.0),
            Extent::Cone(half) => {
                // Uniform over the cap, because its height is uniform.
                let height = 1.0 - (u + 1.0) / 2.0 * (1.0 - half.to_radians().cos());
                let (s, c) = (v * std::f64::consts::PI).sin_cos();
                let out = (1.0 - height * height).max(0.0).sqrt();
                Vector3::new(out * c, out * s, height) * length
            }
        };
        let point = frame.origin + frame.rotation * local + spindle;
        (0..3).filter(|k| self.is_free(*k)).for_each(|k| at[k] = point[k]);
        let tip = Vector3::new(at[0], at[1], at[2]) - spindle;
        let shift = match gauge.kind {
            Kind::Bar => {
                let away = tip - frame.origin;
                let free = self.movable(&away);
                let left = length.powi(2) - (away - free).norm_squared();
                let norm = free.norm();
                (left > 0.0 && norm > 0.0).then(|| free * (left.sqrt() / norm - 1.0))?
            }
            Kind::Dial | Kind::Feeler => {
                let shown = gauge.length(self.config, gauge.expected(self.config, own, *at)?);
                let along = self.movable(&normal(own));
                let pose = log::shown(self.config, *at, &gauge.tool);
                // For a dial the tip moves in the opposite direction.
                let slope = gauge.slope(self.config, own, &pose, &gauge.tool);
                let rate = slope / gauge.length(self.config, 1.0);
                along * ((shown - length) * rate / along.dot(&normal(own)))
            }
        };
        self.shift(at, &shift);
        Some(())
    }

    /// Returns the direction away from an object, along axes that the machine moves.
    fn away(&self, own: &Object, at: &[f64; 6]) -> Option<Vector3<f64>> {
        let direction = match self.setup.gauge.kind {
            Kind::Bar => {
                let tip = Vector3::new(at[0], at[1], at[2]) - self.config.spindle;
                tip - own.frame.origin
            }
            Kind::Dial | Kind::Feeler => normal(own),
        };
        self.movable(&direction).try_normalize(0.0)
    }

    fn shift(&self, at: &mut [f64; 6], by: &Vector3<f64>) {
        (0..3).for_each(|k| at[k] += by[k]);
    }

    /// Rounds to the precision of a program: a tenth of a micrometer, a ten-thousandth of a degree.
    fn round(&self, at: &mut [f64; 6]) {
        let scale = 10_f64.powi(decimals(self.config) as i32);
        at.iter_mut().for_each(|x| *x = (*x * scale).round() / scale);
    }

    /// Checks whether a program can move the machine to a pose, with the gauge in its spindle.
    fn judged(&self, at: &[f64; 6]) -> Result<(), Refused> {
        let tool = &self.setup.gauge.tool;
        at_tool::programmable(self.config, &log::shown(self.config, *at, tool), tool)
    }

    /// Returns whether [`Self::judged`] accepts a pose.
    fn is_legal(&self, at: &[f64; 6]) -> bool {
        self.judged(at).is_ok()
    }

    /// Returns whether the machine can move straight from one pose to the other.
    fn is_clear(&self, from: &[f64; 6], to: &[f64; 6]) -> bool {
        let between = |share: f64| -> [f64; 6] {
            std::array::from_fn(|k| from[k] + share * (to[k] - from[k]))
        };
        (0..=PIECES).all(|piece| self.is_legal(&between(piece as f64 / PIECES as f64)))
    }

    /// Sets the transit position of every pose at a plane, and removes poses without a clear path to it.
    fn raise(&self, candidates: &mut Vec<Candidate>) {
        if self.setup.gauge.kind == Kind::Bar {
            return;
        }
        let lift = self.lift();
        let height = |at: &[f64; 6]| lift.dot(&Vector3::new(at[0], at[1], at[2]));
        let highest = candidates.iter().map(|c| height(&c.over)).fold(f64::NEG_INFINITY, f64::max);
        candidates.retain_mut(|candidate| {
            let up = lift * (highest - height(&candidate.over));
            self.shift(&mut candidate.high, &up);
            self.round(&mut candidate.high);
            self.is_clear(&candidate.over, &candidate.high)
        });
    }

    /// Returns the direction in which the tool is retracted: of the axes that the machine moves, the one
    /// nearest to the direction from tip to holder.
    fn lift(&self) -> Vector3<f64> {
        let mut direction = self.movable(&self.setup.gauge.tool);
        if direction.norm() == 0.0 {
            direction = self.movable(&normal(&self.setup.objects[0]));
        }
        let largest = direction.iamax();
        Vector3::from_fn(|k, _| if k == largest { direction[k].signum() } else { 0.0 })
    }

    /// Selects the best poses, the first one first, and returns the error of the tip before and after.
    fn chosen(
        &self,
        candidates: &[Candidate],
        tolerance: &Tolerance,
        progress: &mut impl FnMut(f64),
    ) -> Result<(Vec<usize>, f64, [Shape; 2]), NoProposal> {
        let (config, gauge) = (self.config, &self.setup.gauge);
        let mut model = Model::new(config.geometry, config.offsets, tolerance)?;
        for object in &self.setup.objects {
            model = model.with_unknown_frame(object.frame);
        }
        let mut axes: Vec<Option<Vector3<f64>>> = vec![];
        for object in &self.setup.objects {
            if !axes.contains(&gauge.axis(object)) {
                model = model.with_zero(axes.len(), gauge.zero);
                axes.push(gauge.axis(object));
            }
        }
        let drawing = vec![0.0; model.parameters.len()];
        let changed = Changed::new(&model, &drawing)?;
        let rows = |candidate: &Candidate| -> Result<DMatrix<f64>, Fault> {
            let Stop { object, at, expected } = candidate.stop;
            let own = &self.setup.objects[object];
            let mut reading = gauge.reading(config, own, at, expected)?;
            reading.frame = object;
            if let Some(zero) = &mut reading.instrument.zero {
                zero.number = axes.iter().position(|axis| *axis == zero.axis).unwrap_or(0);
            }
            Ok(changed.seen(&reading, &changed.at(reading.pose, &reading.tool)?).1)
        };
        let rows = candidates.iter().map(rows).collect::<Result<Vec<_>, Fault>>()?;
        let poses = at_tool::whole_workspace(config, &gauge.tool);
        let tips = [shape::rates(&model, &changed, &poses, &gauge.tool)?];
        let noise = gauge.length(config, gauge.deviation);
        // The first one is level, so that the operator can set the gauge there.
        let mut chosen = vec![0];
        let mut known = rows[0].clone();
        while chosen.len() < self.setup.count {
            let left: Vec<usize> = (0..rows.len()).filter(|k| !chosen.contains(k)).collect();
            let own: Vec<DMatrix<f64>> = left.iter().map(|k| rows[*k].clone()).collect();
            let Some(best) = next_best(&model, &known, &own, &tips, noise, 1).first().copied()
            else {
                break;
            };
            let row = known.nrows();
            known = known.resize_vertically(row + 1, 0.0);
            known.rows_mut(row, 1).copy_from(&own[best]);
            chosen.push(left[best]);
            progress(0.9 * chosen.len() as f64 / self.setup.count as f64);
        }
        let none = DMatrix::zeros(0, model.parameters.len());
        let of = |rows: &DMatrix<f64>| {
            shape::of_covariance(&tips[0], &covariance(&model, rows, noise), CONFIDENCE)
        };
        // The angle between a dial's axis and the plane's normal, which is neglected, changes it by a tenth at most.
        let spread = of_machine(&model, &known).iter().copied().fold(0.0, f64::max);
        Ok((chosen, gauge.shown(config, spread), [of(&none), of(&known)]))
    }

    /// Orders the poses, the first one first, then always the nearest reachable one.
    fn ordered(&self, mut left: Vec<Candidate>) -> Result<Route, NoProposal> {
        let (mut stops, mut paths) = (vec![], vec![]);
        let home = self.home();
        let mut here: Option<Candidate> = None;
        while !left.is_empty() {
            let mut order: Vec<usize> = (0..left.len()).collect();
            if let Some(here) = &here {
                order.sort_by(|a, b| {
                    self.distance(here, &left[*a]).total_cmp(&self.distance(here, &left[*b]))
                });
            }
            let next =
                order.into_iter().find_map(|k| Some((k, self.path(here.as_ref(), &left[k])?)));
            let Some((k, path)) = next else {
                let name = here.map_or("home".into(), |_| format!("pose {}", stops.len()));
                return Err(NoProposal::NoWay(name));
            };
            let candidate = left.remove(k);
            stops.push(candidate.stop.clone());
            paths.push(path);
            here = Some(candidate);
        }
        let last = here.expect("at least one pose is asked for");
        let mut back = self.out_of(&last);
        let over = back.last().map_or(last.high, |step| step.at);
        let through =
            self.transit(&over, &home).ok_or_else(|| NoProposal::NoWay("the last pose".into()))?;
        back.extend(through);
        Ok(Route { stops, paths, home: back })
    }

    /// Returns `[TRAJ]HOME` as LinuxCNC displays it with the tool offset active.
    fn home(&self) -> [f64; 6] {
        let mut home = self.config.start;
        self.shift(&mut home, &(self.config.spindle - self.setup.gauge.tool));
        home
    }

    /// Returns the distance between two poses, angles at the platform's radius.
    fn distance(&self, a: &Candidate, b: &Candidate) -> f64 {
        let radius = self.config.machine.radius().to_radians();
        let part = |k: usize| (a.stop.at[k] - b.stop.at[k]) * if k < 3 { 1.0 } else { radius };
        (0..6).map(|k| part(k).powi(2)).sum::<f64>().sqrt()
    }

    /// Plans moves from one pose to another that keep away from both objects.
    fn path(&self, from: Option<&Candidate>, to: &Candidate) -> Option<Vec<Step>> {
        let mut path = from.map_or(vec![], |from| self.out_of(from));
        let here = from.map_or(self.home(), |from| from.high);
        let is_arc = self.setup.gauge.kind == Kind::Bar
            && from.is_some_and(|from| from.stop.object == to.stop.object);
        path.extend(match is_arc {
            true => self.arc(&here, to)?,
            false => self.transit(&here, &to.high)?,
        });
        let step = |at, is_slow| Step { at, is_slow };
        if to.over != to.high {
            path.push(step(to.over, false));
        }
        path.push(step(to.stop.at, true));
        Some(path)
    }

    /// Returns the moves from a pose to the height of transit.
    fn out_of(&self, from: &Candidate) -> Vec<Step> {
        let mut path = vec![Step { at: from.over, is_slow: true }];
        if from.over != from.high {
            path.push(Step { at: from.high, is_slow: false });
        }
        path
    }

    /// Plans a straight transit, or a level one if the straight one violates limits.
    fn transit(&self, from: &[f64; 6], to: &[f64; 6]) -> Option<Vec<Step>> {
        let level = |at: &[f64; 6]| -> [f64; 6] {
            std::array::from_fn(|k| if k < 3 { at[k] } else { self.config.home[k] })
        };
        let paths = [vec![*to], vec![level(from), level(to), *to]];
        paths.into_iter().find_map(|ends| self.fast(from, &ends))
    }

    /// Plans a motion around the ball, at the distance of the poses.
    fn arc(&self, from: &[f64; 6], to: &Candidate) -> Option<Vec<Step>> {
        let centre = self.setup.objects[to.stop.object].frame.origin + self.config.spindle;
        let place = |at: &[f64; 6]| Vector3::new(at[0], at[1], at[2]) - centre;
        let (a, b) = (place(from), place(&to.high));
        let pieces = (a.angle(&b).to_degrees() / ARC).ceil().max(1.0) as usize;
        let between = |piece: usize| {
            let share = piece as f64 / pieces as f64;
            let mut at: [f64; 6] =
                std::array::from_fn(|k| from[k] + share * (to.high[k] - from[k]));
            let offset = (a + share * (b - a)).try_normalize(0.0)?
                * (a.norm() + share * (b.norm() - a.norm()));
            (0..3).filter(|k| self.is_free(*k)).for_each(|k| at[k] = centre[k] + offset[k]);
            self.round(&mut at);
            Some(at)
        };
        let mut ends = (1..pieces).map(between).collect::<Option<Vec<_>>>()?;
        ends.push(to.high);
        self.fast(from, &ends)
    }

    fn fast(&self, from: &[f64; 6], ends: &[[f64; 6]]) -> Option<Vec<Step>> {
        let mut here = *from;
        for end in ends {
            if !self.is_clear(&here, end) {
                return None;
            }
            here = *end;
        }
        Some(ends.iter().map(|at| Step { at: *at, is_slow: false }).collect())
    }
}

/// Returns the standard deviations of readings due to the drawing's tolerances of the machine alone.
fn of_machine(model: &Model, rows: &DMatrix<f64>) -> Vec<f64> {
    let of = |row: usize| {
        let own = model.parameters.iter().enumerate().filter(|(_, p)| p.quantity.is_of_machine());
        own.map(|(k, p)| (rows[(row, k)] * p.deviation).powi(2)).sum::<f64>().sqrt()
    };
    (0..rows.nrows()).map(of).collect()
}

/// Returns the decimals of lengths and angles in programs.
pub(crate) fn decimals(config: &Mechanism) -> usize {
    if config.units_per_mm == 1.0 { 4 } else { 5 }
}

/// Formats the words of the letters that the machine moves.
pub(crate) fn words(config: &Mechanism, at: &[f64; 6]) -> String {
    let layout = config.machine.layout();
    let decimals = decimals(config);
    let word =
        |letter: &Letter| format!("{}{:.decimals$}", letter.name(), at[letter.index()] + 0.0);
    let all = Letter::ALL.iter().filter(|letter| {
        layout.coordinates().as_slice().contains(letter)
            || layout.table().as_slice().contains(letter)
    });
    all.map(word).collect::<Vec<_>>().join(" ")
}
