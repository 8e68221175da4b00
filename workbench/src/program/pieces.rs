// SPDX-License-Identifier: GPL-2.0-or-later
//! From the moves of a program to those of the queue: what lies on a line becomes one.

use crate::program::interpreter::{Arc, Move, MoveKind, PathMode};
use crate::program::segment::{ALONG_CIRCLES, End, FUZZ, Segment, Shape, between, lengths, norm};
use crate::program::share::{Limits, circle_limits, directions, line_limits};
use crate::read::machine::MachineConfig;
use kinematics::Vector3;
use std::collections::VecDeque;

/// Moves merged at most.
const MERGED: usize = 100;

/// An end of a straight move, or a whole arc.
struct Piece<'a> {
    number: usize,
    step: &'a Move,
    places: Vec<[f64; 6]>,
    arc: Option<Arc>,
    stands: bool,
}

pub(super) struct Source<'a> {
    config: &'a MachineConfig,
    moves: &'a [Move],
    next: usize,
    /// End of what was read, and of what was handed on.
    at: [f64; 6],
    sent: [f64; 6],
    waiting: VecDeque<Piece<'a>>,
}

impl<'a> Source<'a> {
    pub(super) fn new(config: &'a MachineConfig, moves: &'a [Move]) -> Self {
        Self {
            config,
            moves,
            next: 0,
            at: config.home,
            sent: config.home,
            waiting: VecDeque::new(),
        }
    }

    /// The next move that moves anything; arcs whole, or as two lines where they are nearly straight.
    fn piece(&mut self) -> Option<Piece<'a>> {
        if let Some(piece) = self.waiting.pop_front() {
            return Some(piece);
        }
        let mut stands = false;
        let begin = self.at;
        let mut places = vec![];
        while let Some(step) = self.moves.get(self.next) {
            stands |= step.path.stands;
            places.push(step.end);
            self.next += 1;
            let following = self.moves.get(self.next).and_then(|next| next.path.arc);
            let arc = step.path.arc;
            if arc.is_some_and(|arc| following.is_some_and(|next| next.number == arc.number)) {
                continue;
            }
            let number = self.next - 1;
            if !moves_anything(&begin, &places) {
                places.clear();
                continue;
            }
            self.at = step.end;
            if let Some(middle) = nearly_straight(step, &begin, &places) {
                let last = Piece { number, step, places: vec![step.end], arc: None, stands: false };
                self.waiting.push_back(last);
                return Some(Piece { number, step, places: vec![middle], arc: None, stands });
            }
            return Some(Piece { number, step, places, arc, stands });
        }
        None
    }

    /// Straight moves within the tolerance Q of one line become one.
    fn merged(&mut self, begin: &[f64; 6]) -> Option<Piece<'a>> {
        let mut piece = self.piece()?;
        let PathMode::Blend { merging, .. } = piece.step.path.mode else { return Some(piece) };
        if merging == 0.0 || piece.arc.is_some() || piece.step.kind != MoveKind::Feed {
            return Some(piece);
        }
        while piece.places.len() <= MERGED {
            let Some(more) = self.piece() else { break };
            let same = more.step.path.mode == piece.step.path.mode
                && more.step.kind == MoveKind::Feed
                && (more.step.feed, more.step.tool) == (piece.step.feed, piece.step.tool)
                && more.arc.is_none()
                && !more.stands;
            if !same || !on_one_line(begin, &piece.places, &more.places[0], merging) {
                self.waiting.push_front(more);
                break;
            }
            (piece.number, piece.step) = (more.number, more.step);
            piece.places.extend(more.places);
        }
        let last = piece.places[piece.places.len() - 1];
        piece.places = vec![last];
        Some(piece)
    }

    pub(super) fn next(&mut self) -> Option<Segment> {
        let piece = self.merged(&self.sent.clone())?;
        let mut places = vec![self.sent];
        places.extend(&piece.places);
        self.sent = places[places.len() - 1];
        Some(segment(self.config, &piece, places))
    }
}

fn moves_anything(begin: &[f64; 6], places: &[[f64; 6]]) -> bool {
    let last = &places[places.len() - 1];
    places.len() > 1 || between(begin, last).iter().any(|delta| delta.abs() >= FUZZ)
}

