// SPDX-License-Identifier: GPL-2.0-or-later
//! Curves of one-parametric families: points, tangents, lengths, joints.

use kinematics::Pose;
use machine::read::mechanism::Mechanism;
use paths::carriages::taken;
use paths::file::{PathFile, ProgramKeys};
use paths::motion::{Pace, node};
use paths::piece::{Arc, Piece};
use paths::route::{Route, route};
use paths::table::rows;
use paths::whole::{Curve, CurveError};
use program::motion::{Move, MoveKind, moves};
use serde::Deserialize;
use std::f64::consts::{PI, TAU};
use std::fs;
use std::sync::LazyLock;
use test_support::CIRCLE;
use test_support::shipped::config;

/// Positions of 100 mm by well-conditioned formulas; quadrature adds 1e-13 of a length.
const EXACT: f64 = 1e-10;

#[derive(Deserialize)]
pub struct Golden {
    pub circle: Vec<[f64; 6]>,
    pub pyramid_joints: Vec<[f64; 7]>,
    pub pyramid_rates: Vec<[f64; 7]>,
    pub chords_of_a_turn: usize,
    pub cycloid_h20_arch: f64,
    #[serde(rename = "epicycloid_R40_r10_arch")]
    pub epicycloid: f64,
    pub involute_r15_t2: f64,
    pub ellipse_60_35: f64,
    pub ellipse_60_35_t_at_third_of_quarter: f64,
    pub archimedes_k5_two_turns: f64,
    #[serde(rename = "helix_r30_P8_turn")]
    pub helix: f64,
    #[serde(rename = "conical_helix_r30_k1p5_P4_10rad")]
    pub conical_helix: f64,
    #[serde(rename = "loxodrome_R100_75deg_lat20_80")]
    pub loxodrome: f64,
    pub loxodrome_lat75: [f64; 5],
}

pub static GOLDEN: LazyLock<Golden> =
    LazyLock::new(|| toml::from_str(include_str!("cutting_path.toml")).unwrap());

pub fn curve(text: &str) -> Result<Curve, CurveError> {
    Curve::of(&PathFile::parse(text).unwrap())
}

fn refusal(text: &str) -> String {
    curve(text).unwrap_err().to_string()
}

const LOXODROME: &str = "
[parameters]
R = 100
tan_beta = 3.7320508075688776
from = 0.3490658503988659
[curve]
x_mm = 'R*cos(t)*cos(tan_beta*(asinh(tan(t)) - asinh(tan(from))))'
y_mm = 'R*cos(t)*sin(tan_beta*(asinh(tan(t)) - asinh(tan(from))))'
t = ['pi/9', '4*pi/9']
[laws]
z_mm = 'R*sin(t)'
normal = ['x', 'y', 'z']
";

fn explicit(x: &str, y: &str, t: [f64; 2]) -> Curve {
    let [from, to] = t;
    curve(&format!("[curve]\nx_mm = '{x}'\ny_mm = '{y}'\nt = [{from:?}, {to:?}]\n")).unwrap()
}

/// Returns part and parameter at a value of t, for a curve along which t increases.
fn at_t(curve: &Curve, t: f64) -> (usize, f64) {
    let of = |part: usize, at: f64| curve.at(part, at).unwrap().t.value.middle();
    let end = |part: usize| of(part, curve.parts[part].range[1]);
    let part = (0..curve.parts.len()).find(|k| end(*k) >= t).unwrap_or(curve.parts.len() - 1);
    let [mut low, mut high] = curve.parts[part].range;
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        *(if of(part, middle) < t { &mut low } else { &mut high }) = middle;
    }
    (part, 0.5 * (low + high))
}

fn close(a: f64, b: f64) {
    assert!((a - b).abs() <= EXACT * (1.0 + b.abs()), "{a} {b}");
}

#[test]
fn points_tangents_and_lengths_of_a_circle_of_two_pencils_are_those_of_its_closed_form() {
    let curve = curve(CIRCLE).unwrap();
    assert!(curve.turnings.is_empty() && !curve.is_closed);
    for [t, x, y, dx, dy, s] in &GOLDEN.circle {
        let (part, at) = at_t(&curve, *t);
        let here = curve.at(part, at).unwrap();
        close(here.pose[0].value.middle(), *x);
        close(here.pose[1].value.middle(), *y);
        let by_t = |k: usize| here.pose[k].first().middle() / here.t.first().middle();
        close(by_t(0), *dx);
        close(by_t(1), *dy);
        close(curve.length_at(part, at).unwrap(), *s);
    }
    close(curve.length, GOLDEN.circle[2][5]);
}

#[test]
fn lengths_of_classical_curves_are_those_of_their_closed_forms() {
    for (x, y, t, expected) in [
        ("20*(t - sin(t))", "20*(1 - cos(t))", [0.0, TAU], GOLDEN.cycloid_h20_arch),
        // Half an arch, 4 h (1 - cos(t/2)).
        ("20*(t - sin(t))", "20*(1 - cos(t))", [0.0, PI], GOLDEN.cycloid_h20_arch / 2.0),
        ("50*cos(t) - 10*cos(5*t)", "50*sin(t) - 10*sin(5*t)", [0.0, PI / 2.0], GOLDEN.epicycloid),
        ("15*(cos(t) + t*sin(t))", "15*(sin(t) - t*cos(t))", [0.0, 2.0], GOLDEN.involute_r15_t2),
        ("60*cos(t)", "35*sin(t)", [0.0, TAU], GOLDEN.ellipse_60_35),
        ("5*t*cos(t)", "5*t*sin(t)", [0.0, 2.0 * TAU], GOLDEN.archimedes_k5_two_turns),
    ] {
        close(explicit(x, y, t).length, expected);
    }
}

/// Returns the length in space, from the speed at many points (Simpson's rule).
fn length_in_space(curve: &Curve) -> f64 {
    const STEPS: usize = 4000;
    let [a, b] = curve.parts[0].range;
    let speed = |k: usize| {
        let here = curve.at(0, a + (b - a) * k as f64 / STEPS as f64).unwrap();
        here.pose[..3].iter().map(|x| x.first().middle().powi(2)).sum::<f64>().sqrt()
    };
    let weight = |k: usize| if k % 2 == 1 { 4.0 } else { 2.0 };
    let inner: f64 = (1..STEPS).map(|k| weight(k) * speed(k)).sum();
    (speed(0) + inner + speed(STEPS)) * (b - a) / (3.0 * STEPS as f64)
}

#[test]
fn lengths_in_space_of_helices_and_of_the_loxodrome_are_those_of_their_closed_forms() {
    let helix = |r: &str, z: &str, last: f64| {
        let text = format!(
            "[curve]\nx_mm = '{r}*cos(t)'\ny_mm = '{r}*sin(t)'\nt = [0, {last:?}]\n[laws]\nz_mm = '{z}'\n"
        );
        curve(&text).unwrap()
    };
    let turn = helix("30", "-8*t/(2*pi)", TAU);
    close(length_in_space(&turn), GOLDEN.helix);
    close(length_in_space(&helix("(30 - 1.5*t)", "-4*t/(2*pi)", 10.0)), GOLDEN.conical_helix);
    let loxodrome = curve(LOXODROME).unwrap();
    close(length_in_space(&loxodrome), GOLDEN.loxodrome);
    let here = loxodrome.at(0, 75_f64.to_radians()).unwrap();
    for (found, expected) in here.pose.iter().zip(GOLDEN.loxodrome_lat75) {
        close(found.value.middle(), expected);
    }
}

