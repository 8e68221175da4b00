// SPDX-License-Identifier: GPL-2.0-or-later
//! Tables of readings that the operator types: `pkm measure` writes them empty, below lines that state their
//! origin.
//!
//! ```text
//! # pkm readings 1
//! # geometry 0x6df26e72
//! # gauge dial
//! # unit um                       of expected, reading and again
//! # deviation 2                   standard deviation of one reading, in that unit
//! # range 0 1000                  possible readings of the gauge
//! # zero 0.2                      standard deviation of its zero, machine units
//! # radius 0                      of the gauge's end
//! # tool 0 0 60                   with the spindle offset
//! # object plate 0 0 150 0 0 0    approximate pose: X Y Z A B C
//! # poses 8f3a 11c2               a checksum of each, including the gauge
//! pose,object,x,y,z,a,b,c,expected,reading,again
//! 1,plate,0,0,150,0,0,0,500,498,499
//! ```

use super::gauge::{Gauge, Kind, Object, Scale};
use super::heading;
use super::log::BadLog;
use super::model::Frame;
use super::reading::Reading;
use kinematics::{Pose, Vector3};
use machine::digits::list;
use machine::files::csv;
use machine::read::mechanism::Mechanism;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::fmt::Write as _;

/// First line of a table.
pub(crate) const HEADER: &str = "# pkm readings 1";

const COLUMNS: [&str; 11] =
    ["pose", "object", "x", "y", "z", "a", "b", "c", "expected", "reading", "again"];

/// The only column that may be missing.
const AGAIN: usize = 10;

/// Entry for a reading that could not be taken.
const LEFT_OUT: &str = "-";

/// Largest factor between the median of all readings and the expected value: the next unit differs by a factor of
/// 25.
const PLAUSIBLE: f64 = 5.0;

/// Another unit is suggested if it brings the readings within this factor.
const NEAR: f64 = 2.5;

/// Thresholds in multiples of the median error: below the first a reading is like the others, above the second it is
/// far off.
const USUAL: f64 = 5.0;
pub(crate) const UNUSUAL: f64 = 20.0;

/// Least number of rows read twice from which both runs are compared: medians of fewer rows vary too much.
pub(crate) const FEWEST: usize = 8;

/// Probability that the scatter of good readings is judged too large.
const FALSE_ALARM: f64 = 1e-3;

/// A pose at which a gauge is read.
#[derive(Clone, Debug, PartialEq)]
pub struct Stop {
    pub object: usize,
    /// The tip as LinuxCNC displays it, machine units and degrees.
    pub at: [f64; 6],
    /// Expected reading of the machine as drawn.
    pub expected: f64,
}

/// A table filled in by the operator.
#[derive(Clone, Debug)]
pub struct Sheet {
    /// The gauge that was read.
    pub gauge: Gauge,
    /// The objects it was read against.
    pub objects: Vec<Object>,
    pub rows: Vec<Row>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Line in the file, counted from 1.
    pub line: usize,
    pub stop: Stop,
    /// Number of the pose in the program.
    pub pose: usize,
    /// The reading of each run: one, or two.
    pub shown: Vec<f64>,
}

/// Agreement of two runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scatter {
    /// Number of rows read twice.
    pub rows: usize,
    /// Standard deviation of one reading, from the differences.
    pub deviation: f64,
    /// Mean of the second run minus the first.
    pub drift: f64,
    /// Whether the scatter is larger than the stated deviation explains.
    pub is_more: bool,
    /// Whether all rows have the same reading twice. Feelers come in steps, so their readings may.
    pub is_copied: bool,
    pub is_drift: bool,
}

/// Returns whether a text is a table of readings: a spreadsheet may have quoted its comments.
pub(crate) fn is_one(text: &str) -> bool {
    text.lines().next().is_some_and(|line| mended(line) == HEADER)
}

/// Returns a comment without the characters that spreadsheets add to it.
fn mended(line: &str) -> &str {
    line.trim_matches(|c: char| c.is_whitespace() || "\u{feff},;\"".contains(c))
}

fn is_comment(line: &str) -> bool {
    mended(line).starts_with('#')
}

