// SPDX-License-Identifier: GPL-2.0-or-later
//! `counts`: prints instructions of the module's calls as a table, with their bounds from
//! counts.toml; exit 1 if one is exceeded. `counts write` rewrites that file.
//!
//! `counts measure FILE` is run under valgrind.
//!
//! Forward ends after `limit-iterations` solves, at most [`MAX_ITERATIONS`]. Its calls are
//! counted with limits of 1, 2, 3 … solves: that gives the largest cost of one more solve (with the
//! sub-step around it), and the largest cost of the rest. The maximum number of solves times the one plus the other
//! bounds every call.

use abi_tests::control::Control;
use abi_tests::module::Module;
use kinematics::{Cause, MAX_ITERATIONS};
use prove::callgrind::{begin, counted, run};
use prove::cases::{Aim, Call, Case, all, machines, searching, unmonitored};
use prove::monitored::{
    begin_forward, begin_jog, change_tool, make_busy, move_on, pass_singular, passing_pose,
};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Bounds are the counts at the time of writing times this factor: for another release of
/// the compiler, and for calls that the search did not find.
const MARGIN: f64 = 1.25;

/// Poses that the survey of a tool change visits in a cycle, and solves that forward may take
/// for each: as in the module's `tool/survey.rs`.
const PLACES_PER_CYCLE: u64 = 4;
const SOLVES_PER_PLACE: u32 = 24;

/// Number of forward calls per check of all pins if no monitor runs: as in the module's
/// `module/freezing.rs`.
const LOOKS: u32 = 16;

/// Returns the head of counts.toml.
fn head() -> String {
    format!(
        "\
# SPDX-License-Identifier: GPL-2.0-or-later
#
# Written by `cargo xtask counts write`: the instructions that were counted, times {MARGIN}. `cargo xtask counts`
# fails above them. Of each call the typical number and the worst, which of forward is {MAX_ITERATIONS} solves at their
# dearest.
"
    )
}

/// Bounds by machine and call: typical and worst.
type Bounds = BTreeMap<String, BTreeMap<String, [u64; 2]>>;

/// The counts of one function on one machine.
#[derive(Clone, Debug, Default)]
struct Found {
    /// Median.
    typical: u64,
    /// Largest.
    worst: u64,
    /// For forward.
    solving: Option<Solving>,
    /// For a call that calls forward: a bound of these calls.
    survey: Option<u64>,
    /// Calls of forward that exceed the bound for their number of solves.
    dearer: Vec<String>,
}

/// The components of forward's bound.
#[derive(Clone, Debug, Default)]
struct Solving {
    /// Largest number of solves in any case.
    most: u32,
    /// Largest cost of one more solve.
    each: u64,
    /// Largest cost of the rest.
    rest: u64,
}

impl Solving {
    fn bound(&self) -> u64 {
        self.of(MAX_ITERATIONS)
    }

    fn of(&self, solves: u32) -> u64 {
        self.rest + self.each * u64::from(solves)
    }
}

impl Found {
    /// Returns the bound of any call.
    fn bound(&self) -> u64 {
        match (&self.solving, self.survey) {
            (Some(solving), _) => solving.bound(),
            (None, Some(survey)) => self.worst + survey,
            (None, None) => self.worst,
        }
    }
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let result = match arguments[..] {
        ["measure", file] => measure(Path::new(file)).map(|()| ExitCode::SUCCESS),
        [] => count().and_then(|found| judge(&found)),
        ["write"] => count().and_then(|found| write(&found)),
        _ => Err("usage: counts [write]".into()),
    };
    result.unwrap_or_else(|error| {
        eprintln!("counts: {error}");
        ExitCode::from(2)
    })
}

type Table = BTreeMap<(usize, Call), Found>;

