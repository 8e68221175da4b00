// SPDX-License-Identifier: GPL-2.0-or-later
//! The folder in which LinuxCNC runs: copies of the files that it writes, and an INI file that refers to them.

use crate::refusal::NotJudged;
use machine::files::{self, AtFile, Folder, Locate, Whole};
use machine::read::machine::MachineConfig;
use machine::read::places::{OF_TCL, folders, is_of_tcl, named};
use std::fs::{self, File};
use std::io;
use std::path::{self, Path, PathBuf};

const DRIVER: &str = include_str!("../virtual/driver.py");
const WIRING: &str =
    concat!(include_str!("../../machine/src/read/ini.tcl"), include_str!("../virtual/wiring.tcl"));
/// Executes the simulated machine's HAL files.
const SIMULATED: &str = "\nwiring::main {*}$argv\n";

/// Buffers through which milltask, the tool changer and the driver communicate: their names, sizes, numbers, and
/// the additional settings in LinuxCNC's own file.
const BUFFERS: [(&str, u32, u32, &str); 5] = [
    ("emcCommand", 8192, 1, "queue confirm_write serial"),
    ("emcStatus", 20480, 2, ""),
    ("emcError", 8192, 3, "queue"),
    ("toolCmd", 1024, 4, ""),
    ("toolSts", 1024, 5, ""),
];

/// Processes that open them: the library, which creates them, milltask, the driver.
const OPENERS: [(&str, u32); 3] = [("pkmkins", 1), ("emc", 0), ("xemc", 0)];

/// Keys that determine how a joint homes; it starts at its home position instead.
const HOMING: [&str; 9] = [
    "HOME_OFFSET",
    "HOME_SEARCH_VEL",
    "HOME_LATCH_VEL",
    "HOME_FINAL_VEL",
    "HOME_ABSOLUTE_ENCODER",
    "HOME_USE_INDEX",
    "HOME_IS_SHARED",
    "HOME_SEQUENCE",
    "SIM_START",
];

/// The folder; it is deleted when its owner is dropped.
pub struct Scratch {
    folder: Folder,
    /// The tool table's copy; empty without a tool table.
    pub tool_table: PathBuf,
    /// Folders with programs and subroutines that the INI file names.
    pub folders: Vec<PathBuf>,
    /// Whether joints home as in the machine's file, instead of at once.
    homes: bool,
}

/// Free bytes below which a disk counts as full: some blocks of any file system.
const ROOM: usize = 1 << 16;

impl Scratch {
    /// Creates the folder. With `own`, a script, the machine's own HAL files are executed instead of the simulated
    /// machine's, and its joints home as in its file.
    ///
    /// # Errors
    /// A file cannot be read or written, or the INI file requires something that is not supported.
    pub fn new(config: &MachineConfig, own: Option<&str>) -> Result<Self, NotJudged> {
        refuse_others(config, own.is_some())?;
        Ok(Self::made(config, own)?)
    }

    fn made(config: &MachineConfig, own: Option<&str>) -> Result<Self, AtFile<io::Error>> {
        let folder = Folder::new()?;
        let tool_table = match &config.program.tool_table {
            Some(table) => copied(table, &folder.path().join("tools.tbl"))?,
            None => PathBuf::new(),
        };
        let file = &from_root(config);
        let folders = config
            .ini
            .entries()
            .filter_map(|entry| folders(file, &entry.section, &entry.key, &entry.value));
        let folders =
            folders.flat_map(|names| names.split(':').map(PathBuf::from).collect::<Vec<_>>());
        let scratch = Self { folder, tool_table, folders: folders.collect(), homes: own.is_some() };
        match &config.program.parameter_file {
            Some(stored) if stored.exists() => drop(copied(stored, &scratch.parameters())?),
            _ => write(&scratch.parameters(), "")?,
        }
        write(&scratch.ini(), &scratch.ini_text(config))?;
        write(&scratch.path().join("driver.py"), DRIVER)?;
        let written = scratch.path().join("written");
        fs::create_dir(&written).at(&written)?;
        write(&scratch.wiring(), &(WIRING.to_string() + own.unwrap_or(SIMULATED)))?;
        write(&scratch.path().join("buffers.nml"), &buffers())?;
        Ok(scratch)
    }