/// Writes the empty table of some poses.
pub fn empty(config: &Mechanism, gauge: &Gauge, objects: &[Object], stops: &[Stop]) -> String {
    let mut text = format!("{HEADER}\n# geometry {:#010x}\n", config.hash);
    let number = |value: f64| list(&[value]);
    for (key, value) in [
        ("machine", config.file.file_name().unwrap_or_default().to_string_lossy().into_owned()),
        ("gauge", gauge.kind.name().into()),
        ("unit", gauge.scale.name().into()),
        ("deviation", number(gauge.deviation)),
        ("range", list(&gauge.range)),
        ("zero", number(gauge.zero)),
        ("radius", number(gauge.radius)),
        ("tool", list(gauge.tool.as_slice())),
    ] {
        let _ = writeln!(text, "# {key} {value}");
    }
    for Object { name, frame } in objects {
        let pose = placed(frame).to_degrees().map(|value| format!("{:.6}", value + 0.0));
        let _ = writeln!(text, "# object {name} {}", pose.join(" "));
    }
    let sums = (1..).zip(stops).map(|(n, stop)| {
        format!(" {:04x}", checksum(gauge, n, &objects[stop.object].name, &stop.at))
    });
    let _ = writeln!(text, "# poses{}", sums.collect::<String>());
    let row = |(n, stop): (usize, &Stop)| {
        let mut cells = vec![n.to_string(), objects[stop.object].name.clone()];
        cells.extend(stop.at.map(|x| (x + 0.0).to_string()));
        cells.extend([format!("{:.decimals$}", stop.expected, decimals = decimals(gauge))]);
        cells.extend([String::new(), String::new()]);
        cells
    };
    text + &csv(&COLUMNS, (1..).zip(stops).map(row))
}

/// Returns the significant decimals of a reading: a tenth of its deviation.
fn decimals(gauge: &Gauge) -> usize {
    (1.0 - gauge.deviation.log10()).ceil().clamp(0.0, 6.0) as usize
}

fn placed(frame: &Frame) -> Pose {
    let r = &frame.rotation;
    let b = (-r[(2, 0)]).clamp(-1.0, 1.0).asin();
    let a = r[(2, 1)].atan2(r[(2, 2)]);
    let c = r[(1, 0)].atan2(r[(0, 0)]);
    Pose { position: frame.origin, angles: Vector3::new(a, b, c) }
}

/// Computes the checksum of a pose's values, independent of their format, and of the gauge: FNV-1a, folded to 16
/// bits.
fn checksum(gauge: &Gauge, number: usize, object: &str, at: &[f64; 6]) -> u16 {
    let numbers = at.iter().chain(gauge.tool.iter()).chain([&gauge.radius]);
    let numbers = numbers.flat_map(|x| ((x * 1e6).round() as i64).to_le_bytes());
    let names = [object, gauge.kind.name(), gauge.scale.name()].into_iter().flat_map(str::bytes);
    let bytes = number.to_le_bytes().into_iter().chain(names).chain(numbers);
    let hash = bytes
        .fold(0x811c_9dc5_u32, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193));
    (hash ^ (hash >> 16)) as u16
}

fn bad<T>(line: usize, text: impl Into<String>) -> Result<T, BadLog> {
    Err(BadLog { line, text: text.into() })
}

impl Sheet {
    /// Reads a table that was filled in.
    ///
    /// # Errors
    /// See [`BadLog`].
    pub fn read(config: &Mechanism, text: &str) -> Result<Self, BadLog> {
        let comments: String = text
            .lines()
            .map(|line| if is_comment(line) { mended(line) } else { "" })
            .flat_map(|line| [line, "\n"])
            .collect();
        heading::of_geometry(config, &comments)?;
        let gauge = gauge(&comments)?;
        let objects = objects(&comments)?;
        let (line, sums) = heading::value(&comments, "poses", "a line \"# poses\" of checksums")?;
        let sums: Option<Vec<u16>> =
            sums.split_ascii_whitespace().map(|word| u16::from_str_radix(word, 16).ok()).collect();
        let Some(sums) = sums else {
            return bad(
                line,
                "the checksums of the poses were changed: expected four hexadecimal digits each",
            );
        };
        let rows = rows(text, &gauge, &objects, &sums)?;
        Ok(Self { gauge, objects, rows })
    }

