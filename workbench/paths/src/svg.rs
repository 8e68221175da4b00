// SPDX-License-Identifier: GPL-2.0-or-later
//! Paths of SVG files: lines, Bézier curves and elliptical arcs without approximation, with the transforms of
//! the drawing applied.

use crate::element::Element;
use crate::ellipse::Ellipse;
use crate::spline::SplineError;
use kurbo::{Affine, Arc, Point, SvgArc, Vec2};
use nalgebra::Vector3;
use roxmltree::{Document, Node, ParsingOptions};
use svgtypes::{Length, LengthUnit, PathParser, PathSegment, Transform, ViewBox};

/// Why the paths of an SVG file cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum SvgError {
    #[error(transparent)]
    Xml(#[from] roxmltree::Error),
    #[error("line {line}: {attribute}: {error}")]
    Attribute { line: u32, attribute: &'static str, error: svgtypes::Error },
    #[error("line {line}: {text}")]
    Untaken {
        line: u32,
        /// The refused element, and the remedy.
        text: String,
    },
    #[error("no path")]
    NoPath,
    #[error(
        "[curve] svg_unit_mm is missing, and width, height and viewBox of the drawing do not define its unit in mm, cm, in, pt or pc: set 1 for mm, 25.4/96 = 0.26458333 for pixels"
    )]
    NoUnit,
    #[error("line {line}: {error}")]
    Spline { line: u32, error: SplineError },
}

/// Elements whose paths are not drawn in place.
const UNDRAWN: [&str; 6] = ["defs", "symbol", "clipPath", "mask", "marker", "pattern"];

/// Most elements of a drawing, and their largest nesting depth, because all ancestors of each are inspected.
/// Drawing programs nest layers and groups a few levels deep.
const MOST_NODES: u32 = 2_000_000;
const MOST_DEPTH: usize = 200;

/// Most lines and curves of a drawing: some hours of cutting.
const MOST_PIECES: usize = 1_000_000;

/// Parses a drawing whose nesting depth is limited: every element is inspected with all its ancestors.
fn parsed(text: &str) -> Result<Document<'_>, SvgError> {
    let options = ParsingOptions { nodes_limit: MOST_NODES, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options)?;
    let mut depths = vec![0];
    for node in document.descendants().skip(1) {
        // A node follows its parent.
        let depth = 1 + node.parent().map_or(0, |parent| depths[parent.id().get_usize()]);
        depths.push(depth);
        if depth > MOST_DEPTH {
            let line = document.text_pos_at(node.range().start).row;
            let text = format!(
                "more than {MOST_DEPTH} nested groups: ungroup them in the drawing program"
            );
            return Err(SvgError::Untaken { line, text });
        }
    }
    Ok(document)
}

/// Reads all pieces of all paths, x to the right and y up, mm. The drawing's unit is `unit` mm, or
/// follows from the root element.
///
/// # Errors
/// See [`SvgError`].
pub fn elements(text: &str, unit: Option<f64>) -> Result<Vec<Element>, SvgError> {
    let document = parsed(text)?;
    let unit = match unit {
        Some(unit) => unit,
        None => unit_of(&document.root_element()).ok_or(SvgError::NoUnit)?,
    };
    let mut all = vec![];
    let is_drawn = |node: &Node| !node.ancestors().any(|node| UNDRAWN.contains(&name(&node)));
    let (mut line, mut counted) = (1, 0);
    for node in document.descendants().filter(Node::is_element).filter(is_drawn) {
        // Counted from the previous element: counting from the start each time takes hours for a large drawing.
        let start = node.range().start;
        line +=
            text.as_bytes()[counted..start].iter().filter(|byte| **byte == b'\n').count() as u32;
        counted = start;
        match name(&node) {
            "use" => {
                let text = "use elements are not supported: unlink clones in the drawing program";
                return Err(SvgError::Untaken { line, text: text.into() });
            }
            "path" => path(&node, line, unit, &mut all)?,
            _ => (),
        }
        if all.len() > MOST_PIECES {
            let text = format!("more than {MOST_PIECES} lines and curves: split the drawing");
            return Err(SvgError::Untaken { line, text });
        }
    }
    if all.is_empty() { Err(SvgError::NoPath) } else { Ok(all) }
}

