// SPDX-License-Identifier: GPL-2.0-or-later
//! Corners that LinuxCNC rounds by starting a move while the previous one is still ending.
//!
//! The platform then moves by the sum v₁ w₁ + v₂ w₂. LinuxCNC adds both speeds: it reports
//! v₁ + v₂. The direction w₁ of the ending move, per unit of its speed, is known from earlier cycles.
//! Both speeds and the direction of the beginning move therefore follow from its first cycle, long
//! before it is fast.
//!
//! A speed counts X, Y, Z if they move, otherwise A, B, C: the counted part of w has length 1.
//! For the sum r with its speed c, q = r − c w₁ = v₂ (w₂ − w₁). If both count the same letters,
//! |q|² = −2 v₂ q·w₁.

use libm::sqrt;

/// Rate of a pose: X, Y, Z in machine units, A, B, C in degrees, per second.
type Rate = [f64; 6];

/// Share of the speed below which two rates differ only by rounding.
const ROUNDED: f64 = 1e-6;

/// Share of the reported speed that a motion without a corner has at least: chords of arcs are
/// shorter than the arcs by less.
const WHOLE: f64 = 1.0 - 1e-4;

/// Two simultaneous moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// Rate of the move that ends. It brakes as fast as LinuxCNC lets it.
    pub ending: Rate,
    /// Rate of the move that begins.
    pub beginning: Rate,
    /// Speed of the move that begins, as LinuxCNC counts it.
    pub speed: f64,
    /// Increase of that speed in this cycle.
    pub gained: f64,
    /// Whether the requested speed that LinuxCNC reports is still that of the ending move: it reports
    /// only the faster of the two.
    pub hides_request: bool,
}

impl Corner {
    /// Returns whether the beginning move may exceed `allowed` after `cycles` more cycles. Its requested
    /// speed may still be unknown.
    pub fn may_outrun(&self, allowed: f64, cycles: f64) -> bool {
        self.hides_request && !(self.speed + cycles * self.gained < allowed)
    }
}

/// State kept about the move that continues.
#[derive(Clone, Copy, Debug)]
pub struct Straight {
    /// Its rates per unit of its speed: LinuxCNC's and the machine's.
    along: Option<[Rate; 2]>,
    /// Its speed in the previous cycle if another move has begun, and the speed of that move.
    left: f64,
    begun: f64,
    /// Whether it ended in this cycle, between two servo periods.
    is_over: bool,
}

impl Straight {
    /// No move is known.
    pub const NONE: Self = Self { along: None, left: f64::INFINITY, begun: 0.0, is_over: false };

    /// Processes a cycle: the rates of LinuxCNC's pose and of the machine's (equal unless an axis carries
    /// something), and the mean speed that LinuxCNC reports. Returns the two moves of a corner, as the
    /// machine performs them.
    pub fn corner(&mut self, rates: [&Rate; 2], speed: f64) -> Option<Corner> {
        if !(speed > 0.0 && speed.is_finite()) {
            *self = Self::NONE;
            return None;
        }
        let [programmed, own] = rates;
        if counted(programmed, speed) >= WHOLE * speed {
            *self = Self { along: Some(rates.map(|rate| rate.map(|r| r / speed))), ..Self::NONE };
            return None;
        }
        if core::mem::take(&mut self.is_over) {
            return None;
        }
        let [along, own_along] = self.along?;
        let beginning = beginning_speed(programmed, &along, speed)?;
        if !(beginning > 0.0 && beginning <= speed) {
            return None;
        }
        let left = speed - beginning;
        let rests = [(programmed, along), (own, own_along)]
            .map(|(rate, along)| core::array::from_fn(|k| rate[k] - left * along[k]));
        let corner = Corner {
            ending: own_along.map(|w| left * w),
            beginning: rests[1],
            speed: beginning,
            gained: beginning - self.begun,
            hides_request: beginning < left,
        };
        self.follow(rests, beginning, left);
        Some(corner)
    }