/// The middle of an arc in X Y that blending takes for two lines.
fn nearly_straight(step: &Move, begin: &[f64; 6], places: &[[f64; 6]]) -> Option<[f64; 6]> {
    let PathMode::Blend { merging, .. } = step.path.mode else { return None };
    let middle = places.get((places.len() / 2).checked_sub(1)?).filter(|_| places.len() > 1)?;
    let last = &places[places.len() - 1];
    let flat = |a: &[f64; 6], b: &[f64; 6]| (b[0] - a[0]).hypot(b[1] - a[1]);
    let half = flat(begin, last) / 2.0;
    let deviation = (flat(begin, middle).powi(2) - half * half).max(0.0).sqrt();
    (step.path.arc.is_some_and(|arc| arc.normal == 2) && deviation < merging).then_some(*middle)
}

fn on_one_line(begin: &[f64; 6], chain: &[[f64; 6]], end: &[f64; 6], within: f64) -> bool {
    let place = |p: &[f64; 6]| Vector3::new(p[0], p[1], p[2]);
    let (base, way) = (place(begin), place(end) - place(begin));
    let turned = chain.iter().any(|p| p[3..] != end[3..]);
    if turned || way.norm() == 0.0 {
        return false;
    }
    chain.iter().all(|p| {
        let share = (way.dot(&(place(p) - base)) / way.norm_squared()).clamp(0.0, 1.0);
        (place(p) - base - way * share).norm() <= within
    })
}

/// What the queue gets of a move.
fn segment(config: &MachineConfig, piece: &Piece, places: Vec<[f64; 6]>) -> Segment {
    let step = piece.step;
    let delta = between(&places[0], &places[places.len() - 1]);
    let limits = match piece.arc {
        Some(arc) => circle_limits(config, &arc, &delta, &places),
        None => line_limits(config, &delta),
    };
    let Limits { turns_only, length, most, acceleration } = limits;
    let feed = if turns_only { step.angular_feed } else { step.feed };
    let (end, tolerance) = match step.path.mode {
        PathMode::Stop => (End::Stop, 0.0),
        PathMode::Exact => (End::Exact, 0.0),
        PathMode::Blend { tolerance, .. } => (End::Overlap, tolerance),
    };
    let (start, finish) = directions(&places);
    let mut segment = Segment {
        number: piece.number,
        tool: step.tool,
        rapid: step.kind == MoveKind::Rapid,
        stands: piece.stands,
        shape: piece.arc.map_or(Shape::Line, |arc| circle(&arc, &places, &start, &finish)),
        turns: norm(&delta[3..]) > FUZZ,
        along: piece.arc.map_or(vec![], |_| lengths(&places)),
        places,
        start,
        finish,
        target: length,
        nominal: length,
        requested: if step.kind == MoveKind::Rapid { most } else { feed.min(most) },
        most,
        limit: if turns_only { f64::INFINITY } else { config.max_linear_velocity },
        acceleration,
        tangential: ALONG_CIRCLES,
        tolerance,
        end,
        overlaps_before: false,
        final_speed: 0.0,
        kink_speed: None,
        kink: 0.0,
        kink_before: 0.0,
        finalized: false,
        at_peak: false,
        active: false,
        ramps: false,
        progress: 0.0,
        speed: 0.0,
        cycle: config.period,
        overlap_speed: 0.0,
        overlapping: false,
        brakes_to_end: false,
        splitting: false,
        remove: false,
        split_speed: 0.0,
    };
    segment.clamp();
    segment
}

fn circle(arc: &Arc, places: &[[f64; 6]], start: &Vector3<f64>, finish: &Vector3<f64>) -> Shape {
    let flat = |mut way: Vector3<f64>| {
        way[arc.normal] = 0.0;
        way.try_normalize(0.0).unwrap_or_else(Vector3::zeros)
    };
    let (first, last) = (flat(*start), flat(*finish));
    let bend = places.get(2).map_or_else(Vector3::zeros, |third| {
        let (a, b) = (&places[0], &places[1]);
        Vector3::from_fn(|k, _| a[k] - 2.0 * b[k] + third[k])
    });
    let inward = flat(bend - first * first.dot(&bend));
    let height = places[places.len() - 1][arc.normal] - places[0][arc.normal];
    let effective = arc.radius + height * height / arc.radius;
    Shape::Circle { radius: arc.radius, effective, first, inward, last }
}