fn name<'a>(node: &Node<'a, '_>) -> &'a str {
    node.tag_name().name()
}

/// Returns the millimeters per unit of the drawing, from its size. If width and height disagree, the drawing is
/// fitted in, which is the default of `preserveAspectRatio`.
fn unit_of(root: &Node) -> Option<f64> {
    let size = |key: &str| -> Option<f64> {
        let Length { number, unit } = root.attribute(key)?.parse().ok()?;
        let unit = match unit {
            LengthUnit::Mm => 1.0,
            LengthUnit::Cm => 10.0,
            LengthUnit::In => 25.4,
            LengthUnit::Pt => 25.4 / 72.0,
            LengthUnit::Pc => 25.4 / 6.0,
            _ => return None,
        };
        Some(number * unit)
    };
    let shown: ViewBox = root.attribute("viewBox")?.parse().ok()?;
    let ratio = root.attribute("preserveAspectRatio").unwrap_or_default();
    let is_fitted = !ratio.contains("none") && !ratio.contains("slice");
    let unit = (size("width")? / shown.w).min(size("height")? / shown.h);
    (is_fitted && unit > 0.0 && unit.is_finite()).then_some(unit)
}

fn path(node: &Node, line: u32, unit: f64, all: &mut Vec<Element>) -> Result<(), SvgError> {
    let place = Affine::scale_non_uniform(unit, -unit) * moved(node, line)?;
    let first = all.len();
    let mut pen = Pen { at: Point::ZERO, start: Point::ZERO, control: None, place, all };
    for segment in PathParser::from(node.attribute("d").unwrap_or_default()) {
        let segment =
            segment.map_err(|error| SvgError::Attribute { line, attribute: "d", error })?;
        pen.draw(segment).map_err(|error| SvgError::Spline { line, error })?;
    }
    match all[first..].iter().all(Element::is_finite) {
        true => Ok(()),
        false => Err(SvgError::Untaken { line, text: "a number is too large".into() }),
    }
}

/// Returns the combined transforms of a path and its ancestors.
fn moved(node: &Node, line: u32) -> Result<Affine, SvgError> {
    let untaken = |text: String| Err(SvgError::Untaken { line, text });
    let mut whole = Affine::IDENTITY;
    for node in node.ancestors().filter(Node::is_element) {
        let style = node.attribute("style").unwrap_or_default();
        if style.contains("transform") || node.has_attribute("transform-origin") {
            return untaken(
                "CSS transforms are not supported: apply them in the drawing program".into(),
            );
        }
        if name(&node) == "svg" && node.parent_element().is_some() {
            return untaken(
                "nested svg elements are not supported: ungroup them in the drawing program".into(),
            );
        }
        let Some(text) = node.attribute("transform") else { continue };
        let own: Transform = text.parse().map_err(|error| SvgError::Attribute {
            line,
            attribute: "transform",
            error,
        })?;
        whole = Affine::new([own.a, own.b, own.c, own.d, own.e, own.f]) * whole;
    }
    let area = whole.determinant();
    if !(area.is_finite() && area != 0.0) {
        return untaken("transform: it collapses the path; correct it".into());
    }
    Ok(whole)
}

/// A converter of path segments.
struct Pen<'a> {
    at: Point,
    start: Point,
    /// Degree of the previous Bézier curve, and its last control point.
    control: Option<(usize, Point)>,
    place: Affine,
    all: &'a mut Vec<Element>,
}

