// SPDX-License-Identifier: GPL-2.0-or-later
//! Free-form curves: splines with weights and knots, and DXF and SVG drawings, read back by
//! LinuxCNC's interpreter.

use crate::curve::{INTERPRETER, ZERO, distance, read_back_file, to_move};
use paths::file::PathFile;
use paths::route::{Route, route};
use std::f64::consts::{FRAC_1_SQRT_2, PI, TAU};
use std::fs;
use tempfile::TempDir;
use test_support::shipped::config;

/// Words have six decimals: half a unit in each of three.
const WORDS: f64 = 1e-6;

const CHORD: f64 = 0.005;

/// Writes a path file about a drawing, next to it.
pub fn beside(name: &str, text: &str, keys: &str, program: &str) -> (TempDir, PathFile) {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join(name), text).unwrap();
    let text = format!(
        "[curve]\n{keys}\n[laws]\nspeed_mm_per_s = 20\n[tolerance]\nchord_mm = {CHORD:?}\n\
         [program]\nzero_mm = [0, 0, {ZERO:?}]\n{program}\n"
    );
    let file = PathFile { folder: folder.path().into(), ..PathFile::parse(&text).unwrap() };
    (folder, file)
}

/// Returns an ASCII DXF drawing of these entities, in a unit.
fn dxf_in(unit: i32, entities: &[String]) -> String {
    let entities = entities.concat();
    format!(
        "0\nSECTION\n2\nHEADER\n9\n$ACADVER\n1\nAC1015\n9\n$INSUNITS\n70\n{unit}\n0\nENDSEC\n\
         0\nSECTION\n2\nENTITIES\n{entities}0\nENDSEC\n0\nEOF\n"
    )
}

fn dxf(entities: &[String]) -> String {
    dxf_in(4, entities)
}

/// Returns an entity with its values, each after its group code.
fn entity(kind: &str, values: &[(i32, f64)]) -> String {
    let values: String = values
        .iter()
        .map(|(code, value)| match code {
            62..80 => format!("{code}\n{value:.0}\n"),
            _ => format!("{code}\n{value:?}\n"),
        })
        .collect();
    format!("0\n{kind}\n8\nCUT\n{values}")
}

fn line(a: [f64; 2], b: [f64; 2]) -> String {
    entity("LINE", &[(10, a[0]), (20, a[1]), (11, b[0]), (21, b[1])])
}

fn arc(centre: [f64; 2], radius: f64, from: f64, to: f64) -> String {
    entity("ARC", &[(10, centre[0]), (20, centre[1]), (40, radius), (50, from), (51, to)])
}

/// Returns a slot of 40 mm between two half circles of 5 mm.
fn slot() -> String {
    let vertices = [(-20.0, -5.0, 0.0), (20.0, -5.0, 1.0), (20.0, 5.0, 0.0), (-20.0, 5.0, 1.0)];
    let vertices = vertices.iter().flat_map(|(x, y, bulge)| [(10, *x), (20, *y), (42, *bulge)]);
    let all: Vec<_> = [(90, 4.0), (70, 1.0)].into_iter().chain(vertices).collect();
    entity("LWPOLYLINE", &all).replace("90\n4.0\n", "90\n4\n")
}

const NURBS_KNOTS: &str = "[0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]";

/// Returns a circle as a rational spline of degree 2 with nine points.
fn circle_of_nine(radius: f64) -> Vec<[f64; 3]> {
    let corners = [
        (1.0, 0.0),
        (1.0, 1.0),
        (0.0, 1.0),
        (-1.0, 1.0),
        (-1.0, 0.0),
        (-1.0, -1.0),
        (0.0, -1.0),
        (1.0, -1.0),
        (1.0, 0.0),
    ];
    let weight = |k: usize| if k % 2 == 1 { FRAC_1_SQRT_2 } else { 1.0 };
    corners.iter().enumerate().map(|(k, (x, y))| [radius * x, radius * y, weight(k)]).collect()
}

