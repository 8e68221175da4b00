// SPDX-License-Identifier: GPL-2.0-or-later
//! Older configurations: the converted parts, the notes on the rest, and refusals that write nothing.

use machine::read::machine::MachineConfig;
use new::migrate::{Migrated, Migration, migrate};
use new::values::Refusal;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Copy of a configuration of `tests/cases/older`, in a temporary folder.
struct Old {
    place: TempDir,
    file: PathBuf,
}

impl Old {
    fn new(folder: &str) -> Self {
        let from =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/cases/older").join(folder);
        let place = tempfile::tempdir().unwrap();
        let old = place.path().join("old");
        std::fs::create_dir(&old).unwrap();
        let mut file = PathBuf::new();
        for entry in std::fs::read_dir(from).unwrap() {
            let path = entry.unwrap().path();
            let copy = old.join(path.file_name().unwrap());
            std::fs::copy(&path, &copy).unwrap();
            if path.extension().is_some_and(|end| end == "ini") {
                file = copy;
            }
        }
        Self { place, file }
    }

    /// Replaces text in one of its files; an empty name is the INI file.
    fn with(self, name: &str, from: &str, to: &str) -> Self {
        let file = match name {
            "" => self.file.clone(),
            name => self.file.with_file_name(name),
        };
        let text = std::fs::read_to_string(&file).unwrap();
        assert!(text.contains(from), "{from} is not in {}", file.display());
        std::fs::write(&file, text.replacen(from, to, 1)).unwrap();
        self
    }

    fn migrated_with(
        &self,
        home: Option<[f64; 3]>,
        geometry: Option<&Path>,
    ) -> Result<Migrated, Refusal> {
        let migration = Migration { file: &self.file, folder: None, home, geometry };
        migrate(&migration, |_, _| ())
    }

    fn migrated(&self) -> Migrated {
        self.migrated_with(None, None).unwrap_or_else(|error| panic!("{error}"))
    }

    /// Returns the reason of a refusal, and checks that nothing was written.
    fn refused(&self) -> String {
        let before = self.listed();
        let error = self.migrated_with(None, None).unwrap_err().to_string();
        assert_eq!(self.listed(), before, "{error}");
        error
    }

    /// Lists the files in the old folder and beside it.
    fn listed(&self) -> Vec<PathBuf> {
        let in_folder = |folder: &Path| {
            std::fs::read_dir(folder)
                .unwrap()
                .map(|entry| entry.unwrap().path())
                .collect::<Vec<_>>()
        };
        let mut all = in_folder(self.place.path());
        all.extend(in_folder(&self.place.path().join("old")));
        all.sort();
        all
    }
}

fn text(migrated: &Migrated) -> String {
    let file = migrated.folder.join(format!("{}.ini", migrated.name));
    std::fs::read_to_string(file).unwrap()
}

fn assert_said(all: &[String], parts: &[&str]) {
    for part in parts {
        assert!(all.iter().any(|text| text.contains(part)), "{part} is not in {all:#?}");
    }
}

#[test]
fn a_file_of_2_7_gets_joints_limits_homing_scales_and_tools() {
    let old = Old::new("delta-27");
    let migrated = old.migrated();
    let name = migrated.folder.file_name().unwrap();
    assert_eq!((name.to_str().unwrap(), migrated.name.as_str()), ("delta-pkmkins", "delta"));
    assert_eq!(migrated.folder.parent().unwrap(), old.place.path().canonicalize().unwrap());
    assert!(migrated.made.report.fits(), "{:?}", migrated.made.report.findings);
    let text = text(&migrated);
    for line in [
        "KINEMATICS = pkmkins legs=slider:3 coordinates=XYZ boxes=1\n",
        "MIN_LIMIT = 0\nMAX_LIMIT = 345\nMAX_VELOCITY = 250\nMAX_ACCELERATION = 3000\n",
        "HOME_SEARCH_VEL = 25\nHOME_LATCH_VEL = -3\n",
        // 30 mm before the switch at 340, seen along the search.
        "SIM_START = 310\n",
        "SCALE = 80\nSTEPGEN_MAXACCEL = 3600\n",
        "MAX_LINEAR_VELOCITY = 60\n",
        "SERVO_PERIOD = 1000000\n",
        "INCREMENTS = 10 mm, 1 mm, 0.1 mm\n",
        "BASE = 0 118.6 0\n",
        "ROD = 242.3\n",
    ] {
        assert!(text.contains(line), "{line}{text}");
    }
    let tools = std::fs::read(migrated.folder.join("delta.tbl")).unwrap();
    assert_eq!(tools, std::fs::read(old.file.with_file_name("delta.tbl")).unwrap());
    // [TRAJ]HOME was 0 0 0, and the carriages were at 330, where homing ends.
    assert_said(&migrated.notes.undetermined, &["taken is where homing ends", "the file has none"]);
    assert_said(
        &migrated.notes.left_out,
        &["[DELTA] RADIUS, ROD: only HAL files", "[EMCMOT] BASE_PERIOD"],
    );
    let config = MachineConfig::read(&migrated.folder.join("delta.ini")).unwrap();
    assert!((config.first().joints[0].home - 330.0).abs() < 1e-6);
    assert!(text.contains("# Left out: [EMCMOT] BASE_PERIOD."), "{text}");
}

