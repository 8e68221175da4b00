// SPDX-License-Identifier: GPL-2.0-or-later
//! Typical tool paths: programs, subroutines and remapped codes make the same moves, and
//! every machine can run those suitable for it.

use linuxcnc::process::Options;
use machine::read::machine::MachineConfig;
use machine::read::mechanism::Mechanism;
use paths::file::PathFile;
use paths::job::{Job, job};
use paths::route::route;
use program::motion::{Move, MoveKind, moves};
use program::preflight::{judge, preflight};
use serde::Deserialize;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use tempfile::TempDir;
use test_support::shipped::{MACHINES, config, folder, ini, root, unchained};

#[derive(Deserialize)]
struct Golden {
    lathe_circle: Vec<[f64; 5]>,
    zigzag: [f64; 2],
}

static GOLDEN: LazyLock<Golden> =
    LazyLock::new(|| toml::from_str(include_str!("cutting_path.toml")).unwrap());

/// An operation, and two ways to call it: as a subroutine, and as a G-code in its plane.
pub struct Typical {
    machine: &'static str,
    zero: [f64; 3],
    operation: &'static str,
    pub call: &'static str,
    code: &'static str,
}

const PYRAMID: [f64; 3] = [0.0, 0.0, 220.0];

const LATHE: [f64; 3] = [0.0, 450.0, 1000.0];

