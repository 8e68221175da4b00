// SPDX-License-Identifier: GPL-2.0-or-later
//! The keys of the INI file as dictionaries of Tcl and as a section of the manual page.

use keys::{
    KINDS, Key, Need, ROW, Range, chain, joint, kind_name, leg, machine, of_leg, second,
    workspace_box,
};
use std::fmt::Write as _;

/// The dictionaries that pkmkins.tcl reads with.
pub fn dictionaries() -> String {
    let mut text = String::from(
        "# By name: names of its numbers ({} where it is one), need, pin (with N for the leg or joint, K\n\
         # for the box, L for the axis), range, the range in words, what the pin is set to where the key is absent.\n\
         namespace eval pkmkins {\n",
    );
    let mut put = |name: &str, keys: &mut dyn Iterator<Item = &Key>| {
        let _ = writeln!(text, "    variable {name} {{");
        keys.for_each(|key| text.push_str(&entry(key, "        ")));
        text.push_str("    }\n");
    };
    put("machine_keys", &mut machine::ALL.iter().copied());
    put("second_keys", &mut second::ALL.iter().copied());
    put("chain_keys", &mut chain::ALL.iter().copied());
    put("joint_keys", &mut joint::ALL.iter().copied());
    put("box_keys", &mut workspace_box::ALL.iter().copied());
    text.push_str("    variable leg_keys {\n");
    for kind in KINDS {
        let _ = writeln!(text, "        {} {{", kind_name(*kind));
        of_leg(*kind).for_each(|key| text.push_str(&entry(key, "            ")));
        text.push_str("        }\n");
    }
    let _ = writeln!(text, "    }}\n    variable box_row {ROW}\n}}");
    text
}

fn entry(key: &Key, indent: &str) -> String {
    let need = match key.need {
        Need::Needed => "needed".into(),
        Need::Optional => "optional".into(),
        Need::Cardan => "cardan".into(),
        Need::With(other) => format!("{{with {other}}}"),
    };
    let absent = key.absent.map_or("{}".into(), |value| value.to_string());
    let fields = [
        format!("{{{}}}", key.parts.join(" ")),
        need,
        if key.pin.is_empty() { "{}".into() } else { key.pin.into() },
        range(key.range),
        format!("{{{}}}", key.expected()),
        absent,
    ];
    format!("{indent}{} {{{}}}\n", key.name, fields.join(" "))
}

fn range(range: Range) -> String {
    let bound = |value: f64| if value == f64::INFINITY { "Inf".into() } else { value.to_string() };
    match range {
        Range::Any => "any".into(),
        Range::Above(least, most) => format!("{{above {} {}}}", bound(least), bound(most)),
        Range::From(least, most) => format!("{{from {} {}}}", bound(least), bound(most)),
        Range::Whole(least, most) => format!("{{whole {least} {most}}}"),
        Range::Sign => "sign".into(),
        Range::Hash => "hash".into(),
        Range::Model => "model".into(),
        Range::Word(words) => format!("{{word {}}}", words.join(" ")),
    }
}

/// The sections of the manual page.
pub fn manual() -> String {
    let row = format!(
        ".TP\n.B {ROW}L\nFor each letter L of coordinates: row of the matrix of the search, one number a leg. Needed.\n"
    );
    [
        section("[PKM]", "the machine", machine::ALL, ""),
        section("[SECOND]", "what a second mechanism has of its own", second::ALL, ""),
        section("[LEG_0]\\fR, \\fP[LEG_1]\\fR, ...\\fP", "one for each leg", leg::ALL, ""),
        section(
            "[CHAIN_A]\\fR, ... \\fP[CHAIN_C]\\fR, \\fP[CHAIN_U]\\fR, ... \\fP[CHAIN_W]",
            "what an extra axis carries; without its section it passes its coordinate through",
            chain::ALL,
            "",
        ),
        section("[JOINT_0]\\fR, \\fP[JOINT_1]\\fR, ...\\fP", "LinuxCNC's own", joint::ALL, ""),
        section(
            "[BOX_0]\\fR, \\fP[BOX_1]\\fR, ...\\fP",
            "as many as boxes= says, of a second mechanism [SECOND_BOX_0] and so on as many as \
             second_boxes= says; pkm boxes writes and proves them",
            workspace_box::ALL,
            &row,
        ),
    ]
    .concat()
}

fn section(name: &str, text: &str, keys: &[&Key], more: &str) -> String {
    let keys: String = keys.iter().map(|key| paragraph(key)).collect();
    format!(".TP\n.B {name}\n{text}\n.RS\n{keys}{more}.RE\n")
}

fn paragraph(key: &Key) -> String {
    let parts = match key.parts {
        [] => String::new(),
        parts => format!("\\fR = {}\\fP", parts.join(" ")),
    };
    let mut text = format!(".TP\n.B {}{parts}\n", key.name);
    if key.kinds != KINDS {
        let kinds: Vec<&str> = key.kinds.iter().map(|kind| kind_name(*kind)).collect();
        let _ = write!(text, "({}) ", kinds.join(", "));
    }
    text.push_str(key.text);
    let (unit, expected) = (key.unit, key.expected());
    // Degrees stand in the words of the range.
    let words = match (unit, expected.as_str()) {
        ("", words) | (_, words) if words.ends_with(unit) => words.into(),
        (unit, "") => unit.into(),
        (unit, words) => format!("{unit}, {words}"),
    };
    if !words.is_empty() && !matches!(key.range, Range::Sign) {
        let _ = write!(text, " {}.", capital(&words));
    }
    match key.need {
        Need::Needed => text.push_str(" Needed."),
        Need::Optional => {}
        Need::Cardan => text.push_str(" Needed where the strut has a lead."),
        Need::With(other) => {
            let _ = write!(text, " Needs {other}.");
        }
    }
    if let Some(value) = key.absent {
        let _ = write!(text, " {value} where absent.");
    }
    text.push('\n');
    text.replace(" -1", " \\-1")
}

fn capital(words: &str) -> String {
    let mut letters = words.chars();
    letters.next().map(|first| first.to_ascii_uppercase()).into_iter().chain(letters).collect()
}