#[test]
fn a_file_of_machinekit_keeps_its_extruder_as_an_extra_axis() {
    let old = Old::new("machinekit-delta");
    let migrated = old.migrated();
    let text = text(&migrated);
    assert!(text.contains("coordinates=XYZ axes=A"), "{text}");
    assert!(text.contains("[JOINT_3]\nTYPE = ANGULAR\nHOME = 0\n"), "{text}");
    assert!(text.contains("[AXIS_A]\nTYPE = ANGULAR\nMIN_LIMIT = -100000\n"), "{text}");
    assert_said(&migrated.notes.undetermined, &["LinuxCNC has no mkwrapper", "missing.tbl"]);
    assert_said(&migrated.notes.left_out, &["REMAP"]);
}

#[test]
fn axis_limits_that_can_be_kept_are_kept_and_others_are_said() {
    let old = Old::new("hexapod-screws");
    let migrated = old.migrated();
    let text_of = text(&migrated);
    assert!(
        text_of.contains("[AXIS_C]\nTYPE = ANGULAR\nMIN_LIMIT = -6\nMAX_LIMIT = 6\n"),
        "{text_of}"
    );
    assert!(text_of.contains("SCREW_LEAD = 0.4\nSPINDLE_OFFSET = 1.25\n"), "{text_of}");
    assert!(!migrated.notes.undetermined.iter().any(|text| text.contains("limits of")));
    let wide = Old::new("hexapod-screws").with("", "MAX_LIMIT = 19.5", "MAX_LIMIT = 60");
    let migrated = wide.migrated();
    assert_said(
        &migrated.notes.undetermined,
        &["in place of 16.5 to 60, of which not every pose is proved"],
    );
    let text = text(&migrated);
    assert!(text.contains("# The older configuration has 16.5 to 60:"), "{text}");
}

#[test]
fn a_home_outside_of_the_axis_limits_is_said() {
    let old = Old::new("rotary-delta").with("", "MIN_LIMIT = -300", "MIN_LIMIT = -330");
    let old = old.with("", "MAX_LIMIT = -200", "MAX_LIMIT = -280");
    assert_said(
        &old.migrated().notes.undetermined,
        &["in place of -330 to -280, beyond which home is"],
    );
}

#[test]
fn homes_that_contradict_each_other_are_said_with_what_is_taken() {
    let old = Old::new("hexapod-27").with("", "HOME = 14.6751", "HOME = 16.2");
    let migrated = old.migrated();
    assert_said(&migrated.notes.undetermined, &["are off by up to 1.5249", "taken is [TRAJ]HOME"]);
    // Without any pose, several poses fit the joints of a hexapod.
    let old = Old::new("hexapod-27").with("", "HOME = 0 0 14 0 0 0\n", "");
    let error = old.refused();
    assert!(error.contains("home is not determined") && error.contains("--home X Y Z"), "{error}");
    let home = old.migrated_with(Some([0.0, 0.0, 14.0]), None).unwrap();
    assert!(text(&home).contains("\nHOME = 0 0 14 0 0 0\n"));
}

