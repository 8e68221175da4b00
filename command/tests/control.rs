// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm run` and the commands that run LinuxCNC in virtual time, as `make install` has installed it.

use linuxcnc::process::{self, Options};
use linuxcnc::row::{Ending, Row};
use std::fs;
use std::ops::ControlFlow;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::UnixListener;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::Duration;
use test_support::control::{ended, run_text};
use test_support::shipped;

#[test]
fn preflight_writes_the_trace_that_a_run_writes() {
    let copy = Copy::new(|text| text, SHORT);
    let traces = ["run", "preflight"].map(|command| {
        let given = ["hexapod.ini", "programs/p.ngc"].map(|name| copy.file(name));
        let trace = copy.file(&format!("{command}.csv"));
        let arguments = [&given[..], &["--trace".into(), trace.clone()]].concat();
        let (out, error, code) = pkm_with(&copy.file("tmp"), command, &arguments);
        assert_eq!(code, Some(0), "{out}{error}");
        fs::read(trace).unwrap()
    });
    assert!(traces[0] == traces[1] && traces[0].len() > 10_000, "traces differ");
}

// The interpreter waits in the line of M66, and still has the functions of the subroutine that it has left.
#[test]
fn a_following_error_has_the_line_that_moves() {
    let program = "G21 G90\nM52 P0\nM98 P1\nG1 F3000 X60\nM66 P0 L0\nM2\nO1\nG4 P0.1\nM99\n";
    let slow = |text: String| text.replacen("MAX_VELOCITY = 500", "MAX_VELOCITY = 10", 1);
    let (out, error, code) = Copy::new(slow, program).run();
    assert_eq!(code, Some(1), "{out}{error}");
    assert!(out.contains("p.ngc: line 4,") && out.contains("joint 0 following error"), "{out}");
}

/// Runs a program by `pkm run`; returns standard output, standard error, exit code.
fn pkm(folder: &Path, machine: &Path, program: &Path) -> (String, String, Option<i32>) {
    pkm_with(folder, "run", &[machine.into(), program.into()])
}

/// Runs any subcommand in the same way.
fn pkm_with(folder: &Path, command: &str, files: &[PathBuf]) -> (String, String, Option<i32>) {
    let output = Command::new(env!("CARGO_BIN_EXE_pkm"))
        .arg(command)
        .args(files)
        .env("TMPDIR", folder)
        .output()
        .unwrap();
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    (text(&output.stdout), text(&output.stderr), output.status.code())
}

/// A copy of the hexapod's configuration with an edited INI file, and a program.
pub struct Copy {
    folder: tempfile::TempDir,
}

impl Copy {
    pub fn new(edit: impl Fn(String) -> String, program: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        for name in ["hexapod.ini", "hexapod.tbl"] {
            let text = fs::read_to_string(shipped::folder("hexapod").join(name)).unwrap();
            let text = if name.ends_with("ini") { edit(text) } else { text };
            fs::write(folder.path().join(name), text).unwrap();
        }
        fs::create_dir_all(folder.path().join("programs")).unwrap();
        fs::create_dir_all(folder.path().join("tmp")).unwrap();
        fs::write(folder.path().join("programs/p.ngc"), program).unwrap();
        Self { folder }
    }

    pub fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn run(&self) -> (String, String, Option<i32>) {
        let (ini, program) = (self.file("hexapod.ini"), self.file("programs/p.ngc"));
        let found = pkm(&self.file("tmp"), &ini, &program);
        let left: Vec<_> = fs::read_dir(self.file("tmp")).unwrap().collect();
        assert!(left.is_empty(), "left behind: {left:?}");
        found
    }

    /// Checks that the program is not judged, with words that name the reason.
    fn refuses(&self, words: &str) {
        let (out, error, code) = self.run();
        assert_eq!(code, Some(2), "{out}{error}");
        assert!(error.contains(words), "{error}");
    }
}

pub const SHORT: &str = "G21 G90\nG0 X1\nM2\n";

