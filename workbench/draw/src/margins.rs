// SPDX-License-Identifier: GPL-2.0-or-later
//! The limits that a program uses, in figures over a common axis.

use crate::lines::Line;
use crate::machine_path::in_its_room;
use crate::over::Mark;
use crate::plot::DrawError;
use crate::sheet::TIME;
use crate::strips::{Strip, Strips, drawn_strips};
use crate::thin::{envelope, highest, lowest};
use kinematics::{Letter, Limit};
use machine::read::joints::Group;
use machine::read::mechanism::Mechanism;
use program::timeline::{Abscissa, AllJoints, Sample, Thinned};

/// Distances to limits are drawn between this and 1.
const LEAST_ROOM: f64 = -0.3;

/// Largest share of a limit drawn: otherwise a single jump would hide all others.
const MOST_SHARE: f64 = 2.0;

/// A plot with its explanation.
#[derive(Clone, Debug)]
pub struct Figure {
    pub title: String,
    /// Explanation of good and bad values, in plain words.
    pub about: String,
    pub svg: String,
}

/// Draws all figures of a page about a program.
///
/// # Errors
/// As [`DrawError`].
pub fn figures(
    config: &Mechanism,
    course: &Thinned,
    marks: &[Mark],
) -> Result<Vec<Figure>, DrawError> {
    if course.samples.is_empty() {
        return Ok(vec![]);
    }
    let sheet = Sheet { config, course, marks };
    let mut figures = vec![sheet.path()?, sheet.rooms()?];
    let in_time = course.abscissa == Abscissa::Seconds;
    if in_time {
        figures.push(sheet.rooms_of_motion()?);
        figures.extend(sheet.feed()?);
    }
    figures.extend(sheet.axes()?);
    for group in config.all_groups() {
        figures.push(sheet.values(&group)?);
        if in_time {
            figures.extend(sheet.motion(&group)?);
        }
    }
    Ok(figures)
}

/// Common data of all figures of a page.
struct Sheet<'a> {
    config: &'a Mechanism,
    course: &'a Thinned,
    marks: &'a [Mark],
}