#[test]
fn a_broken_file_is_refused_with_its_line_and_nothing_is_made() {
    for (from, to, parts) in [
        (
            "MIN_LIMIT = 0\n",
            "MIN_LIMIT = 0\nMIN_LIMIT = 5\n",
            ["[AXIS_0]MIN_LIMIT", "given 2 times"],
        ),
        (
            "MIN_LIMIT = 0\n",
            "MIN_LIMIT = 400\n",
            ["[AXIS_0]MIN_LIMIT = 400", "less than MAX_LIMIT = 345"],
        ),
        ("MIN_LIMIT = 0\n", "", ["[AXIS_0]MIN_LIMIT is missing", "both limits"]),
        ("MIN_LIMIT = 0\nMAX_LIMIT = 345\n", "", ["[AXIS_0]MIN_LIMIT is missing", "leg's drive"]),
        (
            "HOME = 330.0\n",
            "HOME = 330.0 # top\n",
            ["[AXIS_0]HOME = 330.0 # top", "one decimal number"],
        ),
        ("MAX_VELOCITY = 250", "MAX_VELOCITY = 0", ["[AXIS_0]MAX_VELOCITY = 0", "more than 0"]),
        ("[AXIS_1]", "[AXIS_7]", ["[AXIS_1]", "copy that of another leg"]),
        ("[AXIS_1]", "[AXIS_0]", ["[AXIS_0]", "given 2 times"]),
        (
            "LINEAR_UNITS = mm\n",
            "",
            ["[TRAJ]LINEAR_UNITS is missing", "mean nothing without their unit"],
        ),
        (
            "LINEAR_UNITS = mm\n",
            "LINEAR_UNITS = 0.03937\n",
            ["LINEAR_UNITS = 0.03937", "expected mm or inch"],
        ),
        (
            "ANGULAR_UNITS = degree",
            "ANGULAR_UNITS = rad",
            ["ANGULAR_UNITS = rad", "convert all angles"],
        ),
        ("AXES = 3", "AXES = 2", ["[TRAJ]AXES = 2", "lineardeltakins has 3 joints"]),
        (
            "[TRAJ]\n",
            "[KINS]\nKINEMATICS = trivkins\n[TRAJ]\n",
            ["KINEMATICS = trivkins", "genhexkins, lineardeltakins"],
        ),
        (
            "[TRAJ]\n",
            "[KINS]\nKINEMATICS = pkmkins\n[TRAJ]\n",
            ["for pkmkins already", "pkm check"],
        ),
    ] {
        let error = Old::new("delta-27").with("", from, to).refused();
        assert!(parts.iter().all(|part| error.contains(part)), "{from:?} as {to:?}: {error}");
    }
    let error = Old::new("delta-27")
        .with("delta.hal", "loadrt lineardeltakins", "loadrt trivkins")
        .refused();
    assert!(error.contains("trivkins is loaded, expected loadrt of genhexkins"), "{error}");
}

#[test]
fn a_folder_that_is_there_stays_as_it_is() {
    let old = Old::new("delta-27");
    let there = old.place.path().join("delta-pkmkins");
    std::fs::create_dir(&there).unwrap();
    std::fs::write(there.join("mine"), "mine").unwrap();
    let error = old.refused();
    assert!(error.contains("delta-pkmkins exists already") && error.contains("--out"), "{error}");
    assert_eq!(std::fs::read_to_string(there.join("mine")).unwrap(), "mine");
}

#[test]
fn geometry_that_only_a_running_script_knows_is_not_determined_and_nothing_of_it_runs() {
    for (folder, file, from, to, parts) in [
        // A program started by Tcl.
        (
            "rotary-delta",
            "picker.tcl",
            "foreach {pin key}",
            "exec touch ../touched\nforeach {pin key}",
            ["picker.tcl", "exec"],
        ),
        // A program started by HAL may set pins that no file sets.
        (
            "delta-27",
            "delta.hal",
            "setp lineardeltakins.L [DELTA]ROD",
            "loadusr -w python3 geometry.py",
            ["delta.hal:16", "python3"],
        ),
        // An unknown pin.
        (
            "delta-27",
            "delta.hal",
            "setp lineardeltakins.L [DELTA]ROD",
            "net rod mux.0.out => lineardeltakins.L",
            ["delta.hal:16", "signal rod"],
        ),
        // An alias of a pin.
        (
            "delta-27",
            "delta.hal",
            "setp lineardeltakins.L [DELTA]ROD",
            "alias pin lineardeltakins.L rod\nsetp rod 242.3",
            ["delta.hal:16", "another name"],
        ),
        // A key missing in the INI file.
        (
            "delta-27",
            "delta.hal",
            "[DELTA]ROD",
            "[DELTA]LENGTH",
            ["delta.hal:16", "[DELTA]LENGTH is not in the INI file"],
        ),
        // HAL files in Python.
        (
            "machinekit-delta",
            "rostock.ini",
            "HALFILE = machine.hal\n",
            "HALFILE = machine.hal\nHALFILE = geometry.py\n",
            ["geometry.py", "Python"],
        ),
    ] {
        let old = Old::new(folder).with(file, from, to);
        if to.contains("geometry.py") {
            let script = "from machinekit import hal\nhal.pins['lineardeltakins.L'].set(230)\n";
            std::fs::write(old.file.with_file_name("geometry.py"), script).unwrap();
        }
        let error = old.refused();
        let parts = parts.iter().chain(&["the geometry is not determined", "--geometry FILE.hal"]);
        assert!(parts.clone().all(|part| error.contains(part)), "{parts:?}: {error}");
        assert!(!old.place.path().join("touched").exists());
    }
}