#[test]
fn what_the_ini_file_asks_for_beside_the_program_is_not_judged() {
    let after = |section: &'static str, line: &'static str| {
        move |text: String| {
            text.replacen(&format!("\n{section}\n"), &format!("\n{section}\n{line}\n"), 1)
        }
    };
    let cases = [
        ("[RS274NGC]", "REMAP = M400 modalgroup=10 prolog=first ngc=more", "[RS274NGC]REMAP"),
        ("[EMCIO]", "DB_PROGRAM = ./tools.py", "[EMCIO]DB_PROGRAM"),
        ("[TASK]", "TASK = ./task.py", "[TASK]TASK = ./task.py"),
        ("[TRAJ]", "PLANNER_TYPE = 7", "[TRAJ]PLANNER_TYPE = 7"),
        ("[EMC]", "NML_FILE = far.nml", "[EMC]NML_FILE = far.nml: it names processes of other"),
        ("[TRAJ]", "TPMOD = no_such_planner", "no_such_planner"),
    ];
    for (section, line, words) in cases {
        let copy = Copy::new(after(section, line), SHORT);
        let buffer = "B emcCommand SHMEM localhost 8192 0 0 1 16 1001 TCP=5005\n";
        let far = format!("{buffer}P xemc emcCommand REMOTE controller RW 0 10.0 0 10\n");
        fs::write(copy.file("far.nml"), far).unwrap();
        copy.refuses(words);
    }
}

/// Returns X in every cycle of a trace, without standstills.
fn places_of_x(trace: &Path) -> Vec<f64> {
    let mut reader = csv::Reader::from_path(trace).unwrap();
    let x = |row: Result<csv::StringRecord, csv::Error>| row.unwrap()[2].parse().unwrap();
    let mut all: Vec<f64> = reader.records().map(x).collect();
    all.dedup();
    all
}

#[test]
fn a_code_remapped_to_a_subroutine_is_run() {
    let remap = "REMAP = G88.1 modalgroup=1 argspec=xf ngc=further\nSUBROUTINE_PATH = programs";
    let edit =
        |text: String| text.replacen("\n[RS274NGC]\n", &format!("\n[RS274NGC]\n{remap}\n"), 1);
    let copy = Copy::new(edit, "G21 G90 G61\nG88.1 X10 F600\nM2\n");
    let further = "o<further> sub\nG1 X#<x> F#<f>\nG1 X[-#<x>]\no<further> endsub\nM2\n";
    fs::write(copy.file("programs/further.ngc"), further).unwrap();
    let found = [1, 2].map(|number| {
        let trace = copy.file(&format!("{number}.csv"));
        if number == 2 {
            let plain = "G21 G90 G61\nG1 X10 F600\nG1 X-10\nM2\n";
            fs::write(copy.file("programs/p.ngc"), plain).unwrap();
        }
        let output = Command::new(env!("CARGO_BIN_EXE_pkm"))
            .arg("run")
            .args([copy.file("hexapod.ini"), copy.file("programs/p.ngc")])
            .arg("--trace")
            .arg(&trace)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        places_of_x(&trace)
    });
    assert!(found[0] == found[1], "the code moves as the subroutine does");
    let lowest = found[0].iter().copied().fold(0.0, f64::min);
    assert_eq!((found[0].iter().copied().fold(0.0, f64::max), lowest), (10.0, -10.0));
}

#[test]
fn a_tool_table_that_is_not_there_is_named() {
    let copy = Copy::new(|text| text, SHORT);
    fs::remove_file(copy.file("hexapod.tbl")).unwrap();
    copy.refuses("hexapod.tbl: No such file");
}

#[test]
fn a_program_of_the_users_is_not_started() {
    let copy = Copy::new(|text| text, "G21 G90\nM101\nG0 X1\nM2\n");
    let started = copy.file("started");
    let script = format!("#!/bin/sh\ntouch {}\n", started.display());
    fs::write(copy.file("programs/M101"), script).unwrap();
    let mut mode = fs::metadata(copy.file("programs/M101")).unwrap().permissions();
    mode.set_mode(0o755);
    fs::set_permissions(copy.file("programs/M101"), mode).unwrap();
    copy.refuses("M100 to M199");
    assert!(!started.exists());
}

#[test]
fn a_program_writes_no_file_of_the_users() {
    let copy = Copy::new(|text| text, "");
    let log = copy.file("log.txt");
    let text = format!("(LOGOPEN,{})\n(LOG,here)\n(LOGCLOSE)\n{SHORT}", log.display());
    fs::write(copy.file("programs/p.ngc"), text).unwrap();
    let (out, error, code) = copy.run();
    assert_eq!(code, Some(0), "{out}{error}");
    assert!(!log.exists() && !copy.file("hexapod.var").exists());
    let arguments = ["--written".into(), copy.file("kept").into_os_string()];
    let output = Command::new(env!("CARGO_BIN_EXE_pkm"))
        .arg("run")
        .args([copy.file("hexapod.ini"), copy.file("programs/p.ngc")])
        .args(arguments)
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(fs::read_to_string(copy.file("kept/log.txt")).unwrap().trim(), "here");
}

