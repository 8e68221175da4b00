// SPDX-License-Identifier: GPL-2.0-or-later
//! Whether a machine's INI file describes a machine that fits together.

use crate::check::drives;
use crate::check::homing::{self, Trouble};
use crate::check::homing_ways;
use crate::check::mobility::Structure;
use crate::check::wiring::{self, at_key};
use crate::limits;
use crate::proof::axis_box::{self, AxisBox};
use crate::proof::conditioning;
use crate::proof::reach::{Reach, Stop};
use crate::read::diagnostic::Severity;
use crate::read::error::MachineError;
use crate::read::ini::{Ini, IniError, Problem};
use crate::read::joints::JointKind;
use crate::read::machine::MachineConfig;
use crate::read::tools::{self, Tool};
use kinematics::{Fault, Letter, Limit, Limits, Margin, Nearest};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use std::fmt::Write;

/// Largest difference of HOME of a joint and the kinematics at [TRAJ]HOME, as a share of the
/// machine's size (of a radian for arms): some micrometres, so that four digits after the point
/// in millimetres are enough.
const HOME_TOLERANCE: f64 = 1e-5;

/// Poses drawn from the axis limits.
const DRAWN: usize = 20_000;

/// Tilts of the table, as shares of the largest one within the axis limits.
const TILTS: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];

/// Share of the tilt limit that is tried to prove.
const TILT_SHARE: f64 = 0.98;

/// Digits after the point of suggested limits, of a box that is 1 to 10 units wide.
const LIMIT_DIGITS: i32 = 3;

/// One thing found.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// How much it weighs.
    pub severity: Severity,
    /// What, where, and a way out.
    pub problem: Problem,
}

/// What a check has found.
#[derive(Clone, Debug)]
pub struct Report {
    /// The machine.
    pub config: MachineConfig,
    /// Names and values, one line each.
    pub facts: Vec<(String, String)>,
    /// What does not fit, or may not.
    pub findings: Vec<Finding>,
    /// The box of poses that is proved to be inside the workspace.
    pub suggestion: Option<AxisBox>,
    /// Tilts of A and B, degrees, and the largest box in X Y Z that is proved with each, without a
    /// tool; empty where the machine does not tilt.
    pub tilts: Vec<(f64, Option<AxisBox>)>,
    /// Tools with which the suggestion is proved, too, of a machine that tilts.
    pub proved_tools: Vec<Tool>,
    /// Whether that is all of the box that the axis limits give.
    pub is_whole: bool,
}

impl Report {
    /// Whether nothing is wrong.
    pub fn fits(&self) -> bool {
        self.findings.iter().all(|finding| finding.severity == Severity::Warning)
    }

    fn fact(&mut self, name: &str, value: impl Into<String>) {
        self.facts.push((name.into(), value.into()));
    }

    fn finding(&mut self, severity: Severity, error: IniError) {
        self.findings.push(Finding { severity, problem: *error.0 });
    }
}

/// Checks a machine, of two mechanisms one; `progress` is told the share of the work that is done.
///
/// # Errors
/// The file describes no machine.
pub fn check(config: &MachineConfig, progress: impl FnMut(f64)) -> Result<Report, MachineError> {
    let ini = &*config.ini;
    let mut report = Report {
        config: config.clone(),
        facts: vec![],
        findings: vec![],
        suggestion: None,
        tilts: vec![],
        proved_tools: vec![],
        is_whole: false,
    };
    structure(&mut report, config)?;
    homes(&mut report, ini, config)?;
    for trouble in homing::check(ini, config)? {
        report.finding(severity(&trouble), homing_problem(ini, config, &trouble));
    }
    let (fact, error) = homing_ways::told(ini, config)?;
    report.fact("homing", fact);
    if let Some(error) = error {
        report.finding(Severity::Warning, error);
    }
    // Both mechanisms are on one module.
    for error in if config.place.is_second { vec![] } else { wiring::check(ini)? } {
        report.finding(Severity::Warning, error);
    }
    for (severity, error) in if config.place.is_second { vec![] } else { drives::check(ini)? } {
        report.finding(severity, error);
    }
    workspace(&mut report, ini, config, progress);
    Ok(report)
}