#[test]
fn geometry_from_a_file_of_its_own_takes_the_place_of_a_script() {
    let old = Old::new("delta-27").with(
        "delta.hal",
        "setp lineardeltakins.L [DELTA]ROD",
        "loadusr -w ./rods.sh",
    );
    let file = old.place.path().join("own.hal");
    std::fs::write(&file, "setp lineardeltakins.R 118.6\nsetp lineardeltakins.L 251.5\n").unwrap();
    let migrated = old.migrated_with(None, Some(&file)).unwrap();
    assert!(text(&migrated).contains("ROD = 251.5\n"));
    std::fs::write(&file, "setp lineardeltakins.R\n").unwrap();
    std::fs::remove_dir_all(&migrated.folder).unwrap();
    let error = old.migrated_with(None, Some(&file)).unwrap_err().to_string();
    assert!(error.contains("own.hal:1") && error.contains("expects more words"), "{error}");
}

#[test]
fn a_pin_that_the_module_has_not_is_refused_and_a_default_is_said() {
    let line = "setp lineardeltakins.L [DELTA]ROD\n";
    let more =
        |text: &str| Old::new("delta-27").with("delta.hal", line, &format!("{line}{text}\n"));
    let error = more("setp lineardeltakins.J0off 1.5").refused();
    assert!(error.contains("delta.hal:17") && error.contains("no pin J0off"), "{error}");
    more("setp lineardeltakins.J0off 0").migrated();
    let error = more("setp lineardeltakins.R wide").refused();
    assert!(error.contains("lineardeltakins.R wide: expected a decimal number"), "{error}");
    let old = Old::new("delta-27").with("delta.hal", line, "");
    let migrated = old.migrated();
    assert_said(&migrated.notes.undetermined, &["no HAL file sets L"]);
    assert!(text(&migrated).contains("ROD = 269\n"));
}

#[test]
fn limits_that_are_none_are_read_and_those_of_arms_have_to_be_some() {
    let old = Old::new("delta-27").with("", "MAX_LIMIT = 345", "MAX_LIMIT = 1e9");
    assert!(text(&old.migrated()).contains("MAX_LIMIT = 1000000000\n"));
    let error = Old::new("rotary-delta").with("", "MAX_LIMIT = 80", "MAX_LIMIT = 360").refused();
    assert!(
        error.contains("[JOINT_0]MAX_LIMIT = 360") && error.contains("arm can turn"),
        "{error}"
    );
}

#[test]
fn a_hal_file_that_sources_itself_ends() {
    let line = "addf stepgen.update-freq servo-thread\n";
    let twice = format!("{line}source delta.hal\nsource delta.hal\n");
    let error = Old::new("delta-27").with("delta.hal", line, &twice).refused();
    assert!(error.contains("delta.hal sources itself"), "{error}");
    let old = Old::new("delta-27").with(
        "delta.hal",
        "setp lineardeltakins.R [DELTA]RADIUS\n",
        "source none.hal\n",
    );
    let error = old.refused();
    assert!(
        error.contains("none.hal is neither beside") && error.contains("not determined"),
        "{error}"
    );
}

#[test]
fn a_machine_that_cannot_be_is_refused() {
    let error = Old::new("delta-27").with("", "ROD = 242.3", "ROD = 42.3").refused();
    assert!(error.contains("the machine cannot be at any of"), "{error}");
}

#[test]
fn a_simulated_drive_that_searches_downwards_starts_above_its_switch() {
    let old = Old::new("delta-27").with("", "HOME_SEARCH_VEL = 25", "HOME_SEARCH_VEL = -25").with(
        "",
        "HOME_OFFSET = 340",
        "HOME_OFFSET = 10",
    );
    assert!(text(&old.migrated()).contains("SIM_START = 40\n"));
}

#[test]
fn the_axes_of_joints_are_undetermined_on_struts_with_a_lead_only() {
    let undetermined = |old: &Old| {
        let notes = old.migrated().notes.undetermined;
        notes.iter().filter(|note| note.contains("base-n")).count()
    };
    assert_eq!(undetermined(&Old::new("hexapod-27")), 0);
    assert_eq!(undetermined(&Old::new("hexapod-screws")), 0);
    let without =
        Old::new("hexapod-screws").with("geometry.hal", "setp genhexkins.base-n.0.x 0.2508\n", "");
    assert_eq!(undetermined(&without), 1);
}