pub const TYPICAL: [Typical; 16] = [
    Typical {
        machine: "pyramid",
        zero: PYRAMID,
        operation: "kind = 'zigzag'\nstart_mm = [-30, -20]\nlength_mm = 60\nwidth_mm = 40\nstep_mm = 6\n\
                    level_mm = -1\nclear_mm = 5\nfeed_mm_per_min = 900",
        call: "o<pkm_zigzag> call [17] [-30] [-20] [60] [40] [6] [-1] [5] [900]",
        code: "G22.1 X-30 Y-20 Z-1 I60 J40 Q6 R5 F900",
    },
    Typical {
        machine: "four-rod-lathe",
        zero: LATHE,
        operation: "kind = 'zigzag'\nplane = 'yz'\nstart_mm = [20, 30]\nlength_mm = -33\nwidth_mm = -20\n\
                    step_mm = 7\nlevel_mm = 12\nclear_mm = 15\nfeed_mm_per_min = 900",
        call: "o<pkm_zigzag> call [19] [20] [30] [-33] [-20] [7] [12] [15] [900]",
        code: "G19 G22.1 X12 Y20 Z30 I-33 J-20 Q7 R15 F900",
    },
    Typical {
        machine: "four-rod-lathe",
        zero: LATHE,
        operation: "kind = 'loop'\nplane = 'yz'\nstart_mm = [15, -8]\nlength_mm = -30\nwidth_mm = -32\n\
                    step_mm = 5\nlevel_mm = -3\nclear_mm = 3\nfeed_mm_per_min = 900",
        call: "o<pkm_loop> call [19] [15] [-8] [-30] [-32] [5] [-3] [3] [900]",
        code: "G19 G22.2 X-3 Y15 Z-8 I-30 J-32 Q5 R3 F900",
    },
    Typical {
        machine: "hexapod",
        zero: [0.0, 0.0, 250.0],
        operation: "kind = 'box-pocket'\nstart_mm = [-12, -10]\nlength_mm = 25\nwidth_mm = 20\nstep_mm = 4\n\
                    level_mm = -3\nclear_mm = 2\nfeed_mm_per_min = 900",
        call: "o<pkm_box_pocket> call [17] [-12] [-10] [25] [20] [4] [-3] [2] [900]",
        code: "G22.3 X-12 Y-10 Z-3 I25 J20 Q4 R2 F900",
    },
    Typical {
        machine: "four-rod-lathe",
        zero: LATHE,
        operation: "kind = 'circle'\nplane = 'zx'\ncentre_mm = [3, -2]\nradius_mm = 20\nlevel_mm = 1\n\
                    clear_mm = 4\nclockwise = true\nfeed_mm_per_min = 900",
        call: "o<pkm_circle> call [18] [3] [-2] [20] [1] [4] [2] [900]",
        code: "G18 G22.4 X-2 Y1 Z3 I20 J2 R4 F900",
    },
    Typical {
        machine: "six-rod-lathe",
        zero: LATHE,
        operation: "kind = 'circle'\nplane = 'yz'\ncentre_mm = [3, -2]\nradius_mm = 20\nlevel_mm = 1\n\
                    clear_mm = 4\nfeed_mm_per_min = 900",
        call: "o<pkm_circle> call [19] [3] [-2] [20] [1] [4] [3] [900]",
        code: "G19 G22.4 X1 Y3 Z-2 I20 J3 R4 F900",
    },
    Typical {
        machine: "pyramid",
        zero: PYRAMID,
        operation: "kind = 'pocket'\ncentre_mm = [5, -5]\nradius_mm = 21\nstep_mm = 4\nlevel_mm = -3\n\
                    clear_mm = 4\nfeed_mm_per_min = 900",
        call: "o<pkm_pocket> call [17] [5] [-5] [21] [4] [-3] [4] [900] [0.01]",
        code: "G22.5 X5 Y-5 Z-3 I21 Q4 R4 F900 D0.01",
    },
    Typical {
        machine: "pyramid",
        zero: PYRAMID,
        operation: "kind = 'spiral'\ncentre_mm = [5, -5]\ngrowth_mm = 4\nturns = 3.5\nlevel_mm = -3\n\
                    clear_mm = 4\nfeed_mm_per_min = 900",
        call: "o<pkm_spiral> call [17] [5] [-5] [4] [3.5] [-3] [4] [900] [0.01]",
        code: "G22.6 X5 Y-5 Z-3 Q4 J3.5 R4 F900 D0.01",
    },
    Typical {
        machine: "pyramid",
        zero: PYRAMID,
        operation: "kind = 'helix'\ncentre_mm = [5, -5]\nradius_mm = 15\npitch_mm = -2\nturns = 3\n\
                    level_mm = 0\nclear_mm = 4\nfeed_mm_per_min = 900",
        call: "o<pkm_helix> call [17] [5] [-5] [15] [0] [-2] [3] [0] [4] [900] [0.01]",
        code: "G22.7 X5 Y-5 Z0 I15 K0 Q-2 J3 R4 F900 D0.01",
    },
    Typical {
        machine: "four-rod-lathe",
        zero: LATHE,
        operation: "kind = 'helix'\nplane = 'yz'\ncentre_mm = [5, -5]\nradius_mm = 15\nshrink_mm = 4\n\
                    pitch_mm = -2\nturns = 2.75\nlevel_mm = 0\nclear_mm = 4\nfeed_mm_per_min = 900",
        call: "o<pkm_helix> call [19] [5] [-5] [15] [4] [-2] [2.75] [0] [4] [900] [0.01]",
        code: "G19 G22.7 X0 Y5 Z-5 I15 K4 Q-2 J2.75 R4 F900 D0.01",
    },
    Typical {
        machine: "four-rod-lathe",
        zero: LATHE,
        operation: "kind = 'turn'\nfrom_mm = 30\nto_mm = 14\nface_mm = 0\nshoulder_mm = -25\nfillet_mm = 2\n\
                    cut_mm = 3\nspare_mm = 0.5\nfeed_mm_per_min = 900",
        call: "o<pkm_turn> call [30] [14] [0] [-25] [2] [3] [0.5] [900]",
        code: "G23.1 X14 Z-25 I30 K0 J2 Q3 D0.5 F900",
    },
    Typical {
        machine: "four-rod-lathe",
        zero: LATHE,
        operation: "kind = 'turn'\nfrom_mm = 30\nto_mm = 28\nface_mm = -5\nshoulder_mm = -25\n\
                    cut_mm = 3\nfeed_mm_per_min = 900",
        call: "o<pkm_turn> call [30] [28] [-5] [-25] [0] [3] [0] [900]",
        code: "G23.1 X28 Z-25 I30 K-5 J0 Q3 D0 F900",
    },
    Typical {
        machine: "six-rod-lathe",
        zero: LATHE,
        operation: "kind = 'plunge'\nfrom_mm = 34\nto_mm = 28\nz_mm = -16\nfeed_mm_per_min = 900",
        call: "o<pkm_plunge> call [34] [28] [-16] [900]",
        code: "G23.2 X28 Z-16 I34 F900",
    },
    Typical {
        machine: "tripod",
        zero: [125.0, 45.0, 80.0],
        operation: "kind = 'drill'\npoints = 'down'\nat_mm = [2, 1, 0]\ndepth_mm = 5\nclear_mm = 3\n\
                    feed_mm_per_min = 900",
        call: "o<pkm_drill> call [2] [1] [0] [5] [3] [900]",
        code: "G23.3 X2 Y1 Z0 Q5 R3 F900",
    },
    Typical {
        machine: "four-rod-lathe",
        zero: LATHE,
        operation: "kind = 'drill'\npoints = 'across'\nat_mm = [22, 0, -34]\nb_deg = 15\ndepth_mm = 6\n\
                    clear_mm = 5\nfeed_mm_per_min = 900",
        call: "o<pkm_drill_across> call [22] [0] [-34] [15] [6] [5] [900]",
        code: "G23.4 X22 Y0 Z-34 B15 Q6 R5 F900",
    },
    Typical {
        machine: "hexapod",
        zero: [0.0, 0.0, 250.0],
        operation: "kind = 'drill'\npoints = 'down'\nat_mm = [2, 1, 0]\na_deg = 8\nb_deg = -6\ndepth_mm = 5\n\
                    clear_mm = 3\nfeed_mm_per_min = 900",
        call: "o<pkm_drill_leaning> call [2] [1] [0] [8] [-6] [5] [3] [900]",
        code: "G23.5 X2 Y1 Z0 A8 B-6 Q5 R3 F900",
    },
];