#[test]
fn the_parameter_at_a_length_of_an_ellipse_is_that_of_the_elliptic_integral() {
    let curve = explicit("60*cos(t)", "35*sin(t)", [0.0, TAU]);
    let (part, at) = curve.at_length(GOLDEN.ellipse_60_35 / 12.0).unwrap();
    assert_eq!(part, 0);
    close(at, GOLDEN.ellipse_60_35_t_at_third_of_quarter);
}

#[test]
fn a_spiral_of_circles_and_lines_is_followed_around_the_origin() {
    let spiral = curve(
        "[parameters]\nk = 5\n[curve]\nalpha = 'x^2 + y^2 - (k*t)^2'\nbeta = 'x*sin(t) - y*cos(t)'\n\
         start_mm = [2.70151152934, 4.20735492404]\nt = [1, '4*pi']\n",
    )
    .unwrap();
    for (part, own) in spiral.parts.iter().enumerate() {
        let here = spiral.at(part, 0.3 * own.range[1]).unwrap();
        let [t, x, y] = [here.t, here.pose[0], here.pose[1]].map(|x| x.value.middle());
        close(x, 5.0 * t * t.cos());
        close(y, 5.0 * t * t.sin());
    }
    let closed = |t: f64| 2.5 * (t * t.hypot(1.0) + t.asinh());
    close(spiral.length, closed(2.0 * TAU) - closed(1.0));
}

const LINES_OVER_A_CIRCLE: &str = "
[curve]
alpha = 'y - t'
beta = 'x^2 + y^2 - 50^2'
start_mm = [50, 0]
t = [0, 60]
t_bounds = [-60, 60]
";

#[test]
fn a_circle_that_t_crosses_twice_is_followed_through_both_turning_points_to_its_start() {
    let circle = curve(LINES_OVER_A_CIRCLE).unwrap();
    assert!(circle.is_closed);
    assert_eq!(circle.turnings.len(), 2);
    for (turning, t) in circle.turnings.iter().zip([50.0, -50.0]) {
        assert!((turning.t - t).abs() < 1e-9 && turning.at[0].abs() < 1e-6, "{turning:?}");
    }
    assert!((circle.length - 100.0 * PI).abs() < 1e-9, "{}", circle.length);
}

#[test]
fn a_curve_that_follows_t_ends_at_its_turning_point() {
    let arc = curve(&format!("{LINES_OVER_A_CIRCLE}follow = 't'\n")).unwrap();
    assert!(!arc.is_closed && arc.turnings.len() == 1);
    // The turning point is where the slope of t changes its sign: y to rounding, x to the square root of it.
    assert!((arc.length - 25.0 * PI).abs() < 1e-6, "{}", arc.length);
}

#[test]
fn a_fold_is_followed_through() {
    // x = y^3 - 3 y, with t = x: two folds at y = 1 and -1.
    let fold = curve(
        "[curve]\nalpha = 'x - (y^3 - 3*y)'\nbeta = 'x - t'\nstart_mm = [-18, -3]\nt = [-18, 18]\n",
    )
    .unwrap();
    let found: Vec<f64> = fold.turnings.iter().map(|turning| turning.t).collect();
    assert!((found[0] - 2.0).abs() < 1e-9 && (found[1] + 2.0).abs() < 1e-9, "{found:?}");
    let last = fold.parts.len() - 1;
    let end = fold.at(last, fold.parts[last].range[1]).unwrap();
    close(end.pose[1].value.middle(), 3.0);
}

#[test]
fn a_curve_whose_branches_cross_is_refused_with_the_place() {
    let message = refusal(
        "[curve]\nalpha = 'y - t*x'\nbeta = '(x^2 + y^2)^2 - 3600*(x^2 - y^2)'\n\
         start_mm = [60, 0]\nt = [0, 2]\nt_bounds = [-2, 2]\n",
    );
    assert!(
        message.contains("singular point near x 0.000") && message.contains("t 1.0"),
        "{message}"
    );
}

#[test]
fn what_is_no_curve_is_refused_with_the_key_or_the_place() {
    let explicit = |x: &str| format!("[curve]\nx_mm = \"{x}\"\ny_mm = 0\nt = [-1, 3]\n");
    for (text, expected) in [
        (explicit("1/(t-1)"), "at t = 1: \"1/(t-1)\" divides by 0"),
        (explicit("1/(t-1.3)"), "a pole, a divisor of 0"),
        (explicit("1/(t-1.3)"), "at t = 1.30000"),
        // The divisor loses digits near the pole.
        ("[curve]\nx_mm = '1/(1+cos(t))'\ny_mm = 0\nt = [0, '2*pi']\n".into(), "divides by 0"),
        (explicit("sqrt(t)"), "at t = -1"),
        (explicit("sqrt(t)"), "no real value: sqrt of -"),
        (explicit("q*t"), "[curve] x_mm: \"q*t\": unknown name q; known names are t"),
        (explicit("2 +"), "character 4: expected a number"),
        (explicit("2 + §"), "character 5: expected a number"),
        (explicit("3"), "length is 0"),
        ("[curve]\nx_mm = 't'\ny_mm = 0\n".into(), "[curve] t: missing"),
        ("[curve]\nx_mm = 't'\ny_mm = 0\nt = [2, 2]\n".into(), "both ends are 2"),
        ("[curve]\nx_mm = 't'\ny_mm = 0\nt = [2, 1]\n".into(), "the smaller number first"),
        ("[curve]\nx_mm = 't'\nt = [2, 1]\n".into(), "expected x_mm and y_mm, or alpha and beta"),
        ("[curve]\nalpha = 'y'\nt = [0, 1]\n".into(), "beta: missing"),
        ("[curve]\nf = 'y'\n".into(), "start_mm: missing"),
        (
            "[curve]\nf = 'y - t'\nstart_mm = [0, 0]\n".into(),
            "unknown name t; known names are x, y",
        ),
        ("[curve]\nf = 'y'\nt = [0, 1]\nstart_mm = [0, 0]\n".into(), "use t_bounds or length_mm"),
        (
            "[curve]\nf = 'y'\nalpha = 'x'\nbeta = 'y'\nt = [0, 1]\nstart_mm = [0, 0]\n".into(),
            "or alpha and beta, or f, or one of",
        ),
        ("[curve]\nf = 'x^2 + y^2 - 1'\nstart_mm = [0, 0]\n".into(), "singular point"),
        ("[curve]\nf = 'x^2 + y^2 + 1'\nstart_mm = [1, 0]\n".into(), "no real branch"),
        (
            "[curve]\nalpha = 'x^2 + y^2 + 1'\nbeta = 'x - t'\nstart_mm = [0, 0]\nt = [0, 1]\n"
                .into(),
            "no real branch near start_mm [0, 0] at t = 0",
        ),
        (format!("{CIRCLE}[split]\nt_x = 't'\n"), "families define x and y together"),
        (
            format!("{CIRCLE}[laws]\nnormal = ['0', '0', '1']\na_deg = 1\n"),
            "normal or a_deg b_deg c_deg, not both",
        ),
    ] {
        let message = refusal(&text);
        assert!(message.contains(expected), "{expected}: {message}");
    }
}

