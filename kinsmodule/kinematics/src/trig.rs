// SPDX-License-Identifier: GPL-2.0-or-later
//! Sines, cosines and arcs of mostly small angles, two at once: faster than libm's.

use crate::lanes::both;
use core::f64::consts::{FRAC_2_PI, FRAC_PI_2, FRAC_PI_4, PI};
use libm::atan2;
use wide::f64x2;

/// Radians in a degree.
pub(crate) const RADIANS: f64 = PI / 180.0;

/// Degrees in a radian.
pub(crate) const DEGREES: f64 = 180.0 / PI;

/// Largest angle accepted, in degrees: beyond it argument reduction becomes slow and angles lose
/// precision.
pub(crate) const MAX_ANGLE_DEG: f64 = 1e6;

/// Below this ratio of sine to cosine the arc is a short series: the first omitted term,
/// t¹³/13, is less than half a unit in the last place.
const SHORT: f64 = 0.03;

/// Computes atan2 for directions mostly near (0, 1), where a short series is faster.
pub(crate) fn arc(sine: f64, cosine: f64) -> f64 {
    // Also for (0, 0), whose quotient is undefined.
    if !(sine.abs() < SHORT * cosine) {
        return atan2(sine, cosine);
    }
    short_arc(both(sine / cosine)).to_array()[0]
}

/// Computes atan2 of two directions mostly near (0, 1).
#[inline(always)]
pub(crate) fn arcs(sine: f64x2, cosine: f64x2) -> f64x2 {
    if !sine.abs().simd_lt(both(SHORT) * cosine).all() {
        return arcs_all_around(sine, cosine);
    }
    short_arc(sine / cosine)
}

/// tan of half the angle up to which [`broad_arcs`] needs one polynomial: 47.3°.
const BROAD: f64 = 7.0 / 16.0;

const TAN_22_5: f64 = core::f64::consts::SQRT_2 - 1.0;

/// Computes atan2 of two directions that are mostly within 47° of (0, 1).
#[inline(always)]
pub(crate) fn broad_arcs(sine: f64x2, cosine: f64x2) -> f64x2 {
    let (arcs, known) = arcs_by_half(sine, cosine);
    if known.all() { arcs } else { arcs_all_around(sine, cosine) }
}

/// Computes atan2 of any two directions, from the nearest of 0°, 45° and 90° to their first octants.
///
/// Uses only sums, products and quotients, so that every processor computes the same bits: the function
/// in `wide` uses fused multiply-add if the processor has it.
#[inline(always)]
pub(crate) fn arcs_all_around(sine: f64x2, cosine: f64x2) -> f64x2 {
    let (rise, run) = (sine.abs(), cosine.abs());
    let steep = rise.simd_gt(run);
    let (less, more) = (steep.select(run, rise), steep.select(rise, run));
    let level = less.simd_le(both(TAN_22_5) * more);
    let tangent = level.select(less, less - more) / level.select(more, less + more);
    // A zero vector has no direction; its angle is 0.
    let tangent = more.simd_eq(both(0.0)).select(both(0.0), tangent);
    let to_less = level.select(both(0.0), both(FRAC_PI_4)) + both(0.5) * twice_arcs(tangent);
    let first = steep.select(both(FRAC_PI_2) - to_less, to_less);
    let behind = cosine.simd_lt(both(0.0));
    behind.select(both(PI) - first, first).copysign(sine)
}

/// Computes atan2 of any direction.
#[inline(always)]
pub(crate) fn arc_all_around(sine: f64, cosine: f64) -> f64 {
    arcs_all_around(both(sine), both(cosine)).to_array()[0]
}

/// Computes atan2 of two directions within 47° of (0, 1) from half their angle, and a mask of those for
/// which the result is valid.
#[inline(always)]
pub(crate) fn arcs_by_half(sine: f64x2, cosine: f64x2) -> (f64x2, f64x2) {
    let square = sine * sine + cosine * cosine;
    let base = cosine + square.sqrt();
    // Squares that underflow or overflow give no length; for half a turn the base is 0.
    let known = square.simd_ge(both(1e-280))
        & square.simd_le(both(1e300))
        & sine.abs().simd_lt(both(BROAD) * base);
    let t = sine / base;
    (twice_arcs(t), known)
}

