// SPDX-License-Identifier: GPL-2.0-or-later
//! Refusals by `pkm path`, through the command itself: exit 2, the key or the t in the message, and
//! no file remaining.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;
use test_support::shipped::folder;

/// A valid path file, of which each case changes something.
const FINE: &str = "
[parameters]
h = 10
[curve]
x_mm = 'h*t'
y_mm = 0
t = [0, 1]
[laws]
z_mm = 0
speed_mm_per_s = 20
[tolerance]
chord_mm = 0.01
[program]
zero_mm = [0, 0, 200]
";

const FAMILIES: &str = "
[curve]
alpha = 'x^2 + y^2 - 100*(1 - t)'
beta = 'y'
start_mm = [10, 0]
t = [0, 0.5]
[laws]
speed_mm_per_s = 20
[tolerance]
chord_mm = 0.01
[program]
zero_mm = [0, 0, 200]
";

const CARRIAGES: &str = "
[carriages]
t_s = [0, 1]
laws_mm_or_deg = ['800 + 10*t', '800 + 10*t', '800 + 10*t', '800 + 10*t', 0, 0]
";

fn drawing(keys: &str) -> String {
    FINE.replace("x_mm = 'h*t'\ny_mm = 0\nt = [0, 1]", keys)
}

fn dxf(unit: i32, entities: &str) -> String {
    let entities = entities.replace(' ', "\n");
    format!(
        "0\nSECTION\n2\nHEADER\n9\n$INSUNITS\n70\n{unit}\n0\nENDSEC\n0\nSECTION\n2\nENTITIES\n\
         {entities}\n0\nENDSEC\n0\nEOF\n"
    )
}

const LINE: &str = "0 LINE 8 CUT 10 0 20 0 11 10 21 0";

/// Changes of a file, with the other files, and the expected text.
struct Case {
    text: String,
    beside: Vec<(&'static str, String)>,
    expected: &'static [&'static str],
}

fn case(text: String, expected: &'static [&'static str]) -> Case {
    Case { text, beside: vec![], expected }
}

fn fine(from: &str, to: &str, expected: &'static [&'static str]) -> Case {
    assert!(FINE.contains(from), "{from}");
    case(FINE.replace(from, to), expected)
}

fn with(
    file: &'static str,
    content: String,
    keys: &str,
    expected: &'static [&'static str],
) -> Case {
    Case { text: drawing(keys), beside: vec![(file, content)], expected }
}

fn run(ini: &Path, case: &Case, ask: &[&str]) -> (Option<i32>, String, BTreeSet<String>) {
    let place = tempfile::tempdir().unwrap();
    fs::write(place.path().join("path.toml"), &case.text).unwrap();
    for (name, content) in &case.beside {
        fs::write(place.path().join(name), content).unwrap();
    }
    let out = Command::new(env!("CARGO_BIN_EXE_pkm"))
        .arg("path")
        .arg(ini)
        .arg("path.toml")
        .args(ask)
        .current_dir(place.path())
        .output()
        .unwrap();
    assert!(out.status.success() || out.stdout.is_empty(), "{}", case.text);
    let names = fs::read_dir(place.path()).unwrap();
    let names = names.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    (out.status.code(), String::from_utf8_lossy(&out.stderr).into_owned(), names)
}

