// SPDX-License-Identifier: GPL-2.0-or-later
//! A machine at home in two views: leg numbers, axes of base and platform, and positive directions.

use crate::arrows::{SIGN, WIDTH, along_sight, arrow};
use crate::key::{Key, Sign};
use crate::machine::{GUIDE, JOINT_AXIS, LEG, PASSIVE, passive, rail_or_arm};
use crate::plot::DrawError;
use crate::sheet::{AROUND, Area, Chart, Frame, drawn_on, path_axes, span};
use crate::style::{BLUE, GREEN, NAME, PURPLE, TITLE, VERMILLION, letters_at, width_of};
use kinematics::{At, Carries, Letter, POSE_LETTERS, Segment, Vector3};
use machine::passive::{PassiveShape, parts};
use machine::read::direction::ToolDirection;
use machine::read::legs::drive_rate;
use machine::read::mechanism::Mechanism;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, VPos};

/// Lengths of arrows as shares of the largest side: the axes of the base, those of the platform, joints, and the
/// tool.
const AXIS: f64 = 0.16;
const OWN_AXIS: f64 = 0.1;
const JOINT: f64 = 0.12;
const TOOL_LENGTH: f64 = 0.17;

/// Margin around the drawing for numbers, as a share of the picture.
const ROOM: f64 = 0.13;

/// Most pixels of both views together, horizontally and vertically.
const MOST: [f64; 2] = [980.0, 440.0];
/// Least pixels of a side.
const LEAST: f64 = 170.0;

/// Criterion for joints in a plane: across the plane they extend by at most this share of their largest side, and along
/// the second direction in it by at least this share.
const FLAT: f64 = 0.25;

/// Ratio of the extent along Z to the extent across, above which a machine is drawn lying.
const LYING: f64 = 1.5;

/// Distance in pixels within which two joints coincide.
const SAME: i32 = 10;

/// Width of the tool's arrow; it is drawn below axes that it would cover.
const TOOL: u32 = 9;

/// Radius of joints, pixels.
const BALL: i32 = 5;

/// Pixels of the title and of a line of the key.
const HEAD: u32 = 40;
const STEP: i32 = 24;

/// A view along one of the axes, with the indices of the horizontal and the vertical axis.
struct View {
    title: &'static str,
    across: usize,
    up: usize,
    eye: Vector3<f64>,
}

const NAMES: [&str; 3] = ["X", "Y", "Z"];

/// Returns the views of standing machines, or of machines that lie along Z, as lathes do.
fn views(is_lying: bool) -> [View; 2] {
    let [top, side] = match is_lying {
        true => ["End view, seen from +Z", "Side view, seen from +Y"],
        false => ["Top view, seen from +Z", "Side view, seen from -Y"],
    };
    let top = View { title: top, across: 0, up: 1, eye: Vector3::z() };
    match is_lying {
        true => [top, View { title: side, across: 2, up: 0, eye: Vector3::y() }],
        false => [top, View { title: side, across: 0, up: 2, eye: -Vector3::y() }],
    }
}

impl View {
    fn flat(&self, place: &Vector3<f64>) -> (f64, f64) {
        (place[self.across], place[self.up])
    }

    /// Returns the horizontal and vertical extent of points.
    fn sides(&self, places: &[Vector3<f64>]) -> [f64; 2] {
        [self.across, self.up].map(|k| {
            let (low, high) = span(places.iter().map(|place| place[k]));
            high - low
        })
    }
}

struct Arrow {
    from: Vector3<f64>,
    to: Vector3<f64>,
    color: RGBColor,
    width: u32,
    name: String,
}

/// A joint at an end of a leg, with its label.
struct Joint {
    at: Vector3<f64>,
    color: RGBColor,
    name: String,
}

/// The elements of the drawing, in base.
struct Drawing {
    lines: Vec<([Vector3<f64>; 2], ShapeStyle)>,
    arrows: Vec<Arrow>,
    joints: Vec<Joint>,
}

/// Draws a machine at home as SVG; `hands` has the letter of the screw of every leg that has one.
///
/// # Errors
/// The error of the drawing library.
pub fn of_machine(
    config: &Mechanism,
    home: &At,
    hands: &[Option<char>],
) -> Result<String, DrawError> {
    let drawing = Drawing::new(config, home, hands);
    let places = drawing.places();
    let ends = [0, 1, 2].map(|k| span(places.iter().map(|place| place[k])));
    let [x, y, z] = ends.map(|(low, high)| high - low);
    let keys = keys(config, hands);
    let title = format!(
        "{}: frames and signs, at home",
        config.file.file_stem().unwrap_or_default().to_string_lossy()
    );
    // Long passive legs make no lathe.
    let lies = config.geometry.constraints().is_empty() && z > LYING * x.max(y);
    sheet(&title, &views(lies), config.length_unit(), &drawing, &keys)
}