/// Tests a curve so near to a pole that rounding of the speed exceeds the requested error of its integral.
#[test]
fn beside_a_pole_the_length_is_that_of_the_line() {
    let text = "[curve]\nx_mm = \"1/(t - 1)\"\ny_mm = 0\nt = [0, 0.9999999999]\n";
    let length = curve(text).unwrap().length;
    let expected = 1.0 / (1.0 - 0.9999999999) - 1.0;
    // Nodes of the rule round to 1e-16 at a distance of 1e-10: a millionth of the speed there.
    assert!((length / expected - 1.0).abs() < 1e-6, "{length}, not {expected}");
}

#[test]
fn a_value_without_its_unit_is_an_unknown_key() {
    for (text, expected) in [
        ("[curve]\nx = 't'\n", "unknown field `x`, expected one of `x_mm`"),
        ("[laws]\nspeed = 3\n", "expected one of `z_mm`, `a_deg`"),
        ("[tolerance]\nchord = 3\n", "unknown field `chord`"),
        ("[tolerance]\nchord_mm = 0\n", "expected more than 0"),
        ("[tolerance]\n", "missing field `chord_mm`"),
        ("[curve]\nx_mm = nan\n", "expected a finite number"),
        ("[curve]\nx_mm = true\n", "a number, or an expression"),
    ] {
        let message = PathFile::parse(text).unwrap_err().to_string();
        assert!(message.contains(expected), "{text}: {message}");
    }
}

#[test]
fn joints_and_rates_on_the_pyramid_are_those_of_two_independent_computations() {
    let config = config("pyramid");
    let text = format!(
        "{CIRCLE}[laws]\nz_mm = '180 + 60*t'\na_deg = '10*t'\nb_deg = '-8*t^2'\nspeed_mm_per_s = 20\n"
    );
    let curve = curve(&text).unwrap();
    let keys = ProgramKeys::default();
    for (joints, rates) in GOLDEN.pyramid_joints.iter().zip(&GOLDEN.pyramid_rates) {
        let (part, at) = at_t(&curve, joints[0]);
        let node = node(&curve, part, at, &Pace { turn: None }).unwrap();
        let row = &rows(&config, &keys, std::slice::from_ref(&node), [0.0; 3]).unwrap()[0];
        // The table's joints are the last two of the machine.
        let order = [4, 5, 0, 1, 2, 3];
        for (k, joint) in order.into_iter().enumerate() {
            close(row.joints[joint], joints[k + 1]);
            let found = row.rates.unwrap()[joint];
            // The golden rates were computed from central differences.
            assert!((found - rates[k + 1]).abs() < 1e-9, "{found} {}", rates[k + 1]);
        }
        close(row.centre[0], row.joints[4]);
        close(row.centre[1], row.joints[5]);
        // The table follows the displacement of the center due to the longer tool.
        let long = &rows(&config, &keys, &[node], [0.0, 0.0, 40.0]).unwrap()[0];
        close(long.centre[0], long.joints[4]);
        close(long.centre[1], long.joints[5]);
        let [a, b] = [long.node.pose[3], long.node.pose[4]].map(f64::to_radians);
        close(long.joints[4] - row.joints[4], 40.0 * a.cos() * b.sin());
        close(long.joints[5] - row.joints[5], -40.0 * a.sin());
        close(long.centre[2] - row.centre[2], 40.0 * a.cos() * b.cos());
    }
}

#[test]
fn what_linuxcnc_reads_of_a_program_ends_at_the_joints_of_the_figures() {
    let config = config("pyramid");
    let text = format!(
        "{CIRCLE}[laws]\nz_mm = '180 + 60*t'\na_deg = '10*t'\nb_deg = '-8*t^2'\nspeed_mm_per_s = 20\n\
         [tolerance]\nchord_mm = 0.01\n[program]\nzero_mm = [0, 0, 0]\n"
    );
    let (_, ends) = read_back(&config, &text);
    let joints = |pose: &[f64; 6]| {
        // In machine coordinates, where the workpiece is at 0.
        let [x, y, z, a, b, c] = *pose;
        let pose = Pose::from_degrees([x, y, z + ZERO, a, b, c]);
        config.machine.inverse(&pose, &config.spindle).unwrap()
    };
    let order = [4, 5, 0, 1, 2, 3];
    for (end, expected) in [
        (&ends[0], GOLDEN.pyramid_joints.first().unwrap()),
        (ends.last().unwrap(), GOLDEN.pyramid_joints.last().unwrap()),
    ] {
        let found = joints(end);
        for (k, joint) in order.into_iter().enumerate() {
            // Words of six decimals.
            assert!((found[joint] - expected[k + 1]).abs() < 1e-4, "{found:?} {expected:?}");
        }
    }
}

/// Returns the carriage position on a guide from (x1, z1) to (x2, z2) by equations 7 and 8 of paper 000, corrected:
/// the circle's center is the joint (x0, z0).
fn carriage([x1, z1]: [f64; 2], [x2, z2]: [f64; 2], [x0, z0]: [f64; 2], rod: f64) -> f64 {
    let k = (x2 - x1) / (z2 - z1);
    let s1 = 1.0 + k * k;
    let s2 = 2.0 * k * x1 - 2.0 * k * x0 - 2.0 * k * k * z1 - 2.0 * z0;
    let s3 = x1 * x1 + x0 * x0 + k * k * z1 * z1 - 2.0 * k * z1 * x1 + 2.0 * k * z1 * x0
        - 2.0 * x0 * x1
        + z0 * z0
        - rod * rod;
    let z = (-s2 + (s2 * s2 - 4.0 * s1 * s3).sqrt()) / (2.0 * s1);
    (z - z1) * s1.sqrt()
}

const CYCLOID: &str = "
[parameters]
h = 16
[curve]
x_mm = 'h*(t - sin(t)) - pi*h'
y_mm = 0
t = [0, '2*pi']
[laws]
z_mm = 'h*(1 - cos(t))'
speed_mm_per_s = 20
[tolerance]
chord_mm = 0.005
[program]
zero_mm = [0, 0, 200]
";

/// Positions of some 1000 mm through a square root of 1e6 have a relative error of 1e-12.
const EQUATION_9: f64 = 1e-9;

#[test]
fn carriages_of_a_cycloid_that_the_table_shares_follow_the_law_of_the_height_alone() {
    let config = config("pyramid");
    let found = route(&config, &PathFile::parse(CYCLOID).unwrap()).unwrap();
    // An arch of h = 16 is 8 h long, and 2π h in x and y. Quadrature with two points in each of some 120 pieces has an
    // error of 1e-8 mm.
    assert!((found.length - 128.0).abs() < 1e-7, "{}", found.length);
    close(found.curve.length, 32.0 * PI);
    for row in &found.rows {
        let t = row.node.t;
        let (x, z) = (16.0 * (t - t.sin()) - 16.0 * PI, 16.0 * (1.0 - t.cos()) + 200.0);
        let expected = carriage([700.0, 200.0], [200.0, 1200.0], [120.0, z + 150.0], 550.0);
        for joint in &row.joints[..4] {
            assert!((joint - expected).abs() < EQUATION_9, "t {t}: {joint} {expected}");
        }
        assert!((row.joints[4] - x).abs() < EQUATION_9 && row.joints[5].abs() < EQUATION_9);
    }
}

