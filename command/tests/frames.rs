// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm frames`: the drawing agrees with the kinematics, by the scale at its sides. Its
//! legibility is tested with the other pictures.

use crate::commands::Bench;
use crate::scene::{lower, scene};
use kinematics::{LegKind, Vector3};
use std::path::Path;
use test_support::shipped::{MACHINES, config, ini};

const BASE: &str = "#0072B2";
const PLATFORM: &str = "#D55E00";
const GROWS: &str = "#009E73";
const TOOL: &str = "#CC79A7";

/// Rounding of positions of pixels and of ticks, at both ends of the scale.
const PIXELS: f64 = 2.0;

/// An arrow within 15 degrees of the line of sight is drawn as a sign.
const SIGHT: f64 = 0.966;

/// One of the two views: the axes across and up, and pixels of a position.
struct View {
    axes: [usize; 2],
    scale: [[f64; 2]; 2],
}

impl View {
    fn pixel(&self, place: &Vector3<f64>) -> [f64; 2] {
        [0, 1].map(|k| self.scale[k][0] + self.scale[k][1] * place[self.axes[k]])
    }
}

fn number(node: roxmltree::Node, name: &str) -> f64 {
    node.attribute(name).unwrap().parse().unwrap()
}

/// Returns the pixel at 0, and pixels per unit, from ticks as (value, pixel).
fn line(mut ticks: Vec<(f64, f64)>) -> [f64; 2] {
    ticks.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (first, last) = (ticks[0], ticks[ticks.len() - 1]);
    let unit = (last.1 - first.1) / (last.0 - first.0);
    [first.1 - unit * first.0, unit]
}

fn views(sheet: &roxmltree::Document) -> [View; 2] {
    let texts: Vec<_> = sheet.descendants().filter(|node| node.has_tag_name("text")).collect();
    let is_lying = texts.iter().any(|text| text.text().unwrap().contains("End view"));
    let tick = |anchor: &str| -> Vec<(f64, f64, f64)> {
        let ticks = texts.iter().filter(|text| {
            text.attribute("text-anchor") == Some(anchor)
                && text.attribute("fill") == Some("#000000")
        });
        let value = |text: &roxmltree::Node| text.text().unwrap().trim().parse::<f64>().ok();
        ticks
            .filter_map(|text| Some((value(text)?, number(*text, "x"), number(*text, "y"))))
            .collect()
    };
    let (up, mut across) = (tick("end"), tick("middle"));
    // Numbers of joints are in the key, below all ticks.
    let lowest = across.iter().map(|tick| tick.2).fold(f64::INFINITY, f64::min);
    across.retain(|tick| tick.2 == lowest);
    let right = up.iter().map(|tick| tick.1).fold(0.0, f64::max);
    [false, true].map(|is_right| {
        let of_x = across.iter().filter(|tick| (tick.1 > right) == is_right);
        let of_y = up.iter().filter(|tick| (tick.1 == right) == is_right);
        let axes = match (is_right, is_lying) {
            (false, _) => [0, 1],
            (true, false) => [0, 2],
            (true, true) => [2, 0],
        };
        let scale = [of_x.map(|t| (t.0, t.1)).collect(), of_y.map(|t| (t.0, t.2)).collect()];
        View { axes, scale: scale.map(line) }
    })
}

fn is_at(found: &[f64; 2], wanted: &[f64; 2]) -> bool {
    (found[0] - wanted[0]).abs() < PIXELS && (found[1] - wanted[1]).abs() < PIXELS
}

/// Returns the centers of the joints of a color.
fn balls(sheet: &roxmltree::Document, color: &str) -> Vec<[f64; 2]> {
    let balls = sheet.descendants().filter(|node| {
        node.has_tag_name("circle")
            && node.attribute("fill") == Some(color)
            && number(*node, "r") == 5.0
    });
    balls.map(|node| [number(node, "cx"), number(node, "cy")]).collect()
}

/// Returns the lines of a color and a width from their first to their last point.
fn lines(sheet: &roxmltree::Document, color: &str, width: &str) -> Vec<[[f64; 2]; 2]> {
    let lines = sheet.descendants().filter(|node| {
        node.has_tag_name("polyline")
            && node.attribute("stroke") == Some(color)
            && node.attribute("stroke-width") == Some(width)
    });
    let ends = |node: roxmltree::Node| {
        let pair = |pair: &str| {
            let (x, y) = pair.split_once(',').unwrap();
            [x.parse().unwrap(), y.parse().unwrap()]
        };
        let points: Vec<[f64; 2]> =
            node.attribute("points").unwrap().split_whitespace().map(pair).collect();
        [points[0], points[points.len() - 1]]
    };
    lines.map(ends).collect()
}

fn drawn(bench: &Bench, file: &Path) -> String {
    let answer = bench.answer(&format!("frames {}", file.display()), "");
    let svg = answer.strip_suffix("exit 0\n").unwrap_or_else(|| panic!("{answer}"));
    svg[svg.find("<svg").unwrap()..svg.rfind("</svg>").unwrap() + 6].to_string()
}