impl Typical {
    fn file(&self) -> PathFile {
        let [x, y, z] = self.zero;
        let text = format!(
            "[tolerance]\nchord_mm = 0.01\n[program]\nzero_mm = [{x:?}, {y:?}, {z:?}]\n\
             [[operation]]\n{}\n",
            self.operation
        );
        PathFile::parse(&text).unwrap()
    }

    /// Returns the program with another body between head and tail.
    fn with_body(&self, program: &str, body: &str) -> String {
        let from = program.find("; 1: ").unwrap();
        let tail = if program.contains("\nG17\nG54") { "G17\nG54\nM2\n" } else { "G54\nM2\n" };
        format!("{}{body}\n{}{tail}", &program[..from], level(program))
    }
}

/// Returns the move that levels the platform at the end of a program.
fn level(program: &str) -> String {
    let found = program
        .lines()
        .rev()
        .take(4)
        .find(|line| line.starts_with("G0 A") || line.starts_with("G0 B"));
    found.map_or(String::new(), |line| format!("{line}\n"))
}

pub fn subroutines() -> PathBuf {
    root().join("subroutines").canonicalize().unwrap()
}

/// Copies a machine, with the subroutines on its path and with additional lines.
pub fn prepared(machine: &str, more: &str) -> (TempDir, Mechanism) {
    let folder = tempfile::tempdir().unwrap();
    for file in fs::read_dir(ini(machine).parent().unwrap()).unwrap() {
        let file = file.unwrap().path();
        if file.is_file() {
            fs::copy(&file, folder.path().join(file.file_name().unwrap())).unwrap();
        }
    }
    let file = folder.path().join(format!("{machine}.ini"));
    let place = subroutines();
    let place = place.display();
    let lines = format!(
        "[RS274NGC]\nSUBROUTINE_PATH = {place}\n{}",
        more.replace("PLACE", &place.to_string())
    );
    let text = fs::read_to_string(&file).unwrap().replacen("[RS274NGC]\n", &lines, 1);
    fs::write(&file, text).unwrap();
    let config = test_support::shipped::first_of(&file);
    (folder, config)
}