    /// Returns the readings, and the number of zeros. Frames are numbered from `frame` on in the order of the objects,
    /// zeros from `zero` on.
    ///
    /// # Errors
    /// A pose that the machine cannot reach.
    pub(crate) fn readings(
        &self,
        config: &Mechanism,
        frame: usize,
        zero: usize,
        named: &str,
    ) -> Result<(Vec<Reading>, usize), BadLog> {
        let mut axes: Vec<Option<Vector3<f64>>> = vec![];
        let mut readings = vec![];
        for (group, row) in self.rows.iter().enumerate() {
            let object = &self.objects[row.stop.object];
            for shown in &row.shown {
                let mut reading = self
                    .gauge
                    .reading(config, object, row.stop.at, *shown)
                    .map_err(|fault| BadLog { line: row.line, text: fault.to_string() })?;
                reading.name = format!("{named}:{}: pose {}", row.line, row.pose);
                (reading.group, reading.frame) = (group, frame + row.stop.object);
                if let Some(own) = &mut reading.instrument.zero {
                    let place = axes.iter().position(|axis| *axis == own.axis);
                    own.number = zero
                        + place.unwrap_or_else(|| {
                            axes.push(own.axis);
                            axes.len() - 1
                        });
                }
                readings.push(reading);
            }
        }
        Ok((readings, axes.len()))
    }

    /// Returns whether readings are nearer to the expected values than the gauge's deviation allows: by chance once
    /// in a thousand times, for any machine.
    pub fn is_too_good(&self) -> bool {
        let squares: Vec<f64> =
            self.misses().map(|(_, _, miss)| (miss / self.gauge.deviation).powi(2)).collect();
        let law = ChiSquared::new(squares.len().max(1) as f64);
        law.is_ok_and(|law| squares.iter().sum::<f64>() < law.inverse_cdf(FALSE_ALARM))
    }

    /// Compares the second run with the first, if there was one.
    pub fn scatter(&self) -> Option<Scatter> {
        let twice = self.rows.iter().filter_map(|row| match row.shown[..] {
            [first, second] => Some(second - first),
            _ => None,
        });
        let differences: Vec<f64> = twice.collect();
        let count = differences.len() as f64;
        let degrees = count - 1.0;
        if !(degrees >= 1.0) {
            return None;
        }
        let drift = differences.iter().sum::<f64>() / count;
        let squares: f64 = differences.iter().map(|x| (x - drift).powi(2)).sum();
        // The variance of a difference of two readings is twice that of one.
        let deviation = (squares / (2.0 * degrees)).sqrt();
        let stated = self.gauge.deviation;
        let most = |degrees: f64| {
            ChiSquared::new(degrees).map_or(f64::INFINITY, |law| law.inverse_cdf(1.0 - FALSE_ALARM))
        };
        Some(Scatter {
            rows: differences.len(),
            deviation,
            drift,
            is_copied: self.gauge.kind != Kind::Feeler
                && differences.len() >= FEWEST
                && differences.iter().all(|x| *x == 0.0),
            is_more: squares / (2.0 * stated * stated) > most(degrees),
            is_drift: count * drift * drift / (2.0 * deviation.max(stated).powi(2)) > most(1.0),
        })
    }

    /// Returns the standard deviation of one reading: as stated, or from two runs if that is larger.
    pub fn deviation(&self) -> f64 {
        match self.scatter() {
            Some(scatter) if scatter.is_more => scatter.deviation,
            _ => self.gauge.deviation,
        }
    }

    /// Refuses readings in another unit: all of them, or some.
    ///
    /// # Errors
    /// See [`BadLog`].
    pub(crate) fn check_units(&self) -> Result<(), BadLog> {
        self.check_all()?;
        self.check_each()
    }

