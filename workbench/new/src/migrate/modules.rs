// SPDX-License-Identifier: GPL-2.0-or-later
//! LinuxCNC's kinematics modules for parallel machines: their pins, and the legs that these describe.
//!
//! Formulas and defaults are those of LinuxCNC 2.9; tests/module/abi compares joints and defaults with its modules.

use crate::anchors::Leg;
use keys::leg as key;
use std::collections::BTreeMap;

/// Values of a module's pins by their names without the module's prefix.
pub type Pins = BTreeMap<String, f64>;

/// A kinematics module of LinuxCNC.
#[derive(Clone, Copy, Debug)]
pub struct PeerModule {
    pub name: &'static str,
    /// Name of the kind in [`crate::kinds::KINDS`].
    pub kind: &'static str,
    /// Name of the parameter with the range of the drives.
    pub range: &'static str,
    pub legs: usize,
    /// Letters that the legs move.
    pub letters: &'static str,
    /// Letters that the module passes on to the joints after those of the legs, in order.
    pub passes: &'static str,
    /// Geometry pins with their defaults.
    pub defaults: fn() -> Pins,
    /// Pins that do not describe the geometry.
    pub others: &'static [&'static str],
    pub build: fn(&Pins) -> Vec<Leg>,
    /// Whether joint values determine one pose, with the platform on the module's side.
    pub is_one_to_one: bool,
}

pub const PEERS: [PeerModule; 5] = [
    PeerModule {
        name: "genhexkins",
        kind: "hexapod",
        range: "strut",
        legs: 6,
        letters: "XYZABC",
        passes: "",
        defaults: genhexkins,
        others: &[
            "max-error",
            "convergence-criterion",
            "limit-iterations",
            "max-iterations",
            "last-iterations",
            "fwd-kins-fail",
        ],
        build: hexapod,
        is_one_to_one: false,
    },
    PeerModule {
        name: "lineardeltakins",
        kind: "linear-delta",
        range: "carriage",
        legs: 3,
        letters: "XYZ",
        passes: "ABCUVW",
        defaults: || pins(&[("R", 130.25), ("L", 269.0)]),
        others: &[],
        build: linear_delta,
        is_one_to_one: true,
    },
    PeerModule {
        name: "rotarydeltakins",
        kind: "rotary-delta",
        range: "angle",
        legs: 3,
        letters: "XYZ",
        passes: "ABCUVW",
        defaults: || {
            pins(&[
                ("platformradius", 10.0),
                ("thighlength", 10.0),
                ("shinlength", 14.0),
                ("footradius", 6.0),
            ])
        },
        others: &[],
        build: rotary_delta,
        is_one_to_one: true,
    },
    PeerModule {
        name: "tripodkins",
        kind: "tripod",
        range: "strut",
        legs: 3,
        letters: "XYZ",
        passes: "",
        defaults: || pins(&[("Bx", 1.0), ("Cx", 1.0), ("Cy", 1.0)]),
        others: &[],
        build: tripod,
        is_one_to_one: true,
    },
    PeerModule {
        name: "pentakins",
        kind: "pentapod",
        range: "strut",
        legs: 5,
        letters: "XYZAB",
        passes: "",
        defaults: pentakins,
        others: &[
            "max-error",
            "convergence-criterion",
            "limit-iterations",
            "max-iterations",
            "last-iterations",
        ],
        build: pentapod,
        is_one_to_one: false,
    },
];

const XYZ: [&str; 3] = ["x", "y", "z"];

fn pins(values: &[(&str, f64)]) -> Pins {
    values.iter().map(|(name, value)| ((*name).into(), *value)).collect()
}