/// The include that defines the G-codes.
const CODES: &str = "#INCLUDE PLACE/remap.inc\n";

pub fn read(config: &Mechanism, text: &str) -> Vec<Move> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("path.ngc");
    fs::write(&file, text).unwrap();
    let mut all = moves(&config.clone().into(), &file, None)
        .unwrap_or_else(|error| panic!("{error}\n{text}"));
    let mut last = config.home;
    all.retain(|step| {
        let moves = step.end.iter().zip(&last).any(|(a, b)| (a - b).abs() > WORD);
        last = step.end;
        moves
    });
    all
}

/// Words of a written program have six decimals; an arc's end and center have three words.
const WORD: f64 = 3e-6;

fn assert_alike(name: &str, a: &[Move], b: &[Move]) {
    assert_eq!(a.len(), b.len(), "{name}");
    for (n, (a, b)) in a.iter().zip(b).enumerate() {
        assert_eq!(a.kind, b.kind, "{name}: {n}");
        for k in 0..6 {
            assert!((a.end[k] - b.end[k]).abs() < WORD, "{name}: {n}: {a:?} {b:?}");
        }
        let is_feed = a.kind == MoveKind::Feed;
        assert!(!is_feed || (a.feed - b.feed).abs() < 1e-9, "{name}: {n}: {a:?} {b:?}");
    }
}

#[test]
fn subroutines_and_remapped_codes_move_as_the_program_that_the_command_writes() {
    for typical in &TYPICAL {
        let (_folder, config) = prepared(typical.machine, CODES);
        let Job { program, .. } = job(&config, &typical.file()).unwrap();
        let written = read(&config, &program);
        assert!(written.iter().any(|step| step.kind == MoveKind::Feed), "{}", typical.call);
        let called = read(&config, &typical.with_body(&program, typical.call));
        assert_alike(typical.call, &written, &called);
        let coded = read(&config, &typical.with_body(&program, typical.code));
        assert_alike(typical.code, &written, &coded);
    }
}

#[test]
fn every_subroutine_has_a_page_a_code_and_a_test() {
    let folder = subroutines();
    let [pages, codes] =
        ["ngcgui.inc", "remap.inc"].map(|file| fs::read_to_string(folder.join(file)).unwrap());
    let mut count = 0;
    for file in fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()) {
        let text = fs::read_to_string(&file).unwrap();
        let name = file.file_stem().unwrap().to_str().unwrap().to_string();
        if !text.contains("(info:") {
            continue;
        }
        count += 1;
        assert!(pages.contains(&format!("NGCGUI_SUBFILE = {name}.ngc")), "{name}");
        let code = name.replacen("pkm_", "pkm_g_", 1);
        assert!(codes.contains(&format!("ngc={code}\n")), "{name}");
        assert!(
            TYPICAL.iter().any(|typical| typical.call.contains(&format!("o<{name}> "))),
            "{name}"
        );
    }
    assert_eq!(count, 12);
}

#[test]
fn carriages_of_a_circle_on_the_lathe_are_those_of_the_closed_form_and_come_back() {
    let config = config("four-rod-lathe");
    let file = PathFile::parse(
        "[tolerance]\nchord_mm = 0.01\n[program]\nzero_mm = [0, 450, 1000]\n[[operation]]\nkind = 'circle'\n\
         plane = 'zx'\ncentre_mm = [0, 0]\nradius_mm = 40\nlevel_mm = 0\nclear_mm = 0\nfeed_mm_per_min = 900\n",
    )
    .unwrap();
    let Job { done, .. } = job(&config, &file).unwrap();
    for row in &GOLDEN.lathe_circle {
        let (sin, cos) = row[0].to_radians().sin_cos();
        let at = [40.0 * cos, 450.0, 1000.0 + 40.0 * sin];
        let far = |pose: &[f64; 6]| (0..3).map(|k| (pose[k] - at[k]).powi(2)).sum::<f64>().sqrt();
        let near = done[0].places.iter().min_by(|a, b| far(&a.0).total_cmp(&far(&b.0))).unwrap();
        assert!(far(&near.0) < 1e-6, "{row:?} {near:?}");
        for k in 0..4 {
            assert!((near.1[k] - row[k + 1]).abs() < 1e-6, "{row:?} {near:?}");
        }
    }
    let end = done[0].along.last().unwrap();
    // Chords within 1e-3 of the circle are shorter by a share of 1e-5.
    assert!((end.length / (80.0 * std::f64::consts::PI) - 1.0).abs() < 2e-5, "{}", end.length);
    for k in 0..4 {
        assert!(end.change[k].abs() < 1e-9, "{end:?}");
    }
}