/// Draws both views with the key below them.
fn sheet(
    title: &str,
    views: &[View; 2],
    unit: &str,
    drawing: &Drawing,
    keys: &[Key],
) -> Result<String, DrawError> {
    let places = drawing.places();
    let sides = views.each_ref().map(|view| view.sides(&places));
    // Both views have the same scale.
    let across: f64 = sides.iter().map(|[x, _]| x).sum();
    let up = sides.iter().map(|[_, y]| *y).fold(0.0, f64::max);
    let scale = (MOST[0] / across).min(MOST[1] / up);
    let pixels = |side: f64| (side * scale).max(LEAST) as u32;
    let widths = sides.map(|[x, _]| pixels(x) + AROUND.0);
    let height = pixels(up) + AROUND.1;
    let widest = keys.iter().map(Key::width).max().unwrap_or(1) + 24;
    let width = (widths[0] + widths[1]).max(2 * widest + 48);
    let columns = ((width - 24) / widest) as usize;
    let rows = keys.len().div_ceil(columns);
    let size = (width, HEAD + height + (rows as u32 + 1) * STEP as u32);
    drawn_on(size, |root| {
        let style = letters_at(TITLE, HPos::Center, VPos::Top);
        root.draw(&Text::new(title.to_string(), (width as i32 / 2, 12), style))?;
        let (head, below) = root.split_vertically(HEAD + height);
        let (_, plots) = head.split_vertically(HEAD);
        let (first, second) = plots.split_horizontally(width * widths[0] / (widths[0] + widths[1]));
        drawing.draw(&first, &views[0], unit)?;
        drawing.draw(&second, &views[1], unit)?;
        let place =
            |k: usize| ((24 + widest as usize * (k / rows)) as i32, STEP * (k % rows) as i32 + 12);
        keys.iter().enumerate().try_for_each(|(k, key)| key.draw(&below, place(k)))
    })
}

impl Drawing {
    fn new(config: &Mechanism, at: &At, hands: &[Option<char>]) -> Self {
        let legs = &at.segments()[..config.legs()];
        let mut drawing = Self { lines: vec![], arrows: vec![], joints: vec![] };
        let lower: Vec<_> = legs.iter().map(|leg| leg.base).collect();
        let upper: Vec<_> = legs.iter().map(|leg| leg.platform).collect();
        // Carriages and arms move, so their joints are not connected.
        if is_fixed(config) {
            drawing.ring(&lower, BLUE);
        }
        drawing.ring(&upper, VERMILLION);
        for (leg, (from, to)) in lower.iter().zip(&upper).enumerate() {
            drawing.lines.push(([*from, *to], LEG.stroke_width(3)));
            drawing.guide(config, leg, from);
        }
        drawing.lines.extend(passive(config, at));
        let origin = platform_origin(config, at);
        let size = drawing.size(&[&lower[..], &upper[..], &[origin, Vector3::zeros()]].concat());
        for (leg, (from, to)) in lower.iter().zip(&upper).enumerate() {
            drawing.joint_arrow(config, leg, [from, to], JOINT * size);
        }
        drawing.other_joints(config, origin, JOINT * size);
        drawing.tool(config, origin, TOOL_LENGTH * size);
        drawing.axes(Vector3::zeros(), AXIS * size, BLUE, NAMES);
        drawing.axes(origin, OWN_AXIS * size, VERMILLION, ["x", "y", "z"]);
        for (leg, (from, to)) in lower.iter().zip(&upper).enumerate() {
            let number = (config.place.first_leg + leg).to_string();
            let hand = hands.get(leg).copied().flatten().map(|hand| format!(" {hand}"));
            let name = number.clone() + &hand.unwrap_or_default();
            drawing.joints.push(Joint { at: *from, color: BLUE, name });
            drawing.joints.push(Joint { at: *to, color: VERMILLION, name: number });
        }
        drawing
    }

    /// Adds the outline of a body between its joints.
    fn ring(&mut self, joints: &[Vector3<f64>], color: RGBColor) {
        let style = color.mix(0.45).stroke_width(1);
        let ring = outline(joints).unwrap_or_default();
        self.lines.extend(ring.windows(2).map(|line| ([line[0], line[1]], style)));
    }