    /// Makes the beginning move the continuing one if the ending move stops in the next cycle, because it
    /// may round the next corner immediately.
    fn follow(&mut self, rests: [Rate; 2], beginning: f64, left: f64) {
        let is_last = 2.0 * left <= self.left && self.left.is_finite();
        (self.left, self.begun) = (left, beginning);
        if is_last {
            let along = rests.map(|rest| rest.map(|rate| rate / beginning));
            *self = Self { along: Some(along), is_over: true, ..Self::NONE };
        }
    }
}

/// Computes the speed of the beginning move, v₂.
fn beginning_speed(rate: &Rate, along: &Rate, speed: f64) -> Option<f64> {
    let ([r, turns], [w, turned]) = (parts(rate), parts(along));
    let moved = dot(&w, &w) > 0.0;
    if !moved {
        let places = norm(&r);
        let begins_in_places = places > ROUNDED * speed;
        return if begins_in_places { Some(places) } else { alike(&turns, &turned, speed) };
    }
    let still = dot(&r, &w);
    let aside = core::array::from_fn::<f64, 3, _>(|k| r[k] - still * w[k]);
    if norm(&aside) > ROUNDED * speed {
        return alike(&r, &w, speed);
    }
    // The positions continue in one line: the move reverses, or the beginning one has no X Y Z.
    let rest = core::array::from_fn::<f64, 3, _>(|k| turns[k] - still * turned[k]);
    let gap = speed - still;
    Some(if norm(&rest) > ROUNDED * speed { gap } else { gap / 2.0 })
}

/// Computes v₂ of a sum whose parts count the same letters.
fn alike(r: &[f64; 3], w: &[f64; 3], speed: f64) -> Option<f64> {
    let q = core::array::from_fn::<f64, 3, _>(|k| r[k] - speed * w[k]);
    let towards = dot(&q, w);
    (towards < 0.0).then(|| -dot(&q, &q) / (2.0 * towards))
}

/// Computes a rate's speed: of X, Y, Z, or of A, B, C if only these move.
fn counted(rate: &Rate, speed: f64) -> f64 {
    let [places, turns] = parts(rate);
    let length = norm(&places);
    if length > ROUNDED * speed { length } else { norm(&turns) }
}

fn parts(rate: &Rate) -> [[f64; 3]; 2] {
    let [x, y, z, a, b, c] = *rate;
    [[x, y, z], [a, b, c]]
}

fn dot(one: &[f64; 3], other: &[f64; 3]) -> f64 {
    one[0] * other[0] + one[1] * other[1] + one[2] * other[2]
}

fn norm(v: &[f64; 3]) -> f64 {
    sqrt(dot(v, v))
}

#[cfg(test)]
mod tests {
    use super::*;

    impl Straight {
        /// Processes a cycle of a machine whose pose is LinuxCNC's.
        fn plain(&mut self, rate: &Rate, speed: f64) -> Option<Corner> {
            self.corner([rate; 2], speed)
        }
    }

    /// Returns the corner found for v₁ w₁ + v₂ w₂, after w₁ alone.
    fn message(w: [Rate; 2], v: [f64; 2]) -> Option<Corner> {
        let mut straight = Straight::NONE;
        assert_eq!(straight.plain(&w[0].map(|w| 7.0 * w), 7.0), None);
        let sum = core::array::from_fn(|k| v[0] * w[0][k] + v[1] * w[1][k]);
        straight.plain(&sum, v[0] + v[1])
    }

