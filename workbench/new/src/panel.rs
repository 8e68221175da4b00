// SPDX-License-Identifier: GPL-2.0-or-later
//! The operator's panel of a machine, for LinuxCNC's PyVCP: docs/guide/panel.md.
//!
//! Two texts: the widgets, and the pin connected to each of them. Pins have the names of their widgets with
//! the prefix `pyvcp.`.

use check::findings::Finding;
use kinematics::Letter;
use machine::files::{AtFile, read_text};
use machine::read::diagnostic::Severity;
use machine::read::joints::Joint;
use machine::read::machine::MachineConfig;
use machine::read::mechanism::Mechanism;
use std::fmt::Write as _;
use std::io;

/// Colors for within, near and beyond limits, distinguishable with color blindness and in print.
const WELL: &str = "#56b4e9";
const NEAR: &str = "#e69f00";
const BEYOND: &str = "#d55e00";

/// Share of a range within which it counts as near its end.
const EDGE: f64 = 0.1;

/// Installed program that converts codes to words.
const WORDS: &str = "/usr/share/pkmkins/pkmkins_panel.py";

/// Most rows of a page: more do not fit beside AXIS on a screen of 1080 lines.
const ROWS: usize = 12;

/// Comment of both files.
const MADE: &str = "Made by pkm panel";

/// Both texts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Panel {
    /// For `[DISPLAY]PYVCP`.
    pub widgets: String,
    /// For `[HAL]POSTGUI_HALFILE`.
    pub wiring: String,
}

/// Accumulated widgets and nets.
#[derive(Default)]
struct Sheet {
    widgets: String,
    /// Pin and widget.
    nets: Vec<(String, String)>,
}

struct Bar {
    widget: String,
    pin: String,
    range: [f64; 2],
    /// Ends of the ranges of the first and the second color.
    steps: [f64; 2],
    colors: [&'static str; 3],
    format: &'static str,
}

impl Panel {
    /// Creates the panel of this machine, whose files begin with `name`.
    pub fn new(config: &MachineConfig, name: &str) -> Self {
        let mut sheet = Sheet::default();
        sheet.open("pyvcp", "");
        sheet.pages(config);
        sheet.travel(config);
        sheet.dependent(config);
        sheet.guard(config);
        sheet.kinematics(config);
        sheet.refusals();
        sheet.close("pyvcp");
        // A comment of XML must not contain two adjacent hyphens.
        let spaced = name.replace("--", "- -");
        let widgets = format!(
            "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<!-- {MADE} from {spaced}.ini. -->\n{}",
            sheet.widgets
        );
        Self { widgets, wiring: sheet.wiring(config, name) }
    }
}

/// Returns a warning if a file of the panel beside the machine's file is from `pkm panel`, but for another machine.
///
/// # Errors
/// A file cannot be read.
pub fn stale(config: &MachineConfig) -> Result<Option<Finding>, AtFile<io::Error>> {
    let name = config.file.file_stem().unwrap_or_default().to_string_lossy();
    let panel = Panel::new(config, &name);
    for (section, key, ending, text) in [
        ("DISPLAY", "PYVCP", "xml", &panel.widgets),
        ("HAL", "POSTGUI_HALFILE", "tcl", &panel.wiring),
    ] {
        let file = format!("{name}-panel.{ending}");
        let entries = config.ini.all(section, key);
        let Some(entry) = entries.iter().find(|entry| entry.value.trim() == file) else { continue };
        let place = config.file.with_file_name(&file);
        // A missing one is an error of the check.
        let written = if place.is_file() { read_text(&place)? } else { continue };
        if written == *text || !written.contains(MADE) {
            continue;
        }
        let text = format!(
            "the panel is not that of this machine and shows other limits or axes: run pkm panel {} to write it \
             again; if you changed it yourself, remove the comment {MADE:?} from it",
            config.file.display()
        );
        let problem = *config.ini.refuse(entry, &text).0;
        return Ok(Some(Finding { severity: Severity::Warning, problem }));
    }
    Ok(None)
}

impl Sheet {
    fn open(&mut self, element: &str, attributes: &str) {
        let _ = writeln!(self.widgets, "<{element}{attributes}>");
    }

    fn close(&mut self, element: &str) {
        let _ = writeln!(self.widgets, "</{element}>");
    }

