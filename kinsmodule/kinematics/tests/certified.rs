// SPDX-License-Identifier: GPL-2.0-or-later
//! Certified forward at scale: over the shipped machines and random ones of every kind of
//! leg, no call may return a pose other than the one connected with its seed.
//!
//! `cargo xtask certify` prints the tables.

use crate::common::machines::{declared, genhexkins_tilted, wild};
use crate::common::outcome::{Outcome, judged_with_path};
use crate::common::random::{RECIPES, Recipe, coin, draw};
use crate::common::reference::Tracker;
use crate::common::solutions::{all_solutions, is_same};
use crate::common::tolerances::WRONG;
use crate::common::{Case, NO_TOOL, cases, rng};
use kinematics::{Joints, Pose, Solver};
use rand_pcg::Pcg64;
use std::cell::Cell;

/// Number of random machines of each recipe.
const MACHINES: usize = 20;

/// The counts for poses, separated by the sign of det J: those with a sign other than home's are beyond
/// a singular pose, as seen from there.
#[derive(Default)]
struct Row {
    before: Outcome,
    behind: Outcome,
}

/// A pose to find again, with its joints.
struct Call<'a> {
    case: &'a Case,
    tracker: &'a Tracker<'a>,
    pose: Pose,
    joints: Joints,
}

/// Returns machines with their own workspace: the named ones, and genhexkins' default
/// geometry tilted until singular poses lie between.
fn named() -> Vec<Case> {
    let mut named = declared();
    named.push(genhexkins_tilted("genhexkins default, ±20°", 20.0));
    named.push(genhexkins_tilted("genhexkins default, ±40°", 40.0));
    named.push(genhexkins_tilted("genhexkins default, ±50°", 50.0));
    named
}

/// Returns the next pose of a machine: from its workspace; for random machines every other one is
/// far enough out to include singular poses and dead points.
fn next(case: &Case, wide: bool, k: usize, rng: &mut Pcg64) -> Pose {
    match wide && k.is_multiple_of(2) {
        true => case.without_held(&wild(case, 0.15, 40.0)(rng)),
        false => (case.sample)(rng),
    }
}

/// Judges `count` poses of one machine.
fn of_machine(
    case: &Case,
    (count, wide): (usize, bool),
    rng: &mut Pcg64,
    judge: &mut impl FnMut(&Call, &mut Pcg64) -> Outcome,
) -> Row {
    let tracker = Tracker::new(&case.geometry);
    let at_home = tracker.handedness(&case.home, &case.joints(&case.home));
    let mut row = Row::default();
    for k in 0..count {
        let pose = next(case, wide, k, rng);
        let Ok(joints) = case.machine.inverse(&pose, &NO_TOOL) else { continue };
        let behind = tracker.handedness(&pose, &joints) != at_home;
        let outcome = judge(&Call { case, tracker: &tracker, pose, joints }, rng);
        *if behind { &mut row.behind } else { &mut row.before } += outcome;
    }
    row
}

/// Judges as many machines of a recipe as the count allows.
fn of_recipe(
    recipe: &Recipe,
    count: usize,
    rng: &mut Pcg64,
    judge: &mut impl FnMut(&Call, &mut Pcg64) -> Outcome,
) -> Row {
    let mut sum = Row::default();
    for _ in 0..cases(MACHINES) {
        let case = draw(rng, recipe);
        let row = of_machine(&case, (count / cases(MACHINES), true), rng, judge);
        sum.before += row.before;
        sum.behind += row.behind;
    }
    sum
}

impl Row {
    fn print(&self, name: &str) {
        let (a, b) = (&self.before, &self.behind);
        println!(
            "| {name} | {} | {} | {} | {} | {} | {} | {} |",
            a.calls() + b.calls(),
            a.right + a.fitting + b.right + b.fitting,
            a.missed + b.missed,
            a.refused + b.refused,
            a.wrong + b.wrong,
            b.calls(),
            b.right + b.fitting,
        );
    }

    fn all(&self) -> Outcome {
        let mut all = self.before;
        all += self.behind;
        all
    }
}

/// Judges `count` poses of every machine and recipe, and prints a row for each. None may
/// be wrong, and those of the shipped machines' workspaces are all found. Returns the outcome of each recipe's calls.
fn survey(
    title: &str,
    seed: u64,
    count: usize,
    judge: impl Fn(&Call, &mut Pcg64) -> Outcome,
) -> Vec<Outcome> {
    println!("\n{title}\n");
    println!(
        "| machine | poses | right | refused, a path exists | refused, none exists | wrong \
         | behind a singular pose | right |"
    );
    println!("|---|--:|--:|--:|--:|--:|--:|--:|");
    let mut judge = judge;
    let mut sum = Row::default();
    let mut add = |name: &str, row: Row| {
        row.print(name);
        assert_eq!(row.all().wrong, 0, "{title}, {name}");
        assert!(row.all().right > 0, "{title}, {name}");
        sum.before += row.before;
        sum.behind += row.behind;
    };
    for case in named() {
        let row = of_machine(&case, (count, false), &mut rng(seed), &mut judge);
        let reachable = !case.name.contains("genhexkins");
        assert!(!reachable || row.all().right == count, "{}: {:?}", case.name, row.all());
        add(case.name, row);
    }
    let mut of_recipes = vec![];
    for recipe in RECIPES {
        let row = of_recipe(recipe, count, &mut rng(seed), &mut judge);
        of_recipes.push(row.all());
        add(recipe.name, row);
    }
    sum.print("all");
    assert!(sum.behind.calls() > 0, "{title}: singular poses must lie between");
    of_recipes
}