/// Two guides and rods of the pyramid, whose platform also moves in X.
const BIGLIDE: &str = "
[EMCMOT]
SERVO_PERIOD = 1000000
[KINS]
KINEMATICS = pkmkins legs=slider:2 coordinates=XZ
JOINTS = 2
[TRAJ]
COORDINATES = XZ
HOME = 0 0 270
LINEAR_UNITS = mm
ANGULAR_UNITS = degree
MAX_LINEAR_VELOCITY = 100
MAX_ANGULAR_VELOCITY = 15
MAX_LINEAR_ACCELERATION = 600
MAX_ANGULAR_ACCELERATION = 150
[LEG_0]
BASE = 700 0 200
GUIDE = -500 0 1000
PLATFORM = 120 0 150
ROD = 550
SIDE = 1
[LEG_1]
BASE = -700 0 200
GUIDE = 500 0 1000
PLATFORM = -120 0 150
ROD = 550
SIDE = 1
[JOINT_0]
TYPE = LINEAR
HOME = 810.8126291149142
MIN_LIMIT = 0
MAX_LIMIT = 1118
MAX_VELOCITY = 400
MAX_ACCELERATION = 4000
[JOINT_1]
TYPE = LINEAR
HOME = 810.8126291149142
MIN_LIMIT = 0
MAX_LIMIT = 1118
MAX_VELOCITY = 400
MAX_ACCELERATION = 4000
[AXIS_X]
MIN_LIMIT = -150
MAX_LIMIT = 150
MAX_VELOCITY = 100
MAX_ACCELERATION = 600
[AXIS_Z]
MIN_LIMIT = 150
MAX_LIMIT = 390
MAX_VELOCITY = 100
MAX_ACCELERATION = 600
";

#[test]
fn carriages_of_a_cycloid_that_the_platform_follows_have_the_law_of_equation_9_corrected() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("biglide.ini");
    fs::write(&file, BIGLIDE).unwrap();
    let config = test_support::shipped::first_of(&file);
    let found = route(&config, &PathFile::parse(CYCLOID).unwrap()).unwrap();
    assert!(found.rows.len() > 20);
    for row in &found.rows {
        let t = row.node.t;
        let (x, z) = (16.0 * (t - t.sin()) - 16.0 * PI, 16.0 * (1.0 - t.cos()) + 350.0);
        for (joint, side) in row.joints.iter().take(2).zip([1.0, -1.0]) {
            let at = [side * x + 120.0, z];
            let expected = carriage([700.0, 200.0], [200.0, 1200.0], at, 550.0);
            assert!((joint - expected).abs() < EQUATION_9, "t {t}: {joint} {expected}");
        }
    }
}

/// A curve with its closed form, which does not use expressions.
struct Known {
    name: &'static str,
    text: &'static str,
    at: fn(f64) -> [f64; 6],
    t: [f64; 2],
}

fn flat(x: f64, y: f64, z: f64) -> [f64; 6] {
    [x, y, z, 0.0, 0.0, 0.0]
}

fn loxodrome(t: f64) -> [f64; 6] {
    let from = std::f64::consts::PI / 9.0;
    let turn = 75_f64.to_radians().tan() * (t.tan().asinh() - from.tan().asinh());
    let n = [t.cos() * turn.cos(), t.cos() * turn.sin(), t.sin()];
    let [a, b] = [-n[1].asin(), n[0].atan2(n[2])].map(f64::to_degrees);
    [100.0 * n[0], 100.0 * n[1], 100.0 * n[2], a, b, 0.0]
}

const KNOWN: [Known; 8] = [
    Known {
        name: "circle",
        text: "[curve]\nx_mm = '50*cos(t)'\ny_mm = '50*sin(t)'\nt = [0, '2*pi']\n",
        at: |t| flat(50.0 * t.cos(), 50.0 * t.sin(), 0.0),
        t: [0.0, TAU],
    },
    Known {
        name: "cycloid",
        text: "[curve]\nx_mm = '16*(t - sin(t)) - 16*pi'\ny_mm = 7\nt = [0, '2*pi']\n\
               [laws]\nz_mm = '16*(1 - cos(t))'\n",
        at: |t| flat(16.0 * (t - t.sin()) - 16.0 * PI, 7.0, 16.0 * (1.0 - t.cos())),
        t: [0.0, TAU],
    },
    Known {
        name: "epicycloid",
        text: "[curve]\nx_mm = '50*cos(t) - 10*cos(5*t)'\ny_mm = '50*sin(t) - 10*sin(5*t)'\n\
               t = [0, '2*pi']\n",
        at: |t| {
            let u = 5.0 * t;
            flat(50.0 * t.cos() - 10.0 * u.cos(), 50.0 * t.sin() - 10.0 * u.sin(), 0.0)
        },
        t: [0.0, TAU],
    },
    Known {
        name: "involute",
        text: "[curve]\nx_mm = '15*(cos(t) + t*sin(t))'\ny_mm = '15*(sin(t) - t*cos(t))'\nt = [0, 6]\n",
        at: |t| flat(15.0 * (t.cos() + t * t.sin()), 15.0 * (t.sin() - t * t.cos()), 0.0),
        t: [0.0, 6.0],
    },
    Known {
        name: "spiral",
        text: "[curve]\nx_mm = '5*t*cos(t)'\ny_mm = '5*t*sin(t)'\nt = [0, '4*pi']\n",
        at: |t| flat(5.0 * t * t.cos(), 5.0 * t * t.sin(), 0.0),
        t: [0.0, 2.0 * TAU],
    },
    Known {
        name: "helix",
        text: "[curve]\nx_mm = '30*cos(t)'\ny_mm = '30*sin(t)'\nt = [0, '6*pi']\n\
               [laws]\nz_mm = '30 - 8*t/(2*pi)'\n",
        at: |t| flat(30.0 * t.cos(), 30.0 * t.sin(), 30.0 - 8.0 * t / TAU),
        t: [0.0, 3.0 * TAU],
    },
    Known {
        name: "conical helix",
        text: "[curve]\nx_mm = '(30 - 1.5*t)*cos(t)'\ny_mm = '(30 - 1.5*t)*sin(t)'\nt = [0, 10]\n\
               [laws]\nz_mm = '30 - 4*t/(2*pi)'\n",
        at: |t| {
            let r = 30.0 - 1.5 * t;
            flat(r * t.cos(), r * t.sin(), 30.0 - 4.0 * t / TAU)
        },
        t: [0.0, 10.0],
    },
    Known {
        name: "spherical loxodrome",
        text: "[parameters]\nT = 3.7320508075688776\n[curve]\n\
               x_mm = '100*cos(t)*cos(T*(asinh(tan(t)) - asinh(tan(pi/9))))'\n\
               y_mm = '100*cos(t)*sin(T*(asinh(tan(t)) - asinh(tan(pi/9))))'\n\
               t = ['71*pi/180', '85*pi/180']\n\
               [laws]\nz_mm = '100*sin(t)'\nnormal = ['x', 'y', 'z']\n",
        at: loxodrome,
        t: [71_f64.to_radians(), 85_f64.to_radians()],
    },
];