#[test]
fn a_zigzag_has_the_rows_and_the_length_of_its_closed_form() {
    let text = "[tolerance]\nchord_mm = 0.01\n[program]\nzero_mm = [0, 0, 220]\n[[operation]]\nkind = 'zigzag'\n\
                start_mm = [-30, -20]\nlength_mm = 60\nwidth_mm = 40\nstep_mm = 6\nlevel_mm = 0\nclear_mm = 0\n\
                feed_mm_per_min = 900\n";
    let found = job(&config("pyramid"), &PathFile::parse(text).unwrap()).unwrap();
    let rows = found.program.lines().filter(|line| line.starts_with("G1 X")).count();
    assert_eq!(rows as f64, GOLDEN.zigzag[0]);
    let length = found.done[0].along.last().unwrap().length;
    assert!((length - GOLDEN.zigzag[1]).abs() < 1e-9, "{length}");
}

/// Returns the position of the small paths of the next test on each machine, mm.
fn middle(config: &Mechanism) -> [f64; 3] {
    let [x, y, z, ..] = config.home;
    [x, y, z].map(|value| value / config.units_per_mm)
}

const SMALL: [&str; 11] = [
    "kind = 'zigzag'\nstart_mm = [-10, -8]\nlength_mm = 20\nwidth_mm = 16\nstep_mm = 5\nlevel_mm = -2\nclear_mm = 1",
    "kind = 'loop'\nstart_mm = [-10, -8]\nlength_mm = 20\nwidth_mm = 16\nstep_mm = 8\nlevel_mm = -2\nclear_mm = 1",
    "kind = 'box-pocket'\nstart_mm = [-10, -8]\nlength_mm = 20\nwidth_mm = 16\nstep_mm = 5\nlevel_mm = -2\nclear_mm = 1",
    "kind = 'circle'\ncentre_mm = [0, 0]\nradius_mm = 10\nlevel_mm = -2\nclear_mm = 1",
    "kind = 'circle'\nplane = 'zx'\ncentre_mm = [0, 0]\nradius_mm = 5\nlevel_mm = 0\nclear_mm = 1",
    "kind = 'circle'\nplane = 'yz'\ncentre_mm = [0, 0]\nradius_mm = 5\nlevel_mm = 0\nclear_mm = 1",
    "kind = 'pocket'\ncentre_mm = [0, 0]\nradius_mm = 10\nstep_mm = 4\nlevel_mm = -2\nclear_mm = 1",
    "kind = 'spiral'\ncentre_mm = [0, 0]\ngrowth_mm = 3\nturns = 2.5\nlevel_mm = -2\nclear_mm = 1",
    "kind = 'helix'\ncentre_mm = [0, 0]\nradius_mm = 8\npitch_mm = -1\nturns = 3\nlevel_mm = 0\nclear_mm = 1",
    "kind = 'helix'\ncentre_mm = [0, 0]\nradius_mm = 8\nshrink_mm = 2\npitch_mm = -1\nturns = 3\nlevel_mm = 0\nclear_mm = 1",
    "kind = 'drill'\npoints = 'down'\nat_mm = [3, 2, 0]\ndepth_mm = 4\nclear_mm = 2",
];