/// Computes twice the arcs with these tangents, up to [`BROAD`].
///
/// The polynomial is that of FreeBSD's msun (s_atan.c), which libm also uses; the results
/// differ by a few units in the last place.
#[inline(always)]
fn twice_arcs(t: f64x2) -> f64x2 {
    const ARC: [f64; 11] = [
        3.333_333_333_333_293e-1,
        -1.999_999_999_987_648_3e-1,
        1.428_571_427_250_346_6e-1,
        -1.111_111_040_546_235_6e-1,
        9.090_887_133_436_507e-2,
        -7.691_876_205_044_83e-2,
        6.661_073_137_387_531e-2,
        -5.833_570_133_790_573_5e-2,
        4.976_877_994_615_932_4e-2,
        -3.653_157_274_421_691_6e-2,
        1.628_582_011_536_578_2e-2,
    ];
    let z = t * t;
    let [a, b, c, d, e, f, g, h, i, j, k] = ARC.map(both);
    let second = z * z;
    let low = (a + b * z) + second * (c + d * z);
    let middle = (e + f * z) + second * (g + h * z);
    let high = (i + j * z) + second * k;
    let fourth = second * second;
    let twice = t + t;
    twice - twice * z * (low + fourth * (middle + fourth * high))
}

#[inline(always)]
fn short_arc(t: f64x2) -> f64x2 {
    let u = t * t;
    let square = u * u;
    let middle = both(1.0 / 7.0) - u * both(1.0 / 9.0) + square * both(1.0 / 11.0);
    let tail = both(1.0 / 3.0) - u * both(1.0 / 5.0) + square * middle;
    t - t * u * tail
}

/// Terms of the sine, x + x³ (t₀ + t₁ x² + …), and of the cosine, 1 − x²/2 + x⁴ (t₀ + …), for
/// angles up to π/4, from FreeBSD's msun (k_sin.c, k_cos.c), which libm also uses.
const TERMS: [[f64; 2]; 6] = [
    [-1.666_666_666_666_663_2e-1, 4.166_666_666_666_66e-2],
    [8.333_333_333_322_49e-3, -1.388_888_888_887_411e-3],
    [-1.984_126_982_985_795e-4, 2.480_158_728_947_673e-5],
    [2.755_731_370_707_006_8e-6, -2.755_731_435_139_066_3e-7],
    [-2.505_076_025_340_686_3e-8, 2.087_572_321_298_175e-9],
    [1.589_690_995_211_55e-10, -1.135_964_755_778_819_5e-11],
];

/// Computes sines and cosines of two angles up to π/4, to about one unit in the last place, at half the
/// cost of two calls of libm. The sine of −0 is +0.
#[inline(always)]
pub(crate) fn short_sincos(x: f64x2) -> (f64x2, f64x2) {
    let z = x * x;
    let sine = z * x * polynomial(TERMS.map(|[sine, _]| both(sine)), z);
    let cosine = z * z * polynomial(TERMS.map(|[_, cosine]| both(cosine)), z);
    (x + sine, both(1.0) + (cosine - both(0.5) * z))
}

/// Computes sine and cosine of one angle, side by side.
#[inline(always)]
pub(crate) fn short_sincos_of_one(x: f64) -> f64x2 {
    let z = both(x * x);
    let [square, _] = z.to_array();
    let tail = z * f64x2::new([x, square]) * polynomial(TERMS.map(f64x2::new), z);
    f64x2::new([x, 1.0]) + (tail - f64x2::new([0.0, 0.5]) * z)
}

/// Angles up to which [`sincos`] subtracts quarter turns itself, in radians: products of up to 2²⁰ of them and
/// the first two parts of [`QUARTER`] are exact.
const FAR: f64 = 2e4;

const _: () = assert!(MAX_ANGLE_DEG * RADIANS < FAR && FAR < FRAC_PI_2 * (1 << 20) as f64);