fn expressions() -> Vec<Case> {
    let of_t = "'h*t'";
    vec![
        fine(of_t, "'h*q'", &["[curve] x_mm", "unknown name q"]),
        fine("z_mm = 0", "z_mm = 'w'", &["[laws] z_mm", "unknown name w"]),
        fine("= 20", "= 'v*u'", &["[laws] speed_mm_per_s", "unknown name v"]),
        fine(of_t, "'h*/t'", &["[curve] x_mm", "character 3"]),
        fine(of_t, "'h/(t - 0.25)'", &["at t = 0.25:", "divides by 0"]),
        fine(of_t, "'t/t'", &["at t = 0", "divides by 0"]),
        fine("z_mm = 0", "z_mm = '1/(2*t - 1)'", &["at t = 0.5:", "divides by 0"]),
        fine(of_t, "'h*sqrt(t - 0.5)'", &["at t = 0", "no real value: sqrt of -0.5"]),
        fine(of_t, "'h*ln(t - 1)'", &["at t = 0", "no real value"]),
        fine(of_t, "'h*asin(2 + t)'", &["at t = 0", "no real value"]),
        fine(of_t, "'h*(t - 2)^0.5'", &["at t = 0", "no real value"]),
        fine("z_mm = 0", "z_mm = 'sqrt(0.5 - t)'", &["at t = ", "no real value"]),
        case(
            CARRIAGES.replace("'800 + 10*t', 0", "'800/t', 0"),
            &["laws_mm_or_deg 3: at t = 0:", "divides by 0"],
        ),
        case(CARRIAGES.replacen("10*t", "10*x", 1), &["laws_mm_or_deg 0: ", "unknown name x"]),
    ]
}

fn families() -> Vec<Case> {
    let of = |from: &str, to: &str, expected| {
        assert!(FAMILIES.contains(from), "{from}");
        case(FAMILIES.replace(from, to), expected)
    };
    vec![
        of("x^2 + y^2 - 100", "x^2 + y^2 + 100", &["no real branch near start_mm", "at t = 0"]),
        // A lemniscate crosses itself there.
        case(
            FAMILIES
                .replace("x^2 + y^2 - 100*(1 - t)", "y - t*x")
                .replace("beta = 'y'", "beta = '(x^2 + y^2)^2 - 3600*(x^2 - y^2)'")
                .replace("[10, 0]", "[60, 0]")
                .replace("[0, 0.5]", "[0, 2]\nt_bounds = [-2, 2]"),
            &["singular point near x 0.000", "t 1.0"],
        ),
        of("'y'", "'y - q'", &["[curve] beta", "unknown name q"]),
        of("beta = 'y'\n", "", &["[curve] beta: missing"]),
        of("start_mm = [10, 0]\n", "", &["[curve] start_mm: missing"]),
        of("'y'", "'y/t'", &["t 0.000000: ", "divides by 0"]),
    ]
}

fn limits() -> Vec<Case> {
    vec![
        fine("h = 10", "h = 400", &["at t = ", "axis X violates its limit of -150 to 150 mm"]),
        fine("z_mm = 0", "z_mm = '-90*t'", &["at t = ", "axis Z violates its limit"]),
        fine("= 20", "= 2\nb_deg = '40*t'", &["at t = ", "axis B violates its limit"]),
        fine("z_mm = 0", "z_mm = 0\nc_deg = '9*t'", &["no joint moves C, which stays at 0"]),
        fine("= 20", "= 5000", &["at t = ", "MAX_VELOCITY allows"]),
        fine("= 20", "= '20 - 40*t'", &["speed_mm_per_s", "at t = 0.5", "expected more than 0"]),
        case(CARRIAGES.replace("'800 + 10*t', 0", "'800 + 300*t', 0"), &["at t = "]),
        case(CARRIAGES.replace(", 0, 0]", ", '400*t', 0]"), &["at t = ", "axis X"]),
    ]
}

fn units_and_tolerances() -> Vec<Case> {
    vec![
        fine("chord_mm = 0.01", "chord_mm = 0", &["chord_mm = 0", "expected more than 0"]),
        fine("chord_mm = 0.01", "chord_mm = -1", &["chord_mm = -1", "expected more than 0"]),
        fine("chord_mm = 0.01", "chord_mm = nan", &["chord_mm = nan", "expected more than 0"]),
        fine("chord_mm = 0.01", "chord_mm = 1e-7", &["[tolerance] chord_mm", "is finer than"]),
        fine("= 0.01", "= 0.01\nangle_deg = 0", &["angle_deg = 0", "expected more than 0"]),
        fine("[tolerance]\nchord_mm = 0.01\n", "", &["[tolerance] chord_mm: missing"]),
        fine("chord_mm", "chord", &["unknown field `chord`", "chord_mm"]),
        fine("x_mm", "x", &["unknown field `x`", "x_mm"]),
        fine("speed_mm_per_s", "speed", &["unknown field `speed`", "speed_mm_per_s"]),
        fine("zero_mm", "zero", &["unknown field `zero`", "zero_mm"]),
        fine("speed_mm_per_s = 20\n", "", &["[laws] speed_mm_per_s: missing"]),
        fine("t = [0, 1]\n", "", &["[curve] t: missing"]),
        case(String::new(), &["expected exactly one of [curve], [[operation]] and [carriages]"]),
        case("[curve".into(), &["path.toml", "line 1"]),
    ]
}

