// SPDX-License-Identifier: GPL-2.0-or-later
//! Random machines with constraints of the platform, whose platform is turned at home.

use kinematics::{Matrix3, Pose, Vector3};
use machine::read::ini::Ini;
use machine::read::machine::{Lenient, MachineConfig};
use machine::read::mechanism::Mechanism;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Kind of the legs, commanded letters of the platform, letters of the table, kinds of the constraints.
type Plan = (&'static str, &'static str, &'static str, &'static [Kind]);

#[derive(Clone, Copy)]
enum Kind {
    InPlane,
    Through,
    Square,
}

const PLANS: [Plan; 7] = [
    ("strut", "XYZ", "", &[Kind::Through, Kind::Through, Kind::Square]),
    ("slider", "ZAB", "XY", &[Kind::InPlane, Kind::InPlane, Kind::InPlane]),
    ("slider", "XYZ", "", &[Kind::InPlane, Kind::Through, Kind::Square]),
    ("screw", "XYZC", "", &[Kind::Square, Kind::Through]),
    ("strut", "ZAB", "XY", &[Kind::InPlane, Kind::Through, Kind::InPlane]),
    ("screw", "XZB", "Y", &[Kind::InPlane, Kind::Square, Kind::Through]),
    ("ring", "XYZ", "", &[Kind::InPlane, Kind::Through, Kind::Square]),
];

/// Machines that cover every plan.
pub const ALL: std::ops::Range<u64> = 0..PLANS.len() as u64;

/// Reach of the axes about home, mm and degrees.
const REACH: [f64; 2] = [30.0, 4.0];

/// Smallest singular value of a machine: a soft motion of one near a singularity would take seconds of simulated time to
/// decay.
const CONDITIONING: f64 = 0.2;

/// Values of the joints about home, mm.
const TRAVEL: f64 = 150.0;

/// Returns a name and the text of an INI file. The machine reaches all poses between its axis limits along a straight
/// line from home.
pub fn drawn(seed: u64) -> (String, String) {
    let name = format!("constrained-{seed}");
    let mut rng = Pcg64::seed_from_u64(6000 + seed);
    for _ in 0..10_000 {
        let machine = Draft::new(&mut rng, &PLANS[(seed % ALL.end) as usize]);
        let ini = Ini::parse(Path::new("drawn.ini"), &machine.text(&name, &[0.0; 8])).unwrap();
        let Ok(config) = MachineConfig::leniently(&ini, Some(Lenient::Constraints)) else {
            continue;
        };
        let config = config.first();
        let is_good = |pose: &[f64; 6]| {
            let at = config.machine.at(&Pose::from_degrees(*pose), &Vector3::zeros());
            at.is_ok_and(|at| at.smallest_singular_value() > CONDITIONING)
        };
        if machine.corners().iter().all(is_good) {
            let home = config.machine.inverse(&config.home_pose(), &Vector3::zeros()).unwrap();
            return (name.clone(), machine.text(&name, &home));
        }
    }
    panic!("no machine {seed}");
}

/// Returns a machine.
pub fn config(seed: u64) -> Mechanism {
    let (name, text) = drawn(seed);
    let ini = Ini::parse(&PathBuf::from(name).with_extension("ini"), &text).unwrap();
    let config = MachineConfig::leniently(&ini, Some(Lenient::Constraints)).unwrap();
    config.mechanism(1).unwrap()
}

/// Writes the INI file into a folder.
pub fn write(seed: u64, folder: &Path) -> PathBuf {
    let (name, text) = drawn(seed);
    let file = folder.join(format!("{name}.ini"));
    std::fs::write(&file, text).unwrap();
    std::fs::write(file.with_extension("tbl"), "").unwrap();
    file
}

struct Draft {
    plan: Plan,
    /// X Y Z A B C, 0 for those that follow.
    home: [f64; 6],
    sections: String,
}

