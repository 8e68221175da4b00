// SPDX-License-Identifier: GPL-2.0-or-later
//! Keys of the legs' sections from dimensions on a drawing.

use crate::values::Values;
use keys::{Key, leg as key};

/// Digits after the decimal point of an anchor: an atom's width in millimeters.
const DIGITS: f64 = 1e9;

/// Keys and numbers of a leg's section.
#[derive(Clone, Debug, Default)]
pub struct Leg(pub Vec<(&'static Key, Vec<f64>)>);

impl Leg {
    pub(crate) fn with(mut self, key: &'static Key, numbers: &[f64]) -> Self {
        self.0.push((key, numbers.to_vec()));
        self
    }

    pub(crate) fn base(at: [f64; 3]) -> Self {
        Self::default().with(&key::BASE, &at)
    }

    pub(crate) fn slider(
        base: [f64; 3],
        guide: [f64; 3],
        platform: [f64; 3],
        rod: f64,
        side: f64,
    ) -> Self {
        let leg = Self::base(base).with(&key::GUIDE, &guide).with(&key::PLATFORM, &platform);
        leg.with(&key::ROD, &[rod]).with(&key::SIDE, &[side])
    }

    /// Returns the numbers of a key; zeros if the leg has none.
    pub fn numbers<const N: usize>(&self, key: &Key) -> [f64; N] {
        let found = self.0.iter().find(|(own, _)| own.name == key.name);
        found.and_then(|(_, numbers)| numbers.as_slice().try_into().ok()).unwrap_or([0.0; N])
    }
}

/// Returns a point on a circle, by its angle in degrees.
fn on_circle(radius: f64, degrees: f64) -> [f64; 2] {
    let (sin, cos) = degrees.to_radians().sin_cos();
    // Avoids -0, and rounding errors instead of 0.
    [cos, sin].map(|share| (radius * share * DIGITS).round() / DIGITS + 0.0)
}

/// Returns point `i` of three pairs on a circle, each `half` degrees from the center of its pair; the center of the
/// first is at `turn` degrees.
fn of_pairs(i: usize, radius: f64, half: f64, turn: f64) -> [f64; 2] {
    let side = if i.is_multiple_of(2) { -half } else { half };
    on_circle(radius, turn + 120.0 * (i / 2) as f64 + side)
}

/// Returns base and platform points of six legs that cross over from pair to pair.
fn pairs(values: &Values, i: usize, turn: f64) -> [[f64; 2]; 2] {
    let of = |name: &str| values.number(name);
    [
        of_pairs(i, of("base-radius"), of("base-half-angle"), turn),
        of_pairs(i, of("platform-radius"), 60.0 - of("platform-half-angle"), turn),
    ]
}

fn at([x, y]: [f64; 2], z: f64) -> [f64; 3] {
    [x, y, z]
}

/// Returns Z of the platform joints in the platform's frame, whose origin is the nose.
fn nose(values: &Values) -> f64 {
    let nose = values.number("nose");
    if is_up(values) { 0.0 - nose } else { nose }
}

/// Returns whether the tool points up.
pub(crate) fn is_up(values: &Values) -> bool {
    values.word("tool") == "up"
}

/// Returns the side of the platform on which the base is: 1 above it, -1 below it.
fn side(values: &Values) -> f64 {
    if is_up(values) { -1.0 } else { 1.0 }
}

/// Returns no legs: they come from a table.
pub fn none(_: &Values) -> Vec<Leg> {
    vec![]
}

/// Returns six struts.
pub fn hexapod(values: &Values) -> Vec<Leg> {
    let leg = |i| {
        let [base, platform] = pairs(values, i, 0.0);
        Leg::base(at(base, values.number("height")))
            .with(&key::PLATFORM, &at(platform, nose(values)))
    };
    (0..6).map(leg).collect()
}

/// Returns the angle of leg `i` of three, one of them at 90 degrees.
fn of_three(i: usize) -> f64 {
    90.0 + 120.0 * i as f64
}

/// Returns three struts that meet.
pub fn tripod(values: &Values) -> Vec<Leg> {
    let leg = |i| {
        let base = on_circle(values.number("base-radius"), of_three(i));
        Leg::base(at(base, values.number("height"))).with(&key::PLATFORM, &[0.0, 0.0, nose(values)])
    };
    (0..3).map(leg).collect()
}

/// Returns three struts around a passive leg.
pub fn tricept(values: &Values) -> Vec<Leg> {
    a3_head(values)
}

/// Returns two struts with a common plane, and a third one.
pub fn exechon(values: &Values) -> Vec<Leg> {
    let [base, platform] = ["base-width", "platform-width"].map(|name| 0.5 * values.number(name));
    let depths = ["base-depth", "platform-depth"].map(|name| values.number(name));
    let strut = |base, platform| {
        Leg::base(at(base, values.number("height")))
            .with(&key::PLATFORM, &at(platform, nose(values)))
    };
    vec![
        strut([-base, 0.0], [-platform, 0.0]),
        strut([base, 0.0], [platform, 0.0]),
        strut([0.0, depths[0]], [0.0, depths[1]]),
    ]
}

/// Returns three rods from carriages that run towards the work.
pub fn z3_head(values: &Values) -> Vec<Leg> {
    let leg = |i| {
        let of = |name: &str| on_circle(values.number(name), of_three(i));
        Leg::slider(
            at(of("base-radius"), values.number("height")),
            [0.0, 0.0, 0.0 - side(values)],
            at(of("platform-radius"), nose(values)),
            values.number("rod"),
            -1.0,
        )
    };
    (0..3).map(leg).collect()
}

/// Returns three struts.
pub fn a3_head(values: &Values) -> Vec<Leg> {
    let leg = |i| {
        let of = |name: &str| on_circle(values.number(name), of_three(i));
        Leg::base(at(of("base-radius"), values.number("height")))
            .with(&key::PLATFORM, &at(of("platform-radius"), nose(values)))
    };
    (0..3).map(leg).collect()
}

/// Returns five struts from a wall to rings.
pub fn pentapod(values: &Values) -> Vec<Leg> {
    let of = |name: &str| values.number(name);
    let (half, wall) = (0.5 * of("wall-width"), of("wall-distance"));
    let [lower, lowest, upper] = ["lower", "lowest", "upper"].map(of);
    let bases = [
        [-half, wall, lower],
        [half, wall, lower],
        [0.0, wall, lowest],
        [half, wall, upper],
        [-half, wall, upper],
    ];
    let heights = values.list::<5>("ring-heights").unwrap_or_default();
    let leg = |(base, height): (_, f64)| {
        Leg::base(base).with(&key::EFFECTOR, &[of("ring-radius"), side(values) * height])
    };
    bases.into_iter().zip(heights).map(leg).collect()
}

/// Returns three rods from carriages on vertical rails.
pub fn linear_delta(values: &Values) -> Vec<Leg> {
    let leg = |i| {
        let of = |name: &str| on_circle(values.number(name), of_three(i));
        Leg::slider(
            at(of("base-radius"), values.number("height")),
            [0.0, 0.0, 1.0],
            at(of("platform-radius"), nose(values)),
            values.number("rod"),
            side(values),
        )
    };
    (0..3).map(leg).collect()
}

/// Returns a rod from an arm that is level at 0 and then points in a direction, in degrees; larger joint values turn it
/// down.
fn on_arm(values: &Values, base: [f64; 2], direction: f64, platform: [f64; 2]) -> Leg {
    Leg::base(at(base, values.number("height")))
        .with(&key::PLATFORM, &at(platform, nose(values)))
        .with(&key::AXIS, &at(on_circle(1.0, direction + 90.0), 0.0))
        .with(&key::ARM, &at(on_circle(values.number("arm"), direction), 0.0))
        .with(&key::ROD, &[values.number("rod")])
        // The arm whose rod leaves it away from the center.
        .with(&key::SIDE, &[0.0 - side(values)])
}

/// Returns three rods from rotating arms.
pub fn rotary_delta(values: &Values) -> Vec<Leg> {
    let leg = |i| {
        let angle = of_three(i) - 180.0;
        let [base, platform] =
            ["base-radius", "platform-radius"].map(|name| on_circle(values.number(name), angle));
        on_arm(values, base, angle, platform)
    };
    (0..3).map(leg).collect()
}

/// Returns six rods from rotating arms in pairs.
pub fn rotary_hexapod(values: &Values) -> Vec<Leg> {
    let leg = |i: usize| {
        let [base, platform] = pairs(values, i, 0.0);
        let turn = values.number("arm-turn");
        let turn = if i.is_multiple_of(2) { -turn } else { turn };
        on_arm(values, base, 120.0 * (i / 2) as f64 + turn, platform)
    };
    (0..6).map(leg).collect()
}

/// Returns two rods from rotating arms in one plane, which meet in a point.
pub fn five_bar(values: &Values) -> Vec<Leg> {
    let leg = |side: f64| {
        Leg::base([0.5 * side * values.number("axis-distance"), 0.0, nose(values)])
            .with(&key::PLATFORM, &[0.0, 0.0, nose(values)])
            .with(&key::AXIS, &[0.0, 0.0, side])
            .with(&key::ARM, &[side * values.number("arm"), 0.0, 0.0])
            .with(&key::ROD, &[values.number("rod")])
            .with(&key::SIDE, &[-1.0])
    };
    [1.0, -1.0].map(leg).to_vec()
}

/// Returns a rod from a carriage on rail -1, 0 or 1 of parallel horizontal ones; its X is that of home, with the
/// carriage at the center of its travel.
fn on_rail(values: &Values, rail: f64, platform: [f64; 3], side: f64) -> Leg {
    let [low, high] = values.list::<2>("carriage").unwrap_or_default();
    let base = [-0.5 * (low + high), rail * values.number("rail-spacing"), values.number("height")];
    Leg::slider(base, [1.0, 0.0, 0.0], platform, values.number("rod"), side)
}

/// Returns three rods from carriages on horizontal rails.
pub fn triaglide(values: &Values) -> Vec<Leg> {
    let (x, y) = (0.5 * values.number("platform-length"), 0.5 * values.number("platform-width"));
    [(-1.0, -x, -y, -1.0), (0.0, x, 0.0, 1.0), (1.0, -x, y, -1.0)]
        .map(|(rail, x, y, side)| on_rail(values, rail, [x, y, nose(values)], side))
        .to_vec()
}

/// Returns six rods from carriages on horizontal rails.
pub fn hexaglide(values: &Values) -> Vec<Leg> {
    let half = |name: &str| 0.5 * values.number(name);
    let (y, z) = (half("platform-width"), nose(values));
    let outer = (half("platform-length"), z);
    let middle = (half("middle-length"), z + side(values) * values.number("middle-rise"));
    let rails = [(-1.0, outer, -y), (0.0, middle, values.number("middle-offset")), (1.0, outer, y)];
    let legs =
        |(rail, (x, z), y)| [-1.0, 1.0].map(|side| on_rail(values, rail, [side * x, y, z], side));
    rails.map(legs).concat()
}

/// Returns six rods from carriages on vertical rails.
pub fn linapod(values: &Values) -> Vec<Leg> {
    let leg = |i| {
        let [base, platform] = pairs(values, i, 90.0);
        Leg::slider(
            at(base, values.number("height")),
            [0.0, 0.0, 1.0],
            at(platform, nose(values)),
            values.number("rod"),
            side(values),
        )
    };
    (0..6).map(leg).collect()
}

/// Returns four rods from carriages on guides that lean inward.
pub fn pyramid(values: &Values) -> Vec<Leg> {
    let of = |name: &str| values.number(name);
    let inwards = of("top-radius") - of("foot-radius");
    let leg = |i| {
        let on = |radius: f64| on_circle(radius, 90.0 * i as f64);
        Leg::slider(
            at(on(of("foot-radius")), of("height")),
            at(on(inwards), of("guide-rise")),
            at(on(of("platform-radius")), nose(values)),
            of("rod"),
            side(values),
        )
    };
    (0..4).map(leg).collect()
}

/// Returns the rods of one side of a lathe, 1 or -1, that spread along the rail.
fn spread(values: &Values, side: f64) -> [Leg; 2] {
    let half = |name: &str| 0.5 * values.number(name);
    let base = [side * half("rail-distance"), 0.0, 0.0];
    [-1.0, 1.0].map(|end| {
        let platform = [side * half("platform-width"), 0.0, end * half("platform-length")];
        Leg::slider(base, [0.0, 0.0, 1.0], platform, values.number("rod"), end)
    })
}

/// Returns four rods from carriages on two rails.
pub fn four_rod_lathe(values: &Values) -> Vec<Leg> {
    [1.0, -1.0].map(|side| spread(values, side)).concat()
}

/// Returns six rods from carriages on four rails.
pub fn six_rod_lathe(values: &Values) -> Vec<Leg> {
    let half = |name: &str| 0.5 * values.number(name);
    let of_side = |side: f64| {
        let [first, second] = spread(values, side);
        let base = [side * half("third-rail-distance"), 0.0, 0.0];
        let depth = self::side(values) * values.number("third-depth");
        let platform = [side * half("third-width"), depth, 0.0];
        let third = Leg::slider(base, [0.0, 0.0, 1.0], platform, values.number("rod"), 1.0);
        [first, second, third]
    };
    [1.0, -1.0].map(of_side).concat()
}