fn refused(config: &MachineConfig, fault: Fault) -> MachineError {
    MachineError::of_geometry(&config.ini, &config.place, fault)
}

fn structure(report: &mut Report, config: &MachineConfig) -> Result<(), MachineError> {
    let structure = Structure::of(config).map_err(|fault| refused(config, fault))?;
    let groups = config.groups();
    let legs: Vec<String> =
        groups.iter().map(|g| format!("{} {}", g.joints.len(), g.kind.plural())).collect();
    let extra: Vec<&str> = config.extra.iter().map(|axis| axis.joint.name.as_str()).collect();
    report
        .fact("joints", [legs, extra.into_iter().map(String::from).collect()].concat().join(", "));
    report.fact("mobility", structure.mobility());
    report.fact("count", structure.loops());
    report.fact("geometry hash", format!("{:#010x}", config.hash));
    Ok(())
}

fn tolerance(config: &MachineConfig, kind: JointKind) -> f64 {
    match kind {
        JointKind::Arm => HOME_TOLERANCE.to_degrees(),
        _ => HOME_TOLERANCE * config.machine.size(),
    }
}

/// HOME of joints and axes against the kinematics and the limits.
fn homes(report: &mut Report, ini: &Ini, config: &MachineConfig) -> Result<(), MachineError> {
    let joints = config
        .machine
        .inverse(&config.home_pose(), &config.spindle)
        .map_err(|fault| refused(config, fault))?;
    let mut farthest = 0.0_f64;
    for (i, (joint, wanted)) in config.joints.iter().zip(joints).enumerate() {
        let section = config.place.joint_section(i);
        let away = (joint.home - wanted).abs();
        farthest = farthest.max(away);
        if !(away <= tolerance(config, joint.kind)) {
            let text = format!("the kinematics put {} to {wanted} at [TRAJ]HOME", joint.name);
            report.finding(Severity::Error, at_key(ini, &section, "HOME", &text));
        }
        if !(joint.min..=joint.max).contains(&wanted) {
            let text = format!(
                "[TRAJ]HOME needs {wanted} of {}: widen its limits {} to {}, or move HOME",
                joint.name, joint.min, joint.max
            );
            report.finding(Severity::Error, at_key(ini, "TRAJ", "HOME", &text));
        }
    }
    for (letter, (axis, home)) in Letter::ALL.iter().zip(config.axes.iter().zip(config.home)) {
        if !(axis.min..=axis.max).contains(&home) {
            let name = config.place.letter(*letter);
            let text = format!(
                "{name} = {home} is outside of [AXIS_{name}], {} to {}",
                axis.min, axis.max
            );
            report.finding(Severity::Error, at_key(ini, "TRAJ", "HOME", &text));
        }
    }
    extra_homes(report, ini, config);
    report.fact("home", format!("joints within {farthest:.1e} of the kinematics at [TRAJ]HOME"));
    Ok(())
}

/// HOME of extra axes against the limits of joint and axis.
fn extra_homes(report: &mut Report, ini: &Ini, config: &MachineConfig) {
    for (n, extra) in config.extra.iter().enumerate() {
        let (joint, axis) = (&extra.joint, &extra.axis);
        let (least, most) = (joint.min.max(axis.min), joint.max.min(axis.max));
        if !(least..=most).contains(&joint.home) {
            let text = format!(
                "{} is outside of its limits as joint and as [AXIS_{}], {least} to {most}",
                joint.name, extra.letter
            );
            let section = format!("JOINT_{}", config.guarded_joints() + n);
            report.finding(Severity::Error, at_key(ini, &section, "HOME", &text));
        }
    }
}