    fn widget(&mut self, element: &str, attributes: &str) {
        let _ = writeln!(self.widgets, "<{element} {attributes}/>");
    }

    /// Adds a widget that shows a pin.
    fn shown(&mut self, element: &str, widget: &str, pin: &str, attributes: &str) {
        self.widget(element, &format!("halpin=\"{widget}\" {attributes}"));
        self.nets.push((pin.into(), widget.into()));
    }

    fn label(&mut self, text: &str) {
        self.widget("label", &format!("text=\"{text}\" anchor=\"w\""));
    }

    fn bar(&mut self, bar: &Bar) {
        let Bar { range: [low, high], steps: [first, second], colors, .. } = bar;
        let [low, high, first, second] = [low, high, first, second].map(|value| rounded(*value));
        let [one, two, three] = colors;
        let attributes = format!(
            "min_=\"{low}\" max_=\"{high}\" range1=\"({low},{first},'{one}')\" \
             range2=\"({first},{second},'{two}')\" range3=\"({second},{high},'{three}')\" \
             fillcolor=\"{two}\" bgcolor=\"#dddddd\" format=\"{}\" canvas_width=\"210\" \
             canvas_height=\"33\" bar_height=\"17\" bar_width=\"150\"",
            bar.format
        );
        self.shown("bar", &bar.widget, &bar.pin, &attributes);
    }

    fn table(&mut self, columns: &str) {
        self.open("table", &format!(" {columns}"));
        self.widget("tablesticky", "sticky=\"w\"");
    }

    fn row(&mut self) {
        self.widgets.push_str("<tablerow/>\n");
    }

    fn lamp(&mut self, widget: &str, pin: &str, text: &str, color: &str) {
        let attributes = format!("size=\"12\" on_color=\"{color}\" off_color=\"#dddddd\"");
        self.shown("led", widget, pin, &attributes);
        self.label(text);
    }

    /// Adds joints, and the cones that the machine has, on separate pages.
    fn pages(&mut self, config: &MachineConfig) {
        let joints: Vec<_> = config.all_joints().enumerate().collect();
        let cones = cones(config);
        let pages: Vec<_> = joints.chunks(ROWS).collect();
        let of_cones: Vec<_> = cones.chunks(ROWS).collect();
        let name = |what: &str, n: usize, count: usize| match count {
            1 => format!("'{what}'"),
            _ => format!("'{what} {}'", n + 1),
        };
        let names = (0..pages.len()).map(|n| name("Joints", n, pages.len()));
        let names = names.chain((0..of_cones.len()).map(|n| name("Angles", n, of_cones.len())));
        let names = names.collect::<Vec<_>>().join(",");
        self.open("tabs", &format!(" names=\"[{names}]\" width=\"375\""));
        for page in pages {
            self.table("");
            self.row();
            for heading in ["", "in its range", "to its end"] {
                self.label(heading);
            }
            for (n, (one, i)) in page {
                self.joint(config, *n, one.joint(*i), one.unit_of(*i));
            }
            self.close("table");
        }
        for page in of_cones {
            self.table("");
            for (name, pin, most) in page {
                self.row();
                self.label(name);
                self.bar(&Bar {
                    widget: pin.replace('.', "-"),
                    pin: format!("pkmkins.{pin}"),
                    range: [0.0, *most],
                    steps: [(1.0 - EDGE) * most, *most],
                    colors: [WELL, NEAR, BEYOND],
                    format: ".1f",
                });
            }
            self.close("table");
        }
        self.close("tabs");
    }

    /// Adds the position of a joint in its range, and its distance from the nearer end.
    fn joint(&mut self, config: &MachineConfig, n: usize, joint: &Joint, unit: &str) {
        let (min, max) = (joint.min, joint.max);
        let edge = EDGE * (max - min);
        let format = digits(config, unit);
        self.row();
        self.label(&joint.name);
        self.bar(&Bar {
            widget: format!("joint-{n}"),
            pin: format!("joint.{n}.pos-fb"),
            range: [min, max],
            steps: [min + edge, max - edge],
            colors: [NEAR, WELL, NEAR],
            format,
        });
        if n < config.guarded_joints() {
            let attributes = format!("format=\"{format}\" width=\"8\" anchor=\"e\"");
            self.shown(
                "number",
                &format!("margin-{n}"),
                &format!("pkmkins.margin.{n}"),
                &attributes,
            );
        }
    }