#[test]
fn files_with_percent_signs_and_programs_without_an_end_are_what_linuxcnc_says() {
    let (_, _, code) = Copy::new(|text| text, "%\nG21 G90\nG0 X1\n%\n").run();
    assert_eq!(code, Some(0));
    let (out, _, code) = Copy::new(|text| text, "G21 G90\nG0 X1\n").run();
    assert_eq!(code, Some(1));
    // LinuxCNC 2.9.4 lists them in brackets.
    assert!(
        out.contains("File ended with no percent sign") && out.contains("or program end"),
        "{out}"
    );
}

#[test]
fn what_is_no_program_is_refused_before_anything_starts() {
    let copy = Copy::new(|text| text, SHORT);
    let ini = copy.file("hexapod.ini");
    // A file that even root, who may read every file, cannot read.
    let _socket = UnixListener::bind(copy.file("socket.ngc")).unwrap();
    let cases = [
        ("programs", "is a directory"),
        ("none.ngc", "No such file"),
        ("socket.ngc", "No such device or address"),
    ];
    for (program, words) in cases {
        // For a folder preflight runs every program in it.
        let commands = if program == "programs" { &["run"][..] } else { &["run", "preflight"] };
        for command in commands {
            let arguments = [ini.clone(), copy.file(program)];
            let (out, error, code) = pkm_with(&copy.file("tmp"), command, &arguments);
            assert_eq!(code, Some(2), "{command} {program}: {out}{error}");
            assert!(error.contains(words) && error.contains(program), "{error}");
            assert_eq!(fs::read_dir(copy.file("tmp")).unwrap().count(), 0);
        }
    }
}

#[test]
fn a_disk_that_is_full_is_named_and_nothing_is_left() {
    // A limit of the file size in KiB, like a disk with as much room, for one process: less than a run
    // needs in its folder, and than the trace of half a minute.
    for (command, room, full) in
        [("run", 8, "pkm-control"), ("run", 4096, "trace.csv"), ("preflight", 4096, "trace.csv")]
    {
        let copy = Copy::new(|text| text, "G21 G90\nG0 X1\nG4 P30\nM2\n");
        let script = "trap '' XFSZ; ulimit -f $4; exec \"$0\" $5 \"$1\" \"$2\" --trace \"$3\"";
        let arguments = ["hexapod.ini", "programs/p.ngc", "trace.csv"].map(|name| copy.file(name));
        let output = Command::new("bash")
            .args(["-c", script, env!("CARGO_BIN_EXE_pkm")])
            .args(arguments)
            .args([&room.to_string(), command])
            .env("TMPDIR", copy.file("tmp"))
            .output()
            .unwrap();
        let error = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{error}");
        assert!(error.contains("File too large") && error.contains(full), "{error}");
        assert_eq!(fs::read_dir(copy.file("tmp")).unwrap().count(), 0);
        assert!(!copy.file("trace.csv").exists());
        let left: Vec<_> = fs::read_dir(copy.folder.path()).unwrap().collect();
        assert_eq!(left.len(), 4, "left behind: {left:?}");
    }
}

#[test]
fn a_disk_that_fills_up_while_linuxcnc_writes_is_named_and_the_machine_is_not_blamed() {
    // Room for the initial files of a run, but not for LinuxCNC's output. The panel's files are not copied.
    let program = "G21 G90\n(LOGOPEN,log.txt)\n(LOG,x)\n(LOGCLOSE)\nG0 X1\nM2\n";
    let without_panel = |text: String| {
        text.lines()
            .filter(|line| !line.contains("panel"))
            .map(|line| format!("{line}\n"))
            .collect()
    };
    let copy = Copy::new(without_panel, program);
    let script =
        "mount -t tmpfs -o size=$4 full \"$1/tmp\" || exit 77; cd \"$1\"; export TMPDIR=\"$1/tmp\"
        \"$0\" $2 hexapod.ini $3; code=$?; ls -A tmp; exit $code";
    let needed = fs::metadata("/usr/bin/milltask").unwrap().len() / 1024;
    for (command, words) in
        [("check", ""), ("run", "programs/p.ngc"), ("preflight", "programs/p.ngc")]
    {
        for more in [20, 100, 160] {
            let size = format!("{}K", needed + more);
            let output = Command::new("unshare")
                .args([
                    "--mount",
                    "--map-root-user",
                    "bash",
                    "-c",
                    script,
                    env!("CARGO_BIN_EXE_pkm"),
                ])
                .arg(copy.file(""))
                .args([command, words, &size])
                .output()
                .unwrap();
            let text =
                String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned();
            // If users may create no namespaces there is no such disk.
            if output.status.code() == Some(77) || text.contains("unshare failed") {
                return;
            }
            let is_full = text.contains("No space left on device");
            let done = ["switched on, homed", "The program fits", "runs to its end"];
            let is_done = done.iter().any(|words| text.contains(words));
            assert!(is_full != is_done && !text.contains("not fit"), "{command} {size}: {text}");
            let code = if is_full && command != "check" { 2 } else { 0 };
            assert_eq!(output.status.code(), Some(code), "{command} {size}: {text}");
            assert!(!text.lines().any(|line| line.starts_with("pkm-")), "left behind: {text}");
        }
    }
}