/// π/2 in three parts, the first two of at most 33 bits (FreeBSD's e_rem_pio2.c, which libm also uses).
const QUARTER: [f64; 3] =
    [1.570_796_326_734_125_6, 6.077_100_506_303_966e-11, 2.022_266_248_795_950_6e-21];

/// Adding this to a number leaves its nearest whole number in the last bits.
const WHOLE: f64 = 1.5 * (1_u64 << 52) as f64;

/// Computes sines and cosines of any two angles, within [`FAR`] to about two units in the last place, at seven
/// tenths of the cost of two calls of libm, which computes both if one is beyond.
#[inline(always)]
pub(crate) fn sincos(x: f64x2) -> (f64x2, f64x2) {
    // The same bits as below, without computing quarter turns.
    if x.abs().simd_le(both(FRAC_PI_4)).all() {
        return short_sincos(x);
    }
    if !x.abs().simd_le(both(FAR)).all() {
        let [(s0, c0), (s1, c1)] = x.to_array().map(libm::sincos);
        return (f64x2::new([s0, s1]), f64x2::new([c0, c1]));
    }
    let (rest, quarters) = within_an_octant(x);
    let (sines, cosines) = short_sincos(rest);
    let (s, c, n) = (sines.to_array(), cosines.to_array(), quarters.to_array());
    let ([s0, c0], [s1, c1]) = (turned([s[0], c[0]], n[0]), turned([s[1], c[1]], n[1]));
    (f64x2::new([s0, s1]), f64x2::new([c0, c1]))
}

/// Computes sine and cosine of any angle.
#[inline(always)]
pub(crate) fn sincos_of_one(x: f64) -> [f64; 2] {
    if x.abs() <= FRAC_PI_4 {
        return short_sincos_of_one(x).to_array();
    }
    if !(x.abs() <= FAR) {
        return libm::sincos(x).into();
    }
    let (rest, quarters) = within_an_octant(both(x));
    turned(short_sincos_of_one(rest.to_array()[0]).to_array(), quarters.to_array()[0])
}

/// Reduces angles by whole quarter turns, and returns the number of these in the last bits.
#[inline(always)]
fn within_an_octant(x: f64x2) -> (f64x2, f64x2) {
    let quarters = x * both(FRAC_2_PI) + both(WHOLE);
    let n = quarters - both(WHOLE);
    let [a, b, c] = QUARTER.map(both);
    (((x - n * a) - n * b) - n * c, quarters)
}

/// Returns sine and cosine after so many more quarter turns.
#[inline(always)]
fn turned([sine, cosine]: [f64; 2], quarters: f64) -> [f64; 2] {
    let n = quarters.to_bits();
    let [s, c] = if n & 1 == 0 { [sine, cosine] } else { [cosine, sine] };
    // Bit 1 of n, and of n + 1, is the sign.
    let signed = |value: f64, n: u64| f64::from_bits(value.to_bits() ^ (n & 2) << 62);
    [signed(s, n), signed(c, n + 1)]
}