    /// Returns the path of the folder.
    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Returns the INI file that LinuxCNC reads.
    pub fn ini(&self) -> PathBuf {
        self.path().join("machine.ini")
    }

    /// Checks that the disk is not full.
    ///
    /// # Errors
    /// The disk is full, or the folder cannot be written for another reason.
    pub fn check_room(&self) -> Result<(), AtFile<io::Error>> {
        let file = self.path().join("room");
        fs::write(&file, [0; ROOM]).at(self.path())?;
        fs::remove_file(&file).at(&file)
    }

    /// Copies the files that the program wrote.
    ///
    /// # Errors
    /// One of them cannot be written.
    pub fn keep_written(&self, folder: &Path) -> Result<(), AtFile<io::Error>> {
        let written = self.path().join("written");
        fs::create_dir_all(folder).at(folder)?;
        for entry in fs::read_dir(&written).at(&written)? {
            let entry = entry.at(&written)?;
            let (from, to) = (entry.path(), folder.join(entry.file_name()));
            let mut whole = Whole::new(&to)?;
            io::copy(&mut File::open(&from).at(&from)?, &mut whole).at(&to)?;
            whole.finish()?;
        }
        Ok(())
    }

    /// Copies milltask under another name: LinuxCNC ends every process of its own name when it stops.
    ///
    /// # Errors
    /// The copy cannot be made.
    pub fn milltask(&self, original: &Path) -> Result<PathBuf, AtFile<io::Error>> {
        copied(original, &self.path().join("pkm-control"))
    }

    /// Returns the script that executes the HAL files.
    pub fn wiring(&self) -> PathBuf {
        self.path().join("wiring.tcl")
    }

    fn parameters(&self) -> PathBuf {
        self.path().join("parameters.var")
    }

    /// Returns the machine's INI file with the files and folders of the run; every joint homes at once, where it is.
    fn ini_text(&self, config: &MachineConfig) -> String {
        let file = &from_root(config);
        let mut text = String::new();
        let mut section = String::new();
        for line in config.program.expanded.as_deref().unwrap_or(config.ini.text()).lines() {
            let trimmed = line.trim();
            let heading = trimmed.strip_prefix('[').and_then(|rest| rest.split_once(']'));
            if let Some((name, _)) = heading {
                section = name.into();
                text += &format!("{line}\n{}", self.added(config, &section));
                continue;
            }
            let key = trimmed.split_once('=').map(|(key, value)| (key.trim(), value.trim()));
            let replaced = key.map(|(key, value)| self.replaced(&section, key, value, file));
            text +=
                &replaced.unwrap_or_else(|| Some(line.into())).map_or(String::new(), |l| l + "\n");
        }
        text
    }

    /// Returns the lines added at the head of a section.
    fn added(&self, config: &MachineConfig, section: &str) -> String {
        let joint = section.strip_prefix("JOINT_").and_then(|n| n.parse::<usize>().ok());
        match (section, joint.and_then(|n| config.all_joints().nth(n))) {
            ("RS274NGC", _) => format!("PARAMETER_FILE = {}\n", self.parameters().display()),
            ("EMC", _) => format!("NML_FILE = {}/buffers.nml\n", self.path().display()),
            (_, Some((one, i))) if !self.homes => format!(
                "HOME_OFFSET = {}\nHOME_SEARCH_VEL = 0\nHOME_LATCH_VEL = 0\nHOME_SEQUENCE = 0\n",
                one.joint(i).home
            ),
            _ => String::new(),
        }
    }

    /// Adapts a line of the INI file to the run; returns `None` for one that is left out.
    fn replaced(&self, section: &str, key: &str, value: &str, file: &Path) -> Option<String> {
        let said = |value: String| Some(format!("{key} = {value}"));
        match (section, key) {
            ("EMC", "NML_FILE" | "DEBUG")
            | ("RS274NGC", "LOG_FILE" | "LOG_LEVEL" | "PARAMETER_FILE") => None,
            ("EMCIO", "TOOL_TABLE") => said(self.tool_table.display().to_string()),
            (_, "COMP_FILE") if section.starts_with("JOINT_") => {
                said(named(file, value).display().to_string())
            }
            _ if !self.homes && section.starts_with("JOINT_") && HOMING.contains(&key) => None,
            _ => said(folders(file, section, key, value).unwrap_or_else(|| value.into())),
        }
    }
}