#[test]
fn a_program_of_10_gb_is_refused_at_once() {
    let copy = Copy::new(|text| text, SHORT);
    fs::File::create(copy.file("big.ngc")).unwrap().set_len(10 << 30).unwrap();
    for command in ["run", "preflight", "replay", "filter --machine"] {
        // Less memory than the largest file that is read.
        let script = format!("ulimit -v 1000000; exec \"$0\" {command} \"$1\" \"$2\"");
        let output = Command::new("bash")
            .args(["-c", &script, env!("CARGO_BIN_EXE_pkm")])
            .args([copy.file("hexapod.ini"), copy.file("big.ngc")])
            .output()
            .unwrap();
        let error = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{command}: {error}");
        assert!(error.contains("big.ngc: larger than 1 GiB"), "{command}: {error}");
    }
}

#[test]
fn two_runs_at_once_are_the_same_as_one() {
    let copy = Copy::new(|text| text, "G21 G90\nT1 M6 G43\nG0 X1\nG1 F600 Y5 A2\nM2\n");
    let start = |trace: &str| {
        Command::new(env!("CARGO_BIN_EXE_pkm"))
            .args(["preflight", "--format", "json"])
            .args([copy.file("hexapod.ini"), copy.file("programs/p.ngc")])
            .arg("--trace")
            .arg(copy.file(trace))
            .env("TMPDIR", copy.file("tmp"))
            .stdout(Stdio::piped())
            .spawn()
            .unwrap()
    };
    let alone = start("alone.csv").wait_with_output().unwrap();
    assert_eq!(alone.status.code(), Some(0));
    // They write one file: the last one to end has written it completely.
    for run in [start("both.csv"), start("both.csv")] {
        let both = run.wait_with_output().unwrap();
        assert!(both.status.success() && both.stdout == alone.stdout);
    }
    assert!(fs::read(copy.file("both.csv")).unwrap() == fs::read(copy.file("alone.csv")).unwrap());
    assert_eq!(fs::read_dir(copy.file("tmp")).unwrap().count(), 0);
}

#[test]
fn startup_code_that_linuxcnc_refuses_is_named_with_its_line() {
    let with = |code: &'static str| {
        move |text: String| {
            let line = |line: &str| match line.starts_with("RS274NGC_STARTUP_CODE") {
                true => format!("RS274NGC_STARTUP_CODE = {code}\n"),
                false => format!("{line}\n"),
            };
            text.lines().map(line).collect()
        }
    };
    for (code, words) in [
        ("G21 G91.2", "Unknown g code used"),
        ("G21 G0 X10", "while the machine is off"),
        ("M2", "does not start with it"),
    ] {
        let (_, error, exit) = Copy::new(with(code), SHORT).run();
        assert_eq!(exit, Some(2), "{error}");
        let place = format!("[RS274NGC]RS274NGC_STARTUP_CODE = {code}: ");
        assert!(error.contains("hexapod.ini:") && error.contains(&place), "{error}");
        assert!(error.contains(words), "{error}");
    }
    let copy = Copy::new(with("G21 T1 M6"), SHORT);
    let config = test_support::shipped::first_of(&copy.file("hexapod.ini"));
    let options = Options { most_work: 1.5, ..Options::default() };
    let program = copy.file("programs/p.ngc");
    let see = |_: &Row| ControlFlow::Continue(());
    let refusal =
        process::run(&config.clone().into(), &program, &options, see).unwrap_err().to_string();
    assert!(
        refusal.contains("STARTUP_CODE = G21 T1 M6: ") && refusal.contains("forever"),
        "{refusal}"
    );
}