/// Checks a program as the command does, LinuxCNC's own cycles included.
fn assert_passes(config: &Mechanism, program: &Path) {
    let whole = MachineConfig::read(&config.file).unwrap();
    let found = judge(&whole, program, &Options::default(), &mut |_| ()).unwrap().found;
    assert!(found.fits() && found.time.is_whole(), "{}: {:?}", program.display(), found.breaks);
}

#[test]
fn small_typical_paths_pass_preflight_on_every_machine() {
    for machine in unchained() {
        let config = config(machine);
        let [x, y, z] = middle(&config);
        let head =
            format!("[tolerance]\nchord_mm = 0.01\n[program]\nzero_mm = [{x:?}, {y:?}, {z:?}]\n");
        let small = SMALL.map(|keys| format!("[[operation]]\nfeed_mm_per_min = 1200\n{keys}\n"));
        let found = job(&config, &PathFile::parse(&(head + &small.concat())).unwrap());
        let found = found.unwrap_or_else(|error| panic!("{machine}: {error}"));
        assert_eq!(found.done.len(), SMALL.len());
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("path.ngc");
        fs::write(&file, &found.program).unwrap();
        assert_passes(&config, &file);
    }
}

/// Path files shipped with the configurations, and whether they are jobs.
const SHIPPED: [(&str, &str, bool); 13] = [
    ("pyramid", "cycloid", false),
    ("pyramid", "two-pencils", false),
    ("pyramid", "loxodrome", false),
    ("four-rod-lathe", "stepped-shaft", true),
    ("four-rod-lathe", "milling", true),
    ("four-rod-lathe", "circles", true),
    ("four-rod-lathe", "helices", true),
    ("linear-delta", "twisted-vase", false),
    ("hexaglide", "dome", false),
    ("linapod", "bowl", false),
    ("pyramid-cross", "cycloid", false),
    ("pyramid-cross", "trough", false),
    ("triaglide", "pockets", true),
];

fn written(machine: &str, name: &str, is_job: bool) -> String {
    let config = config(machine);
    let file = PathFile::read(&folder(machine).join(format!("paths/{name}.toml"))).unwrap();
    match is_job {
        true => job(&config, &file).unwrap_or_else(|e| panic!("{name}: {e}")).program,
        false => route(&config, &file).unwrap_or_else(|e| panic!("{name}: {e}")).program,
    }
}

#[test]
fn paths_beside_the_configurations_pass_preflight() {
    for (machine, name, is_job) in SHIPPED {
        let config = config(machine);
        let program = written(machine, name, is_job);
        let place = tempfile::tempdir().unwrap();
        let place = place.path().join("path.ngc");
        fs::write(&place, program).unwrap();
        assert_passes(&config, &place);
    }
    let folders = MACHINES.map(|machine| fs::read_dir(folder(machine).join("paths")));
    assert_eq!(folders.into_iter().flatten().flatten().count(), SHIPPED.len());
}

#[test]
fn subroutines_pass_preflight_and_of_remapped_codes_the_path_does() {
    for typical in [&TYPICAL[0], &TYPICAL[9], &TYPICAL[15]] {
        let (folder, config) = prepared(typical.machine, "");
        let Job { program, .. } = job(&config, &typical.file()).unwrap();
        let file = folder.path().join("path.ngc");
        fs::write(&file, typical.with_body(&program, typical.call)).unwrap();
        assert_passes(&config, &file);
        // LinuxCNC in virtual time does not run remapped codes; their moves are checked instead.
        let (_folder, config) = prepared(typical.machine, CODES);
        fs::write(&file, typical.with_body(&program, typical.code)).unwrap();
        let read = moves(&config.clone().into(), &file, None).unwrap();
        assert!(
            preflight(std::slice::from_ref(&config), &read).unwrap().fits(),
            "{}",
            typical.code
        );
    }
}