/// Returns the route of a curve, and the ends of its moves as LinuxCNC's interpreter reads them: the first one is at
/// the start of the curve.
fn read_back(config: &Mechanism, text: &str) -> (Route, Vec<[f64; 6]>) {
    read_back_file(config, &PathFile::parse(text).unwrap())
}

/// Returns the same for a path file that refers to other files.
pub fn read_back_file(config: &Mechanism, file: &PathFile) -> (Route, Vec<[f64; 6]>) {
    let found = route(config, file).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("path.ngc");
    // LinuxCNC would merge moves within the tolerance (naive CAM detection), but each is checked here.
    let each = |line: &str| match line.contains("G64 P") {
        true => line.replace("G64 P", "G61 (") + ")",
        false => line.to_string(),
    };
    let text: Vec<String> = found.program.lines().map(each).collect();
    fs::write(&file, text.join("\n")).unwrap();
    let moves = moves(&config.clone().into(), &file, None).unwrap();
    let first = moves.iter().position(|step| step.kind == MoveKind::Feed).unwrap();
    let last = moves.iter().rposition(|step| step.kind == MoveKind::Feed).unwrap();
    let in_work = |step: &Move| {
        let [x, y, z, a, b, c] = step.end;
        [x, y, z - ZERO, a, b, c]
    };
    (found, moves[first - 1..=last].iter().map(in_work).collect())
}

/// Height of the workpiece in the pyramid.
pub const ZERO: f64 = 200.0;

pub fn asked(text: &str, chord: f64, moves: &str) -> String {
    let laws = if text.contains("[laws]") { "" } else { "[laws]\n" };
    format!(
        "{text}{laws}speed_mm_per_s = 20\n[tolerance]\nchord_mm = {chord:?}\nangle_deg = 0.02\n\
         [program]\nmoves = '{moves}'\nzero_mm = [0, 0, {ZERO:?}]\n"
    )
}

pub fn distance(a: &[f64; 6], b: &[f64; 6]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}

#[test]
fn straight_moves_that_linuxcnc_reads_stay_within_the_tolerance_at_every_parameter() {
    let config = config("pyramid");
    for known in &KNOWN {
        for chord in [0.002, 0.05] {
            let (found, ends) = read_back(&config, &asked(known.text, chord, "lines"));
            assert_eq!(ends.len(), found.rows.len(), "{}", known.name);
            let (mut most, mut most_angle) = (0.0_f64, 0.0_f64);
            for (nodes, ends) in found.rows.windows(2).zip(ends.windows(2)) {
                let [from, to] = [nodes[0].node.t, nodes[1].node.t];
                for n in 0..=16 {
                    let share = f64::from(n) / 16.0;
                    let on_curve = (known.at)(from + share * (to - from));
                    let on_line =
                        std::array::from_fn(|k| ends[0][k] + share * (ends[1][k] - ends[0][k]));
                    most = most.max(distance(&on_curve, &on_line));
                    let angle = |k: usize| (on_curve[k] - on_line[k]).abs();
                    most_angle = most_angle.max(angle(3)).max(angle(4));
                }
            }
            assert!(most <= chord, "{}: {most}", known.name);
            assert!(most_angle <= 0.02, "{}: {most_angle}", known.name);
            // The bound is tight: where the chord decides, the deviation of pieces comes close to it.
            let need = found.pieces.iter().map(|piece| piece.deviation).fold(0.0, f64::max);
            assert!(most > 0.9 * need, "{}: {most} of {need}", known.name);
            assert!((found.rows[0].node.t - known.t[0]).abs() < 1e-12);
            assert!((found.rows[ends.len() - 1].node.t - known.t[1]).abs() < 1e-12);
        }
    }
}

/// Returns the distance of a point from a straight move.
pub fn to_move(point: &[f64; 6], from: &[f64; 6], to: &[f64; 6]) -> f64 {
    let along: Vec<f64> = (0..3).map(|k| to[k] - from[k]).collect();
    let square: f64 = along.iter().map(|x| x * x).sum();
    let product: f64 = (0..3).map(|k| (point[k] - from[k]) * along[k]).sum();
    let share = if square > 0.0 { (product / square).clamp(0.0, 1.0) } else { 0.0 };
    let near = std::array::from_fn(|k| if k < 3 { from[k] + share * along[k] } else { 0.0 });
    distance(point, &near)
}

/// The interpreter replaces arcs by straight moves within this distance.
pub const INTERPRETER: f64 = 1e-4;

#[test]
fn arcs_that_linuxcnc_reads_stay_within_the_tolerance_and_are_fewer_than_lines() {
    let config = config("pyramid");
    for known in KNOWN.iter().filter(|known| known.name != "spherical loxodrome") {
        let chord = 0.005;
        let (found, ends) = read_back(&config, &asked(known.text, chord, "arcs"));
        let lines = route(&config, &PathFile::parse(&asked(known.text, chord, "lines")).unwrap());
        let (arcs, lines) = (found.pieces.len(), lines.unwrap().pieces.len());
        assert!(3 * arcs < lines, "{}: {arcs} of {lines}", known.name);
        // Along the curve and the moves simultaneously.
        let (mut at, mut most) = (0, 0.0_f64);
        let steps = 40 * ends.len();
        for n in 0..=steps {
            let t = known.t[0] + (known.t[1] - known.t[0]) * n as f64 / steps as f64;
            let point = (known.at)(t);
            let to = |k: usize| to_move(&point, &ends[k], &ends[k + 1]);
            while at + 2 < ends.len() && to(at + 1) <= to(at) {
                at += 1;
            }
            most = most.max(to(at));
        }
        assert_eq!(at + 2, ends.len(), "{}: the moves go on behind the curve", known.name);
        assert!(most <= chord + INTERPRETER, "{}: {most}", known.name);
    }
}

/// First axis, second axis and the axis across of G17, G18 and G19.
const PLANES: [[usize; 3]; 3] = [[0, 1, 2], [2, 0, 1], [1, 2, 0]];

/// Part of the tolerance for the words of an arc, which have six decimals: its end, and start, end and center.
const OF_WORDS: f64 = 4e-6;

/// Returns the deviation of a curve from an arc that replaces a part of it, and how far the arc turns, radians.
fn off_arc(found: &Route, piece: &Piece, arc: &Arc) -> [f64; 2] {
    let [first, second, across] = PLANES[arc.plane];
    let point = |n: usize| {
        let share = n as f64 / 64.0;
        let at = piece.range[0] + share * (piece.range[1] - piece.range[0]);
        let pose = found.curve.at(piece.part, at).unwrap().pose;
        let place = [first, second, across].map(|k| pose[k].value.middle());
        [place[0] - arc.centre[0], place[1] - arc.centre[1], place[2]]
    };
    let points: Vec<[f64; 3]> = (0..=64).map(point).collect();
    let side = if arc.is_left { 1.0 } else { -1.0 };
    let mut angles = vec![0.0];
    for pair in points.windows(2) {
        let [[x, y, _], [u, v, _]] = [pair[0], pair[1]];
        let step = side * (x * v - y * u).atan2(x * u + y * v);
        assert!(step > 0.0, "the curve goes back along {piece:?}");
        angles.push(angles[angles.len() - 1] + step);
    }
    let turn = angles[64];
    let radius = points[0][0].hypot(points[0][1]);
    let rise = points[64][2] - points[0][2];
    close(arc.length, (turn * radius).hypot(rise));
    let off = points.iter().zip(&angles).map(|([x, y, z], angle)| {
        (x.hypot(*y) - radius).hypot(z - points[0][2] - rise * angle / turn)
    });
    [off.fold(0.0, f64::max), turn]
}