#[test]
fn the_tool_changer_looks_at_its_pins_as_often_as_the_ini_file_says() {
    let seconds = |cycle: &str| {
        let edit = |text: String| text.replacen("CYCLE_TIME = 0.050", cycle, 1);
        let (out, error, code) = Copy::new(edit, "G21 G90\nT1 M6\nM2\n").run();
        assert_eq!(code, Some(0), "{out}{error}");
        let words: Vec<&str> = out.split_whitespace().collect();
        words[words.len() - 2].parse::<f64>().expect("runs to its end in ... s")
    };
    let [none, given] = ["", "CYCLE_TIME = 0.050"].map(seconds);
    let slow = seconds("CYCLE_TIME = 0.5");
    // LinuxCNC's own is 0.1 s without one. T and M6 wait for at least two polls, the first of which may be
    // immediate.
    assert!(none > given + 0.04 && slow > none + 0.35, "{given} {none} {slow}");
}

#[test]
fn modules_stand_beside_hal_files_and_beside_a_library_that_is_named() {
    let copy = Copy::new(|text| text, SHORT);
    let folder = copy.file("of my own");
    fs::create_dir(&folder).unwrap();
    // A component under another name than LinuxCNC's, in a folder with blanks.
    fs::copy("/usr/lib/linuxcnc/modules/or2.so", folder.join("mine.so")).unwrap();
    let hal = folder.join("more.hal");
    fs::write(&hal, "loadrt mine names=one\naddf one servo-thread\n").unwrap();
    let options = Options { hal: vec![hal], ..Options::default() };
    let outcome = run_text("hexapod", SHORT, &options).unwrap();
    assert_eq!(outcome.ending, Ending::Finished);

    let library = copy.file("libpkmkins-virtual.so");
    fs::copy(virtual_library(), &library).unwrap();
    fs::write(copy.file("pkmkins.so"), "no module").unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_pkm"))
        .arg("run")
        .args([copy.file("hexapod.ini"), copy.file("programs/p.ngc")])
        .env("PKM_VIRTUAL_LIBRARY", library)
        .output()
        .unwrap();
    let error = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{error}");
    let module = copy.file("pkmkins.so");
    assert!(error.contains(&format!("{}: ", module.display())), "{error}");
}

/// Returns the library that the tests use.
fn virtual_library() -> PathBuf {
    let installed = || "/usr/lib/linuxcnc/modules/libpkmkins-virtual.so".into();
    std::env::var_os("PKM_VIRTUAL_LIBRARY").map_or_else(installed, PathBuf::from)
}

#[test]
fn a_control_that_is_killed_and_a_command_that_is_interrupted_leave_nothing() {
    let text = "G21 G90\no1 while [1]\nG0 X1\nG0 X-1\no1 endwhile\nM2\n";
    for signal in ["-KILL", "-SEGV", "-INT"] {
        let copy = Copy::new(|text| text, text);
        let mut child = Command::new(env!("CARGO_BIN_EXE_pkm"))
            .arg("run")
            .args([copy.file("hexapod.ini"), copy.file("programs/p.ngc")])
            .env("TMPDIR", copy.file("tmp"))
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let control = control_of(child.id());
        let target = if signal != "-INT" { &control } else { &child.id().to_string() };
        assert!(Command::new("kill").args([signal, target]).status().unwrap().success());
        let status = ended(&mut child);
        assert_eq!(status.code(), Some(if signal == "-INT" { 130 } else { 2 }));
        assert_eq!(fs::read_dir(copy.file("tmp")).unwrap().count(), 0);
        let proc = Path::new("/proc").join(&control);
        let gone = (0..500).any(|_| {
            sleep(Duration::from_millis(10));
            !proc.exists()
        });
        assert!(gone, "{signal}: LinuxCNC goes on");
    }
}

/// Waits for the LinuxCNC process that a command starts, and returns it.
pub fn control_of(parent: u32) -> String {
    for _ in 0..1000 {
        let found = Command::new("pgrep").args(["-P", &parent.to_string(), "pkm-control"]).output();
        let text = String::from_utf8(found.unwrap().stdout).unwrap();
        if !text.trim().is_empty() {
            return text.trim().into();
        }
        sleep(Duration::from_millis(10));
    }
    panic!("LinuxCNC was not started");
}
