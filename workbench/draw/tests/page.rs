// SPDX-License-Identifier: GPL-2.0-or-later
//! The figures of a page about a program: limits, marks, and their size.

use draw::margins::{Figure, figures};
use draw::over::Mark;
use draw::page::{Report, of_program};
use kinematics::{MAX_JOINTS, Pose};
use linuxcnc::row::{Beside, Extra, Flags, Row};
use machine::read::mechanism::Mechanism;
use program::timeline::{Course, Sample, Thinned};
use test_support::shipped::config;

/// Attributes of a limit line: no other line is black and as wide.
const LIMIT: &str = "stroke=\"#000000\" stroke-width=\"3\"";

/// Largest page: it is opened in a browser on a machine's controller.
const MOST_BYTES: usize = 1_000_000;

/// Returns a run over a surface with these many lines of five cycles each, and a step in the middle that
/// no drive can follow.
fn surface(config: &Mechanism, lines: u32) -> Thinned {
    let mut course = Course::new(config);
    const CYCLES: u32 = 5;
    for cycle in 0..lines * CYCLES {
        let share = f64::from(cycle) / f64::from(lines * CYCLES);
        let angle = 400.0 * share;
        let offset = [
            20.0 * angle.sin(),
            40.0 * share - 20.0,
            5.0 * (7.0 * angle).sin(),
            3.0 * (3.0 * angle).sin(),
            3.0 * (2.0 * angle).cos() - 3.0,
            0.0,
        ];
        let pose: [f64; 6] = std::array::from_fn(|k| config.home[k] + offset[k]);
        let at = config.machine.at(&Pose::from_degrees(pose), &config.spindle).unwrap();
        let mut joints = *at.joints();
        if cycle == lines * CYCLES / 2 {
            joints[0] += 1.0;
        }
        let errors = std::array::from_fn(|i| 0.5 * (angle * i as f64).sin());
        course.see(&Row {
            cycle: u64::from(cycle),
            file: 0,
            number: 0,
            line: cycle / CYCLES + 1,
            flags: Flags { on: true, tool_busy: false, held: false },
            pose,
            joints,
            errors,
            allowed: [1.0; MAX_JOINTS],
            extra: Extra::default(),
            second: Beside::default(),
            tool: config.spindle.into(),
            feed: if share > 0.5 { 0.7 } else { 1.0 },
        });
    }
    course.finish()
}

fn whole(figures: &[Figure], marks: &[Mark]) -> String {
    of_program(&Report {
        program: "surface.ngc",
        machine: "hexapod.ini",
        fits: Some(false),
        why: "A drive cannot follow.".into(),
        notes: vec![],
        help: None,
        rows: vec![],
        marks,
        figures,
        text: "",
    })
}

#[test]
fn a_page_of_200_000_lines_is_below_a_megabyte_and_shows_limits_and_breaks() {
    let config = config("hexapod");
    let lines = 200_000;
    let course = surface(&config, lines);
    let fastest = |sample: &Sample| sample.speeds.iter().copied().fold(0.0, f64::max);
    let worst = course.samples.iter().max_by(|a, b| fastest(a).total_cmp(&fastest(b))).unwrap();
    let line = lines / 2 + 1;
    assert!(fastest(worst) > 1.0 && (worst.lines[0]..=worst.lines[1]).contains(&line), "{worst:?}");
    let mark = Mark {
        place: format!("line {line}"),
        block: "G1 X1".into(),
        text: "too fast".into(),
        at: Some(worst.at),
        pose: config.home,
    };
    let marks = [mark];
    let figures = figures(&config, &course, &marks).unwrap();
    // Path, two of distances to limits, feed, axes, and four of the struts.
    assert_eq!(figures.len(), 9);
    let label = format!("1: line {line}");
    for (k, Figure { title, about, svg }) in figures.iter().enumerate() {
        assert!(svg.contains(&label), "{title}");
        assert!(about.contains("Good: ") && about.contains("Bad: "), "{title}");
        // The limits in the path are those of the axes: an edge of their box.
        let limit = if k == 0 { "limits of the axes" } else { LIMIT };
        assert!(svg.contains(limit), "{title}");
    }
    let size = whole(&figures, &marks).len();
    assert!(size < MOST_BYTES, "{size}");
}

#[test]
fn all_figures_share_one_time_axis() {
    let config = config("hexapod");
    let figures = figures(&config, &surface(&config, 500), &[]).unwrap();
    // Ticks of the horizontal axis, with their positions.
    let ticks = |figure: &Figure| -> Vec<String> {
        let texts = figure.svg.split("<text ").skip(1);
        // Without their heights, which depend on the strips.
        let is_below =
            |text: &&str| text.contains("text-anchor=\"middle\"") && !text.contains("transform");
        let place = |text: &str| {
            let (x, rest) = text.split_once(" y=").unwrap();
            let words = rest.split_once('>').unwrap().1.split("</text>").next().unwrap();
            format!("{x}: {}", words.trim())
        };
        texts.filter(is_below).map(place).collect()
    };
    let first = ticks(&figures[1]);
    assert!(first.iter().any(|text| text.contains("time in s")) && first.len() > 4, "{first:?}");
    for figure in &figures[2..] {
        assert_eq!(ticks(figure), first, "{}", figure.title);
    }
}
