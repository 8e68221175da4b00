// SPDX-License-Identifier: GPL-2.0-or-later
//! The HTML page about one program on one machine, readable without knowledge of kinematics.
//!
//! It is self-contained: no other file, no script. Color is never the only sign.

use crate::margins::Figure;
use crate::over::Mark;
use maud::{DOCTYPE, Markup, PreEscaped, html};

const STYLE: &str =
    "body { font-family: sans-serif; max-width: 62em; margin: 2em auto; padding: 0 1em;
  line-height: 1.4; color: #111; background: #fff }
table { border-collapse: collapse; margin: 1em 0; width: 100%; font-size: 0.9em }
td, th { text-align: left; padding: 0.3em 0.5em; vertical-align: top; border-bottom: 1px solid #ccc }
th small { display: block; font-weight: normal; color: #444 }
.number { text-align: right; white-space: nowrap }
.verdict { border-left: 0.6em solid; padding: 0.6em 1em; margin: 1em 0 }
.verdict h2 { margin: 0 }
.fits { background: #e7f5e9; border-color: #1b6e2c }
.misfit { background: #fde8e6; border-color: #b40000 }
.open { background: #fff4d6; border-color: #9a6700 }
.broken { background: #fde8e6 }
.bad { font-weight: bold }
.broken td:first-child { font-weight: bold }
code, pre { background: #f4f4f4; white-space: pre-wrap }
figure { margin: 2em 0 }
svg, img { max-width: 100%; height: auto }
svg text[font-weight] { paint-order: stroke; stroke: #fff; stroke-width: 4px }
h1 { overflow-wrap: anywhere }
@media (max-width: 50em) {
  table { display: block }
  table, figure { overflow-x: auto }
  td:last-child { min-width: 8em }
  svg { min-width: 44em }
}
";

/// Most lines of the command's output that the page repeats.
const MOST_LINES: usize = 400;

/// One limit, as a row of the table.
#[derive(Clone, Debug, PartialEq)]
pub struct LimitRow {
    pub name: String,
    /// Purpose of the limit.
    pub meaning: String,
    /// Joint, leg or axis nearest to it.
    pub part: String,
    /// The machine's limit value.
    pub allowed: String,
    /// The program's extreme value.
    pub used: String,
    /// Difference of both, negative beyond the limit.
    pub margin: String,
    /// Line of the extreme value.
    pub line: String,
    /// Numbers of its violations, counted from 1.
    pub breaks: Vec<usize>,
    /// Whether the whole program was checked: then the limit is satisfied if there is no violation.
    pub is_judged: bool,
}

/// Contents of the page.
pub struct Report<'a> {
    /// Name of the program.
    pub program: &'a str,
    /// Name of the machine.
    pub machine: &'a str,
    /// The verdict; `None` if not everything could be checked.
    pub fits: Option<bool>,
    /// The reason, in a sentence.
    pub why: String,
    /// What could not be checked, and what the user should check: sentences.
    pub notes: Vec<String>,
    /// A remedy: a sentence, and the block to run.
    pub help: Option<(String, String)>,
    pub rows: Vec<LimitRow>,
    /// All violations, in the order of the program.
    pub marks: &'a [Mark],
    pub figures: &'a [Figure],
    /// The output of the command.
    pub text: &'a str,
}

/// Writes the page about a program.
pub fn of_program(report: &Report) -> String {
    let body = html! {
        (verdict(report.fits, ["The program fits the machine", "The program does not fit the machine"], &report.why))
        (breaks(report.marks))
        (table(&report.rows))
        (advice(report))
        @for figure in report.figures { (drawing(figure)) }
        (answer(report.text))
    };
    page(&format!("{} on {}", report.program, report.machine), &body)
}

/// Writes a page with its title as heading.
pub fn page(title: &str, body: &Markup) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                h1 { (title) }
                (body)
            }
        }
    };
    page.into_string()
}

/// Returns a verdict, in the words of `yes` or `no`, with its reason; the sign is readable without color.
pub fn verdict(fits: Option<bool>, [yes, no]: [&str; 2], why: &str) -> Markup {
    let [sign, words, class] = match fits {
        Some(true) => ["\u{2713}", yes, "fits"],
        Some(false) => ["\u{2717}", no, "misfit"],
        None => ["?", "Not judged", "open"],
    };
    html! {
        div class={ "verdict " (class) } role="status" {
            h2 { span aria-hidden="true" { (sign) " " } (words) }
            p { (why) }
        }
    }
}

fn advice(report: &Report) -> Markup {
    html! {
        @if let Some((help, block)) = &report.help {
            h2 { "What helps" }
            p { (help) }
            pre { (block) }
        }
        @if !report.notes.is_empty() {
            h2 { "Warnings" }
            ul { @for note in &report.notes { li { (note) } } }
        }
    }
}

fn breaks(marks: &[Mark]) -> Markup {
    html! {
        @if !marks.is_empty() {
            h2 { "Violated limits" }
            ol { @for mark in marks { li {
                b { (mark.place) } " " code { (mark.block) } ": " (mark.text) "."
                @if mark.at.is_none() { " The program stops before it." }
            } } }
        }
    }
}

fn table(rows: &[LimitRow]) -> Markup {
    // Sorting is stable: otherwise the order is unchanged.
    let mut rows: Vec<&LimitRow> = rows.iter().collect();
    rows.sort_by_key(|row| row.breaks.first().copied().unwrap_or(usize::MAX));
    html! {
        h2 { "All limits" }
        table {
            thead { tr {
                @for head in ["", "limit", "part"] { th scope="col" { (head) } }
                @for head in ["allowed", "used", "margin"] { th scope="col" class="number" { (head) } }
                th scope="col" { "where" }
            } }
            tbody { @for row in rows { (limit(row)) } }
        }
    }
}

fn limit(row: &LimitRow) -> Markup {
    let numbers: Vec<String> = row.breaks.iter().map(usize::to_string).collect();
    html! {
        tr class=[(!row.breaks.is_empty()).then_some("broken")] {
            td {
                @if !numbers.is_empty() { "\u{2717} violated (" (numbers.join(", ")) ")" }
                @else if row.is_judged { "\u{2713} kept" }
                @else { "? not judged" }
            }
            th scope="row" { (row.name) small { (row.meaning) } }
            td { (row.part) }
            @for value in [&row.allowed, &row.used, &row.margin] { td class="number" { (value) } }
            td { (row.line) }
        }
    }
}

pub(super) fn drawing(figure: &Figure) -> Markup {
    let name = html! { title { (figure.title) } desc { (figure.about) } }.into_string();
    // The accessible name of a drawing is its first child.
    let svg =
        figure.svg.replacen("<svg ", "<svg role=\"img\" ", 1).replacen('>', &format!(">{name}"), 1);
    html! {
        figure {
            h2 { (figure.title) }
            (PreEscaped(svg))
            figcaption { (figure.about) }
        }
    }
}

fn answer(text: &str) -> Markup {
    let lines: Vec<&str> = text.lines().collect();
    let left_out = lines.len().saturating_sub(MOST_LINES);
    html! {
        details {
            summary { "Output of pkm preflight" }
            pre { (lines[..lines.len() - left_out].join("\n")) }
            @if left_out > 0 { p { (left_out) " more lines: see the output of the command." } }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(name: &str, breaks: &[usize]) -> LimitRow {
        let word = |text: &str| text.to_string();
        LimitRow {
            name: name.into(),
            meaning: word("what it is there for"),
            part: word("strut 1"),
            allowed: word("1 to 2 mm"),
            used: word("1 to 3 mm"),
            margin: word("-1 mm"),
            line: word("line 7"),
            breaks: breaks.to_vec(),
            is_judged: true,
        }
    }

    fn report<'a>(marks: &'a [Mark], figures: &'a [Figure], text: &'a str) -> Report<'a> {
        Report {
            program: "<b>.ngc",
            machine: "m.ini",
            fits: Some(false),
            why: "a < b & c > d".into(),
            notes: vec!["times".into()],
            help: Some(("run".into(), "G10".into())),
            rows: vec![row("kept limit", &[]), row("second", &[2]), row("first", &[1, 3])],
            marks,
            figures,
            text,
        }
    }

    #[test]
    fn texts_cannot_become_markup() {
        let figure = Figure {
            title: "x > y".into(),
            about: "\"&".into(),
            svg: "<svg width=\"1\">\n</svg>".into(),
        };
        let page = of_program(&report(&[], &[figure], "</pre>"));
        assert!(page.contains("a &lt; b &amp; c &gt; d") && !page.contains("<b>"), "{page}");
        assert!(page.contains("<svg role=\"img\" width=\"1\"><title>x &gt; y</title>"), "{page}");
        // The block of the remedy, and the output.
        assert_eq!(page.matches("</pre>").count(), 2);
    }

    #[test]
    fn broken_limits_come_first() {
        let page = of_program(&report(&[], &[], ""));
        let place = |name: &str| page.find(&format!(">{name}<small>")).unwrap();
        assert!(place("first") < place("second") && place("second") < place("kept limit"));
        assert!(page.contains("violated (1, 3)") && page.contains("\u{2713} kept"));
    }

    #[test]
    fn a_limit_that_was_not_looked_at_throughout_is_not_called_kept() {
        let open = LimitRow { is_judged: false, ..row("open", &[]) };
        let broken = LimitRow { is_judged: false, ..row("broken", &[1]) };
        let page = of_program(&Report { rows: vec![open, broken], ..report(&[], &[], "") });
        assert!(page.contains("<td>? not judged</td>") && page.contains("violated (1)"), "{page}");
        assert!(!page.contains("kept"), "{page}");
    }

    #[test]
    fn every_break_is_named_with_its_line() {
        let mark = |line, at| Mark {
            place: format!("line {line}"),
            block: format!("G1 X{line}"),
            text: format!("breaks at {line}"),
            at,
            pose: [0.0; 6],
        };
        let page = of_program(&report(&[mark(4, Some(1.0)), mark(99, None)], &[], ""));
        for line in [4, 99] {
            let row = format!("<b>line {line}</b> <code>G1 X{line}</code>: breaks at {line}.");
            assert!(page.contains(&row), "{page}");
        }
        assert_eq!(page.matches("stops before it").count(), 1);
    }

    #[test]
    fn what_is_not_judged_is_no_fit() {
        let cause = "LinuxCNC is not installed";
        let open = Report { fits: None, why: cause.into(), ..report(&[], &[], "") };
        let page = of_program(&open);
        assert!(page.contains("class=\"verdict open\"") && page.contains(cause), "{page}");
        assert!(page.contains("? </span>Not judged") && !page.contains("fits the machine"));
    }

    #[test]
    fn a_long_answer_is_cut_and_that_is_said() {
        let page = of_program(&report(&[], &[], &"word\n".repeat(10_000)));
        assert!(page.contains("9600 more lines") && page.len() < 10_000);
    }
}