fn severity(trouble: &Trouble) -> Severity {
    match trouble {
        Trouble::LeftOut(_) => Severity::Warning,
        Trouble::Limit(..) | Trouble::NoPose(..) => Severity::Error,
    }
}

fn homing_problem(ini: &Ini, config: &MachineConfig, trouble: &Trouble) -> IniError {
    match trouble {
        Trouble::LeftOut(i) => {
            let text = "Home All leaves this joint out, and without it there is no world mode";
            ini.error(&format!("JOINT_{i}"), "HOME_SEQUENCE", None, text)
        }
        Trouble::Limit(sequence, margin) => {
            let text = format!(
                "between HOME and the switches at HOME_OFFSET {}; home more legs together, or move \
                 the switches",
                limits::sentence(config, margin)
            );
            at_sequence(ini, *sequence, &text)
        }
        Trouble::NoPose(sequence, fault) => {
            let text = format!(
                "no pose between HOME and the switches at HOME_OFFSET: {fault}; home more legs \
                 together, or move the switches"
            );
            at_sequence(ini, *sequence, &text)
        }
    }
}

fn at_sequence(ini: &Ini, sequence: i64, text: &str) -> IniError {
    let is_it = |section: &&str| {
        let number = ini.number_or(section, "HOME_SEQUENCE", f64::NAN);
        number.is_ok_and(|number| number.abs() == sequence.abs() as f64)
    };
    let section = ini.sections().filter(|name| name.starts_with("JOINT_")).find(is_it);
    at_key(ini, section.unwrap_or("JOINT_0"), "HOME_SEQUENCE", text)
}

/// Conditioning, joint ranges and the box inside the workspace.
fn workspace(report: &mut Report, ini: &Ini, config: &MachineConfig, progress: impl FnMut(f64)) {
    let within = axis_box::range(config);
    nearest_at_home(report, config);
    let reach = match Reach::new(config) {
        Ok(reach) => reach,
        Err(fault) => return home_outside(report, ini, config, Stop::Fault(fault)),
    };
    match reach.check(&config.home) {
        Ok(()) => {
            let value = reach.conditioning(&config.home);
            report.fact("conditioning", format!("{value:.4} at home (0: a singular pose)"));
        }
        // Told already, with the value.
        Err(Stop::Limit(Margin { limit: Limit::JointRange, .. })) => return,
        Err(stop) => return home_outside(report, ini, config, stop),
    }
    let seen = Seen::of(config, &reach, &within);
    joint_ranges(report, config, &seen);
    worst_conditioning(report, ini, config, &seen);
    let share = 100.0 * seen.taken as f64 / DRAWN as f64;
    report.fact("axis limits", format!("the machine can take {share:.1} % of the poses in them"));
    nearest_seen(report, ini, config, &seen);
    report.tilts = tilts(config, &within);
    let tilted = report.tilts.last().and_then(|(_, found)| *found);
    match axis_box::find(config, &within, tilted.as_ref(), progress) {
        Ok(found) => {
            report.is_whole = found == within;
            let found = found.rounded();
            tools(report, ini, config, &within, &found);
            report.suggestion = Some(found);
        }
        Err(stop) => home_outside(report, ini, config, stop),
    }
}

/// What the tools of the table leave of the axis limits, and whether the suggested ones hold with
/// them, where tools change what the machine can take: where it tilts.
fn tools(
    report: &mut Report,
    ini: &Ini,
    config: &MachineConfig,
    within: &AxisBox,
    suggested: &AxisBox,
) {
    let table = match tools::read(config) {
        Ok(table) => table,
        Err(text) => {
            let text = format!("{text}; LinuxCNC needs it, if only with a line T1 P1 Z0");
            return report.finding(Severity::Warning, at_key(ini, "EMCIO", "TOOL_TABLE", &text));
        }
    };
    if !Letter::ALL.iter().any(|l| l.is_angle() && !config.machine.layout().is_held(*l)) {
        return;
    }
    for tool in table {
        let Ok(reach) = Reach::with_tool(config, config.spindle + tool.offset) else { continue };
        let share = 100.0 * taken(config, &reach, within);
        let is_proved = axis_box::holds_with(config, &tool.offset, suggested);
        let proof = if is_proved { "proved" } else { "not proved" };
        let text = format!("{share:.1} % of the poses in the axis limits; {proof} for those below");
        report.fact(&tool.name(), text);
        if is_proved {
            report.proved_tools.push(tool);
        }
    }
}