fn drawings() -> Vec<Case> {
    let by_dxf = "dxf = 'a.dxf'";
    let of_dxf = |content: String, expected| with("a.dxf", content, by_dxf, expected);
    let entity = |text: &str, expected| of_dxf(dxf(4, text), expected);
    let by_svg = "svg = 'a.svg'\nsvg_unit_mm = 1";
    let of_svg = |content: &str, expected| with("a.svg", content.into(), by_svg, expected);
    let path = |data: &str| format!("<svg><path d='{data}'/></svg>");
    vec![
        case(drawing(by_dxf), &["a.dxf", "No such file"]),
        case(
            drawing("dxf = 'a.dxf'\nsvg = 'a.svg'"),
            &["[curve]: expected exactly one of points, svg and dxf"],
        ),
        case(
            drawing("svg = 'a.svg'\ndxf_unit_mm = 1"),
            &["[curve] dxf_unit_mm is only valid with dxf"],
        ),
        fine("t = [0, 1]", "t = [0, 1]\ndegree = 2", &["[curve] degree is only valid with points"]),
        of_dxf(dxf(0, LINE), &["[curve] dxf_unit_mm is missing", "$INSUNITS", "Unitless"]),
        of_dxf("hello\n".into(), &["a.dxf", "the line EOF at its end is missing"]),
        of_dxf(dxf(4, LINE).replace("0\nEOF\n", ""), &["the line EOF at its end is missing"]),
        of_dxf("AutoCAD Binary DXF\r\n".into(), &["binary"]),
        of_dxf(format!("x\ny\n{}", dxf(4, LINE)), &["line 1: expected a group code"]),
        of_dxf(dxf(4, LINE).replace("ENDSEC", "ENDS"), &["not a DXF drawing"]),
        entity("0 LINE 8 CUT 10 0 20 zero 11 1 21 1", &["line 22: zero: expected a finite number"]),
        entity("0 LINE 8 CUT 10 0 20 inf 11 1 21 1", &["line 22: inf: expected a finite number"]),
        entity("0 LINE 8 CUT 10 0 20 0 11 0 21 0", &["entity 1 (LINE", "its length is 0"]),
        entity("0 ARC 8 CUT 10 0 20 0 40 0 50 0 51 9", &["entity 1 (ARC", "radius 0"]),
        entity("0 ELLIPSE 8 CUT 10 0 20 0 11 0 21 0 40 1", &["entity 1 (ELLIPSE", "more than 0"]),
        entity("0 SPLINE 8 CUT 71 3 11 0 21 0 31 0", &["entity 1 (SPLINE", "only fit points"]),
        entity(
            "0 SPLINE 8 CUT 71 1 40 0 40 0 10 0 20 0 30 0 10 9 20 0 30 0",
            &["entity 1 (SPLINE", "expected 4 knots", "found 2"],
        ),
        entity("0 INSERT 8 CUT 2 B 10 0 20 0", &["entity 1 (INSERT", "explode it"]),
        entity("0 TEXT 8 CUT 10 0 20 0 40 5 1 hello", &["entity 1 (", "not a curve"]),
        entity("999 none", &["the drawing has no entities"]),
        entity(
            &format!(
                "{LINE} 0 LINE 8 CUT 10 10 20 0 11 20 21 9 0 LINE 8 CUT 10 10 20 0 11 20 21 -9"
            ),
            &["X 10.000000 Y 0.000000", "entity 1 (LINE", "entity 3 (LINE", "dxf_handles"],
        ),
        entity(
            &format!("{LINE} 0 LINE 8 CUT 10 11 20 0 11 20 21 0"),
            &["at t = 1", "a gap from [10.0, 0.0, 0.0] to [11.0, 0.0, 0.0]", "clear_z_mm"],
        ),
        with(
            "a.dxf",
            dxf(4, LINE),
            "dxf = 'a.dxf'\ndxf_layer = 'X'",
            &["dxf_layer", "\"X\"", "CUT"],
        ),
        with(
            "a.dxf",
            dxf(4, LINE),
            "dxf = 'a.dxf'\ndxf_handles = ['FFF']",
            &["dxf_handles", "\"FFF\""],
        ),
        with("a.dxf", dxf(4, LINE), "dxf = 'a.dxf'\ndxf_handles = []", &["dxf_handles"]),
        with(
            "a.dxf",
            dxf(4, LINE),
            "dxf = 'a.dxf'\ndxf_unit_mm = 0",
            &["dxf_unit_mm = 0", "more than 0"],
        ),
        with("a.svg", path("M 0 0 h 9"), "svg = 'a.svg'", &["[curve] svg_unit_mm is missing"]),
        of_svg("<svg", &["a.svg"]),
        of_svg("<svg/>", &["a.svg: no path"]),
        of_svg(&path("M 0 0 q"), &["line 1: d: "]),
        of_svg(&path("M 0 0 h 9 m 9 0 h 9"), &["at t = 1", "a gap from [9.0,", "clear_z_mm"]),
        with("p.csv", "x,y\n0,0\n".into(), "points = 'p.csv'", &["p.csv", "missing field `z`"]),
        with("p.csv", "x,y,z\n0,0,a\n".into(), "points = 'p.csv'", &["p.csv", "line: 2"]),
        with("p.csv", "x,y,z\n0,0,inf\n".into(), "points = 'p.csv'", &["row 2: expected finite"]),
        with(
            "p.csv",
            "x,y,z\n0,0,0\n".into(),
            "points = 'p.csv'",
            &["degree 3 needs at least 4 points"],
        ),
        with(
            "p.csv",
            "x,y,z,weight\n0,0,0,1\n5,5,0,-1\n9,0,0,1\n".into(),
            "points = 'p.csv'\ndegree = 2",
            &["weight -1 of point 2"],
        ),
    ]
}