/// Computes the sum of t_k z^k, in pairs of terms to shorten the dependency chain.
#[inline(always)]
fn polynomial([a, b, c, d, e, f]: [f64x2; 6], z: f64x2) -> f64x2 {
    let square = z * z;
    (a + b * z) + square * ((c + d * z) + square * (e + f * z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arcs_are_those_of_libm_to_two_roundings_within_and_beyond_the_series() {
        for k in -400..=400 {
            // Ratios up to a third beyond the end of the series, in either direction.
            let (sine, cosine) = (1e-4 * f64::from(k) * 3.0, 3.0);
            for (sine, cosine) in [(sine, cosine), (sine, -cosine), (cosine, sine)] {
                let exact = atan2(sine, cosine);
                let near = |got: f64, exact: f64| {
                    assert!((got - exact).abs() <= 2.0 * f64::EPSILON * exact.abs(), "{got}");
                };
                near(arc(sine, cosine), exact);
                let [one, other] = arcs(both(sine), f64x2::new([cosine, 3.0])).to_array();
                near(one, exact);
                near(other, atan2(sine, 3.0));
            }
        }
    }

    #[test]
    fn broad_arcs_are_those_of_libm_all_around_and_for_lengths_whose_squares_vanish() {
        let near = |sine: f64, cosine: f64| {
            let [one, other] = broad_arcs(both(sine), f64x2::new([cosine, cosine])).to_array();
            let exact = atan2(sine, cosine);
            // Two roundings each of length, base and quotient, and that of the polynomial.
            let allowed = 4.0 * f64::EPSILON * exact.abs();
            assert!((one - exact).abs() <= allowed && one == other, "{sine} {cosine}: {one}");
        };
        for k in -1000..=1000 {
            let (sine, cosine) = libm::sincos(f64::from(k) * 3.1415e-3);
            for length in [1.0, 1e6, 1e-6, 1e150, 1e-140, 1e-155, 1e-160, 1e-200, 1e155] {
                near(sine * length, cosine * length);
            }
        }
        for sine in [0.0, -0.0] {
            near(sine, 1.0);
            near(sine, -1.0);
            near(sine, 0.0);
        }
        // Neither lane affects the other.
        let apart = broad_arcs(f64x2::new([0.1, 2.0]), f64x2::new([1.0, -1.0])).to_array();
        assert!((apart[0] - atan2(0.1, 1.0)).abs() < 1e-16 && apart[1] == atan2(2.0, -1.0));
        assert!(broad_arcs(both(f64::NAN), both(1.0)).to_array()[0].is_nan());
    }

    #[test]
    fn sines_and_cosines_are_those_of_libm_to_a_unit_in_the_last_place() {
        for k in -1000..=1000 {
            let angle = FRAC_PI_4 * f64::from(k) / 1000.0;
            let (sines, cosines) = short_sincos(f64x2::new([angle, -0.5 * angle]));
            for (angle, (sine, cosine)) in [angle, -0.5 * angle]
                .into_iter()
                .zip(sines.to_array().into_iter().zip(cosines.to_array()))
            {
                let (exact_sine, exact_cosine) = libm::sincos(angle);
                let unit = |value: f64| value.abs() * f64::EPSILON;
                assert!((sine - exact_sine).abs() <= unit(exact_sine), "{angle}");
                assert!((cosine - exact_cosine).abs() <= unit(exact_cosine), "{angle}");
                assert_eq!(short_sincos_of_one(angle).to_array(), [sine, cosine]);
            }
        }
    }

    #[test]
    fn sines_and_cosines_of_any_angle_are_those_of_libm() {
        let near = |angle: f64| {
            let (sines, cosines) = sincos(f64x2::new([angle, -0.3 * angle]));
            let within = angle.abs() <= FAR;
            for (lane, angle) in [angle, -0.3 * angle].into_iter().enumerate() {
                let found = [sines.to_array()[lane], cosines.to_array()[lane]];
                let (sine, cosine) = libm::sincos(angle);
                for (found, exact) in found.into_iter().zip([sine, cosine]) {
                    // Two roundings of the angle within its octant, and those of the polynomial.
                    assert!((found - exact).abs() <= 2.0 * f64::EPSILON * exact.abs(), "{angle}");
                }
                // If one of two angles is beyond, libm computes both.
                if within || angle.abs() > FAR {
                    assert_eq!(sincos_of_one(angle), found, "{angle}");
                }
            }
        };
        for k in -20_000..=20_000 {
            let k = f64::from(k);
            // Of every size, whole quarter turns and eighths, and the two numbers next to them.
            let eighths = [k * FRAC_PI_4, (k * FRAC_PI_4).next_up(), (k * FRAC_PI_4).next_down()];
            for angle in [k * 1e-3, k * 0.9, k * k * k * 1e-9].into_iter().chain(eighths) {
                near(angle);
            }
        }
        // Beyond the range of the reduction, in one lane and in both.
        for angle in [1.9e4, 6e4, 1e9, -1e300] {
            near(angle);
        }
        for angle in [f64::NAN, f64::INFINITY] {
            let (sines, _) = sincos(f64x2::new([1.0, angle]));
            assert!(sines.to_array()[1].is_nan() && sincos_of_one(angle)[1].is_nan());
        }
    }
}