/// A pose of the machine within the limits of the axes, and of those that carry something.
fn drawn_pose(config: &MachineConfig, within: &AxisBox, rng: &mut Pcg64) -> [f64; 6] {
    if config.chain.is_empty() {
        return within.at(std::array::from_fn(|_| rng.random()));
    }
    let mut between = |low: f64, high: f64| low + rng.random::<f64>() * (high - low);
    let pose = std::array::from_fn(|k| {
        let axis = &config.programmed[k];
        match axis.min.is_finite() && axis.max.is_finite() {
            true => between(axis.min, axis.max),
            false => config.start[k],
        }
    });
    let extra = std::array::from_fn(|n| {
        config.extra.get(n).map_or(0.0, |axis| {
            between(axis.joint.min.max(axis.axis.min), axis.joint.max.min(axis.axis.max))
        })
    });
    config.carried(&pose, &extra, &config.spindle).unwrap_or(config.home)
}

/// Share of the poses of a box that the machine can take, seen.
fn taken(config: &MachineConfig, reach: &Reach, within: &AxisBox) -> f64 {
    let mut rng = Pcg64::seed_from_u64(2);
    let inside =
        (0..DRAWN).filter(|_| reach.check(&drawn_pose(config, within, &mut rng)).is_ok()).count();
    inside as f64 / DRAWN as f64
}

/// What a smaller tilt gains in X Y Z, from the largest that the limits allow to none.
fn tilts(config: &MachineConfig, within: &AxisBox) -> Vec<(f64, Option<AxisBox>)> {
    let ends = within.low[3..5].iter().chain(&within.high[3..5]);
    let most = ends.map(|angle| angle.abs()).fold(0.0, f64::max).min(tilt_of_both(config, within));
    if most == 0.0 {
        return vec![];
    }
    let mut steeper = None;
    let mut found: Vec<_> = TILTS
        .into_iter()
        .rev()
        .map(|share| {
            let tilt = share * most;
            steeper = axis_box::at_tilt(config, within, tilt, steeper.as_ref());
            (tilt, steeper)
        })
        .collect();
    found.reverse();
    found
}

/// Largest angle that A and B may have together, a little below the end, where a proof has no room.
fn tilt_of_both(config: &MachineConfig, within: &AxisBox) -> f64 {
    let Some(limit) = config.tilt_limit else { return f64::INFINITY };
    let both = (3..5).all(|k| within.high[k] > within.low[k]);
    // The tool axis tilts by acos(cos A cos B).
    let most = if both { limit.to_radians().cos().sqrt().acos().to_degrees() } else { limit };
    (most * TILT_SHARE * 10.0).floor() / 10.0
}

/// What poses drawn from the axis limits show.
struct Seen {
    /// Smallest and largest value of every joint, whether the pose keeps the limits or not.
    joints: Vec<(f64, f64)>,
    /// Poses that the machine can take.
    taken: usize,
    /// The worst conditioning of a pose that keeps all other limits.
    worst: Option<(f64, [f64; 6])>,
    /// The nearest legs, of poses that the machine can take, or where nothing else keeps the legs
    /// from meeting.
    nearest: Option<(Nearest, [f64; 6])>,
}