fn count() -> Result<(Vec<Control>, Table), String> {
    let machines = machines();
    let cases = all(&machines);
    let scratch = Scratch::new()?;
    let list = scratch.0.join("cases");
    let lines: Vec<String> = cases.iter().map(Case::to_line).collect();
    std::fs::write(&list, lines.join("\n")).map_err(|e| e.to_string())?;
    let list = list.to_str().ok_or("the temporary folder has no plain name")?;
    let counts = run(&["measure", list], &scratch.0)?;
    if counts.len() != cases.len() || counts.contains(&0) {
        return Err(format!("valgrind counted {} of {} calls", counts.len(), cases.len()));
    }
    let counted: Vec<(Case, u64)> = cases.into_iter().zip(counts).collect();
    let mut table = table(&counted);
    bound_pairs(&machines, &mut table);
    bound_surveys(&mut table);
    Ok((machines, table))
}

/// A temporary folder, which is removed at the end.
struct Scratch(PathBuf);

impl Scratch {
    fn new() -> Result<Scratch, String> {
        let path = std::env::temp_dir().join(format!("pkmkins-counts-{}", std::process::id()));
        std::fs::create_dir(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        Ok(Scratch(path))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Makes the calls of a list, under valgrind.
fn measure(list: &Path) -> Result<(), String> {
    let machines = machines();
    let text = std::fs::read_to_string(list).map_err(|e| e.to_string())?;
    let read = |(n, line)| Case::from_line(line).ok_or_else(|| format!("line {n} is no case"));
    let cases: Vec<Case> = text.lines().enumerate().map(read).collect::<Result<_, _>>()?;
    let mut modules = BTreeMap::new();
    for case in &cases {
        let control = &machines[case.machine];
        modules.entry((case.machine, Purpose::of(case))).or_insert_with_key(|(_, purpose)| {
            match purpose {
                Purpose::Alone => unmonitored(control),
                Purpose::Of(_) => control.module(),
                Purpose::Search => searching(control),
            }
        });
    }
    begin();
    for case in &cases {
        make(case, &machines[case.machine], &modules[&(case.machine, Purpose::of(case))]);
    }
    Ok(())
}

/// The purpose of a module: one per purpose is kept for every machine, because under valgrind loading one takes longer
/// than most of its calls.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
enum Purpose {
    Alone,
    Search,
    /// A call that leaves a changed state.
    Of(Call),
}

impl Purpose {
    fn of(case: &Case) -> Self {
        match case.call {
            Call::Searching => Self::Search,
            Call::Inverse | Call::Forward | Call::Jacobian if case.aim == Aim::Typical => {
                Self::Of(Call::Monitor)
            }
            Call::Inverse | Call::Forward | Call::Jacobian | Call::Freezing => Self::Alone,
            call => Self::Of(call),
        }
    }
}

/// Makes one call, counted.
fn make(case: &Case, control: &Control, module: &Module) {
    match case.call {
        Call::Inverse => {
            let mut joints = [0.0; 16];
            counted(|| module.inverse_into(&case.pose, &mut joints));
        }
        Call::Forward => {
            module.set("limit-iterations", f64::from(MAX_ITERATIONS));
            if case.aim == Aim::Typical {
                module.set("machine-on", 1.0);
            }
            begin_forward(case, control, module);
            // Without a monitor one call of 16 checks all pins: every call that is counted. NaN or infinite extra
            // joints would be refused before that.
            if Purpose::of(case) == Purpose::Alone && !case.is_before_homing() {
                let mut broken = [0.0; 16];
                let of_mechanisms = control.mechanisms().iter().map(|m| m.joints()).sum();
                broken[..of_mechanisms].fill(f64::NAN);
                let home = control.home();
                let at_home = module.inverse(&home).expect("home");
                for _ in 0..LOOKS - 2 {
                    module.forward_from(&broken, &home);
                }
                module.forward_from(&at_home, &home);
            }
            module.set("limit-iterations", f64::from(case.limit));
            counted(|| module.forward_from(&case.joints, &case.pose));
        }
        Call::Jacobian => {
            let _ = counted(|| module.jacobian(&case.joints, &case.pose));
        }
        Call::Monitor => {
            move_on(case, control, module);
            counted(|| module.monitor());
        }
        Call::Jog => {
            begin_jog(case, control, module);
            move_on(case, control, module);
            counted(|| module.monitor());
        }
        Call::Passing => {
            let joints = pass_singular(case, control, module);
            let mut world = passing_pose(case, case.limit);
            counted(|| module.forward_into(&joints, &mut world));
        }
        Call::ToolChange => {
            change_tool(case, control, module);
            counted(|| module.monitor());
        }
        Call::Applying => {
            make_busy(case, control, module);
            counted(|| module.monitor());
        }
        Call::Freezing => {
            let module = control.loaded();
            control.wire(&module);
            let mut joints = [0.0; 16];
            counted(|| module.inverse_into(&case.pose, &mut joints));
        }
        Call::Searching => {
            // Restart: a search continues for the joints of its first call.
            assert!(control.apply(module), "{:?}", module.messages());
            let mut world = control.home();
            let code = counted(|| module.forward_into(&case.joints, &mut world));
            assert_eq!(code, Cause::Searching.code(), "the search ends early");
        }
    }
}

fn table(counted: &[(Case, u64)]) -> Table {
    let mut table = Table::new();
    for (case, _) in counted {
        table.entry((case.machine, case.call)).or_default();
    }
    for ((machine, call), found) in &mut table {
        let mine: Vec<&(Case, u64)> =
            counted.iter().filter(|(c, _)| c.machine == *machine && c.call == *call).collect();
        found.typical = median(&mine);
        found.worst = mine.iter().map(|(_, count)| *count).max().unwrap_or(0);
        if *call == Call::Forward {
            let solving = solving(&mine);
            found.dearer = dearer(&mine, &solving);
            found.solving = Some(solving);
        }
    }
    table
}

/// Adds the bounds of two mechanisms for calls of both: a call may take all solves of both, but no call that was
/// found takes the most expensive of both at once.
fn bound_pairs(machines: &[Control], table: &mut Table) {
    for (machine, control) in machines.iter().enumerate() {
        let Control::Pair(_, two) = control else { continue };
        let of_each = [&two.first, &two.second].map(|subject| {
            let alone = machines.iter().position(|other| other.name() == subject.name);
            let alone = alone.expect("both are counted alone as well");
            table[&(alone, Call::Forward)].solving.clone().expect("of forward")
        });
        let found = table.get_mut(&(machine, Call::Forward));
        if let Some(solving) = found.and_then(|found| found.solving.as_mut()) {
            let sum = |of: fn(&Solving) -> u64| of_each.iter().map(of).sum::<u64>();
            solving.each = solving.each.max(sum(|solving| solving.each));
            solving.rest = solving.rest.max(sum(|solving| solving.rest));
        }
    }
}

/// Records the largest possible cost of inner forward calls: the survey of a tool change calls forward, and beyond a
/// singular pose forward repeats itself with all its solves. It is added in full, whatever part the worst call has.
fn bound_surveys(table: &mut Table) {
    let most: Vec<(usize, [(Call, u64); 2])> = table
        .iter()
        .filter_map(|((machine, _), found)| Some((*machine, found.solving.as_ref()?)))
        .map(|(machine, solving)| {
            let survey = PLACES_PER_CYCLE * solving.of(SOLVES_PER_PLACE);
            (machine, [(Call::ToolChange, survey), (Call::Passing, 2 * solving.bound())])
        })
        .collect();
    for (machine, calls) in most {
        for (call, most) in calls {
            if let Some(found) = table.get_mut(&(machine, call)) {
                found.survey = Some(most);
            }
        }
    }
}

/// Returns hard forward calls that take more than their solves explain. (Without
/// a seed a call starts from the last good pose: which one that is, and how many solves away,
/// depends on the calls before.)
fn dearer(cases: &[&(Case, u64)], solving: &Solving) -> Vec<String> {
    cases
        .iter()
        .filter(|(case, _)| case.aim == Aim::Worst && case.pose.iter().all(|x| !x.is_nan()))
        // Before homing every refusal has the same code, which does not contain the number of solves.
        .filter(|(case, _)| !case.is_before_homing())
        .filter(|(case, count)| *count > solving.of(case.solves))
        .map(|(case, count)| format!("{} solves took {count} instructions", case.solves))
        .collect()
}

fn median(cases: &[&(Case, u64)]) -> u64 {
    let typical = cases.iter().filter(|(case, _)| case.aim == Aim::Typical);
    let mut counts: Vec<u64> = typical.map(|(_, count)| *count).collect();
    counts.sort_unstable();
    counts.get(counts.len() / 2).copied().unwrap_or(0)
}

/// Computes from the rows of limited calls the cost of a solve, and that of the rest.
fn solving(cases: &[&(Case, u64)]) -> Solving {
    let mut rows: BTreeMap<usize, BTreeMap<u32, u64>> = BTreeMap::new();
    for (case, count) in cases {
        if let Aim::Row(row) = case.aim {
            rows.entry(row).or_default().insert(case.limit, *count);
        }
    }
    let (mut each, mut first, mut last) = (0, 0, 0);
    for row in rows.values() {
        first = first.max(row.values().next().copied().unwrap_or(0));
        // The last solve continues to the end of the call.
        let end = row.keys().next_back().copied().unwrap_or(0);
        for (limit, count) in row {
            let Some(next) = row.get(&(limit + 1)) else { continue };
            let step = next.saturating_sub(*count);
            let largest = if limit + 1 == end { &mut last } else { &mut each };
            *largest = step.max(*largest);
        }
    }
    let most = cases.iter().map(|(case, _)| case.solves).max().unwrap_or(0);
    Solving { most, each, rest: first + last }
}

fn path() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("counts.toml")
}

fn write((machines, table): &(Vec<Control>, Table)) -> Result<ExitCode, String> {
    let wide = |count: u64| (count as f64 * MARGIN).ceil() as u64;
    let mut bounds = Bounds::new();
    for ((machine, call), found) in table {
        let of_machine = bounds.entry(machines[*machine].name().into()).or_default();
        of_machine.insert(call.name().into(), [found.typical, found.bound()].map(wide));
    }
    let text = toml::to_string(&bounds).map_err(|e| e.to_string())?;
    std::fs::write(path(), format!("{}\n{text}", head())).map_err(|e| e.to_string())?;
    show(machines, table);
    Ok(ExitCode::SUCCESS)
}

fn show(machines: &[Control], table: &Table) {
    println!("| machine | call | typical | worst found | solves | each | rest | cannot exceed |");
    println!("|---|---|--:|--:|--:|--:|--:|--:|");
    for ((machine, call), found) in table {
        let solving = found
            .solving
            .as_ref()
            .map_or("– | – | –".into(), |s| format!("{} | {} | {}", s.most, s.each, s.rest));
        let typical = if found.typical == 0 { "–".into() } else { found.typical.to_string() };
        println!(
            "| {} | {} | {typical} | {} | {solving} | {} |",
            machines[*machine].name(),
            call.name(),
            found.worst,
            if found.bound() == found.worst { "–".into() } else { found.bound().to_string() },
        );
    }
    println!("\nA servo cycle, guarded: forward, inverse and monitor.\n");
    println!("| machine | typical |");
    println!("|---|--:|");
    for (machine, subject) in machines.iter().enumerate() {
        let calls = [Call::Forward, Call::Inverse, Call::Monitor];
        let typical = calls.map(|call| table.get(&(machine, call)).map_or(0, |f| f.typical));
        println!("| {} | {} |", subject.name(), typical.iter().sum::<u64>());
    }
}

fn judge((machines, table): &(Vec<Control>, Table)) -> Result<ExitCode, String> {
    show(machines, table);
    let text = std::fs::read_to_string(path()).map_err(|e| e.to_string())?;
    let bounds: Bounds = toml::from_str(&text).map_err(|e| format!("counts.toml: {e}"))?;
    let names: Vec<&str> = machines.iter().map(|machine| machine.name()).collect();
    let complaints = complaints(&names, table, &bounds);
    for complaint in &complaints {
        println!("counts: {complaint}");
    }
    println!("\ncounts: {} rows, {} failed", table.len(), complaints.len());
    Ok(ExitCode::from(u8::from(!complaints.is_empty())))
}

/// Returns counts that exceed their bound, or have none.
fn complaints(machines: &[&str], table: &Table, bounds: &Bounds) -> Vec<String> {
    let mut complaints = Vec::new();
    for ((machine, call), found) in table {
        let (machine, call) = (machines[*machine], call.name());
        complaints.extend(found.dearer.iter().map(|case| {
            format!("{call}, {machine}: a call of {case}: more than its solves explain")
        }));
        let Some(&[typical, worst]) = bounds.get(machine).and_then(|calls| calls.get(call)) else {
            complaints.push(format!("{call}, {machine}: no bound; run `cargo xtask counts write`"));
            continue;
        };
        let pairs = [("typically", found.typical, typical), ("at worst", found.bound(), worst)];
        for (when, count, most) in pairs.into_iter().filter(|(_, count, most)| count > most) {
            complaints.push(format!(
                "{call}, {machine}: {when} {count} instructions where {most} are allowed: make it \
                 cheaper, or run `cargo xtask counts write` and say why"
            ));
        }
    }
    complaints
}

#[cfg(test)]
mod tests {
    use super::*;

    fn case(aim: Aim, limit: u32, solves: u32) -> Case {
        let (pose, joints) = ([0.0; 9], [1.0; 16]);
        Case { machine: 0, call: Call::Forward, aim, pose, joints, limit, solves }
    }

    /// Returns a row of six solves: 100 before the first, 10 to 14 each, and 50 after the last.
    fn row() -> Vec<(Case, u64)> {
        let counts = [(1, 110), (3, 134), (4, 148), (5, 158), (6, 218)];
        counts.map(|(limit, count)| (case(Aim::Row(0), limit, 6), count)).to_vec()
    }

    #[test]
    fn the_bound_is_the_dearest_solve_at_every_solve_and_the_rest_once() {
        let row = row();
        let solving = solving(&row.iter().collect::<Vec<_>>());
        assert_eq!((solving.most, solving.each, solving.rest), (6, 14, 110 + 60));
        assert_eq!(solving.bound(), 170 + u64::from(MAX_ITERATIONS) * 14);
    }

    fn of(cases: &[(Case, u64)]) -> Table {
        let mut table = table(cases);
        bound_surveys(&mut table);
        table
    }

    fn bound(typical: u64, worst: u64) -> Bounds {
        [("m".into(), [("forward".into(), [typical, worst])].into())].into()
    }

    #[test]
    fn a_tool_change_is_bounded_by_the_forward_calls_of_its_survey() {
        let mut cases = row();
        let change = Case { call: Call::ToolChange, ..case(Aim::Worst, 3, 0) };
        cases.push((change, 700));
        let of_one_place = 170 + 24 * 14;
        assert_eq!(of(&cases)[&(0, Call::ToolChange)].bound(), 700 + 4 * of_one_place);
    }

    #[test]
    fn exceeded_bounds_are_reported() {
        let mut cases = row();
        cases.push((case(Aim::Typical, MAX_ITERATIONS, 0), 90));
        let table = of(&cases);
        let complaints = |bounds: &Bounds| complaints(&["m"], &table, bounds);
        let most = 170 + u64::from(MAX_ITERATIONS) * 14;
        assert_eq!(complaints(&bound(90, most)), Vec::<String>::new());
        for (bounds, word) in [
            (bound(89, most), "typically"),
            (bound(90, most - 1), "at worst"),
            (Bounds::new(), "no bound"),
        ] {
            let reported = complaints(&bounds);
            assert!(reported.len() == 1 && reported[0].contains(word), "{reported:?}");
        }
    }

    #[test]
    fn a_call_that_its_solves_do_not_explain_is_reported() {
        let mut cases = row();
        cases.push((case(Aim::Worst, MAX_ITERATIONS, 2), 170 + 2 * 14 + 1));
        let reported = complaints(&["m"], &of(&cases), &bound(0, 10_000));
        assert!(reported.len() == 1 && reported[0].contains("solves explain"), "{reported:?}");
    }
}
