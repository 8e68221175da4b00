// SPDX-License-Identifier: GPL-2.0-or-later
//! Helpers that the tests of several crates share.

pub mod constrained;
pub mod control;
pub mod drawn_constraints;
pub mod edits;
pub mod generated;
pub mod shipped;
pub mod stability;

/// Machines and equations of the core's tests.
#[path = "../../../kinsmodule/kinematics/tests/common/mod.rs"]
pub mod common;

/// A study of a linear delta that cuts, for `pkm cut` and its calculations.
pub const CUT: &str = "[platform]\nmass_kg = 2\ncentre_mm = [0, 0, 20]\n\
    inertia_kg_m2 = [[0.01, 0, 0], [0, 0.01, 0], [0, 0, 0.01]]\n\
    [legs]\nstiffness_n_per_um = 5\ndamping_ratio = 0.05\nmax_force_n = 500\n\
    [cutting]\nteeth = 2\nentry_deg = 0\nexit_deg = 180\ndepth_mm = 0.1\nkt_n_per_mm2 = 700\n\
    kr_n_per_mm2 = 200\nka_n_per_mm2 = 90\n";

/// A path file without laws: two pencils of lines through the ends of a diameter intersect on a circle.
pub const CIRCLE: &str = "
[parameters]
R = 80
[curve]
alpha = 'y - t*(x + R)'
beta = '(x - R) + t*y'
start_mm = [80, 0]
t = [0, 1]
";