/// An arc ends where one of 1.5 times its length would leave the tolerance or turn too far. The deviation grows with the
/// third power of the length, so that most arcs use a fifth of the tolerance.
#[test]
fn arcs_stay_within_the_tolerance_everywhere_and_are_as_long_as_possible() {
    let config = config("pyramid");
    for known in KNOWN.iter().filter(|known| known.name != "spherical loxodrome") {
        for chord in [1e-5, 0.005, 0.1] {
            let text = asked(known.text, chord, "arcs");
            let found = route(&config, &PathFile::parse(&text).unwrap()).unwrap();
            let (mut arcs, mut short) = (0, 0);
            for piece in &found.pieces {
                let Some(arc) = &piece.arc else { continue };
                let [off, turn] = off_arc(&found, piece, arc);
                assert!(off <= chord - OF_WORDS, "{}: {off} of {chord}: {piece:?}", known.name);
                assert!(turn <= 1.5 * PI, "{}: {turn}: {piece:?}", known.name);
                arcs += 1;
                short += usize::from(off < 0.2 * (chord - OF_WORDS) && turn < PI);
            }
            // The last arc, and those before a cusp.
            assert!(short <= 1 + arcs / 50, "{} {chord}: {short} of {arcs}", known.name);
        }
    }
}

/// An arc of a huge radius, of a tolerance that its own words use up, or along which the tool tilts, is written as lines.
#[test]
fn arcs_that_cannot_be_written_exactly_are_lines() {
    let config = config("pyramid");
    let arcs = |text: &str, chord: f64| {
        let found = route(&config, &PathFile::parse(&asked(text, chord, "arcs")).unwrap());
        found.unwrap().pieces.iter().filter(|piece| piece.arc.is_some()).count()
    };
    let tilting = format!("{}[laws]\na_deg = '5*sin(t)'\n", KNOWN[0].text);
    assert_eq!(arcs(&tilting, 0.005), 0);
    let circle = |radius: f64, end: f64, chord: f64| {
        let text = format!(
            "[curve]\nx_mm = '{radius:?}*cos(t) - {radius:?}'\ny_mm = '{radius:?}*sin(t)'\nt = [0, {end:?}]\n"
        );
        arcs(&text, chord)
    };
    assert_eq!(circle(9_000.0, 0.005, 0.005), 1);
    assert_eq!(circle(11_000.0, 0.005, 0.005), 0);
    assert!(circle(50.0, 0.1, 4.5e-6) > 0);
    assert_eq!(circle(50.0, 0.1, 3.5e-6), 0);
}

/// A straight line of two families, with the point at a value of t.
struct Straight {
    alpha: &'static str,
    beta: &'static str,
    start: [f64; 2],
    t: [f64; 2],
    at: fn(f64) -> [f64; 2],
}

const STRAIGHT: [Straight; 4] = [
    Straight {
        alpha: "x - 3*t",
        beta: "x + y - 40",
        start: [0.0, 40.0],
        t: [0.0, 20.0],
        at: |t| [3.0 * t, 40.0 - 3.0 * t],
    },
    // Circles and a line through their center.
    Straight {
        alpha: "x^2 + y^2 - t^2",
        beta: "y - 0.75*x",
        start: [8.0, 6.0],
        t: [10.0, 60.0],
        at: |t| [0.8 * t, 0.6 * t],
    },
    // A pencil, along which t is no linear function of the length.
    Straight {
        alpha: "y - t*x",
        beta: "x + y - 40",
        start: [40.0, 0.0],
        t: [0.0, 3.0],
        at: |t| [40.0 / (1.0 + t), 40.0 * t / (1.0 + t)],
    },
    // Two hyperbolas: enclosures of products are far wider than the line bends.
    Straight {
        alpha: "x*y - t^2",
        beta: "x^3*y - x*y^3",
        start: [10.0, 10.0],
        t: [10.0, 60.0],
        at: |t| [t, t],
    },
];

#[test]
fn a_straight_line_of_two_families_is_a_few_moves_within_the_tolerance() {
    let config = config("pyramid");
    for Straight { alpha, beta, start, t, at } in &STRAIGHT {
        let text = format!(
            "[curve]\nalpha = '{alpha}'\nbeta = '{beta}'\nstart_mm = {start:?}\nt = {t:?}\n"
        );
        let (found, ends) = read_back(&config, &asked(&text, 0.002, "lines"));
        // Three: LinuxCNC reads the start as well. Without joining, the steps of the continuation alone make 18.
        assert!(ends.len() <= 3, "{alpha}: {} moves", ends.len() - 1);
        let is_on_a_move = |point: &[f64; 6]| {
            ends.windows(2)
                .map(|pair| to_move(point, &pair[0], &pair[1]))
                .fold(f64::INFINITY, f64::min)
        };
        for n in 0..=1000 {
            let [x, y] = at(t[0] + (t[1] - t[0]) * f64::from(n) / 1000.0);
            assert!(is_on_a_move(&flat(x, y, 0.0)) <= 0.002, "{alpha}: {x} {y}");
        }
        // Joints and speeds are still checked as often as the proofs require.
        assert!(found.rows.len() > 10, "{alpha}: {}", found.rows.len());
    }
}

#[test]
fn a_curve_that_is_straight_and_then_bends_leaves_no_move_by_more_than_the_tolerance() {
    let config = config("pyramid");
    // y = 30 (x/60)^12: flat up to x = 25, steep at its end.
    let text =
        "[curve]\nalpha = 'y - 30*(x/60)^12'\nbeta = 'x - t'\nstart_mm = [0, 0]\nt = [0, 60]\n";
    for chord in [0.001, 0.02] {
        let (found, ends) = read_back(&config, &asked(text, chord, "lines"));
        let mut most = 0.0_f64;
        for n in 0..=6000 {
            let x = f64::from(n) / 100.0;
            let point = flat(x, 30.0 * (x / 60.0).powi(12), 0.0);
            let distance = ends.windows(2).map(|pair| to_move(&point, &pair[0], &pair[1]));
            most = most.max(distance.fold(f64::INFINITY, f64::min));
        }
        let proved = found.pieces.iter().map(|piece| piece.deviation).fold(0.0, f64::max);
        assert!(most <= proved && proved <= chord, "{most} {proved} {chord}");
        assert!(found.pieces[0].from.is_some(), "the flat stretch is not joined");
        let [part, at] =
            found.pieces.last().map(|piece| [piece.part as f64, piece.range[1]]).unwrap();
        let end = found.curve.at(part as usize, at).unwrap().pose;
        assert!((end[0].value.middle() - 60.0).abs() < 1e-9);
    }
}

