// SPDX-License-Identifier: GPL-2.0-or-later
//! Structure of the shipped machines by counting and by the leg rows.

use check::mobility::{Structure, rank, rows_at_home, singular_values};
use kinematics::Letter::{self, A, B, C, X, Y, Z};
use machine::proof::conditioning;
use test_support::shipped::MACHINES;
use test_support::shipped::config;

fn structure(machine: &str) -> Structure {
    Structure::of(&config(machine)).unwrap()
}

#[test]
fn links_and_joints_fit_the_loops_and_leave_six_freedoms_for_any_number_of_legs() {
    for (machine, links, joints, loops) in [
        ("tripod", 8, 9, 2),
        ("four-rod-lathe", 10, 12, 3),
        ("pyramid", 10, 12, 3),
        ("six-rod-lathe", 14, 18, 5),
    ] {
        let s = structure(machine);
        assert_eq!((s.links(), s.joints(), s.independent_loops()), (links, joints, loops));
        assert_eq!(s.links() + s.independent_loops() - s.joints(), 1, "{machine}");
        assert_eq!(s.freedoms(), 6, "{machine}");
    }
}

#[test]
fn rank_redundancy_and_held_coordinates_are_those_of_each_machine() {
    let delta = &[A, B, C][..];
    for (machine, rank, active_rank, redundancy, held) in [
        ("hexapod", 6, 6, 0, &[][..]),
        ("lab-hexapod", 6, 6, 0, &[]),
        ("six-rod-lathe", 6, 6, 0, &[]),
        ("four-rod-lathe", 4, 4, 0, &[A, C]),
        // Both pairs of rods measure Z; X and Y belong to the table.
        ("pyramid", 3, 3, 1, &[X, Y, C]),
        ("linear-delta", 3, 3, 0, delta),
        ("rotary-delta", 3, 3, 0, delta),
        ("tripod", 3, 3, 0, delta),
    ] {
        let s = structure(machine);
        assert_eq!((s.rank, s.active_rank, s.redundancy()), (rank, active_rank, redundancy));
        assert_eq!(s.held, held, "{machine}");
    }
}

#[test]
fn the_mobility_of_the_legs_is_reported_in_one_line() {
    assert_eq!(structure("hexapod").mobility(), "legs constrain 6 of 6 motions, 6 of XYZABC");
    assert_eq!(
        structure("pyramid").mobility(),
        "legs constrain 3 of 6 motions, 3 of ZAB; redundant legs: 1; joints or guides constrain XYC"
    );
}

/// Returns all 15 sets of four coordinates.
fn quadruples() -> Vec<Vec<Letter>> {
    let all = 0..1_usize << 6;
    let set = |bits: usize| Letter::ALL.into_iter().filter(move |l| bits >> l.index() & 1 == 1);
    all.filter(|bits| bits.count_ones() == 4).map(|bits| set(bits).collect()).collect()
}

#[test]
fn four_rods_move_only_four_of_the_fifteen_sets_of_four_coordinates() {
    let rows = rows_at_home(&config("four-rod-lathe")).unwrap();
    assert_eq!(quadruples().len(), 15);
    let regular = quadruples().into_iter().filter(|q| rank(&rows, q) == 4);
    let expected = [[X, Y, Z, B], [X, Y, A, B], [Y, Z, B, C], [Y, A, B, C]];
    assert_eq!(regular.collect::<Vec<_>>(), expected);
}

/// |det| of the unit rows at home, angles times 100 mm, from an independent calculation with
/// three decimals.
const DETERMINANTS: [([Letter; 4], f64); 4] =
    [([X, Y, Z, B], 1.946), ([X, Y, A, B], 1.182), ([Y, Z, B, C], 4.377), ([Y, A, B, C], 2.659)];

#[test]
fn determinants_of_the_four_rods_are_those_of_an_independent_calculation() {
    let config = config("four-rod-lathe");
    let rows = rows_at_home(&config).unwrap();
    for (letters, expected) in DETERMINANTS {
        let angles = letters.iter().filter(|letter| letter.is_angle()).count() as i32;
        let per_radius: f64 = singular_values(&rows, &letters)[..4].iter().product();
        let det = per_radius * (config.machine.radius() / 100.0).powi(angles);
        // Half of the last printed digit, and as much for earlier rounding.
        assert!((det - expected).abs() < 1e-3, "{letters:?}: {det}");
    }
}

#[test]
fn conditioning_is_the_singular_value_of_the_rows_at_home() {
    for machine in MACHINES {
        let config = config(machine);
        let home = conditioning::at(&config, &config.home).unwrap();
        // Rows about the centroid or CENTRE; those of `mobility` are about CENTRE.
        assert!(home > 0.05 && home < 2.0, "{machine}: {home}");
    }
    // Three vertical rods at 120 degrees would give exactly 1 along Z; see the linear delta.
    let delta = config("linear-delta");
    let rows = rows_at_home(&delta).unwrap();
    let least = singular_values(&rows, delta.machine.layout().coordinates().as_slice())[2];
    let found = conditioning::at(&delta, &delta.home).unwrap();
    assert!((least - found).abs() < 1e-12, "{least} {found}");
}