fn rational_spline() -> String {
    let mut values = vec![(70, 4.0), (71, 2.0), (72, 12.0), (73, 9.0)];
    let knots = [0.0, 0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 4.0, 4.0, 4.0];
    values.extend(knots.map(|knot| (40, knot)));
    let points = circle_of_nine(25.0);
    values.extend(points.iter().map(|[_, _, w]| (41, *w)));
    values.extend(points.iter().flat_map(|[x, y, _]| [(10, *x), (20, *y), (30, 0.0)]));
    entity("SPLINE", &values)
}

/// Returns the largest distance of a curve from the moves that LinuxCNC reads, at equal t.
fn farthest(found: &Route, ends: &[[f64; 6]], at: impl Fn(f64) -> [f64; 6]) -> f64 {
    let mut most = 0.0_f64;
    assert_eq!(ends.len(), found.rows.len());
    for (nodes, ends) in found.rows.windows(2).zip(ends.windows(2)) {
        let [from, to] = [nodes[0].node.t, nodes[1].node.t];
        for n in 0..=16 {
            let t = from + (to - from) * f64::from(n) / 16.0;
            most = most.max(to_move(&at(t), &ends[0], &ends[1]));
        }
    }
    most
}

#[test]
fn a_rational_quadratic_with_weights_and_knots_is_a_circle_to_rounding() {
    let config = config("pyramid");
    let rows: String =
        circle_of_nine(25.0).iter().map(|[x, y, w]| format!("{x:?},{y:?},3,{w:?}\n")).collect();
    let csv = format!("x,y,z,weight\n{rows}");
    let keys = format!("points = 'points.csv'\ndegree = 2\nknots = {NURBS_KNOTS}");
    for moves in ["lines", "arcs"] {
        let program = format!("moves = '{moves}'");
        let (_folder, file) = beside("points.csv", &csv, &keys, &program);
        let (found, ends) = read_back_file(&config, &file);
        // The ends of moves are on the circle, and those of an arc's chords as accurately as the interpreter's.
        for [x, y, z, ..] in &ends {
            let off = x.hypot(*y) - 25.0;
            assert!(off.abs() < 2.0 * WORDS && (z - 3.0).abs() < WORDS, "{moves}: {off} {z}");
        }
        assert!((found.curve.length - 50.0 * PI).abs() < 1e-9, "{}", found.curve.length);
        let arcs: Vec<_> = found.pieces.iter().filter_map(|piece| piece.arc).collect();
        match moves {
            "arcs" => {
                assert_eq!((arcs.len(), found.pieces.len()), (4, 4));
                for arc in arcs {
                    // Through three points of the curve, each with some roundings of 25 mm.
                    assert!(arc.centre[0].hypot(arc.centre[1]) < 1e-12, "{arc:?}");
                    assert!(arc.is_left && (arc.length - 12.5 * PI).abs() < 1e-12, "{arc:?}");
                }
            }
            _ => assert!(arcs.is_empty() && found.pieces.len() > 20),
        }
    }
}

/// One entity, and its point at a share of its length.
struct Known {
    text: String,
    at: fn(f64) -> [f64; 3],
}

fn around(centre: [f64; 2], radius: f64, degrees: f64) -> [f64; 3] {
    let (sin, cos) = degrees.to_radians().sin_cos();
    [centre[0] + radius * cos, centre[1] + radius * sin, 0.0]
}