#[test]
fn joined_lines_do_not_hide_a_law_of_tilt_or_speed() {
    let config = config("pyramid");
    let straight =
        "[curve]\nalpha = 'x - 3*t'\nbeta = 'x + y - 40'\nstart_mm = [0, 40]\nt = [0, 20]\n";
    let plain = read_back(&config, &asked(straight, 0.002, "lines")).1.len();
    let tilted = format!("{straight}[laws]\na_deg = '5*sin(t/20)'\n");
    assert!(read_back(&config, &asked(&tilted, 0.002, "lines")).1.len() > 5 * plain);
}

#[test]
fn a_curve_given_by_f_is_followed_with_smaller_values_on_its_left() {
    let ellipse = |f: &str| format!("[curve]\nf = '{f}'\nstart_mm = [58, 3]\n");
    for (f, side) in [("x^2/60^2 + y^2/35^2 - 1", 1.0), ("1 - x^2/60^2 - y^2/35^2", -1.0)] {
        let found = curve(&ellipse(f)).unwrap();
        assert!(found.is_closed);
        // 4 a E(1 - b²/a²).
        close(found.length, 303.641157809);
        let place = |s: f64| {
            let (part, at) = found.at_length(s).unwrap();
            found.at(part, at).unwrap().pose.map(|x| x.value.middle())
        };
        let (from, to) = (place(0.0), place(1.0));
        assert!(side * (from[0] * to[1] - from[1] * to[0]) > 0.0, "{f}");
        // The start is near the given point, and on the curve.
        assert!(distance(&from, &flat(58.0, 3.0, 0.0)) < 3.0, "{from:?}");
        let moved = found.moved_start.unwrap();
        close(moved.distance, (from[0] - 58.0).hypot(from[1] - 3.0));
        assert!(moved.distance > 0.1 && (moved.at[0] - from[0]).abs() < 1e-12);
        for k in 0..100 {
            let [x, y, ..] = place(f64::from(k) * 3.0);
            assert!(((x / 60.0).powi(2) + (y / 35.0).powi(2) - 1.0).abs() < 1e-12);
        }
    }
}

#[test]
fn a_start_on_the_curve_is_kept() {
    let found = curve("[curve]\nf = 'x^2/60^2 + y^2/35^2 - 1'\nstart_mm = [0, 35]\n").unwrap();
    assert_eq!(found.moved_start, None);
}

#[test]
fn an_open_curve_given_by_f_ends_at_its_bound_or_length() {
    // The branch x > 0 of a hyperbola, upwards: F grows to the right.
    let hyperbola = "[parameters]\nc = 400\n[curve]\nf = 'x^2 - y^2 - c'\nstart_mm = [21, 5]\n";
    let end = |found: &Curve| {
        let part = found.parts.len() - 1;
        found.at(part, found.parts[part].range[1]).unwrap().pose.map(|x| x.value.middle())
    };
    let found = curve(&format!("{hyperbola}t_bounds = [0, 40]\n")).unwrap();
    close(end(&found)[0], 40.0);
    close(end(&found)[1].abs(), 1200_f64.sqrt());
    let found = curve(&format!("{hyperbola}length_mm = 30\n")).unwrap();
    close(found.length, 30.0);
    let refused = refusal(hyperbola);
    assert!(refused.contains("does not end") && refused.contains("length_mm"), "{refused}");
}

#[test]
fn a_circle_needs_as_many_chords_as_its_closed_form_says() {
    let text = asked(KNOWN[0].text, 0.002, "lines");
    let found = route(&config("pyramid"), &PathFile::parse(&text).unwrap()).unwrap();
    assert_eq!(found.pieces.len(), GOLDEN.chords_of_a_turn);
    // One whole turn consists of few arcs.
    let text = asked(KNOWN[0].text, 0.002, "arcs");
    let found = route(&config("pyramid"), &PathFile::parse(&text).unwrap()).unwrap();
    assert!(found.pieces.len() <= 3, "{:?}", found.pieces);
    assert!(found.program.contains("G3 X"), "{}", found.program);
}

#[test]
fn feeds_follow_the_law_of_the_speed_and_the_time_is_its_integral() {
    let config = config("pyramid");
    // dt/ds = 1/(10 + 10 u): 314.159 mm take ln 2 / 10 s per mm.
    let text = |moves| asked(KNOWN[0].text, 0.01, moves).replace("= 20", "= '10 + 10*u'");
    for (moves, mode) in ["lines", "arcs"]
        .into_iter()
        .flat_map(|moves| ["per-minute", "inverse-time"].map(|mode| (moves, mode)))
    {
        let text = format!("{}feed = '{mode}'\n", text(moves));
        let found = route(&config, &PathFile::parse(&text).unwrap()).unwrap();
        let expected = 100.0 * PI * 2_f64.ln() / 10.0;
        assert!((found.seconds / expected - 1.0).abs() < 1e-4, "{} {expected}", found.seconds);
        let feeds: Vec<f64> = found
            .program
            .lines()
            .filter_map(|line| line.split(" F").nth(1))
            .map(|word| word.parse().unwrap())
            .collect();
        assert!(feeds.len() > 30);
        if mode == "inverse-time" {
            let minutes: f64 = feeds.iter().map(|feed| 1.0 / feed).sum();
            // Feeds have four decimals.
            assert!((minutes * 60.0 / expected - 1.0).abs() < 1e-4, "{minutes}");
            assert!(found.program.contains("G93") && found.program.contains("G94\n"));
        } else {
            assert!((600.0..615.0).contains(&feeds[0]), "{}", feeds[0]);
            let last = feeds[feeds.len() - 1];
            assert!((1185.0..1200.0).contains(&last), "{last}");
        }
    }
}

#[test]
fn what_the_machine_cannot_is_refused_with_t_and_limit() {
    let refused = |machine: &str, text: &str| {
        let file = PathFile::parse(text).unwrap();
        route(&config(machine), &file).unwrap_err().to_string()
    };
    let line = |laws: &str, program: &str| {
        format!(
            "[curve]\nx_mm = '100*t'\ny_mm = 0\nt = [0, 1]\n[laws]\n{laws}\n\
             [tolerance]\nchord_mm = 0.01\n[program]\nzero_mm = [0, 0, 200]\n{program}\n"
        )
    };
    let speed = "speed_mm_per_s = 20\n";
    for (laws, program, expected) in [
        ("z_mm = '400*t'\nspeed_mm_per_s = 20", "", "axis Z violates its limit of 150 to 390 mm"),
        ("z_mm = '400*t'\nspeed_mm_per_s = 20", "", "at t = "),
        ("b_deg = '40*t'\nspeed_mm_per_s = 20", "", "axis B violates its limit"),
        ("c_deg = '40*t'\nspeed_mm_per_s = 20", "", "no joint moves C, which stays at 0"),
        ("", "", "[laws] speed_mm_per_s: missing, needed at t = 0"),
        ("speed_mm_per_s = '1 - t'", "", "speed_mm_per_s: 0 at t = 1: expected more than 0"),
        ("speed_mm_per_s = 1000", "", "needs 1000.000/s, but MAX_VELOCITY allows 200/s"),
        ("z_mm = '1/(t - 0.3)'\nspeed_mm_per_s = 20", "", "at t = 0.29"),
        (
            "z_mm = 'sqrt(t)'\nspeed_mm_per_s = 20",
            "",
            "second derivative of the curve is unbounded",
        ),
        (speed, "tool = 77", "[program] tool: 77 is not in the machine's tool table"),
        (speed, "clear_z_mm = 3\nclear_x_mm = 3", "exclude each other"),
    ] {
        let message = refused("pyramid", &line(laws, program));
        assert!(message.contains(expected), "{laws}: {message}");
    }
    let fine = line(speed, "").replace("chord_mm = 0.01", "chord_mm = 1e-6");
    assert!(refused("pyramid", &fine).contains("[tolerance] chord_mm: 0.000001 is finer"));
    let none = line(speed, "").replace("[tolerance]\nchord_mm = 0.01\n", "");
    assert!(refused("pyramid", &none).contains("[tolerance] chord_mm: missing"));
}