    fn tool(&mut self, config: &Mechanism, from: Vector3<f64>, length: f64) {
        let Some(direction) = tool_direction(config) else { return };
        let up = if direction == ToolDirection::Up { length } else { -length };
        let to = from + Vector3::z() * up;
        self.arrows.push(Arrow { from, to, color: PURPLE, width: TOOL, name: "tool".into() });
    }

    /// Adds an arrow along each table axis, from the origin, and along each axis that carries something, with the number of
    /// its joint. An axis that turns does so right-handed about its arrow.
    fn other_joints(&mut self, config: &Mechanism, platform: Vector3<f64>, length: f64) {
        let mut add = |from: Vector3<f64>, way: Vector3<f64>, joint: usize| {
            let (to, name) = (from + way * length, joint.to_string());
            self.arrows.push(Arrow { from, to, color: GREEN, width: WIDTH, name });
        };
        for (k, letter) in config.machine.layout().table().as_slice().iter().enumerate() {
            let mut way = Vector3::zeros();
            way[letter.index()] = -1.0;
            add(Vector3::zeros(), way, config.place.first_joint + config.legs() + k);
        }
        let extra = config.extra_axes.places().enumerate();
        for (k, place) in extra {
            let Some(link) = config.chain.links().iter().find(|link| link.place == place) else {
                continue;
            };
            let is_on_platform = match link.carries {
                Carries::Work => config.chain.holder().is_some(),
                Carries::Tool => config.chain.holder().is_none(),
                Carries::Legs => false,
            };
            let origin = if is_on_platform { platform } else { Vector3::zeros() };
            add(origin + link.point, link.axis, config.place.first_extra_joint + k);
        }
    }

    /// Adds the rail of a carriage, or an arm.
    fn guide(&mut self, config: &Mechanism, leg: usize, lower: &Vector3<f64>) {
        let width = if config.geometry.legs()[leg].kind.is_angular() { 6 } else { 5 };
        let rail = rail_or_arm(config, leg, lower);
        self.lines.extend(rail.map(|ends| (ends, GUIDE.stroke_width(width))));
    }

    /// Adds an arrow in the direction in which the lower end or the strut moves as the joint value increases.
    fn joint_arrow(
        &mut self,
        config: &Mechanism,
        leg: usize,
        [lower, upper]: [&Vector3<f64>; 2],
        length: f64,
    ) {
        let segment = Segment { base: *lower, platform: *upper };
        let (from, direction) = match drive_rate(&config.geometry.legs()[leg], &segment) {
            Some(direction) => (*lower, direction),
            // From the middle on, where no joint covers it.
            None => (lower + (upper - lower) * 0.4, upper - lower),
        };
        let to = from + direction.normalize() * length;
        self.arrows.push(Arrow { from, to, color: GREEN, width: WIDTH, name: String::new() });
    }