#[test]
fn an_operation_that_is_none_or_leaves_the_machine_is_refused_with_its_number() {
    let refused = |operation: &str| {
        let text = format!(
            "[tolerance]\nchord_mm = 0.01\n[program]\nzero_mm = [0, 0, 220]\n[[operation]]\nkind = 'spiral'\n\
             centre_mm = [0, 0]\ngrowth_mm = 4\nturns = 1\nlevel_mm = 0\nclear_mm = 2\nfeed_mm_per_min = 900\n\
             [[operation]]\n{operation}\n"
        );
        match PathFile::parse(&text) {
            Ok(file) => job(&config("pyramid"), &file).unwrap_err().to_string(),
            Err(error) => error.to_string(),
        }
    };
    let circle =
        "kind = 'circle'\ncentre_mm = [0, 0]\nlevel_mm = 0\nclear_mm = 2\nfeed_mm_per_min = 900\n";
    for (operation, expected) in [
        (format!("{circle}radius_mm = 200"), "[[operation]] 2, circle: axis X violates its limit of -150 to 150 mm"),
        (format!("{circle}radius_mm = 0"), "0: expected more than 0"),
        (format!("{circle}radius = 3"), "unknown field `radius`"),
        (circle.into(), "missing field `radius_mm`"),
        ("kind = 'square'".into(), "unknown variant `square`"),
        (
            "kind = 'turn'\nfrom_mm = 10\nto_mm = 14\nface_mm = 0\nshoulder_mm = -5\ncut_mm = 3\nfeed_mm_per_min = 9".into(),
            "[[operation]] 2, turn: from_mm: expected more than to_mm",
        ),
        (
            "kind = 'drill'\npoints = 'across'\na_deg = 3\nat_mm = [0, 0, 0]\ndepth_mm = 3\nclear_mm = 1\nfeed_mm_per_min = 9".into(),
            "can lean only by b_deg",
        ),
        ("kind = 'tool'\npark_mm = [0, 0, 9]\ntool = 99".into(), "99 is not in the machine's tool table"),
    ] {
        let message = refused(&operation);
        assert!(message.contains(expected), "{operation}: {message}");
    }
}

/// Two tools of different lengths drill one hole, and change where the next move keeps Y and Z of the workpiece.
#[test]
fn tips_of_all_tools_of_a_job_reach_the_same_place() {
    let [x, y, z] = [-330.0, 450.0, 1000.0];
    let drill = |tool: u32| {
        format!(
            "[[operation]]\nkind = 'tool'\ntool = {tool}\npark_mm = [60, 0, 0]\n[[operation]]\nkind = 'drill'\n\
             points = 'across'\nat_mm = [22, 0, 0]\ndepth_mm = 6\nclear_mm = 3\nfeed_mm_per_min = 900\n"
        )
    };
    let text = format!(
        "[tolerance]\nchord_mm = 0.01\n[program]\nzero_mm = [{x:?}, {y:?}, {z:?}]\n{}{}",
        drill(4),
        drill(5)
    );
    let config = config("four-rod-lathe");
    let program = job(&config, &PathFile::parse(&text).unwrap()).unwrap().program;
    let steps = read(&config, &program);
    let cuts = steps.iter().filter(|step| step.kind == MoveKind::Feed);
    let tips: Vec<[f64; 3]> =
        cuts.map(|step| std::array::from_fn(|k| step.end[k] - step.tool[k])).collect();
    let [first, second] = tips[..] else { panic!("{tips:?}\n{program}") };
    let wanted = [x + 16.0, y, z];
    for tip in [first, second] {
        for k in 0..3 {
            assert!((tip[k] - wanted[k]).abs() < WORD, "{tips:?}\n{program}");
        }
    }
    // The second change happens at its park position, the first one where the machine stands.
    let changes: Vec<u32> = (1..)
        .zip(program.lines())
        .filter(|(_, line)| line.ends_with("M6"))
        .map(|(n, _)| n)
        .collect();
    let [none, parked] = changes[..] else { panic!("{program}") };
    assert!(steps.iter().all(|step| step.line > none), "{program}");
    let before = steps.iter().rfind(|step| step.line < parked).unwrap();
    let park = [x + 60.0, y, z];
    for k in 0..3 {
        assert!((before.end[k] - before.tool[k] - park[k]).abs() < WORD, "{before:?}\n{program}");
    }
}