impl Sheet<'_> {
    fn figure(
        &self,
        title: &str,
        y: &str,
        strips: &[Strip],
        about: &str,
    ) -> Result<Figure, DrawError> {
        let x = match self.course.abscissa {
            Abscissa::Seconds => TIME,
            Abscissa::Length => &format!("length along the path in {}", self.config.length_unit()),
        };
        let (end, marks) = (self.course.end, self.marks);
        let svg = drawn_strips(
            &Strips { title: "", x, y, end, all_limits: true, marks, dots: false },
            strips,
        )?;
        Ok(Figure { title: title.into(), about: about.into(), svg })
    }

    fn path(&self) -> Result<Figure, DrawError> {
        let about = "The tool path, seen obliquely from the front. Left: in the machine, where the thin \
                     black box shows the axis limits. Right: the same path enlarged. Good: a thin blue \
                     line. Near a limit, with less than a tenth of its range left, the line is orange and \
                     wider. Bad: red and widest, beyond \
                     a limit. Red crosses are the breaks, numbered as in the table.";
        Ok(Figure {
            title: "Tool path".into(),
            about: about.into(),
            svg: in_its_room(self.config, self.course, self.marks)?,
        })
    }

    fn rooms(&self) -> Result<Figure, DrawError> {
        let of = |limit: Limit| {
            let room = |s: &Sample| s.rooms[limit.index()];
            self.line(limit.name(), room)
        };
        let lines: Vec<Line> = Limit::ALL.into_iter().filter_map(of).collect();
        let about = "Margin to each limit while the program runs, as a share of its range; for several \
                     parts the smallest. Good: all lines stay above the thick black line at 0. Bad: a \
                     line reaches it or goes below, where the machine cannot continue.";
        let strips = shown(with_limits(lines, &[0.0]), [LEAST_ROOM, 1.0]);
        self.figure("Margins to position limits", "margin, share of the range", &strips, about)
    }

    fn rooms_of_motion(&self) -> Result<Figure, DrawError> {
        let least = |shares: &AllJoints| 1.0 - shares.iter().copied().fold(0.0, f64::max);
        let lines = [
            self.line("joint speed", |s| least(&s.speeds)),
            self.line("acceleration", |s| least(&s.accelerations)),
            self.line("following error", |s| least(&s.errors)),
        ];
        let lines: Vec<Line> = lines.into_iter().flatten().collect();
        let about = "Margin to the limits of the drives: speed, acceleration, and lag behind the \
                     command (following error). 1: the drives are at rest. Good: all lines stay above the \
                     thick black line at 0. Bad: a line goes below, where the program overloads a drive.";
        let strips = shown(with_limits(lines, &[0.0]), [LEAST_ROOM, 1.0]);
        self.figure("Margins to motion limits", "margin, share of the range", &strips, about)
    }

    /// Returns the line of lowest values; `None` if there is no such limit.
    fn line(&self, name: &str, room: impl Fn(&Sample) -> f64) -> Option<Line> {
        let values = self.course.samples.iter().map(|s| (s.at, room(s)));
        let values: Vec<(f64, f64)> = values.filter(|(_, room)| *room < f64::INFINITY).collect();
        (!values.is_empty()).then(|| Line { name: name.into(), points: lowest(&values) })
    }

    /// Draws the share of the feed that the guard allows; `None` if it is always 1.
    fn feed(&self) -> Result<Option<Figure>, DrawError> {
        let values: Vec<(f64, f64)> = self.course.samples.iter().map(|s| (s.at, s.feed)).collect();
        if values.iter().all(|(_, feed)| *feed >= 1.0) {
            return Ok(None);
        }
        let line = Line { name: "feed".into(), points: lowest(&values) };
        let about = "Share of the programmed feed that the guard allows, so that no drive exceeds its \
                     speed. The thick black line at 1 is the programmed feed. Good: the line stays there. \
                     Bad: it drops, the program takes longer, and at 0 the machine stops.";
        let title = "Feed allowed by the guard";
        let strips = with_limits(vec![line], &[1.0]);
        self.figure(title, "share of the programmed feed", &strips, about).map(Some)
    }

    /// Draws coordinates as shares of their ranges; `None` if no axis has a range.
    fn axes(&self) -> Result<Option<Figure>, DrawError> {
        let axes = Letter::ALL.into_iter().zip(&self.config.axes).enumerate();
        let ranged =
            axes.filter(|(_, (_, axis))| (axis.max - axis.min).is_finite() && axis.min < axis.max);
        let lines: Vec<Line> = ranged
            .map(|(k, (letter, axis))| {
                let share = |value: f64| (value - axis.min) / (axis.max - axis.min);
                let values: Vec<_> =
                    self.course.samples.iter().map(|s| (s.at, s.poses[k].map(share))).collect();
                Line { name: letter.name().into(), points: envelope(&values) }
            })
            .collect();
        if lines.is_empty() {
            return Ok(None);
        }
        let about = "Position of the tool on each axis: 0 is the lower axis limit, 1 the upper. Good: \
                     all lines stay between the two thick black lines. Bad: a line leaves them.";
        let y = "share of the axis range";
        self.figure("Positions of the axes", y, &with_limits(lines, &[0.0, 1.0]), about).map(Some)
    }

    fn values(&self, group: &Group) -> Result<Figure, DrawError> {
        let name = group.kind.plural();
        let strip = |i: &usize| {
            let values: Vec<_> = self.course.samples.iter().map(|s| (s.at, s.joints[*i])).collect();
            let name = self.config.joint(*i).name.clone();
            let line = Line { name, points: envelope(&values) };
            let limits = self.config.range_of(*i).into_iter().filter(|end| end.is_finite());
            Strip::of(line, limits.collect())
        };
        let strips: Vec<Strip> = group.joints.iter().map(strip).collect();
        let about = format!(
            "Positions of the {name}, each with its own drive. Good: all lines stay between the thick \
             black lines, the ends of travel. Bad: a line reaches or crosses one."
        );
        let y = format!("{} in {}", group.kind.quantity(), group.unit);
        self.figure(&format!("Positions of the {name}"), &y, &strips, &about)
    }

    fn motion(&self, group: &Group) -> Result<[Figure; 3], DrawError> {
        let name = group.kind.plural();
        let figure = |what: &str, meaning: &str, of: fn(&Sample) -> &AllJoints| {
            let line = |i: &usize| {
                let values: Vec<_> =
                    self.course.samples.iter().map(|s| (s.at, of(s)[*i])).collect();
                Line { name: self.config.joint(*i).name.clone(), points: highest(&values) }
            };
            let lines: Vec<Line> = group.joints.iter().map(line).collect();
            let about = format!(
                "{meaning} Good: all lines stay below the thick black line at 1. Bad: a line above it. \
                 Values above {MOST_SHARE} are drawn there."
            );
            let strips = shown(with_limits(lines, &[1.0]), [0.0, MOST_SHARE]);
            self.figure(&format!("{what} of the {name}"), "share of the limit", &strips, &about)
        };
        Ok([
            figure("Speeds", "Speed of each drive, as a share of its limit.", |s| &s.speeds)?,
            figure("Accelerations", "Acceleration of each drive, as a share of its limit.", |s| {
                &s.accelerations
            })?,
            figure(
                "Following errors",
                "Following error of each drive, as a share of what is allowed at its speed; above 1 \
                 LinuxCNC stops the machine.",
                |s| &s.errors,
            )?,
        ])
    }
}

fn with_limits(lines: Vec<Line>, limits: &[f64]) -> Vec<Strip> {
    lines.into_iter().map(|line| Strip::of(line, limits.to_vec())).collect()
}

/// Restricts strips to the values between two bounds.
fn shown(strips: Vec<Strip>, shown: [f64; 2]) -> Vec<Strip> {
    strips.into_iter().map(|strip| Strip { shown, ..strip }).collect()
}