    fn axes(
        &mut self,
        origin: Vector3<f64>,
        length: f64,
        color: RGBColor,
        names: [&'static str; 3],
    ) {
        for (k, name) in names.into_iter().enumerate() {
            let mut to = origin;
            to[k] += length;
            self.arrows.push(Arrow { from: origin, to, color, width: WIDTH, name: name.into() });
        }
    }

    fn places(&self) -> Vec<Vector3<f64>> {
        let lines = self.lines.iter().flat_map(|(line, _)| line).copied();
        lines.chain(self.arrows.iter().flat_map(|arrow| [arrow.from, arrow.to])).collect()
    }

    /// Returns the largest side of the drawing so far, including `more` points.
    fn size(&self, more: &[Vector3<f64>]) -> f64 {
        let all: Vec<_> = self.places().into_iter().chain(more.iter().copied()).collect();
        let sides = [0, 1, 2].map(|k| {
            let (low, high) = span(all.iter().map(|place| place[k]));
            high - low
        });
        sides.into_iter().fold(0.0, f64::max)
    }

    fn draw(&self, area: &Area, view: &View, unit: &str) -> Result<(), DrawError> {
        let [x, y] = [view.across, view.up].map(|k| format!("{} in {unit}", NAMES[k]));
        let frame = Frame { title: view.title, x: &x, y: &y, limits: vec![] };
        let chart = path_axes(area, &frame, &self.outline(view))?;
        let plot = chart.plotting_area().strip_coord_spec();
        let sight = Sight { chart: &chart, view };
        let mut names =
            Names { taken: vec![], lines: vec![], signs: vec![], size: plot.dim_in_pixel() };
        for (line, style) in &self.lines {
            let pixels = line.each_ref().map(|place| sight.pixel(place));
            names.lines.push(pixels);
            plot.draw(&PathElement::new(pixels, *style))?;
        }
        let joints = self.joints.iter().map(|joint| (sight.pixel(&joint.at), joint));
        let joints: Vec<_> = joints.collect();
        for (at, joint) in &joints {
            plot.draw(&Circle::new(*at, BALL, joint.color.filled()))?;
            names.taken.push(around(*at, BALL));
        }
        let mut ends = vec![];
        for arrow in &self.arrows {
            ends.push((sight.draw(&plot, arrow, &mut names)?, arrow));
        }
        let middle = middle(joints.iter().map(|(at, _)| *at));
        for (at, arrow) in ends.iter().filter(|(_, arrow)| !arrow.name.is_empty()) {
            names.put(&plot, *at, sight.pixel(&arrow.from), &arrow.name, arrow.color)?;
        }
        for (at, color, name) in merged(&joints) {
            names.put(&plot, at, middle, &name, color)?;
        }
        Ok(())
    }

    /// Returns the corners that a view has to show, with a margin for numbers.
    fn outline(&self, view: &View) -> Vec<(f64, f64)> {
        let places: Vec<_> = self.places().iter().map(|place| view.flat(place)).collect();
        let (x, y) = (span(places.iter().map(|p| p.0)), span(places.iter().map(|p| p.1)));
        let room = ROOM * (x.1 - x.0).max(y.1 - y.0);
        vec![(x.0 - room, y.0 - room), (x.1 + room, y.1 + room)]
    }
}

/// Returns whether the lower ends of all legs are fixed.
fn is_fixed(config: &Mechanism) -> bool {
    config.geometry.legs().iter().all(|leg| leg.kind.stands())
}

/// Returns the line around joints in a plane perpendicular to an axis; `None` if they are in no such plane.
fn outline(joints: &[Vector3<f64>]) -> Option<Vec<Vector3<f64>>> {
    let sides =
        [0, 1, 2].map(|k| span(joints.iter().map(|joint| joint[k]))).map(|(low, high)| high - low);
    let mut axes = [0, 1, 2];
    axes.sort_by(|a, b| sides[*b].total_cmp(&sides[*a]));
    let [first, second, across] = axes;
    if joints.len() < 3
        || sides[across] > FLAT * sides[first]
        || sides[second] < FLAT * sides[first]
    {
        return None;
    }
    let middle = joints.iter().sum::<Vector3<f64>>() / joints.len() as f64;
    let angle = |joint: &Vector3<f64>| (joint - middle)[second].atan2((joint - middle)[first]);
    let mut ring = joints.to_vec();
    ring.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    ring.push(ring[0]);
    Some(ring)
}

/// Returns the origin of the platform's frame at home, which is level: docs/reference/view.md has the formula.
fn platform_origin(config: &Mechanism, home: &At) -> Vector3<f64> {
    let centre = Vector3::from(config.geometry.centre);
    let layout = config.machine.layout();
    let is_moved = |letter| layout.constraints() > 0 || layout.coordinates().contains(letter);
    let pose = home.full_pose().position + centre;
    Vector3::from_fn(|k, _| if is_moved(Letter::ALL[k]) { pose[k] } else { 0.0 }) - centre
}

/// Returns the direction of tools; `None` if the file does not give it, or no tool is on the platform.
fn tool_direction(config: &Mechanism) -> Option<ToolDirection> {
    if config.chain.is_bare() {
        return None;
    }
    config.tool_direction.or(ToolDirection::of_length(config.spindle.z))
}

fn keys(config: &Mechanism, hands: &[Option<char>]) -> Vec<Key> {
    let mut keys = vec![
        Key::new(Sign::Line(LEG.stroke_width(3)), "leg"),
        Key::new(Sign::Ball(BLUE), "base joint, with the number of the leg"),
        Key::new(Sign::Ball(VERMILLION), "platform joint"),
        Key::new(Sign::Arrow(GREEN), "positive direction of the joint"),
        Key::new(Sign::Arrow(BLUE), "axes X Y Z of the base"),
        Key::new(Sign::Arrow(VERMILLION), "axes x y z of the platform"),
    ];
    if !is_fixed(config) {
        keys.insert(1, Key::new(Sign::Line(GUIDE.stroke_width(5)), "rail of a carriage, or arm"));
    }
    let shapes: Vec<_> = parts(config).iter().map(|part| part.shape).collect();
    if shapes.contains(&PassiveShape::Axis) {
        keys.insert(1, Key::new(Sign::Line(JOINT_AXIS.stroke_width(3)), "axis of a passive joint"));
    }
    if shapes.iter().any(|shape| *shape != PassiveShape::Axis) {
        keys.insert(1, Key::new(Sign::Line(PASSIVE.stroke_width(6)), "passive leg"));
    }
    match tool_direction(config) {
        Some(_) => keys.push(Key::new(Sign::Arrow(PURPLE), "direction of tools")),
        None if config.chain.is_bare() => {
            keys.push(Key::new(Sign::Letter("-".into()), "no tool is fixed to the platform"));
        }
        None => keys.push(Key::new(Sign::Letter("-".into()), "the file has no TOOL_DIRECTION")),
    }
    keys.push(Key::new(Sign::Sight(true), "arrow towards you"));
    keys.push(Key::new(Sign::Sight(false), "arrow away from you"));
    for (hand, name) in
        [('R', "right-hand screw"), ('L', "left-hand screw"), ('?', "screw of unknown hand")]
    {
        if hands.contains(&Some(hand)) {
            keys.push(Key::new(Sign::Letter(hand.into()), name));
        }
    }
    keys.extend(other_joints(config));
    keys
}

fn other_joints(config: &Mechanism) -> Vec<Key> {
    let legs = config.legs();
    let table = config.machine.layout().table().as_slice().iter().enumerate().map(|(k, letter)| {
        let name = letter.name();
        (
            config.place.first_joint + legs + k,
            format!("table: moves to -{name} as joint and {name} increase"),
        )
    });
    let extra = config.extra_axes.places().enumerate().map(|(k, place)| {
        let link = config.chain.links().iter().find(|link| link.place == place);
        let carries = link.map_or("by itself".into(), |link| {
            format!("carries the {}", link.carries.name().to_ascii_lowercase())
        });
        (config.place.first_extra_joint + k, format!("axis {}, {carries}", POSE_LETTERS[place]))
    });
    table
        .chain(extra)
        .map(|(number, text)| Key::new(Sign::Letter(number.to_string()), &text))
        .collect()
}

/// A view on the sheet.
struct Sight<'a, 'b, 'c> {
    chart: &'a Chart<'b, 'c>,
    view: &'a View,
}