/// Returns the absolute path of the INI file's folder.
fn folder_of(config: &MachineConfig) -> PathBuf {
    from_root(config).parent().unwrap_or(Path::new("/")).into()
}

fn from_root(config: &MachineConfig) -> PathBuf {
    path::absolute(&config.file).unwrap_or_else(|_| config.file.clone())
}

fn write(file: &Path, text: &str) -> Result<(), AtFile<io::Error>> {
    fs::write(file, text).at(file)
}

fn copied(from: &Path, to: &Path) -> Result<PathBuf, AtFile<io::Error>> {
    // Name the missing file; later errors concern the target, such as a full disk.
    files::open(from)?;
    fs::copy(from, to).at(to)?;
    Ok(to.into())
}

fn buffers() -> String {
    let buffer = |(name, size, number, words): (&str, u32, u32, &str)| {
        format!("B {name} LOCMEM localhost {size} 0 0 {number} 16 {words}\n")
    };
    let opener = |(name, master): (&str, u32)| -> String {
        let line =
            |buffer: &str| format!("P {name} {buffer} LOCAL localhost RW 0 1.0 {master} 0\n");
        BUFFERS.iter().map(|(buffer, ..)| line(buffer)).collect()
    };
    BUFFERS.into_iter().map(buffer).chain(OPENERS.into_iter().map(opener)).collect()
}

/// Refuses a configuration that runs other user programs, whose effect on the motion is unknown, or that
/// this LinuxCNC does not support.
fn refuse_others(config: &MachineConfig, leaves_halui: bool) -> Result<(), NotJudged> {
    let value = |section: &str, key: &str| config.ini.as_inivar(section, key);
    let remote = |file: &str| is_remote(&folder_of(config).join(file));
    let reasons = [
        ("EMCIO", "DB_PROGRAM", "a separate program manages the tools"),
        ("PYTHON", "TOPLEVEL", "it would be executed"),
        ("TASK", "TASK", "only milltask is supported"),
        ("TRAJ", "PLANNER_TYPE", "only planner 0 is supported"),
        ("EMC", "NML_FILE", "it names processes of other computers"),
    ];
    for (section, key, why) in reasons {
        let Some(value) = value(section, key) else { continue };
        let is_harmless = match key {
            "HALUI" => leaves_halui,
            "TASK" => value == "milltask",
            "PLANNER_TYPE" => value == "0",
            "NML_FILE" => !remote(value),
            _ => false,
        };
        if !is_harmless {
            return Err(NotJudged::Asked(format!("[{section}]{key} = {value}"), why));
        }
    }
    if let Some(section) = config.ini.sections().find(|section| is_of_tcl(section)) {
        return Err(NotJudged::Refused(format!("[{section}]: {OF_TCL}")));
    }
    let mut remaps = config.ini.all("RS274NGC", "REMAP").into_iter();
    match remaps.find(|entry| is_python(&entry.value)) {
        Some(entry) => {
            let key = format!("[RS274NGC]REMAP = {}", entry.value);
            Err(NotJudged::Asked(key, "it runs Python code of the user"))
        }
        None => Ok(()),
    }
}

/// Returns whether a remapped code is or calls Python, instead of only a subroutine.
fn is_python(remap: &str) -> bool {
    let begins = ["py=", "python=", "prolog=", "epilog="];
    remap.split_whitespace().any(|word| begins.iter().any(|begin| word.starts_with(begin)))
}

/// Returns whether a file of NML buffers has processes of other computers; the run has its own buffers.
fn is_remote(file: &Path) -> bool {
    let text = fs::read_to_string(file).unwrap_or_default();
    text.lines()
        .map(str::split_whitespace)
        .any(|mut words| words.next() == Some("P") && words.nth(2) == Some("REMOTE"))
}