impl Draft {
    fn new(rng: &mut Pcg64, plan: &Plan) -> Self {
        let (legs, commanded, table, kinds) = *plan;
        let mut full: [f64; 6] = std::array::from_fn(|k| match k {
            2 => -600.0,
            0 | 1 => rng.random_range(-40.0..40.0),
            _ => rng.random_range(-8.0..8.0),
        });
        for (k, letter) in "XYZABC".chars().enumerate() {
            // Rounded like the text in the file.
            full[k] = (full[k] * 1e3).round() / 1e3;
            match (k < 3, commanded.contains(letter)) {
                // Dependent coordinates are solved from 0 at home.
                (true, false) => full[k] /= 10.0,
                // Commanded angles are 0 at home.
                (false, true) => full[k] = 0.0,
                _ => {}
            }
        }
        let pose = Pose::from_degrees(full);
        let (point, rotation) = (pose.position, pose.rotation());
        let mut sections = String::new();
        let near =
            |rng: &mut Pcg64, size: f64| Vector3::from_fn(|_, _| rng.random_range(-size..size));
        for i in 0..6 - kinds.len() {
            let around = std::f64::consts::TAU * i as f64 / (6 - kinds.len()) as f64;
            // Crossed, so that they also hold the platform's rotation about Z.
            let twisted = around + if i % 2 == 0 { 0.6 } else { -0.6 };
            let [base, platform] = [(380.0, around), (200.0, twisted)].map(|(radius, angle)| {
                Vector3::new(angle.cos(), angle.sin(), 0.0) * radius + near(rng, 40.0)
            });
            let _ = writeln!(sections, "[LEG_{i}]\nBASE = {}", words(&base));
            let _ = match legs {
                // A ring is centered on the tool axis.
                "ring" => writeln!(sections, "EFFECTOR = 60 {}", platform.z + 80.0 * i as f64),
                _ => writeln!(sections, "PLATFORM = {}", words(&platform)),
            };
            let across = Vector3::new(-around.sin(), around.cos(), 0.0) + near(rng, 0.2);
            let _ = match legs {
                "screw" => writeln!(
                    sections,
                    "LEAD = {}\nBASE_N = {}\nPLATFORM_N = {}",
                    rng.random_range(5.0..20.0),
                    words(&across),
                    words(&-across)
                ),
                "slider" => {
                    let guide = -Vector3::z() + near(rng, 0.2);
                    writeln!(sections, "GUIDE = {}\nROD = 500\nSIDE = -1", words(&guide))
                }
                "ring" => Ok(()),
                _ => writeln!(sections, "LEAD = 0"),
            };
        }
        for (i, kind) in kinds.iter().enumerate() {
            let _ = writeln!(sections, "[CONSTRAINT_{i}]");
            let (b, axis) = (near(rng, 150.0), near(rng, 1.0).normalize());
            let _ = match kind {
                Kind::InPlane => {
                    let base = point + rotation * b + across(rng, &axis) * 200.0;
                    let [b, base, axis] = [b, base, axis].map(|v| words(&v));
                    writeln!(
                        sections,
                        "KIND = point-in-plane\nPLATFORM = {b}\nBASE = {base}\nNORMAL = {axis}"
                    )
                }
                Kind::Through => {
                    let base = point + rotation * (b + across(rng, &axis) * 500.0);
                    let [b, base, axis] = [b, base, axis].map(|v| words(&v));
                    writeln!(
                        sections,
                        "KIND = plane-through-point\nPLATFORM = {b}\nNORMAL = {axis}\nBASE = {base}"
                    )
                }
                Kind::Square => {
                    let [axis, base] = [axis, rotation * across(rng, &axis)].map(|v| words(&v));
                    writeln!(sections, "KIND = square\nPLATFORM_AXIS = {axis}\nBASE_AXIS = {base}")
                }
            };
        }
        let both = commanded.to_owned() + table;
        let home = std::array::from_fn(|k| {
            if both.contains(['X', 'Y', 'Z', 'A', 'B', 'C'][k]) { full[k] } else { 0.0 }
        });
        Self { plan: *plan, home, sections }
    }