#[test]
fn joints_and_the_ways_in_which_they_grow_are_where_the_kinematics_have_them() {
    let bench = Bench::new();
    for machine in MACHINES {
        let svg = drawn(&bench, &ini(machine));
        let sheet = roxmltree::Document::parse(&svg).unwrap();
        let (config, scene) = (config(machine), scene(&ini(machine), &[]));
        let at = config.machine.at(&config.home_pose(), &config.spindle).unwrap();
        let (base, platform, grows) =
            (balls(&sheet, BASE), balls(&sheet, PLATFORM), lines(&sheet, GROWS, "3"));
        for view in views(&sheet) {
            for (n, leg) in at.segments()[..config.legs()].iter().enumerate() {
                for (ends, place) in [(&base, leg.base), (&platform, leg.platform)] {
                    let wanted = view.pixel(&place);
                    assert!(
                        ends.iter().any(|end| is_at(end, &wanted)),
                        "{machine} {n}: {wanted:?} in {ends:?}"
                    );
                }
                let (from, way) = match config.geometry.legs()[n].kind {
                    LegKind::Strut(_) | LegKind::Ring(_) => {
                        (leg.base + 0.4 * (leg.platform - leg.base), leg.platform - leg.base)
                    }
                    _ => {
                        let joint = config.joints[n].home;
                        let [here, there] =
                            [joint, joint + 1e-3].map(|q| lower(&scene["legs"][n], q));
                        (leg.base, there - here)
                    }
                };
                let across = 3 - view.axes[0] - view.axes[1];
                if way[across].abs() > SIGHT * way.norm() {
                    continue;
                }
                let [start, end] = [from, from + way].map(|place| view.pixel(&place));
                let is_along = |arrow: &&[[f64; 2]; 2]| {
                    let [a, b] = [[arrow[0], arrow[1]], [start, end]].map(|[from, to]| {
                        let way = [to[0] - from[0], to[1] - from[1]];
                        let length = way[0].hypot(way[1]);
                        way.map(|part| part / length)
                    });
                    // A pixel at each end of an arrow of a dozen.
                    a[0] * b[0] + a[1] * b[1] > 0.97
                };
                let own = grows.iter().filter(|arrow| is_at(&arrow[0], &start)).find(is_along);
                assert!(own.is_some(), "{machine} {n}: from {start:?} to {end:?} in {grows:?}");
            }
        }
    }
}

#[test]
fn tables_and_axes_that_carry_something_have_an_arrow_with_the_number_of_their_joint() {
    let bench = Bench::new();
    for (machine, joint, from, way) in [
        ("pyramid", "4", Vector3::zeros(), -Vector3::x()),
        ("pyramid", "5", Vector3::zeros(), -Vector3::y()),
        ("pyramid-cross", "4", Vector3::zeros(), -Vector3::y()),
        ("hexapod-rotary-table", "6", Vector3::zeros(), Vector3::z()),
    ] {
        let svg = drawn(&bench, &ini(machine));
        let sheet = roxmltree::Document::parse(&svg).unwrap();
        let is_name = |node: &roxmltree::Node| {
            node.text().is_some_and(|text| text.trim() == joint)
                && node.attribute("fill") == Some(GROWS)
        };
        assert!(sheet.descendants().any(|node| is_name(&node)), "{machine} {joint}");
        let views = views(&sheet);
        let view = views.iter().find(|view| view.axes.iter().any(|k| way[*k] != 0.0)).unwrap();
        let [start, ahead] = [from, from + way].map(|place| view.pixel(&place));
        let is_own = |arrow: &[[f64; 2]; 2]| {
            let along: f64 =
                (0..2).map(|k| (arrow[1][k] - arrow[0][k]) * (ahead[k] - start[k])).sum();
            is_at(&arrow[0], &start) && along > 0.0
        };
        assert!(lines(&sheet, GROWS, "3").iter().any(is_own), "{machine} {joint}: {svg}");
    }
}

#[test]
fn tools_point_as_the_file_says_and_screws_have_the_hand_of_the_file() {
    for (to, is_up) in [("down", false), ("up", true)] {
        let bench = Bench::new().spoilt("TOOL_DIRECTION = down", &format!("TOOL_DIRECTION = {to}"));
        let svg = drawn(&bench, Path::new("linear-delta.ini"));
        let sheet = roxmltree::Document::parse(&svg).unwrap();
        let tools = lines(&sheet, TOOL, "9");
        assert_eq!(tools.len(), 1, "{tools:?}");
        assert_eq!(tools[0][1][1] < tools[0][0][1], is_up, "{to}: {tools:?}");
    }
    let bench = Bench::new();
    let svg = drawn(&bench, &ini("hexapod"));
    assert!(svg.contains("\n3 R\n") && svg.contains("\nright-hand screw\n"), "{svg}");
    let text = std::fs::read_to_string(ini("hexapod")).unwrap();
    let from = text.find("[LEG_3]").unwrap();
    let turned = format!("{}[LEG_3]\nLEAD = -10{}", &text[..from], &text[from + 7..]);
    std::fs::write(bench.0.path().join("mixed.ini"), turned).unwrap();
    let svg = drawn(&bench, Path::new("mixed.ini"));
    assert!(svg.contains("\n3 L\n") && svg.contains("\nleft-hand screw\n"), "{svg}");
}

#[test]
fn what_describes_no_machine_is_refused_and_nothing_is_written() {
    let bench = Bench::new().spoilt("ROD = 269", "ROD = -269");
    let files = bench.files();
    for (words, reported) in [
        ("linear-delta.ini -o frames.svg", "ROD"),
        ("none.ini -o frames.svg", "cannot be read"),
        ("--mechanism 2 linear-delta.ini -o frames.svg", "ROD"),
        ("linear-delta.ini linear-delta.ini", "unexpected argument"),
    ] {
        let answer = bench.answer(&format!("frames {words}"), "");
        assert!(answer.ends_with("exit 2\n") && answer.contains(reported), "{words}: {answer}");
    }
    assert_eq!(bench.files(), files, "nothing is left behind");
    let answer = Bench::new().answer("frames linear-delta.ini -o none/frames.svg", "");
    assert!(answer.ends_with("exit 2\n") && answer.contains("none/frames.svg"), "{answer}");
}