#[test]
fn one_servo_step_away_every_result_is_the_pose_that_the_joints_came_from() {
    survey("One servo step away", 31, cases(45_000), |call, rng| {
        let Call { case, pose, joints, .. } = call;
        let seed = case.servo_step(rng, pose);
        let found = case.machine.forward(joints, &seed, &NO_TOOL, &Solver::default());
        if found.is_ok_and(|found| case.apart(&found.pose, pose) <= WRONG) {
            return Outcome { right: 1, ..Outcome::default() };
        }
        judged_with_path(case, call.tracker, joints, &seed)
    });
}

/// Largest number of a hundred calls from home that may be refused although a path exists, for each recipe: the larger
/// fraction of the short and the long tier, plus a margin. An improvement for one kind of machine must not harm others.
const MOST_MISSED: [(&str, f64); RECIPES.len()] = [
    ("six struts", 6.0),
    ("six sliders", 8.0),
    ("six cranks", 1.0),
    ("all kinds", 8.0),
    ("five sliders", 9.0),
    ("slider, crank and screw, two angles", 3.0),
    ("four sliders, one angle", 6.0),
    ("three cranks", 0.5),
    ("three sliders", 1.0),
    ("wrist of cranks", 1.5),
    ("eight legs", 2.5),
    ("five for three", 2.0),
    ("five rings", 14.0),
    ("six rings", 22.0),
    ("rings beside all kinds", 11.0),
    ("rings and carriages for five", 7.0),
];

/// Calls of each machine and recipe in the short tier.
const FROM_HOME: usize = 400;

#[test]
fn from_home_every_result_is_the_pose_that_the_reference_tracker_reaches() {
    let count = cases(FROM_HOME);
    let found = survey("From home", 32, count, |call, _| {
        judged_with_path(call.case, call.tracker, &call.joints, &call.case.home)
    });
    for ((recipe, outcome), (name, most)) in RECIPES.iter().zip(found).zip(MOST_MISSED) {
        assert_eq!(recipe.name, name);
        let missed = 100.0 * outcome.missed as f64 / outcome.calls() as f64;
        // A fraction of fewer calls is meaningless.
        assert!(count < FROM_HOME || missed <= most, "{name}: {missed} of a hundred are missed");
    }
}

/// The results of the search for every solution for the calls of a row.
#[derive(Default)]
struct Searched {
    found: Cell<usize>,
    /// Results of forward that the search did not find: an estimate of what it misses.
    overlooked: Cell<usize>,
    /// Real poses of the same joints other than the right one.
    others: Cell<usize>,
}

fn add(count: &Cell<usize>, more: usize) {
    count.set(count.get() + more);
}

/// Judges one call by all real poses of its joints: the straight joint path leads back to the seed
/// from the pose that forward returns, and from no other.
fn judged_by_all(call: &Call, seed: &Pose, searched: &Searched, rng: &mut Pcg64) -> Outcome {
    let Call { case, tracker, joints, .. } = call;
    let others = all_solutions(tracker, joints, rng);
    let at_seed = case.joints(seed);
    let is_seed = |found: Option<Pose>| found.is_some_and(|found| is_same(tracker, &found, seed));
    let leads_back = |pose: &Pose| is_seed(tracker.follow(pose, &at_seed));
    let closely_seen = |pose: &Pose| is_seed(tracker.follow_closely(pose, &at_seed));
    let returned = case.machine.forward(joints, seed, &NO_TOOL, &Solver::default());
    let Ok(returned) = returned.map(|found| found.pose) else {
        return judged_with_path(case, tracker, joints, seed);
    };
    let (same, others): (Vec<_>, Vec<_>) =
        others.iter().partition(|pose| is_same(tracker, pose, &returned));
    add(&searched.found, 1);
    add(&searched.overlooked, usize::from(same.is_empty()));
    add(&searched.others, others.len());
    // The least-squares path of a redundant machine cannot be reversed.
    let redundant = case.geometry.layout().is_redundant();
    let right = redundant
        || ((leads_back(&returned) || closely_seen(&returned))
            && !others.into_iter().any(|pose| leads_back(pose) && closely_seen(pose)));
    if !right {
        println!("{}: {returned:?} from {seed:?} with {joints:?} is wrong", case.name);
    }
    Outcome { right: usize::from(right), wrong: usize::from(!right), ..Outcome::default() }
}

#[test]
fn of_all_real_poses_of_the_joints_the_one_that_is_connected_with_the_seed_is_returned() {
    let searched = Searched::default();
    survey("Against every real pose of the joints", 33, cases(40), |call, rng| {
        let near = call.case.servo_step(rng, &call.pose);
        // Next to a dead point a servo step may lead beyond it.
        let reached = call.case.machine.inverse(&near, &NO_TOOL).is_ok();
        let seed = if coin(rng) && reached { near } else { call.case.home };
        judged_by_all(call, &seed, &searched, rng)
    });
    let Searched { found, overlooked, others } = searched;
    let (found, overlooked, others) = (found.get(), overlooked.get(), others.get());
    println!(
        "{found} results, beside {others} other real poses of the same joints; \
         {overlooked} of the results were overlooked by the search"
    );
    assert!(overlooked * 200 <= found, "a search that overlooks poses proves nothing");
    assert!(others > found, "there must be other poses to be mistaken for the right one");
}
