// SPDX-License-Identifier: GPL-2.0-or-later
//! From a path file to a program and the required motion of a machine.

use crate::file::{Feed, PathFile};
use crate::gcode::Writer;
use crate::motion::{Node, Pace, length, nodes, rise, seconds};
use crate::piece::{Piece, Wanted};
use crate::pieces::pieces;
use crate::route_error::RouteError;
use crate::straight::joined;
use crate::table::{Row, rows};
use crate::whole::{Curve, CurveError};
use machine::read::mechanism::Mechanism;
use program::motion::Move;
use program::preflight::preflight;

const ALL: [usize; 6] = [0, 1, 2, 3, 4, 5];

/// Largest distance between ends of pieces without a gap, mm and degrees.
const GAP: f64 = 1e-6;

/// A path within the machine's limits.
#[derive(Clone, Debug)]
pub struct Route {
    pub curve: Curve,
    pub pieces: Vec<Piece>,
    pub program: String,
    /// Positions and joints, one row for every start, for the end of every piece, and for points along a line that joins
    /// several.
    pub rows: Vec<Row>,
    /// Length of the tip's path along the curve, mm.
    pub length: f64,
    /// Duration at the programmed speeds, without acceleration, s.
    pub seconds: f64,
}

/// Plans the route of a file on a machine.
///
/// # Errors
/// See [`RouteError`].
pub fn route(config: &Mechanism, file: &PathFile) -> Result<Route, RouteError> {
    let curve = Curve::of(file)?;
    let missing = || CurveError::Keys("[tolerance] chord_mm: missing".into());
    let tolerance = file.tolerance.ok_or_else(missing)?;
    let wanted = Wanted::new(&tolerance, file.program.moves)?;
    let proved = pieces(&curve, &wanted)?;
    let pace = Pace { turn: file.laws.turn_deg_per_s.map(|turn| turn.0) };
    let ends = nodes(&curve, &proved, &pace)?;
    let rises: f64 =
        proved.iter().map(|piece| rise(&curve, piece)).sum::<Result<f64, CurveError>>()?;
    // Joints and speeds are checked at points as near to each other as the proofs require, also along a long line.
    let points = nodes_once(&ends);
    let pieces = joined(&curve, &proved, &ends, &wanted)?;
    let ends = nodes(&curve, &pieces, &pace)?;
    let blend = file.program.blend_mm.unwrap_or(tolerance.chord_mm).0;
    let title = file.program.title.clone().unwrap_or("Path along a curve".into());
    let origin = format!("within {} mm of the curve, made by pkm path", tolerance.chord_mm.0);
    let mut writer = Writer::begin(config, &file.program, &[title, origin], blend)?;
    let seconds = write(&mut writer, &curve, &pieces, &ends, &pace)?;
    let tool = writer.tool;
    let rows = rows(config, &file.program, &points, tool)?;
    let (program, moves, places) = writer.end();
    check(config, &moves, &places)?;
    Ok(Route { length: curve.length + rises, curve, pieces, program, rows, seconds })
}

/// Returns whether two nodes coincide.
fn meet(a: &Node, b: &Node) -> bool {
    (0..6).all(|k| (a.pose[k] - b.pose[k]).abs() <= GAP)
}

/// Returns starts and ends without duplicates.
fn nodes_once(ends: &[[Node; 2]]) -> Vec<Node> {
    let mut all: Vec<Node> = vec![];
    for [start, end] in ends {
        if !all.last().is_some_and(|last| meet(last, start)) {
            all.push(start.clone());
        }
        all.push(end.clone());
    }
    all
}

fn write(
    writer: &mut Writer,
    curve: &Curve,
    pieces: &[Piece],
    ends: &[[Node; 2]],
    pace: &Pace,
) -> Result<f64, RouteError> {
    let mode = writer.keys().feed;
    let mut last: Option<&Node> = None;
    let mut whole = 0.0;
    for (piece, ends) in pieces.iter().zip(ends) {
        let [start, end] = ends;
        writer.check(&end.pose, end.t)?;
        let time = seconds(curve, piece, ends, pace)?;
        let feed = length(piece, ends).0 / time * 60.0;
        whole += time;
        if !last.is_some_and(|last| meet(last, start)) {
            writer.check(&start.pose, start.t)?;
            begin(writer, start, last, feed, mode)?;
        }
        let minutes = (mode == Feed::InverseTime).then_some(time / 60.0);
        match &piece.arc {
            Some(arc) => writer.arc_to(&end.pose, &ALL, arc, 0, feed, minutes),
            None => writer.feed_to(&end.pose, feed, minutes),
        }
        writer.note(end.t);
        last = Some(end);
    }
    if mode == Feed::InverseTime {
        writer.feed_mode(Feed::PerMinute);
    }
    Ok(whole)
}

/// Moves to the start of the curve, or over a gap in it.
fn begin(
    writer: &mut Writer,
    start: &Node,
    last: Option<&Node>,
    feed: f64,
    mode: Feed,
) -> Result<(), RouteError> {
    if let Some(last) = last {
        if !writer.can_lift() {
            let place = |node: &Node| [node.pose[0], node.pose[1], node.pose[2]];
            let (from, to) = (place(last), place(start));
            return Err(RouteError::Gap { t: last.t, from, to });
        }
        if mode == Feed::InverseTime {
            writer.feed_mode(Feed::PerMinute);
        }
        writer.lift();
    }
    writer.approach(&start.pose, feed);
    writer.note(start.t);
    if mode == Feed::InverseTime {
        writer.feed_mode(mode);
    }
    Ok(())
}

/// Checks the program's moves against the limits of the machine.
fn check(config: &Mechanism, moves: &[Move], places: &[(u32, f64)]) -> Result<(), RouteError> {
    let found = preflight(std::slice::from_ref(config), moves).map_err(|fault| {
        RouteError::Fault { t: places.first().map_or(0.0, |place| place.1), fault }
    })?;
    let Some(first) = found.breaks.iter().min_by_key(|broken| broken.line) else { return Ok(()) };
    let (line, text) = (first.line, first.text.clone());
    match places.iter().find(|place| place.0 == line) {
        Some((_, t)) => Err(RouteError::Leaves { t: *t, text }),
        None => Err(RouteError::Beside { line, text }),
    }
}