impl Seen {
    fn of(config: &MachineConfig, reach: &Reach, within: &AxisBox) -> Self {
        let mut rng = Pcg64::seed_from_u64(1);
        let joints = vec![(f64::INFINITY, f64::NEG_INFINITY); config.joints.len()];
        let mut seen = Self { joints, taken: 0, worst: None, nearest: None };
        let of_legs = Limits { conditioning: 0.0, ..limits::beyond_axes(config) };
        let mut drawn = vec![];
        for _ in 0..DRAWN {
            let pose = drawn_pose(config, within, &mut rng);
            let Ok(at) = reach.at(&pose) else { continue };
            for (range, value) in seen.joints.iter_mut().zip(at.joints()) {
                *range = (range.0.min(*value), range.1.max(*value));
            }
            match at.check(&of_legs) {
                Ok(()) => {
                    let value = at.smallest_singular_value();
                    drawn.push((value, pose));
                    seen.taken += usize::from(value >= config.conditioning_limit);
                    seen.add_nearest(at.nearest(), &pose);
                }
                Err(margin) if margin.limit == Limit::Clearance && config.clearance.is_none() => {
                    seen.add_nearest(at.nearest(), &pose);
                }
                Err(_) => {}
            }
        }
        if !config.chain.is_empty() {
            // What lies between the poses drawn need not be one of a program.
            let least = drawn.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
            return Self { worst: least, ..seen };
        }
        seen.worst = conditioning::worst(within, drawn, |pose| {
            let at = reach.at(pose).ok()?;
            at.check(&of_legs).ok()?;
            Some(at.smallest_singular_value())
        });
        seen
    }

    fn add_nearest(&mut self, nearest: Option<Nearest>, pose: &[f64; 6]) {
        let Some(nearest) = nearest else { return };
        if self.nearest.is_none_or(|(least, _)| nearest.distance < least.distance) {
            self.nearest = Some((nearest, *pose));
        }
    }
}

fn worst_conditioning(report: &mut Report, ini: &Ini, config: &MachineConfig, seen: &Seen) {
    let Some((value, pose)) = seen.worst else { return };
    let place = shown_pose(config, &pose);
    report.fact("", format!("{value:.4} the worst found within the axis limits, at {place}"));
    if value < config.conditioning_limit {
        let text = format!(
            "the legs hardly hold the platform at {place}, conditioning {value:.4}, and pkmkins stops \
             the machine at {}: keep programs away, or take the limits below",
            config.conditioning_limit
        );
        report.finding(Severity::Warning, at_key(ini, "KINS", "KINEMATICS", &text));
    }
}

fn home_outside(report: &mut Report, ini: &Ini, config: &MachineConfig, stop: Stop) {
    let text = format!("the machine cannot stand there: {}", shown_stop(config, stop));
    report.finding(Severity::Error, at_key(ini, "TRAJ", "HOME", &text));
}

/// A stop in words.
fn shown_stop(config: &MachineConfig, stop: Stop) -> String {
    match stop {
        Stop::Fault(fault) => fault.to_string(),
        Stop::Limit(margin) => limits::sentence(config, &margin),
    }
}

fn shown_nearest(config: &MachineConfig, Nearest { distance, pair: [i, j] }: &Nearest) -> String {
    let (distance, unit) = (limits::shown(*distance), config.length_unit());
    let [i, j] = [i, j].map(|leg| config.place.first_leg + leg);
    format!("the centre lines of legs {i} and {j} are {distance} {unit} apart")
}

/// The nearest legs at home, and those whose distance is not judged.
fn nearest_at_home(report: &mut Report, config: &MachineConfig) {
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
        let text = format!("not judged, as they share an anchor: {}", meeting.join(", "));
        report.fact(name, text);
    }
}

