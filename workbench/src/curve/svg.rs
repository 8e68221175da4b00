// SPDX-License-Identifier: GPL-2.0-or-later
//! Paths of SVG files as splines: lines, quadratic and cubic Bézier curves, as they are.

use crate::curve::spline::{Spline, SplineError};
use svgtypes::{SimplePathSegment, SimplifyingPathParser};

/// An SVG file whose paths cannot be taken.
#[derive(Debug, thiserror::Error)]
pub enum SvgError {
    /// No XML.
    #[error(transparent)]
    Xml(#[from] roxmltree::Error),
    /// A path's data.
    #[error("line {line}: {error}")]
    Path {
        /// Line of the file.
        line: u32,
        /// What is wrong.
        error: svgtypes::Error,
    },
    /// An arc, which would have to be replaced by something near it.
    #[error("line {0}: the path has an arc (A): replace arcs by curves in the drawing program")]
    Arc(u32),
    /// Something that moves or turns paths.
    #[error("line {0}: transform= is not looked at: apply it in the drawing program")]
    Transform(u32),
    /// No path in it.
    #[error("no path")]
    NoPath,
    /// Points that make no spline.
    #[error("line {line}: {error}")]
    Spline {
        /// Line of the file.
        line: u32,
        /// What is wrong.
        error: SplineError,
    },
}

/// All pieces of all paths, x to the right and y up, in `scale` mm per unit of the drawing.
///
/// # Errors
/// See [`SvgError`].
pub fn splines(text: &str, scale: f64) -> Result<Vec<Spline>, SvgError> {
    let document = roxmltree::Document::parse(text)?;
    let mut all = vec![];
    for node in document.descendants().filter(|node| node.tag_name().name() == "path") {
        let line = document.text_pos_at(node.range().start).row;
        if node.ancestors().any(|node| node.has_attribute("transform")) {
            return Err(SvgError::Transform(line));
        }
        let data = node.attribute("d").unwrap_or_default();
        if data.contains(['a', 'A']) {
            return Err(SvgError::Arc(line));
        }
        let mut pen = Pen { at: [0.0; 2], start: [0.0; 2], scale, all: &mut all };
        for segment in SimplifyingPathParser::from(data) {
            let segment = segment.map_err(|error| SvgError::Path { line, error })?;
            pen.draw(segment).map_err(|error| SvgError::Spline { line, error })?;
        }
    }
    if all.is_empty() { Err(SvgError::NoPath) } else { Ok(all) }
}

/// Draws segments, each with a parameter range of its own.
struct Pen<'a> {
    at: [f64; 2],
    start: [f64; 2],
    scale: f64,
    all: &'a mut Vec<Spline>,
}

impl Pen<'_> {
    fn draw(&mut self, segment: SimplePathSegment) -> Result<(), SplineError> {
        match segment {
            SimplePathSegment::MoveTo { x, y } => {
                self.at = [x, y];
                self.start = self.at;
                Ok(())
            }
            SimplePathSegment::LineTo { x, y } => self.curve(&[[x, y]]),
            SimplePathSegment::Quadratic { x1, y1, x, y } => self.curve(&[[x1, y1], [x, y]]),
            SimplePathSegment::CurveTo { x1, y1, x2, y2, x, y } => {
                self.curve(&[[x1, y1], [x2, y2], [x, y]])
            }
            SimplePathSegment::ClosePath => self.curve(&[self.start]),
        }
    }

    fn curve(&mut self, points: &[[f64; 2]]) -> Result<(), SplineError> {
        let place = |p: &[f64; 2]| [p[0] * self.scale, -p[1] * self.scale, 0.0];
        let has_length = points.iter().any(|p| *p != self.at);
        if has_length {
            let all: Vec<[f64; 3]> = [self.at].iter().chain(points).map(place).collect();
            let (degree, first) = (points.len(), self.all.len() as f64);
            let knot = |k| if k <= degree { first } else { first + 1.0 };
            let knots = (0..2 * degree + 2).map(knot).collect();
            self.all.push(Spline::new(degree, &all, None, Some(knots))?);
        }
        self.at = points[points.len() - 1];
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::curve::taylor::Taylor;
    use crate::proof::interval::Interval;

    const FILE: &str = "<svg xmlns='http://www.w3.org/2000/svg'>\n<g>\n\
        <path d='M 1 2 l 3 0 q 1 0 1 1 c 0 2 1 2 2 3 z m 10 10 h 5'/>\n</g></svg>";

    #[test]
    fn segments_are_the_splines_that_the_drawing_shows() {
        let all = splines(FILE, 2.0).unwrap();
        assert_eq!(all.len(), 5);
        let end = |k: usize, t: f64| {
            let span = all[k].spans()[0].0;
            let at = all[k].at(span, Taylor::variable(Interval::point(t)));
            at.map(|x| x.value.middle())
        };
        assert_eq!(end(0, 0.0), [2.0, -4.0, 0.0]);
        assert_eq!(end(0, 1.0), [8.0, -4.0, 0.0]);
        assert_eq!(end(1, 1.5), [9.5, -4.5, 0.0]);
        assert_eq!(end(2, 3.0), [14.0, -12.0, 0.0]);
        assert_eq!(end(3, 4.0), [2.0, -4.0, 0.0]);
        assert_eq!(end(4, 5.0), [32.0, -24.0, 0.0]);
    }

    #[test]
    fn what_cannot_be_taken_as_it_is_is_told_with_its_line() {
        for (text, expected) in [
            (FILE.replace("l 3 0", "a 3 3 0 0 1 5 5"), "line 3: the path has an arc"),
            (FILE.replace("<g>", "<g transform='scale(2)'>"), "line 3: transform="),
            (FILE.replace("l 3 0", "l 3 foo"), "line 3: "),
            (FILE.replace("path", "rect"), "no path"),
            ("<svg".into(), "root node"),
        ] {
            let told = splines(&text, 1.0).unwrap_err().to_string();
            assert!(told.contains(expected), "{text}: {told}");
        }
    }
}