fn known() -> Vec<Known> {
    let below = [(210, 0.0), (220, 0.0), (230, -1.0)];
    let mirrored: Vec<_> = [(10, 5.0), (20, 5.0), (40, 20.0), (50, 30.0), (51, 200.0)]
        .into_iter()
        .chain(below)
        .collect();
    vec![
        Known { text: line([0.0, 0.0], [30.0, 10.0]), at: |u| [30.0 * u, 10.0 * u, 0.0] },
        Known {
            text: arc([5.0, 5.0], 20.0, 30.0, 200.0),
            at: |u| around([5.0, 5.0], 20.0, 30.0 + 170.0 * u),
        },
        Known {
            text: arc([5.0, 5.0], 20.0, 300.0, 60.0),
            at: |u| around([5.0, 5.0], 20.0, 300.0 + 120.0 * u),
        },
        // Seen from below: X is reversed.
        Known {
            text: entity("ARC", &mirrored),
            at: |u| {
                let [x, y, z] = around([5.0, 5.0], 20.0, 30.0 + 170.0 * u);
                [-x, y, z]
            },
        },
        // In a tilted plane: the axes of the arbitrary axis algorithm are Y and (-0.8, 0, 0.6).
        Known {
            text: entity(
                "CIRCLE",
                &[(10, 0.0), (20, 0.0), (30, 10.0), (40, 10.0), (210, 0.6), (220, 0.0), (230, 0.8)],
            ),
            at: |u| {
                let (sin, cos) = (TAU * u).sin_cos();
                [6.0 - 8.0 * sin, 10.0 * cos, 8.0 + 6.0 * sin]
            },
        },
        Known {
            text: entity("CIRCLE", &[(10, 1.0), (20, 2.0), (40, 30.0)]),
            at: |u| around([1.0, 2.0], 30.0, 360.0 * u),
        },
        Known {
            text: entity(
                "ELLIPSE",
                &[(10, 10.0), (20, -5.0), (11, 30.0), (21, 10.0), (40, 0.5), (41, 0.5), (42, 4.0)],
            ),
            at: |u| {
                let (sin, cos) = (0.5 + 3.5 * u).sin_cos();
                [10.0 + 30.0 * cos - 5.0 * sin, -5.0 + 10.0 * cos + 15.0 * sin, 0.0]
            },
        },
        // The bulge of a quarter is tan(22.5 degrees); a negative one turns to the right.
        Known {
            text: entity(
                "LWPOLYLINE",
                &[(10, 0.0), (20, 20.0), (42, 1.0 - 2_f64.sqrt()), (10, 20.0), (20, 0.0)],
            ),
            at: |u| around([0.0, 0.0], 20.0, 90.0 - 90.0 * u),
        },
        Known {
            text: format!(
                "{}{}{}{}",
                entity("POLYLINE", &[(66, 1.0), (10, 0.0), (20, 0.0), (30, 4.0), (70, 0.0)]),
                entity("VERTEX", &[(10, 20.0), (20, 0.0), (30, 0.0), (42, 1.0)]),
                entity("VERTEX", &[(10, -20.0), (20, 0.0), (30, 0.0)]),
                entity("SEQEND", &[])
            ),
            at: |u| {
                let [x, y, _] = around([0.0, 0.0], 20.0, 180.0 * u);
                [x, y, 4.0]
            },
        },
        Known {
            text: rational_spline(),
            at: |u| {
                // Each quarter by the tangent of half its angle.
                let (turn, v) = ((4.0 * u).floor().min(3.0), 4.0 * u - (4.0 * u).floor().min(3.0));
                let (a, b, c) = ((1.0 - v).powi(2), 2.0 * v * (1.0 - v) * FRAC_1_SQRT_2, v * v);
                around([0.0, 0.0], 25.0, 90.0 * turn + (b + c).atan2(a + b).to_degrees())
            },
        },
    ]
}