/// The nearest legs within the axis limits, and what nothing keeps them from.
fn nearest_seen(report: &mut Report, ini: &Ini, config: &MachineConfig, seen: &Seen) {
    let Some((nearest, pose)) = &seen.nearest else { return };
    let (apart, place) = (shown_nearest(config, nearest), shown_pose(config, pose));
    report.fact("", format!("{apart}, the least seen in the axis limits, at {place}"));
    if config.clearance.is_some() {
        return;
    }
    let (severity, text) = match nearest.distance < limits::beyond_axes(config).clearance {
        true => (
            Severity::Error,
            format!("{apart} at {place}: they meet within the axis limits, and nothing stops them"),
        ),
        false => (
            Severity::Warning,
            "the thickness of the legs is not judged: give the distance that their centre lines \
             have to keep, their diameter and some room"
                .into(),
        ),
    };
    report.finding(severity, at_key(ini, "PKM", "ROD_CLEARANCE", &text));
}

/// What the poses within the axis limits ask of every joint.
fn joint_ranges(report: &mut Report, config: &MachineConfig, seen: &Seen) {
    for (joint, (low, high)) in config.joints.iter().zip(&seen.joints) {
        let unit = config.unit(joint.kind);
        let text = format!(
            "{low:.3} to {high:.3} {unit} seen in the axis limits; MIN_LIMIT {}, MAX_LIMIT {}",
            joint.min, joint.max
        );
        report.fact(&joint.name, text);
    }
}

pub(super) fn shown_pose(config: &MachineConfig, pose: &[f64; 6]) -> String {
    let moved = |letter: &&Letter| !config.machine.layout().is_held(**letter);
    let word =
        |letter: &Letter| format!("{}{:.2}", config.place.letter(*letter), pose[letter.index()]);
    Letter::ALL.iter().filter(moved).map(word).collect::<Vec<_>>().join(" ")
}

impl AxisBox {
    /// The pose at these shares of the extents.
    pub fn at(&self, shares: [f64; 6]) -> [f64; 6] {
        std::array::from_fn(|k| self.low[k] + shares[k] * (self.high[k] - self.low[k]))
    }

    /// Ends with few digits, inside this box.
    pub(crate) fn rounded(&self) -> Self {
        let mut rounded = *self;
        for k in 0..6 {
            let width = self.high[k] - self.low[k];
            if width > 0.0 {
                let grid = 10_f64.powi(LIMIT_DIGITS - width.log10().floor() as i32);
                rounded.low[k] = (self.low[k] * grid).ceil() / grid;
                rounded.high[k] = (self.high[k] * grid).floor() / grid;
            }
        }
        rounded
    }
}

/// Tilts and widths of their boxes, as a table; empty where there are none.
pub fn tilt_table(config: &MachineConfig, tilts: &[(f64, Option<AxisBox>)]) -> String {
    let letters: Vec<Letter> = [Letter::X, Letter::Y, Letter::Z]
        .into_iter()
        .filter(|letter| !config.machine.layout().is_held(*letter))
        .collect();
    let mut text = String::new();
    for (tilt, part) in tilts {
        let part = part.map(|part| part.rounded());
        let range = |letter: &Letter| match part {
            Some(AxisBox { low, high }) => {
                let k = letter.index();
                format!("  {} {} to {}", config.place.letter(*letter), low[k], high[k])
            }
            None => String::new(),
        };
        let ranges: String = letters.iter().map(range).collect();
        let ranges = if ranges.is_empty() { "  none proved about home" } else { &ranges };
        let _ = writeln!(text, "  {tilt:>5}°{ranges}");
    }
    text
}

/// The limits as lines of an INI file, of the coordinates that the machine moves.
pub fn axis_lines(config: &MachineConfig, limits: &AxisBox) -> String {
    let mut text = String::new();
    for letter in Letter::ALL.into_iter().filter(|l| !config.machine.layout().is_held(*l)) {
        let (low, high) = (limits.low[letter.index()], limits.high[letter.index()]);
        // Writing to a String does not fail.
        let _ = writeln!(
            text,
            "[AXIS_{}]\nMIN_LIMIT = {low}\nMAX_LIMIT = {high}",
            config.place.letter(letter)
        );
    }
    text
}