impl Pen<'_> {
    fn draw(&mut self, segment: PathSegment) -> Result<(), SplineError> {
        let from = if segment.is_abs() { Vec2::ZERO } else { self.at.to_vec2() };
        let p = |x, y| Point::new(x, y) + from;
        match segment {
            PathSegment::MoveTo { x, y, .. } => {
                self.at = p(x, y);
                self.start = self.at;
                self.control = None;
                Ok(())
            }
            PathSegment::LineTo { x, y, .. } => self.curve(&[p(x, y)]),
            PathSegment::HorizontalLineTo { x, .. } => {
                self.curve(&[Point::new(x + from.x, self.at.y)])
            }
            PathSegment::VerticalLineTo { y, .. } => {
                self.curve(&[Point::new(self.at.x, y + from.y)])
            }
            PathSegment::Quadratic { x1, y1, x, y, .. } => self.curve(&[p(x1, y1), p(x, y)]),
            PathSegment::SmoothQuadratic { x, y, .. } => self.curve(&[self.mirrored(2), p(x, y)]),
            PathSegment::CurveTo { x1, y1, x2, y2, x, y, .. } => {
                self.curve(&[p(x1, y1), p(x2, y2), p(x, y)])
            }
            PathSegment::SmoothCurveTo { x2, y2, x, y, .. } => {
                self.curve(&[self.mirrored(3), p(x2, y2), p(x, y)])
            }
            PathSegment::EllipticalArc {
                rx, ry, x_axis_rotation, large_arc, sweep, x, y, ..
            } => self.arc(&SvgArc {
                from: self.at,
                to: p(x, y),
                radii: Vec2::new(rx, ry),
                x_rotation: x_axis_rotation.to_radians(),
                large_arc,
                sweep,
            }),
            PathSegment::ClosePath { .. } => self.curve(&[self.start]),
        }
    }

    /// Returns the first control point of a smooth curve of a degree.
    fn mirrored(&self, degree: usize) -> Point {
        match self.control {
            Some((own, control)) if own == degree => self.at + (self.at - control),
            _ => self.at,
        }
    }

    fn curve(&mut self, points: &[Point]) -> Result<(), SplineError> {
        let has_length = points.iter().any(|p| *p != self.at);
        if has_length {
            let all: Vec<_> = [self.at].iter().chain(points).map(|p| self.placed(*p)).collect();
            self.all.push(Element::bezier(&all)?);
        }
        let degree = points.len();
        self.control = (degree > 1).then(|| (degree, points[degree - 2]));
        self.at = points[degree - 1];
        Ok(())
    }

    fn arc(&mut self, arc: &SvgArc) -> Result<(), SplineError> {
        let Some(found) = Arc::from_svg_arc(arc) else { return self.curve(&[arc.to]) };
        let half = |axis: Vec2| self.moved(Affine::rotate(found.x_rotation) * axis.to_point());
        let halves = [half(Vec2::new(found.radii.x, 0.0)), half(Vec2::new(0.0, found.radii.y))];
        let angles = [found.start_angle, found.start_angle + found.sweep_angle];
        self.all.push(Element::Ellipse(Ellipse::new(self.placed(found.center), halves, angles)));
        (self.control, self.at) = (None, arc.to);
        Ok(())
    }

    fn placed(&self, p: Point) -> Vector3<f64> {
        let p = self.place * p;
        Vector3::new(p.x, p.y, 0.0)
    }

    /// Transforms a vector, without the translation.
    fn moved(&self, p: Point) -> Vector3<f64> {
        self.placed(p) - self.placed(Point::ZERO)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A drawing with endless nesting, and drawings of many groups and of one path with many lines.
    #[test]
    fn deep_and_large_drawings_end_with_a_message_or_in_a_moment() {
        let start = std::time::Instant::now();
        let within = |inner: &str, depth: usize| {
            format!("<svg>{}{inner}{}</svg>", "<g>".repeat(depth), "</g>".repeat(depth))
        };
        let path = "<path d='M0 0h1'/>";
        assert_eq!(elements(&within(path, 150), Some(1.0)).unwrap().len(), 1);
        for depth in [200, 100_000] {
            let refused = elements(&within(path, depth), Some(1.0)).unwrap_err().to_string();
            assert!(refused.contains("nested groups"), "{refused}");
        }
        let wide = format!("<svg>{}</svg>", "<g>\n<path d='M0 0h1'/></g>".repeat(50_000));
        assert_eq!(elements(&wide, Some(1.0)).unwrap().len(), 50_000);
        let long = format!("<svg>\n<path d='M0 0{}'/></svg>", "h1".repeat(MOST_PIECES + 1));
        let refused = elements(&long, Some(1.0)).unwrap_err().to_string();
        assert!(refused.starts_with("line 2: more than"), "{refused}");
        // Counting the lines from the start for every element would take minutes.
        assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
    }

    const FILE: &str = "<svg xmlns='http://www.w3.org/2000/svg'>\n<g>\n\
        <path d='M 1 2 l 3 0 q 1 0 1 1 c 0 2 1 2 2 3 z m 10 10 h 5'/>\n</g></svg>";

    /// Some ten roundings of numbers up to 100.
    const ROUNDING: f64 = 1e-12;

    fn ends(text: &str, unit: Option<f64>) -> Vec<[[f64; 2]; 2]> {
        let all = elements(text, unit).unwrap();
        all.iter().map(|element| element.ends().map(|p| [p.x, p.y])).collect()
    }

    fn of(path: &str) -> String {
        format!("<svg><path d='{path}'/></svg>")
    }

    fn arc(element: &Element) -> Ellipse {
        match element {
            Element::Ellipse(ellipse) => *ellipse,
            Element::Spline(_) => panic!("{element:?}"),
        }
    }

    #[test]
    fn segments_are_the_curves_that_the_drawing_shows() {
        let expected = [
            [[2.0, -4.0], [8.0, -4.0]],
            [[8.0, -4.0], [10.0, -6.0]],
            [[10.0, -6.0], [14.0, -12.0]],
            [[14.0, -12.0], [2.0, -4.0]],
            [[22.0, -24.0], [32.0, -24.0]],
        ];
        assert_eq!(ends(FILE, Some(2.0)), expected);
        let smooth = elements(&of("M 0 0 C 1 1 2 1 3 0 S 5 -1 6 0"), Some(1.0)).unwrap();
        let written = elements(&of("M 0 0 C 1 1 2 1 3 0 C 4 -1 5 -1 6 0"), Some(1.0)).unwrap();
        assert_eq!(smooth, written);
        let smooth = elements(&of("M 0 0 Q 1 1 2 0 T 4 0 T 6 0"), Some(1.0)).unwrap();
        let written = elements(&of("M 0 0 Q 1 1 2 0 Q 3 -1 4 0 Q 5 1 6 0"), Some(1.0)).unwrap();
        assert_eq!(smooth, written);
        assert_eq!(ends(&of("M 1 2 v 3 H 5 V 1"), Some(1.0))[2], [[5.0, -5.0], [5.0, -1.0]]);
    }

    #[test]
    fn an_arc_is_the_circle_that_the_drawing_shows() {
        // Y points down in SVG, so sweep is clockwise as displayed.
        let quarter = elements(&of("M 10 0 A 10 10 0 0 1 0 10"), Some(1.0)).unwrap();
        let Ellipse { centre, halves, angles, .. } = arc(&quarter[0]);
        assert!(centre.norm() < ROUNDING && (halves[0].norm() - 10.0).abs() < ROUNDING);
        assert!(((angles[1] - angles[0]).abs() - 0.5 * std::f64::consts::PI).abs() < ROUNDING);
        let [start, end] = quarter[0].ends();
        assert!((start - Vector3::new(10.0, 0.0, 0.0)).norm() < ROUNDING);
        assert!((end - Vector3::new(0.0, -10.0, 0.0)).norm() < ROUNDING);
        let large = elements(&of("M 10 0 A 10 10 0 1 0 0 10"), Some(1.0)).unwrap();
        let Ellipse { centre, angles, .. } = arc(&large[0]);
        assert!(centre.norm() < ROUNDING);
        assert!(((angles[1] - angles[0]).abs() - 1.5 * std::f64::consts::PI).abs() < ROUNDING);
        // Radii that are too small are enlarged until the arc reaches; a radius of 0 is a line.
        let grown = elements(&of("M 0 0 a 1 1 0 0 1 8 0"), Some(1.0)).unwrap();
        assert!((arc(&grown[0]).halves[0].norm() - 4.0).abs() < ROUNDING);
        let line = elements(&of("M 0 0 a 0 5 0 0 1 8 0"), Some(1.0)).unwrap();
        assert_eq!(line, elements(&of("M 0 0 h 8"), Some(1.0)).unwrap());
    }

    #[test]
    fn transforms_of_a_path_and_of_its_groups_move_it_from_the_inside_out() {
        let text = |outer: &str, inner: &str| {
            format!(
                "<svg><g transform='{outer}'><path transform='{inner}' d='M 1 0 H 2'/></g></svg>"
            )
        };
        for (outer, inner, expected) in [
            ("translate(10 20)", "", [[11.0, -20.0], [12.0, -20.0]]),
            ("translate(10 20)", "scale(3)", [[13.0, -20.0], [16.0, -20.0]]),
            ("scale(3)", "translate(10 20)", [[33.0, -60.0], [36.0, -60.0]]),
            ("rotate(90)", "", [[0.0, -1.0], [0.0, -2.0]]),
            ("", "rotate(90 1 0)", [[1.0, 0.0], [1.0, -1.0]]),
            ("skewY(45)", "", [[1.0, -1.0], [2.0, -2.0]]),
            ("skewX(45)", "translate(0 1)", [[2.0, -1.0], [3.0, -1.0]]),
            ("matrix(0 1 -1 0 5 6)", "scale(2 4)", [[5.0, -8.0], [5.0, -10.0]]),
        ] {
            let found = ends(&text(outer, inner), Some(1.0))[0];
            for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
                assert!((found - expected).abs() < ROUNDING, "{outer} {inner}: {found} {expected}");
            }
        }
        // A circle becomes the ellipse through the transformed points of the circle.
        let text = "<svg><path transform='skewX(45) scale(2 1)' d='M 3 0 A 3 3 0 0 1 0 3'/></svg>";
        let all = elements(text, Some(1.0)).unwrap();
        let Ellipse { halves: [u, v], .. } = arc(&all[0]);
        let (sin, cos) = 0.7_f64.sin_cos();
        let at = u * cos + v * sin;
        let (y, x) = (-at.y, 0.5 * (at.x + at.y));
        assert!((x.hypot(y) - 3.0).abs() < ROUNDING, "{u} {v}");
    }

    #[test]
    fn the_unit_is_that_of_the_drawing_s_size_unless_a_key_gives_one() {
        let text = |root: &str| format!("<svg {root}><path d='M 0 0 h 10'/></svg>");
        for (root, expected) in [
            ("width='100mm' height='50mm' viewBox='0 0 100 50'", 10.0),
            ("width='2in' height='1in' viewBox='0 0 200 100'", 2.54),
            ("width='7.2pt' height='72pt' viewBox='5 5 0.72 7.2'", 254.0 / 7.2),
            ("width='10cm' height='10cm' viewBox='0 0 200 100'", 5.0),
        ] {
            let found = ends(&text(root), None)[0][1][0];
            assert!((found - expected).abs() < ROUNDING, "{root}: {found}");
            assert_eq!(ends(&text(root), Some(3.0))[0][1][0], 30.0);
        }
        for root in [
            "",
            "width='100' height='50' viewBox='0 0 100 50'",
            "width='100mm' height='50mm'",
            "width='1e999mm' height='1e999mm' viewBox='0 0 1 1'",
            "width='100mm' height='50mm' viewBox='0 0 100 50' preserveAspectRatio='none'",
        ] {
            let message = elements(&text(root), None).unwrap_err().to_string();
            assert!(message.starts_with("[curve] svg_unit_mm is missing"), "{root}: {message}");
        }
    }

    #[test]
    fn an_unsupported_element_is_reported_with_its_line() {
        for (text, expected) in [
            (FILE.replace("<g>", "<g transform='scale(0)'>"), "line 3: transform: it collapses"),
            (FILE.replace("<g>", "<g transform='turn(2)'>"), "line 3: transform: "),
            (FILE.replace("<g>", "<g style='transform: scale(2)'>"), "line 3: CSS transforms"),
            (FILE.replace("<g>", "<svg>").replace("</g>", "</svg>"), "line 3: nested svg"),
            (FILE.replace("<g>", "<g><use href='#a'/>"), "line 2: use elements"),
            (FILE.replace("l 3 0", "l 3 foo"), "line 3: d: "),
            (FILE.replace("l 3 0", "l 1e308 0 1e308 0 1e308 0"), "line 3: a number is too large"),
            (FILE.replace("path", "rect"), "no path"),
            (FILE.replace("<g>", "<defs>").replace("</g>", "</defs>"), "no path"),
            ("<svg".into(), "root node"),
        ] {
            let message = elements(&text, Some(1.0)).unwrap_err().to_string();
            assert!(message.contains(expected), "{text}: {message}");
        }
    }
}