#[test]
fn every_kind_of_entity_is_written_within_the_tolerance_of_its_closed_form() {
    let config = config("pyramid");
    for Known { text, at } in known() {
        let full = |u: f64| {
            let [x, y, z] = at(u);
            [x, y, z, 0.0, 0.0, 0.0]
        };
        for moves in ["lines", "arcs"] {
            let program = format!("moves = '{moves}'");
            let (_folder, file) =
                beside("a.dxf", &dxf(std::slice::from_ref(&text)), "dxf = 'a.dxf'", &program);
            let (found, ends) = read_back_file(&config, &file);
            let last = ends[ends.len() - 1];
            let ends_off = distance(&full(0.0), &ends[0]).max(distance(&full(1.0), &last));
            assert!(ends_off < 2.0 * WORDS, "{text}: {ends_off}");
            match moves {
                "lines" => {
                    let most = farthest(&found, &ends, full);
                    assert!(most <= CHORD, "{text}: {most}");
                }
                _ => {
                    // Compared with all moves of the interpreter: the nearest must be within the tolerance.
                    for n in 0..=400 {
                        let at = full(f64::from(n) / 400.0);
                        let near = ends.windows(2).map(|pair| to_move(&at, &pair[0], &pair[1]));
                        let near = near.fold(f64::INFINITY, f64::min);
                        assert!(near <= CHORD + INTERPRETER, "{text}: {near}");
                    }
                    let is_round = !text.contains("LINE\n8\nCUT\n10\n0.0\n20\n0.0\n11")
                        && !text.contains("ELLIPSE")
                        && !text.contains("\n210\n0.6\n");
                    let arcs = found.pieces.iter().filter(|piece| piece.arc.is_some()).count();
                    assert!(!is_round || arcs == found.pieces.len() && arcs <= 4, "{text}: {arcs}");
                }
            }
        }
    }
}

#[test]
fn lines_and_arcs_in_any_order_are_joined_to_one_contour_in_the_unit_of_the_drawing() {
    let inches = [
        line([0.0, 0.0], [1.0, 0.0]),
        arc([0.0, 0.5], 0.5, 90.0, 270.0),
        line([0.0, 1.0], [1.0, 1.0]),
        arc([1.0, 0.5], 0.5, 270.0, 90.0),
    ];
    let text = dxf_in(1, &inches);
    let program = "moves = 'arcs'\nclear_z_mm = 5";
    let (_folder, file) = beside("a.dxf", &text, "dxf = 'a.dxf'", program);
    let config = config("pyramid");
    let (found, ends) = read_back_file(&config, &file);
    let expected = 25.4 * (2.0 + PI);
    assert!((found.curve.length - expected).abs() < 1e-9, "{}", found.curve.length);
    // Down once and up once: the contour is not interrupted.
    assert_eq!(found.program.matches("G0 Z5").count(), 2, "{}", found.program);
    // The first move goes down to the start, which is also the end.
    assert!(distance(&ends[1], &ends[ends.len() - 1]) < 2.0 * WORDS);
    assert!(found.program.contains("\nG1 X25.4\n"), "{}", found.program);
    // A key has priority over the unit of the drawing.
    let (_folder, file) = beside("a.dxf", &text, "dxf = 'a.dxf'\ndxf_unit_mm = 10", program);
    let found = route(&config, &file).unwrap();
    assert!((found.curve.length - 10.0 * (2.0 + PI)).abs() < 1e-9);
}

#[test]
fn the_same_slot_as_an_svg_with_arcs_and_transforms_and_as_a_dxf_with_bulges_is_the_same_program() {
    let svg = "<svg width='120mm' height='120mm' viewBox='0 0 60 60'>\
               <g transform='rotate(90) matrix(0.5 0 0 -0.5 0 0)'><g transform='rotate(90)'>\
               <path d='M -20 -5 H 20 a 5 5 0 0 1 0 10 L -20 5 A 5 5 0 0 1 -20 -5'/></g></g></svg>";
    let program = "moves = 'arcs'\nclear_z_mm = 5";
    let config = config("pyramid");
    let (_a, file) = beside("a.svg", svg, "svg = 'a.svg'", program);
    let (by_svg, svg_ends) = read_back_file(&config, &file);
    let (_b, file) = beside("a.dxf", &dxf(&[slot()]), "dxf = 'a.dxf'", program);
    let (by_dxf, dxf_ends) = read_back_file(&config, &file);
    assert_eq!(by_svg.pieces.len(), by_dxf.pieces.len());
    assert_eq!(svg_ends.len(), dxf_ends.len());
    for (a, b) in svg_ends.iter().zip(&dxf_ends) {
        assert!(distance(a, b) < 2.0 * WORDS, "{a:?} {b:?}");
    }
    // Two lines, and two arcs of half a turn.
    assert_eq!(by_dxf.pieces.iter().filter(|piece| piece.arc.is_some()).count(), 2);
    let length = 80.0 + 5.0 * TAU;
    for found in [by_svg, by_dxf] {
        assert!((found.curve.length - length).abs() < 1e-9, "{}", found.curve.length);
    }
}