impl Sight<'_, '_, '_> {
    /// Returns the pixel within the plot.
    fn pixel(&self, place: &Vector3<f64>) -> (i32, i32) {
        let plot = self.chart.plotting_area();
        let (x, y) = plot.map_coordinate(&self.view.flat(place));
        let (left, top) = plot.get_base_pixel();
        (x - left, y - top)
    }

    /// Draws an arrow; returns the position of its name.
    fn draw(&self, plot: &Area, drawn: &Arrow, names: &mut Names) -> Result<(i32, i32), DrawError> {
        let [from, to] = [&drawn.from, &drawn.to].map(|place| self.pixel(place));
        let direction = drawn.to - drawn.from;
        let sight = direction.normalize().dot(&self.view.eye);
        // Within 15 degrees of the viewing direction.
        if sight.abs() > 0.966 {
            let sign = (from, sight > 0.0, drawn.color);
            if let Some((_, at)) = names.signs.iter().find(|(other, _)| *other == sign) {
                return Ok(*at);
            }
            let at = names.free_for_sign(from);
            along_sight(plot, at, sight > 0.0, drawn.color)?;
            names.taken.push(around(at, SIGN));
            names.signs.push((sign, at));
            return Ok(at);
        }
        arrow(plot, from, to, drawn.color, drawn.width)?;
        names.lines.push([from, to]);
        names.taken.push(around(to, 3));
        Ok(to)
    }
}

/// Left, top, right and bottom.
type Bounds = [i32; 4];

fn around((x, y): (i32, i32), half: i32) -> Bounds {
    [x - half, y - half, x + half, y + half]
}

fn middle(points: impl Iterator<Item = (i32, i32)>) -> (i32, i32) {
    let (count, x, y) = points.fold((0, 0, 0), |(n, x, y), p| (n + 1, x + p.0, y + p.1));
    (x / count.max(1), y / count.max(1))
}