    /// Refuses readings that are as a whole far from those of any machine built to the drawing.
    fn check_all(&self) -> Result<(), BadLog> {
        let mut ratios: Vec<(f64, usize)> = self
            .rows
            .iter()
            .flat_map(|row| row.shown.iter().map(|shown| (shown / row.stop.expected, row.line)))
            .filter(|(ratio, _)| ratio.is_finite())
            .collect();
        ratios.sort_by(|a, b| a.0.total_cmp(&b.0));
        let Some((middle, line)) = ratios.get(ratios.len() / 2).copied() else { return Ok(()) };
        if (1.0 / PLAUSIBLE..=PLAUSIBLE).contains(&middle) {
            return Ok(());
        }
        let own = self.gauge.scale;
        let way_out = match self.other_unit(|scale| middle * scale.in_mm() / own.in_mm()) {
            Some(scale) => format!("if they are in {scale}, convert them to {own}"),
            None => "set the gauge at the first pose to the expected reading, and correct the position of the object".into(),
        };
        bad(
            line,
            format!("readings are about {middle:.2e} times the expected ones in {own}: {way_out}"),
        )
    }

    /// Refuses a reading that is far from the expected value, unlike the others, but close to it if read in another
    /// unit. The fit cannot detect it: a machine as far from its drawing as its tolerances allow may give this reading.
    fn check_each(&self) -> Result<(), BadLog> {
        let mut misses: Vec<f64> = self.misses().map(|(_, _, miss)| miss.abs()).collect();
        misses.sort_by(f64::total_cmp);
        let Some(middle) = misses.get(misses.len() / 2) else { return Ok(()) };
        let usual = middle.max(self.gauge.deviation);
        let own = self.gauge.scale;
        for (row, shown, miss) in self.misses().filter(|(_, _, miss)| miss.abs() > UNUSUAL * usual)
        {
            for scale in Scale::ALL.into_iter().filter(|scale| *scale != own) {
                let meant = shown * scale.in_mm() / own.in_mm();
                if (meant - row.stop.expected).abs() < USUAL * usual {
                    return bad(
                        row.line,
                        format!(
                            "{shown} {own} of pose {} differs from the expected reading by {:.4} {own}, \
                             half of all by less than {middle:.4}; {shown} {scale} would fit: enter {} \
                             {own}",
                            row.pose,
                            miss.abs(),
                            rounded(meant)
                        ),
                    );
                }
            }
        }
        Ok(())
    }

    /// Returns every reading with its difference from the expected value.
    fn misses(&self) -> impl Iterator<Item = (&Row, f64, f64)> {
        self.rows.iter().flat_map(|row| {
            row.shown.iter().map(move |shown| (row, *shown, shown - row.stop.expected))
        })
    }

    /// Returns another unit in which a ratio to the expected value is near 1.
    fn other_unit(&self, ratio: impl Fn(Scale) -> f64) -> Option<Scale> {
        let distance = |scale: &Scale| ratio(*scale).abs().ln().abs();
        Scale::ALL
            .into_iter()
            .filter(|scale| *scale != self.gauge.scale && distance(scale) <= NEAR.ln())
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }
}

fn gauge(comments: &str) -> Result<Gauge, BadLog> {
    let word = |key: &str, expected: &str| heading::value(comments, key, expected);
    let number = |key: &str, least: &str, is_good: fn(f64) -> bool| {
        let expected = format!("a line \"# {key} NUMBER\"");
        let [value] = heading::numbers(comments, key, &expected)?;
        match is_good(value) {
            true => Ok(value),
            false => bad(word(key, &expected)?.0, format!("{key} {value}: expected {least}")),
        }
    };
    let or_more = |key: &str| number(key, "0 or more", |value| value >= 0.0);
    let (line, name) = word("gauge", "a line \"# gauge dial\", bar or feeler")?;
    let Some(kind) = Kind::named(name) else {
        return bad(line, format!("gauge {name}: expected dial, bar or feeler"));
    };
    let (line, name) = word("unit", "a line \"# unit um\", the unit of the readings")?;
    let Some(scale) = Scale::named(name) else {
        return bad(line, format!("unit {name}: expected um, mm, thou or inch"));
    };
    let deviation = number("deviation", "more than 0", |value| value > 0.0)?;
    let range: [f64; 2] = heading::numbers(comments, "range", "a line \"# range LEAST MOST\"")?;
    if !(range[0] < range[1]) {
        let (line, words) = word("range", "")?;
        return bad(
            line,
            format!("range {words}: expected the smallest reading, then the largest"),
        );
    }
    Ok(Gauge {
        kind,
        scale,
        deviation,
        range,
        zero: or_more("zero")?,
        radius: or_more("radius")?,
        tool: heading::tool(comments)?,
    })
}