    fn travel(&mut self, config: &MachineConfig) {
        self.open("labelframe", " text=\"Travel left from here\"");
        self.table("");
        self.row();
        self.label("");
        for heading in ["to smaller", "to larger"] {
            self.widget("label", &format!("text=\"{heading}\" width=\"10\" anchor=\"e\""));
        }
        for (letter, is_angle) in letters(config) {
            let unit = if is_angle { "degrees" } else { config.length_unit() };
            let format = digits(config, unit);
            self.row();
            self.label(&letter.to_string());
            for way in ["minus", "plus"] {
                let widget = format!("{}-{way}", letter.to_ascii_lowercase());
                let attributes = format!("format=\"{format}\" width=\"10\" anchor=\"e\"");
                self.shown("number", &widget, &format!("pkmkins-panel.{widget}"), &attributes);
            }
            self.label(unit);
        }
        self.close("table");
        self.open("hbox", "");
        self.lamp("travel-known", "pkmkins-panel.known", "known", WELL);
        self.close("hbox");
        self.close("labelframe");
    }

    /// Adds the coordinates that constraints determine.
    fn dependent(&mut self, config: &MachineConfig) {
        let letters = config.first().dependent();
        if letters.is_empty() {
            return;
        }
        self.open("labelframe", " text=\"Platform: coordinates that follow\"");
        self.table("");
        for letter in letters {
            let unit = if letter.is_angle() { "degrees" } else { config.length_unit() };
            let name = letter.name().to_ascii_lowercase();
            self.row();
            self.label(&letter.name().to_string());
            let attributes =
                format!("format=\"{}\" width=\"10\" anchor=\"e\"", digits(config, unit));
            let pin = format!("pkmkins.dependent.{name}");
            self.shown("number", &format!("dependent-{name}"), &pin, &attributes);
            self.label(unit);
        }
        self.close("table");
        self.close("labelframe");
    }

    fn guard(&mut self, config: &MachineConfig) {
        self.open("labelframe", " text=\"Guard\"");
        self.table("");
        for mechanism in &config.mechanisms {
            let (stem, own) = stem(mechanism);
            let limit = mechanism.conditioning_limit;
            self.row();
            self.label(&format!("hold{}", own.replace('-', " ")));
            self.bar(&Bar {
                widget: format!("conditioning{own}"),
                pin: format!("{stem}conditioning"),
                range: [0.0, 1.0],
                steps: [limit, 2.0 * limit],
                colors: [BEYOND, NEAR, WELL],
                format: ".3f",
            });
        }
        self.row();
        self.label("feed allowed");
        self.bar(&Bar {
            widget: "feed-scale".into(),
            pin: "pkmkins.feed-scale".into(),
            range: [0.0, 1.0],
            steps: [0.25, 0.99],
            colors: [BEYOND, NEAR, WELL],
            format: ".2f",
        });
        self.row();
        self.label("jog speed allowed");
        self.bar(&Bar {
            widget: "jog-scale".into(),
            pin: "pkmkins.jog-scale".into(),
            range: [0.0, 1.0],
            steps: [0.25, 0.99],
            colors: [BEYOND, NEAR, WELL],
            format: ".2f",
        });
        self.close("table");
        self.table("");
        self.row();
        self.lamp("guard-on", "pkmkins-panel.guard-on", "M52 P1 on", WELL);
        self.lamp("limit-soon", "pkmkins.limit-soon", "limit ahead", NEAR);
        self.row();
        self.lamp("feed-inhibit", "pkmkins.feed-inhibit", "feed stopped", BEYOND);
        self.lamp("tool-busy", "pkmkins.tool-busy", "tool changes", NEAR);
        self.close("table");
        self.close("labelframe");
    }

    fn kinematics(&mut self, config: &MachineConfig) {
        self.open("labelframe", " text=\"Kinematics\"");
        self.table("");
        self.row();
        self.lamp("is-machine", "kinstype.is-0", "machine", WELL);
        self.lamp("is-joints", "kinstype.is-1", "joints as axes", NEAR);
        if has_identity(config) {
            self.widget(
                "radiobutton",
                "halpin=\"kinematics\" choices=\"['machine','joints']\" orient=\"'h'\"",
            );
        }
        for mechanism in &config.mechanisms {
            let (stem, own) = stem(mechanism);
            self.row();
            self.lamp(
                &format!("geometry-ok{own}"),
                &format!("{stem}geometry-ok"),
                "geometry",
                WELL,
            );
            let changed = format!("{stem}geometry-changed");
            self.lamp(&format!("geometry-changed{own}"), &changed, "pins differ", BEYOND);
            let hash = format!("{stem}geometry-hash");
            self.shown("u32", &format!("geometry-hash{own}"), &hash, "");
        }
        self.close("table");
        self.close("labelframe");
    }