#[test]
fn what_is_refused_names_the_key_or_t_ends_with_2_and_leaves_no_file() {
    let ini = folder("pyramid").join("pyramid.ini");
    let all = ["-o", "path.ngc", "--csv", "path.csv", "--plots", "plots"];
    let good = case(FINE.into(), &[]);
    let (code, reported, names) = run(&ini, &good, &all);
    assert_eq!(code, Some(0), "{reported}");
    assert_eq!(
        names.into_iter().collect::<Vec<_>>(),
        ["path.csv", "path.ngc", "path.toml", "plots"]
    );
    let cases = [expressions(), families(), limits(), units_and_tolerances(), drawings()]
        .into_iter()
        .flatten();
    let mut wrong = vec![];
    for case in cases {
        let is_law = case.text.contains("[carriages]");
        let ask = if is_law { &all[2..] } else { &all[..] };
        let (code, reported, names) = run(&ini, &case, ask);
        let before: BTreeSet<String> = case
            .beside
            .iter()
            .map(|(name, _)| *name)
            .chain(["path.toml"])
            .map(String::from)
            .collect();
        let is_told = case.expected.iter().all(|expected| reported.contains(expected));
        if code != Some(2) || !is_told || names != before || !reported.contains("path.toml") {
            wrong.push(format!(
                "{:?} of\n{}\n{code:?} {names:?} {reported}",
                case.expected, case.text
            ));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n----\n"));
}