fn objects(comments: &str) -> Result<Vec<Object>, BadLog> {
    let mut found: Vec<Object> = vec![];
    for (line, text) in (1..).zip(comments.lines()) {
        let Some(words) = text.strip_prefix("# object ") else { continue };
        let (name, numbers) = words.trim().split_once(' ').unwrap_or((words, ""));
        let numbers: Option<[f64; 6]> =
            heading::finite(numbers).and_then(|numbers| numbers.try_into().ok());
        let Some(numbers) = numbers else {
            return bad(
                line,
                "expected \"# object NAME X Y Z A B C\", with its approximate position",
            );
        };
        if found.iter().any(|object| object.name == name) {
            return bad(line, format!("object {name} appears twice"));
        }
        let pose = Pose::from_degrees(numbers);
        let frame = Frame { origin: pose.position, rotation: pose.rotation() };
        found.push(Object { name: name.into(), frame });
    }
    match found.is_empty() {
        true => bad(1, "expected a line \"# object NAME X Y Z A B C\" for each measured object"),
        false => Ok(found),
    }
}

/// Parses the rows, checked one by one and as a whole.
fn rows(text: &str, gauge: &Gauge, objects: &[Object], sums: &[u16]) -> Result<Vec<Row>, BadLog> {
    let lines: Vec<(usize, &str)> = (1..)
        .zip(text.lines())
        .filter(|(_, line)| !is_comment(line) && !mended(line).is_empty())
        .collect();
    let Some(((line, names), rows)) = lines.split_first() else {
        return bad(1, format!("expected columns {}", COLUMNS.join(",")));
    };
    let columns = columns(*line, names)?;
    // A decimal comma always adds a cell.
    let width = names.split(',').count();
    let mut found = vec![];
    let mut last = 0;
    let mut again: Option<(bool, usize)> = None;
    for (line, row) in rows {
        let cells: Vec<&str> = row.split(',').map(|cell| cell.trim().trim_matches('"')).collect();
        if cells.len() > width {
            return bad(
                *line,
                format!(
                    "{} cells, more than there are columns: a decimal comma? write 0.5, not 0,5",
                    cells.len()
                ),
            );
        }
        let cell = |k: usize| columns[k].and_then(|at| cells.get(at).copied()).unwrap_or_default();
        let number = pose_number(*line, cell(0), last, sums.len())?;
        last = number;
        let stop = stop(*line, number, &cell, (gauge, objects), sums)?;
        if let Some((has_second, other)) = again
            && has_second == cell(AGAIN).is_empty()
        {
            return bad(
                *line,
                format!(
                    "the second run has a reading in one of lines {other} and {line} but not in the \
                         other: enter all of it, \"{LEFT_OUT}\" for one that could not be taken"
                ),
            );
        }
        again = Some((!cell(AGAIN).is_empty(), *line));
        let mut shown = vec![];
        for (k, run) in [(9, "reading"), (AGAIN, "again")] {
            match cell(k) {
                "" if k == AGAIN => {}
                LEFT_OUT => {}
                "" => {
                    return bad(
                        *line,
                        format!(
                            "{run} of pose {number} is empty: enter it, or \"{LEFT_OUT}\" if it could not be taken"
                        ),
                    );
                }
                word => shown.push(value(*line, word, gauge)?),
            }
        }
        if !shown.is_empty() {
            found.push(Row { line: *line, stop, pose: number, shown });
        }
    }
    let end = rows.last().map_or(*line, |(line, _)| *line);
    match (last == sums.len(), found.is_empty()) {
        (false, _) => {
            bad(end, format!("the table ends with pose {last} of {}: rows are missing", sums.len()))
        }
        (_, true) => bad(end, "the table has no reading: enter the measured values"),
        _ => Ok(found),
    }
}