/// Merges the names of joints of one color that coincide in this view.
fn merged(joints: &[((i32, i32), &Joint)]) -> Vec<((i32, i32), RGBColor, String)> {
    let mut found: Vec<((i32, i32), RGBColor, String)> = vec![];
    for (at, joint) in joints {
        let is_near =
            |other: &(i32, i32)| (other.0 - at.0).abs() <= SAME && (other.1 - at.1).abs() <= SAME;
        match found.iter_mut().find(|(other, color, _)| *color == joint.color && is_near(other)) {
            Some((_, _, name)) => *name += &format!(", {}", joint.name),
            None => found.push((*at, joint.color, joint.name.clone())),
        }
    }
    found
}

/// Label placement: next to the named object, where a label covers least.
struct Names {
    taken: Vec<Bounds>,
    lines: Vec<[(i32, i32); 2]>,
    signs: Vec<(AlongSight, (i32, i32))>,
    size: (u32, u32),
}

/// An arrow along the viewing direction: its start, whether it points towards the viewer, and its color.
type AlongSight = ((i32, i32), bool, RGBColor);

impl Names {
    /// Returns a position, shifted to the left and down if symbols of other arrows are there.
    fn free_for_sign(&self, (x, y): (i32, i32)) -> (i32, i32) {
        let step = 2 * SIGN + 3;
        let is_free = |(x, y): &(i32, i32)| {
            self.signs.iter().all(|(_, (a, b))| (x - a).abs().max((y - b).abs()) >= step)
        };
        let places = (0..).map(|k| (x - k * step, y + k * step));
        places.into_iter().find(is_free).unwrap_or((x, y))
    }

    /// Writes a name near a position, preferably on the side away from `from`.
    fn put(
        &mut self,
        plot: &Area,
        at: (i32, i32),
        from: (i32, i32),
        name: &str,
        color: RGBColor,
    ) -> Result<(), DrawError> {
        let (width, height) = (width_of(name, NAME) as i32, NAME);
        let outwards = f64::from(at.1 - from.1).atan2(f64::from(at.0 - from.0));
        let mut best: Option<(f64, Bounds)> = None;
        for step in 0..48_usize {
            let (turn, ring) = (step % 16, step / 16);
            let angle = outwards + std::f64::consts::TAU * turn as f64 / 16.0;
            let reach = 15.0 + 11.0 * ring as f64;
            let (x, y) = (angle.cos(), angle.sin());
            // The box of the name touches a circle around the position.
            let x = at.0 + (x * (reach + 0.5 * f64::from(width - height).max(0.0))).round() as i32;
            let y = at.1 + (y * reach).round() as i32;
            let bounds = [x - width / 2, y - height / 2, x + width / 2, y + height / 2];
            let turned = turn.min(16 - turn) as f64;
            let cost = self.cost(&bounds) + 0.25 * turned + 2.5 * ring as f64;
            if best.is_none_or(|(least, _)| cost < least) {
                best = Some((cost, bounds));
            }
        }
        let Some((_, bounds)) = best else { return Ok(()) };
        let at = ((bounds[0] + bounds[2]) / 2, (bounds[1] + bounds[3]) / 2);
        let style = letters_at(NAME, HPos::Center, VPos::Center).color(&color);
        plot.draw(&Text::new(name.to_string(), at, style))?;
        self.taken.push(bounds);
        Ok(())
    }

    /// Returns the cost of what a name at a position covers.
    fn cost(&self, bounds: &Bounds) -> f64 {
        let [left, top, right, bottom] = *bounds;
        let (width, height) = (self.size.0 as i32, self.size.1 as i32);
        let is_outside = left < 0 || top < 0 || right > width || bottom > height;
        let covers = |[l, t, r, b]: &Bounds| *l < right && left < *r && *t < bottom && top < *b;
        let taken = self.taken.iter().filter(|other| covers(other)).count();
        let lines = self.lines.iter().filter(|line| crosses(line, bounds)).count();
        1000.0 * f64::from(is_outside) + 100.0 * taken as f64 + 4.0 * lines as f64
    }
}

/// Returns whether a line enters a box, tested at points at most as far apart as letters are high.
fn crosses([from, to]: &[(i32, i32); 2], [left, top, right, bottom]: &Bounds) -> bool {
    let (x, y) = (to.0 - from.0, to.1 - from.1);
    let steps = x.abs().max(y.abs()) / 6 + 1;
    (0..=steps).any(|k| {
        let (x, y) = (from.0 + x * k / steps, from.1 + y * k / steps);
        (*left..=*right).contains(&x) && (*top..=*bottom).contains(&y)
    })
}