#[test]
fn a_spline_of_control_points_is_written_within_the_tolerance() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(
        folder.path().join("points.csv"),
        "x,y,z\n0,0,0\n10,30,5\n40,-20,8\n60,10,0\n70,0,3\n",
    )
    .unwrap();
    let text = "[curve]\npoints = 'points.csv'\n[laws]\nspeed_mm_per_s = 20\n[tolerance]\nchord_mm = 0.01\n\
                [program]\nzero_mm = [0, 0, 200]\n";
    let file = PathFile { folder: folder.path().into(), ..PathFile::parse(text).unwrap() };
    let found = route(&config("pyramid"), &file).unwrap();
    // The closed form: a clamped cubic with one knot at 1/2, from its basis functions.
    let points = [[0., 0., 0.], [10., 30., 5.], [40., -20., 8.], [60., 10., 0.], [70., 0., 3.]];
    let place = |t: f64| -> [f64; 6] {
        let f = |x: f64| x.max(0.0).powi(3);
        let (a, b) = (1.0 - t, 2.0 * t);
        let basis = [
            f(1.0 - b),
            if t < 0.5 { 2.0 * t * (7.0 * t * t - 9.0 * t + 3.0) } else { 2.0 * f(a) },
            if t < 0.5 { 2.0 * t * t * (3.0 - 4.0 * t) } else { 2.0 * a * a * (3.0 - 4.0 * a) },
            if t < 0.5 { 2.0 * f(t) } else { 2.0 * a * (7.0 * a * a - 9.0 * a + 3.0) },
            f(1.0 - 2.0 * a),
        ];
        std::array::from_fn(|k| {
            (0..5).map(|n| if k < 3 { basis[n] * points[n][k] } else { 0.0 }).sum()
        })
    };
    for nodes in found.rows.windows(2) {
        for n in 0..=8 {
            let share = f64::from(n) / 8.0;
            let [a, b] = [&nodes[0].node, &nodes[1].node];
            let line = std::array::from_fn(|k| a.pose[k] + share * (b.pose[k] - a.pose[k]));
            let far = distance(&place(a.t + share * (b.t - a.t)), &line);
            assert!(far <= 0.01, "{far} at {}", a.t);
        }
    }
    assert!(found.rows.len() > 20);
}

#[test]
fn paths_of_a_drawing_are_cut_one_after_the_other_and_lifted_between() {
    let folder = tempfile::tempdir().unwrap();
    let drawing = "<svg xmlns='http://www.w3.org/2000/svg'><path d='M 0 0 L 30 0 Q 40 0 40 10 M 0 20 h 20'/></svg>";
    fs::write(folder.path().join("drawing.svg"), drawing).unwrap();
    let text = "[curve]\nsvg = 'drawing.svg'\nsvg_unit_mm = 1\n[laws]\nz_mm = -1\nspeed_mm_per_s = 20\n\
                [tolerance]\nchord_mm = 0.01\n[program]\nzero_mm = [0, 0, 200]\nclear_z_mm = 5\n";
    let read =
        |text: &str| PathFile { folder: folder.path().into(), ..PathFile::parse(text).unwrap() };
    let found = route(&config("pyramid"), &read(text)).unwrap();
    assert_eq!(found.program.matches("G0 Z5").count(), 3, "{}", found.program);
    assert!(found.program.contains("G0 X0 Y-20\nG1 Z-1\nG1 X20\n"), "{}", found.program);
    let refused = |text: &str| route(&config("pyramid"), &read(text)).unwrap_err().to_string();
    assert!(refused(&text.replace("clear_z_mm = 5", "")).contains("t = 2: the curve has a gap"));
    assert!(refused(&text.replace("svg_unit_mm = 1", "")).contains("svg_unit_mm is missing"));
}

#[test]
fn laws_of_the_carriages_give_back_the_path_that_they_were_made_from() {
    let config = config("pyramid");
    // Carriages that rise together move the platform along Z, by the height of equation 7.
    let law = "810.8126291149142 + 10*sin(t)";
    let text = format!(
        "[carriages]\nt_s = [0, 1]\nlaws_mm_or_deg = ['{law}', '{law}', '{law}', '{law}', '20*t', 0]\n"
    );
    let places = taken(&config, &PathFile::parse(&text).unwrap()).unwrap();
    assert_eq!(places.len(), 1001);
    for place in &places {
        let pose = kinematics::Pose::from_degrees(place.pose);
        let joints = config.machine.inverse(&pose, &config.spindle).unwrap();
        for i in 0..6 {
            assert!((joints[i] - place.joints[i]).abs() < 1e-6, "{place:?}");
        }
        assert!((place.pose[0] - 20.0 * place.t).abs() < 1e-6 && place.pose[3].abs() < 1e-6);
        let expected =
            carriage([700.0, 200.0], [200.0, 1200.0], [120.0, place.pose[2] + 150.0], 550.0);
        assert!((place.joints[0] - expected).abs() < 1e-6);
    }
    let refused = |from: &str, to: &str| {
        let file = PathFile::parse(&text.replacen(from, to, 1)).unwrap();
        taken(&config, &file).unwrap_err().to_string()
    };
    for (from, to, expected) in [
        ("20*t", "200*t", "axis X is at 150"),
        ("10*sin(t)", "300*t", "at t = "),
        ("20*t", "t/t", "laws_mm_or_deg 4: at t = 0: \"t/t\" divides by 0"),
        ("20*t", "20*x", "unknown name x"),
        (", 0]", "]", "expected 6, one per joint; found 5"),
        ("[0, 1]", "[1, 0]", "expected the smaller number first"),
    ] {
        let message = refused(from, to);
        assert!(message.contains(expected), "{to}: {message}");
    }
}

#[test]
fn a_title_with_any_characters_stays_one_comment() {
    let config = config("pyramid");
    let plain = PathFile::parse(CYCLOID).unwrap();
    let lines = route(&config, &plain).unwrap().program.lines().count();
    for title in ["x)\\nM68 E0 Q1 (", "a\\rM3 S1000", "py,import os", &"long ".repeat(200)] {
        let text = format!("{CYCLOID}title = \"{title}\"\n");
        let program = route(&config, &PathFile::parse(&text).unwrap()).unwrap().program;
        assert_eq!(program.lines().count(), lines, "{title}");
        let first = program.lines().next().unwrap();
        // LinuxCNC executes the text after ";py," without a blank, and reads 255 bytes of a line.
        assert!(first.starts_with("; ") && first.len() < 255, "{first}");
        assert!(!first.contains(['(', ')', '\r']), "{first}");
    }
}