fn columns(line: usize, names: &str) -> Result<Vec<Option<usize>>, BadLog> {
    if !names.contains(',') && names.contains([';', '\t']) {
        return bad(line, "cells are separated by semicolons or tabs: save the table with commas");
    }
    let names: Vec<String> =
        names.split(',').map(|name| name.trim().trim_matches('"').to_ascii_lowercase()).collect();
    let place = |name: &str| names.iter().position(|own| own == name);
    let columns: Vec<Option<usize>> = COLUMNS.iter().map(|name| place(name)).collect();
    match columns.iter().take(AGAIN).position(Option::is_none) {
        Some(k) => {
            bad(line, format!("no column \"{}\": expected {}", COLUMNS[k], COLUMNS.join(",")))
        }
        None => Ok(columns),
    }
}

/// Parses the number of a pose, which must follow the last one.
fn pose_number(line: usize, word: &str, last: usize, count: usize) -> Result<usize, BadLog> {
    let Some(number) = word.parse::<usize>().ok().filter(|n| (1..=count).contains(n)) else {
        return bad(line, format!("pose \"{word}\": the program has poses 1 to {count}"));
    };
    match number {
        _ if number == last + 1 => Ok(number),
        _ if number == last => bad(line, format!("pose {number} appears twice")),
        _ if number < last => bad(
            line,
            format!("pose {number} follows pose {last}: restore the order of the program"),
        ),
        _ => bad(line, format!("pose {} is missing, {number} follows pose {last}", last + 1)),
    }
}

/// Parses the pose of a row, which must be that of the program.
fn stop<'a>(
    line: usize,
    number: usize,
    cell: &impl Fn(usize) -> &'a str,
    (gauge, objects): (&Gauge, &[Object]),
    sums: &[u16],
) -> Result<Stop, BadLog> {
    let Some(object) = objects.iter().position(|object| object.name == cell(1)) else {
        let names: Vec<&str> = objects.iter().map(|object| object.name.as_str()).collect();
        return bad(line, format!("object \"{}\": expected {}", cell(1), names.join(" or ")));
    };
    let mut numbers = [0.0; 7];
    for (k, value) in numbers.iter_mut().enumerate() {
        *value = finite(line, cell(2 + k))?;
    }
    let [x, y, z, a, b, c, expected] = numbers;
    let at = [x, y, z, a, b, c];
    if checksum(gauge, number, cell(1), &at) != sums[number - 1] {
        return bad(
            line,
            format!(
                "pose {number} is not that of the program: its numbers, or gauge, unit, radius or tool \
                 above, were changed or rounded; restore them as `pkm measure` wrote them"
            ),
        );
    }
    Ok(Stop { object, at, expected })
}

/// Rounds a number for a message.
pub(crate) fn rounded(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

fn finite(line: usize, word: &str) -> Result<f64, BadLog> {
    let number = word.parse().ok().filter(|x: &f64| x.is_finite());
    number.map_or_else(|| bad(line, format!("\"{word}\" is not a number")), Ok)
}

/// Parses a reading that is possible for the gauge.
fn value(line: usize, word: &str, gauge: &Gauge) -> Result<f64, BadLog> {
    let value = finite(line, word)?;
    let [low, high] = gauge.range;
    if (low..=high).contains(&value) {
        return Ok(value);
    }
    let own = gauge.scale;
    let fits = |scale: &Scale| (low..=high).contains(&(value * scale.in_mm() / own.in_mm()));
    let others: Vec<&str> = Scale::ALL.into_iter().filter(fits).map(Scale::name).collect();
    let way_out = match others.is_empty() {
        true => "measure it again".to_string(),
        false => format!("in {} it could be one", others.join(" or ")),
    };
    bad(
        line,
        format!(
            "{value} {own} is outside the range of the gauge, {low} to {high} {own}: {way_out}"
        ),
    )
}