    /// Returns the letters of LinuxCNC's pose.
    fn letters(&self) -> impl Iterator<Item = (usize, char)> {
        let (_, commanded, table, _) = self.plan;
        let both = commanded.to_owned() + table;
        "XYZABC".chars().enumerate().filter(move |(_, letter)| both.contains(*letter))
    }

    fn corners(&self) -> Vec<[f64; 6]> {
        let letters: Vec<usize> = self.letters().map(|(k, _)| k).collect();
        let corner = |n: u32| {
            let mut pose = self.home;
            for (bit, k) in letters.iter().enumerate() {
                let side = if n >> bit & 1 == 0 { -1.0 } else { 1.0 };
                pose[*k] += side * REACH[k / 3];
            }
            pose
        };
        (0..1 << letters.len()).map(corner).collect()
    }

    fn text(&self, name: &str, joints: &[f64]) -> String {
        let (legs, commanded, table, kinds) = self.plan;
        let count = 6 - kinds.len() + table.len();
        let kind = if legs == "screw" { "strut" } else { legs };
        let letters: String = self.letters().map(|(_, letter)| letter).collect();
        let mut text = format!(
            "# Drawn at random, for tests.\n[EMC]\nVERSION = 1.1\nMACHINE = {name}\n[DISPLAY]\nDISPLAY = axis\n\
             [EMCMOT]\nEMCMOT = motmod\nSERVO_PERIOD = 1000000\n[TASK]\nTASK = milltask\nCYCLE_TIME = 0.002\n\
             [EMCIO]\nEMCIO = io\nCYCLE_TIME = 0.050\nTOOL_TABLE = {name}.tbl\n\
             [HAL]\nHALFILE = LIB:pkmkins_sim.tcl\nHALFILE = LIB:pkmkins.tcl\n\
             [KINS]\nKINEMATICS = pkmkins legs={kind}:{} coordinates={commanded} {} constraints={}\nJOINTS = {count}\n\
             [TRAJ]\nCOORDINATES = {letters}\nHOME = {}\nLINEAR_UNITS = mm\nANGULAR_UNITS = degree\n\
             MAX_LINEAR_VELOCITY = 50\nMAX_ANGULAR_VELOCITY = 20\nMAX_LINEAR_ACCELERATION = 200\n\
             MAX_ANGULAR_ACCELERATION = 100\n[PKM]\nTOOL_DIRECTION = down\n",
            6 - kinds.len(),
            if table.is_empty() { String::new() } else { format!("table={table}") },
            kinds.len(),
            self.home.map(|value| value.to_string()).join(" "),
        );
        text += &self.sections;
        for (n, home) in joints.iter().enumerate().take(count) {
            let _ = writeln!(
                text,
                "[JOINT_{n}]\nTYPE = LINEAR\nHOME = {home}\nMIN_LIMIT = {}\nMAX_LIMIT = {}\nMAX_VELOCITY = 300\n\
                 MAX_ACCELERATION = 3000\nFERROR = 2\nMIN_FERROR = 0.5\nHOME_ABSOLUTE_ENCODER = 2\nHOME_OFFSET = 0\n\
                 HOME_SEARCH_VEL = 0\nHOME_LATCH_VEL = 0\nHOME_SEQUENCE = 0",
                home - TRAVEL,
                home + TRAVEL
            );
        }
        for (k, letter) in self.letters() {
            let (kind, reach) = if k < 3 { ("LINEAR", REACH[0]) } else { ("ANGULAR", REACH[1]) };
            let _ = writeln!(
                text,
                "[AXIS_{letter}]\nTYPE = {kind}\nMIN_LIMIT = {}\nMAX_LIMIT = {}\nMAX_VELOCITY = 50\n\
                 MAX_ACCELERATION = 200",
                self.home[k] - reach,
                self.home[k] + reach
            );
        }
        text
    }
}

/// Draws a unit vector across an axis.
fn across(rng: &mut Pcg64, axis: &Vector3<f64>) -> Vector3<f64> {
    let other = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
    (Matrix3::identity() - axis * axis.transpose()) * other.normalize()
}

fn words(values: &Vector3<f64>) -> String {
    values.iter().map(f64::to_string).collect::<Vec<_>>().join(" ")
}