    #[test]
    fn both_moves_of_a_corner_are_distinguished_for_all_letters() {
        let across = [0.6, 0.8, 0.0, 0.1, 0.0, 0.2];
        let along = [0.0, 0.28, 0.96, -0.3, 0.0, 0.0];
        let back = across.map(|w| -w);
        let turning = [0.0, 0.0, 0.0, 0.6, 0.0, 0.8];
        let other = [0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        for w in
            [[across, along], [across, back], [across, turning], [turning, along], [turning, other]]
        {
            for v in [[40.0, 0.5], [20.0, 20.0], [0.5, 40.0]] {
                let corner = message(w, v).expect("a corner");
                // Rounding of speeds of 40, divided by their share of the differences.
                assert!((corner.speed - v[1]).abs() < 1e-11, "{corner:?} {v:?}");
                for k in 0..6 {
                    assert!((corner.ending[k] - v[0] * w[0][k]).abs() < 1e-11, "{corner:?}");
                    assert!((corner.beginning[k] - v[1] * w[1][k]).abs() < 1e-11, "{corner:?}");
                }
            }
        }
    }

    #[test]
    fn consecutive_corners_are_distinguished_without_a_straight_between_them() {
        let w = [
            [0.6, 0.8, 0.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.5, 0.0, 0.0],
            [-1.0, 0.0, 0.0, 0.0, 0.0, 0.3],
        ];
        let mut straight = Straight::NONE;
        assert_eq!(straight.plain(&w[0], 1.0), None);
        // One move brakes by 1 per cycle and the other gains it; in the last cycle half of it is left.
        for k in 0..2 {
            let speeds = (1..10).map(|n| [10.0 - f64::from(n), f64::from(n)]);
            for (n, v) in speeds.chain([[0.25, 10.0]]).enumerate() {
                let sum = core::array::from_fn(|i| v[0] * w[k][i] + v[1] * w[k + 1][i]);
                let Some(corner) = straight.plain(&sum, v[0] + v[1]) else {
                    assert_eq!(n, 9, "only the last cycle is none");
                    continue;
                };
                assert!(n < 9 && (corner.speed - v[1]).abs() < 1e-12, "{corner:?} {v:?}");
            }
        }
    }

    #[test]
    fn a_move_with_a_hidden_request_may_outrun_the_allowed_speed_while_it_gains() {
        let w = [[1.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0, 0.0, 0.0]];
        let mut straight = Straight::NONE;
        straight.plain(&w[0].map(|w| 10.0 * w), 10.0);
        let mut seen = |v: [f64; 2]| {
            straight.plain(&[v[0], v[1], 0.0, 0.0, 0.0, 0.0], v[0] + v[1]).expect("a corner")
        };
        let [one, two, later] = [[9.0, 1.0], [8.0, 2.0], [4.0, 6.0]].map(&mut seen);
        assert_eq!((one.gained, two.gained, later.gained), (1.0, 1.0, 4.0));
        assert!(two.may_outrun(5.0, 3.0) && !two.may_outrun(5.1, 3.0));
        assert!(two.may_outrun(f64::NAN, 3.0));
        assert!(!later.hides_request && !later.may_outrun(0.0, 3.0));
    }

    #[test]
    fn a_corner_of_what_is_programmed_is_one_of_what_the_machine_makes_of_it() {
        let programmed = [[1.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0, 0.0, 2.0]];
        let own = [[0.0, 1.0, 0.0, 0.0, 0.0, 0.0], [-1.0, 0.5, 0.0, 0.0, 0.0, 0.0]];
        let mut straight = Straight::NONE;
        assert_eq!(straight.corner([&programmed[0], &own[0]], 1.0), None);
        let sum = |w: &[Rate; 2]| core::array::from_fn(|k| 3.0 * w[0][k] + 2.0 * w[1][k]);
        let corner = straight.corner([&sum(&programmed), &sum(&own)], 5.0).expect("a corner");
        assert_eq!((corner.speed, corner.ending), (2.0, own[0].map(|w| 3.0 * w)));
        assert_eq!(corner.beginning, own[1].map(|w| 2.0 * w));
    }

    #[test]
    fn no_corner_is_seen_on_one_move_at_rest_or_without_one_before() {
        let w = [0.6, 0.8, 0.0, 0.1, 0.0, 0.2];
        assert_eq!(message([w, w], [3.0, 4.0]), None);
        let mut straight = Straight::NONE;
        assert_eq!(straight.plain(&w, 2.0), None);
        for speed in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let mut straight = Straight::NONE;
            assert_eq!(straight.plain(&w, 1.0), None);
            assert_eq!(straight.plain(&w, speed), None);
            assert_eq!(straight.plain(&w.map(|w| w / 2.0), 1.0), None);
        }
        // Faster than reported: a motion that is not from LinuxCNC's planner.
        let mut straight = Straight::NONE;
        assert_eq!(straight.plain(&w, 1.0), None);
        assert_eq!(straight.plain(&[f64::NAN; 6], 1.0), None);
    }
}