fn genhexkins() -> Pins {
    const BASE: [[f64; 3]; 6] = [
        [-22.95, 13.25, 0.0],
        [22.95, 13.25, 0.0],
        [22.95, 13.25, 0.0],
        [0.0, -26.5, 0.0],
        [0.0, -26.5, 0.0],
        [-22.95, 13.25, 0.0],
    ];
    const PLATFORM: [[f64; 3]; 6] = [
        [-1.0, 11.5, 0.0],
        [1.0, 11.5, 0.0],
        [10.459, -4.884, 0.0],
        [9.459, -6.616, 0.0],
        [-9.459, -6.616, 0.0],
        [-10.459, -4.884, 0.0],
    ];
    #[expect(clippy::approx_constant, reason = "the module has six digits")]
    const HALF: f64 = 0.707_107;
    const BASE_N: [[f64; 3]; 6] = [
        [HALF, 0.0, HALF],
        [0.0, -HALF, HALF],
        [-HALF, 0.0, HALF],
        [-HALF, 0.0, HALF],
        [0.0, HALF, HALF],
        [HALF, 0.0, HALF],
    ];
    const PLATFORM_N: [[f64; 3]; 6] = [
        [-1.0, 0.0, 0.0],
        [0.866_025, 0.5, 0.0],
        [0.866_025, 0.5, 0.0],
        [0.866_025, -0.5, 0.0],
        [0.866_025, -0.5, 0.0],
        [-1.0, 0.0, 0.0],
    ];
    let mut pins = pins(&[("screw-lead", 0.0), ("spindle-offset", 0.0), ("tool-offset", 0.0)]);
    for (name, table) in
        [("base", BASE), ("platform", PLATFORM), ("base-n", BASE_N), ("platform-n", PLATFORM_N)]
    {
        for (n, vector) in table.into_iter().enumerate() {
            for (axis, value) in XYZ.into_iter().zip(vector) {
                pins.insert(format!("{name}.{n}.{axis}"), value);
            }
        }
    }
    pins
}

fn pentakins() -> Pins {
    const BASE: [[f64; 3]; 5] = [
        [-418.03, 324.56, 895.56],
        [417.96, 324.56, 895.56],
        [-418.03, -325.44, 895.56],
        [417.96, -325.44, 895.56],
        [-0.06, -492.96, 895.56],
    ];
    const HEIGHTS: [f64; 5] = [-185.5, -159.5, -67.5, -41.5, -14.0];
    let mut pins = pins(&[("tool-offset", 0.0)]);
    for (n, (base, height)) in BASE.into_iter().zip(HEIGHTS).enumerate() {
        for (axis, value) in XYZ.into_iter().zip(base) {
            pins.insert(format!("base.{n}.{axis}"), value);
        }
        pins.insert(format!("effector.{n}.r"), 80.32);
        pins.insert(format!("effector.{n}.z"), height);
    }
    pins
}

fn vector(pins: &Pins, name: &str, leg: usize) -> [f64; 3] {
    XYZ.map(|axis| pins[&format!("{name}.{leg}.{axis}")])
}

fn hexapod(pins: &Pins) -> Vec<Leg> {
    let leg = |n| {
        let of = |name: &str| vector(pins, name, n);
        let leg = Leg::base(of("base")).with(&key::PLATFORM, &of("platform"));
        // Without a lead the axes have no effect.
        match pins["screw-lead"] {
            0.0 => leg,
            _ => leg.with(&key::BASE_N, &of("base-n")).with(&key::PLATFORM_N, &of("platform-n")),
        }
    };
    (0..6).map(leg).collect()
}

/// Returns the directions of three legs a third of a turn apart, the first along Y or against it.
fn spokes(first: f64) -> [[f64; 2]; 3] {
    let far = 0.75_f64.sqrt();
    [[0.0, first], [-far * first, -0.5 * first], [far * first, -0.5 * first]]
}

fn linear_delta(pins: &Pins) -> Vec<Leg> {
    let leg = |[x, y]: [f64; 2]| {
        let base = [pins["R"] * x, pins["R"] * y, 0.0];
        Leg::slider(base, [0.0, 0.0, 1.0], [0.0; 3], pins["L"], 1.0)
    };
    spokes(1.0).map(leg).to_vec()
}

fn rotary_delta(pins: &Pins) -> Vec<Leg> {
    let leg = |[x, y]: [f64; 2]| {
        let along = |name: &str| [pins[name] * x, pins[name] * y, 0.0];
        Leg::base(along("platformradius"))
            .with(&key::PLATFORM, &along("footradius"))
            .with(&key::AXIS, &[0.0 - y, x, 0.0])
            .with(&key::ARM, &along("thighlength"))
            .with(&key::ROD, &[pins["shinlength"]])
            .with(&key::SIDE, &[-1.0])
    };
    spokes(-1.0).map(leg).to_vec()
}

fn tripod(pins: &Pins) -> Vec<Leg> {
    let leg = |base| Leg::base(base).with(&key::PLATFORM, &[0.0; 3]);
    let [bx, cx, cy] = ["Bx", "Cx", "Cy"].map(|name| pins[name]);
    [[0.0; 3], [bx, 0.0, 0.0], [cx, cy, 0.0]].map(leg).to_vec()
}

fn pentapod(pins: &Pins) -> Vec<Leg> {
    let leg = |n| {
        let ring = ["r", "z"].map(|part| pins[&format!("effector.{n}.{part}")]);
        Leg::base(vector(pins, "base", n)).with(&key::EFFECTOR, &ring)
    };
    (0..5).map(leg).collect()
}