#[test]
fn a_law_gives_the_height_of_a_plane_drawing_and_one_in_space_has_its_own() {
    let config = config("pyramid");
    let with_law = |file: &mut PathFile| file.laws.z_mm = Some(paths::file::Formula("-2*u".into()));
    let (_a, mut file) = beside("a.dxf", &dxf(&[slot()]), "dxf = 'a.dxf'", "");
    with_law(&mut file);
    let (_, ends) = read_back_file(&config, &file);
    assert!((ends[ends.len() - 1][2] + 2.0).abs() < WORDS);
    let rising =
        entity("LINE", &[(10, 0.0), (20, 0.0), (30, 1.0), (11, 9.0), (21, 0.0), (31, 4.0)]);
    let (_b, mut file) = beside("a.dxf", &dxf(&[rising]), "dxf = 'a.dxf'", "");
    let (_, ends) = read_back_file(&config, &file);
    assert!((ends[ends.len() - 1][2] - 4.0).abs() < WORDS);
    with_law(&mut file);
    let message = route(&config, &file).unwrap_err().to_string();
    assert!(message.contains("[laws] z_mm: a space curve has its own z"), "{message}");
}

/// Entities from a third-party program: a slot, an ellipse, a rational spline, a circle seen
/// from below and a polyline on the layer CUT, a line and a text on NOTES.
const EZDXF: &str = include_str!("drawings/ezdxf.dxf");

#[test]
fn a_drawing_of_another_program_gives_the_entities_of_a_layer_or_of_handles() {
    let read = |keys: &str| {
        let keys = format!("dxf = 'a.dxf'\n{keys}");
        let (_folder, file) = beside("a.dxf", EZDXF, &keys, "clear_z_mm = 20");
        route(&config("pyramid"), &file).map_err(|error| error.to_string())
    };
    let found = read("dxf_layer = 'cut'").unwrap();
    assert_eq!(found.program.matches("G0 Z20").count(), 6, "{}", found.program);
    let slot = 80.0 + 5.0 * TAU;
    let spline = 15.0 * PI;
    let polyline = 10.0 + 5.0 * PI;
    // From 0.5 to 4 of an ellipse with half-axes of 20.6 mm and 10.3 mm: by Simpson's rule.
    let speed = |phi: f64| {
        let (sin, cos) = phi.sin_cos();
        425_f64.sqrt() * (sin * sin + 0.25 * cos * cos).sqrt()
    };
    let weight = |k: i32| if k == 0 || k == 2000 { 1.0 } else { f64::from(2 + 2 * (k % 2)) };
    let ellipse: f64 =
        (0..=2000).map(|k| weight(k) * speed(0.5 + 3.5 * f64::from(k) / 2000.0)).sum::<f64>() * 3.5
            / 6000.0;
    let expected = slot + spline + 7.0 * TAU + polyline + ellipse;
    assert!((found.curve.length - expected).abs() < 1e-8, "{} {expected}", found.curve.length);
    // The circle's handle follows its name.
    let (_, rest) = EZDXF.split_once("\nCIRCLE\n  5\n").unwrap();
    let handle = rest.lines().next().unwrap();
    let found = read(&format!("dxf_handles = ['{handle}']")).unwrap();
    assert!((found.curve.length - 7.0 * TAU).abs() < 1e-9, "{}", found.curve.length);
    let message = read("").unwrap_err();
    assert!(
        message.contains("on layer NOTES): not a curve: put curves on a separate layer"),
        "{message}"
    );
}