    fn refusals(&mut self) {
        self.open("labelframe", " text=\"Refused\"");
        let words = format!(
            "(__import__('runpy').run_path('{WORDS}')['reason'](pyvcp0) if os.path.exists('{WORDS}') else None)"
        );
        self.widget(
            "label",
            &format!(
                "text=\"{WORDS} is missing: make install\" textvariable=\"{words}\" wraplength=\"340\" \
                 justify=\"left\" anchor=\"nw\" height=\"6\""
            ),
        );
        self.close("labelframe");
    }

    fn wiring(&self, config: &MachineConfig, name: &str) -> String {
        // A user interface ends LinuxCNC if this file fails.
        let mut text = format!(
            "# {MADE} from {name}.ini: what {name}-panel.xml shows.\n\
             if {{[catch {{ source [file join $::env(HALLIB_DIR) pkmkins_panel.tcl] }} error]}} {{\n    \
                 catch {{ puts stderr \"pkmkins: panel: not connected: $error\" }}\n    \
                 return\n\
             }}\n\
             pkmkins_panel::start {name}.ini {{{}}}\n",
            letters(config)
                .map(|(letter, _)| letter.to_ascii_lowercase().to_string())
                .collect::<Vec<_>>()
                .join(" ")
        );
        if has_identity(config) {
            text.push_str("pkmkins_panel::switch\n");
        }
        text.push_str("pkmkins_panel::show {\n");
        for (pin, widget) in &self.nets {
            let _ = writeln!(text, "    {pin} {widget}");
        }
        text + "}\n"
    }
}

/// Returns the prefix of the names of a mechanism's pins, and the suffix of its widgets' names.
fn stem(mechanism: &Mechanism) -> (&'static str, &'static str) {
    if mechanism.place.is_second { ("pkmkins.second.", "-second") } else { ("pkmkins.", "") }
}

/// Returns the letters that the machine moves, in LinuxCNC's order, and whether they are angles.
fn letters(config: &MachineConfig) -> impl Iterator<Item = (char, bool)> {
    let own = config.mechanisms.iter().flat_map(|mechanism| {
        let moved = |letter: &Letter| !mechanism.machine.layout().is_held(*letter);
        let place = |letter: Letter| mechanism.place.places[letter.index()];
        Letter::ALL.into_iter().filter(moved).map(place).collect::<Vec<_>>()
    });
    let mut places: Vec<usize> = own.chain(config.first().extra_axes.places()).collect();
    places.sort_unstable();
    places.into_iter().map(|place| (kinematics::POSE_LETTERS[place], (3..6).contains(&place)))
}

/// Returns whether each joint can be assigned a letter.
fn has_identity(config: &MachineConfig) -> bool {
    config.mechanisms.iter().all(|mechanism| {
        let layout = mechanism.machine.layout();
        layout.legs() == layout.coordinates().as_slice().len()
    })
}

/// Returns name, pin and largest value of the angles that have a limit.
fn cones(config: &MachineConfig) -> Vec<(String, String, f64)> {
    let of = |mechanism: &Mechanism| {
        let row = |k: usize, end: &str, i: usize| {
            let (n, most) = (mechanism.place.first_leg + i, mechanism.angles[i].cones[k]?);
            Some((format!("{end} {n}"), format!("{end}-angle.{n}"), most))
        };
        let rows = |(k, end)| {
            (0..mechanism.legs()).filter_map(move |i| row(k, end, i)).collect::<Vec<_>>()
        };
        [(0, "base"), (1, "platform")].map(rows).concat()
    };
    config.mechanisms.iter().flat_map(of).collect()
}

/// Returns the number format of values for the operator.
fn digits(config: &MachineConfig, unit: &str) -> &'static str {
    match unit {
        "degrees" => ".2f",
        _ if config.units_per_mm == 1.0 => ".1f",
        _ => ".3f",
    }
}

/// Rounds for a bar.
fn rounded(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}
