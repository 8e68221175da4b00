// SPDX-License-Identifier: GPL-2.0-or-later
//! Where a machine can put its tool: the positions that it reaches in one orientation, or in every
//! one of a set, and what limits them.
//!
//! Everything is seen along rays from one place inside. A ray is followed in steps and every
//! crossing of a limit is halved down to rounding; what is thinner than a step can be missed. The
//! volume is the sum of the rays' pieces by their solid angles, islands and holes included, and
//! once more, independently, a count on a grid.

use crate::batch;
use crate::limits;
use crate::machine::{JointKind, MachineConfig};
use crate::study;
use kinematics::{
    Cause, Fault, LegKind, Letter, Limit, Limits, Margin, Matrix3, Part, Pose, Vector3,
};
use std::f64::consts::PI;
use std::fmt;
use std::num::NonZero;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Halvings of a step: down to the rounding of a position.
const HALVINGS: usize = 48;

/// What a position breaks first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Border {
    /// The limit.
    pub limit: Limit,
    /// Of what.
    pub part: Part,
    /// Whether it is the lower end of the range that is left.
    pub is_low: bool,
}

impl Border {
    /// That nothing is reached beyond.
    const UNREACHED: Self = Self { limit: Limit::Reach, part: Part::Whole, is_low: true };

    fn of_fault(fault: &Fault) -> Self {
        let part = fault.leg.map_or(Part::Whole, |leg| Part::Leg(leg.into()));
        let limit = match fault.cause {
            Cause::DeadPoint => Limit::DeadPoint,
            _ => Limit::Reach,
        };
        Self { limit, part, is_low: true }
    }

    fn of_margin(margin: &Margin) -> Self {
        let Margin { limit, part, value, range } = *margin;
        Self { limit, part, is_low: value < range[0] }
    }

    /// Name of its kind.
    pub const fn kind(&self) -> &'static str {
        match (self.limit, self.is_low) {
            (Limit::Reach, _) => "out of reach",
            (Limit::JointRange, true) => "joint at its lowest",
            (Limit::JointRange, false) => "joint at its highest",
            (limit, _) => limit.name(),
        }
    }

    /// Kinds of borders in one order.
    pub fn rank(&self) -> (usize, bool) {
        (self.limit.index(), self.limit == Limit::JointRange && !self.is_low)
    }
}

impl fmt::Display for Border {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(self.kind())?;
        match self.part {
            Part::Joint(i) => write!(f, " (joint {i})"),
            Part::Leg(i) => write!(f, " (leg {i})"),
            Part::Legs([i, j]) => write!(f, " ({i} and {j})"),
            Part::Axis(letter) => write!(f, " ({})", letter.name()),
            Part::Whole => Ok(()),
        }
    }
}

/// The limits of a machine, and the orientations in which a position has to keep them.
pub struct Workspace<'a> {
    config: &'a MachineConfig,
    limits: Limits,
    tool: Vector3<f64>,
    /// A B C in degrees.
    orientations: Vec<[f64; 3]>,
    /// Of the study, which may name axes that the machine's file does not.
    pyramids: [Vec<Pyramid>; 2],
}

/// A cardan joint: how far a leg may turn about its fixed axis and across it, both seen from what
/// the axis is fixed in.
struct Pyramid {
    axis: Vector3<f64>,
    home: Vector3<f64>,
    /// Degrees.
    most: [f64; 2],
}

impl Pyramid {
    /// Turns of the leg about the fixed axis and about the moving one, degrees.
    fn turns(&self, leg: &Vector3<f64>) -> [f64; 2] {
        let about = self.axis.dot(&self.home.cross(leg)).atan2(leg.dot(&self.home));
        let across = leg.dot(&self.axis).clamp(-1.0, 1.0).asin();
        [about.to_degrees(), across.to_degrees()]
    }

    fn holds(&self, leg: &Vector3<f64>) -> bool {
        self.turns(leg).iter().zip(self.most).all(|(turn, most)| turn.abs() <= most)
    }
}

/// What is seen along a ray.
#[derive(Clone, Debug, PartialEq)]
pub struct Ray {
    /// Unit vector.
    pub direction: Vector3<f64>,
    /// Pieces within the limits, from and to, machine units; the first one begins at 0.
    pub inside: Vec<[f64; 2]>,
    /// What ends the first piece.
    pub limit: Border,
    /// What stands at the ends of the other pieces, one each for their beginning and their end.
    pub others: Vec<[Border; 2]>,
    /// Positions looked at.
    pub looked: usize,
}

impl Ray {
    /// End of the first piece.
    pub fn exit(&self) -> f64 {
        self.inside[0][1]
    }

    /// Distance and limit of every crossing.
    pub fn crossings(&self) -> impl Iterator<Item = (f64, Border)> + '_ {
        let first = (self.exit(), self.limit);
        let others = self.inside[1..].iter().zip(&self.others);
        let others = others.flat_map(|(ends, limits)| ends.iter().copied().zip(*limits));
        std::iter::once(first).chain(others)
    }
}

impl<'a> Workspace<'a> {
    /// Of a machine, in one orientation or several, with the limits of its INI file and those of a
    /// study.
    ///
    /// # Errors
    /// A sentence: a machine without X, Y or Z, home out of reach, a study that does not fit.
    pub fn new(
        config: &'a MachineConfig,
        tool: Vector3<f64>,
        orientations: Vec<[f64; 3]>,
        study: &study::Study,
    ) -> Result<Self, String> {
        let layout = config.machine.layout();
        if let Some(held) = Letter::ALL[..3].iter().find(|letter| layout.is_held(**letter)) {
            return Err(format!("no joint moves {}: there is no space to look at", held.name()));
        }
        let at = config.machine.at(&config.home_pose(), &tool).map_err(|f| f.to_string())?;
        let legs = &at.segments()[..config.legs()];
        let home: Vec<_> = legs.iter().map(|leg| leg.span().normalize()).collect();
        let diameter = study.legs.rod_diameter_mm.map_or(0.0, |d| d.0 * config.units_per_mm);
        let mut limits = limits::beyond_axes(config);
        limits.clearance = limits.clearance.max(diameter);
        limits.conditioning = study.limits.conditioning.map_or(limits.conditioning, |c| c.0);
        Ok(Self {
            config,
            limits,
            tool,
            orientations,
            pyramids: [
                pyramids(config, &study.limits, End::Base, &home)?,
                pyramids(config, &study.limits, End::Platform, &home)?,
            ],
        })
    }

    /// Whether a position keeps the limits in every orientation.
    ///
    /// # Errors
    /// The first limit that it breaks.
    pub fn check(&self, position: &Vector3<f64>) -> Result<(), Border> {
        self.orientations.iter().try_for_each(|angles| self.check_one(position, angles))
    }

    fn check_one(&self, position: &Vector3<f64>, angles: &[f64; 3]) -> Result<(), Border> {
        let [a, b, c] = *angles;
        let pose = Pose::from_degrees([position.x, position.y, position.z, a, b, c]);
        let at = self.config.machine.at(&pose, &self.tool).map_err(|f| Border::of_fault(&f))?;
        limits::check(&at, &self.limits).map_err(|margin| Border::of_margin(&margin))?;
        let ends = [Limit::BasePyramid, Limit::PlatformPyramid];
        for (limit, (pyramids, turn)) in
            ends.into_iter().zip(self.pyramids.iter().zip([Matrix3::identity(), at.rotation()]))
        {
            let outside = pyramids
                .iter()
                .zip(at.segments())
                .position(|(pyramid, leg)| !pyramid.holds(&turn.tr_mul(&leg.span().normalize())));
            if let Some(i) = outside {
                return Err(Border { limit, part: Part::Leg(i), is_low: false });
            }
        }
        Ok(())
    }

    /// No position within the limits is farther than this from another one, by the machine's size.
    pub fn extent(&self) -> f64 {
        let joints = self.config.joints.iter().filter(|joint| joint.kind != JointKind::Arm);
        let travel = joints.map(|j| (j.max - j.min).max(j.max.abs()).max(j.min.abs()));
        2.0 * self.config.machine.size() + travel.fold(0.0, f64::max)
    }

    /// A ray from a place inside, followed in steps of a length to the end of the extent.
    pub fn ray(&self, from: &Vector3<f64>, direction: &Vector3<f64>, step: f64) -> Ray {
        let at = |distance: f64| self.check(&(from + direction * distance));
        let steps = (self.extent() / step).ceil() as usize;
        let mut looked = 0;
        let mut crossings = vec![];
        let mut before = Ok(());
        for k in 1..=steps {
            let now = at(step * k as f64);
            looked += 1;
            if now.is_ok() != before.is_ok() {
                looked += HALVINGS;
                let ends = (step * (k - 1) as f64, step * k as f64);
                crossings.push(crossing(&at, ends, before.is_ok(), now.or(before).err()));
            }
            before = now;
        }
        let of = |k: usize| crossings.get(k).copied();
        let end = (self.extent(), Border::UNREACHED);
        let (exit, limit) = of(0).unwrap_or(end);
        let mut ray =
            Ray { direction: *direction, inside: vec![[0.0, exit]], limit, others: vec![], looked };
        for k in (1..crossings.len()).step_by(2) {
            let (from, to) = (crossings[k], of(k + 1).unwrap_or(end));
            ray.inside.push([from.0, to.0]);
            ray.others.push([from.1, to.1]);
        }
        ray
    }
}

/// Where the limits are crossed between two places, and what is broken on the outer side.
fn crossing(
    at: &impl Fn(f64) -> Result<(), Border>,
    (mut low, mut high): (f64, f64),
    leaves: bool,
    outside: Option<Border>,
) -> (f64, Border) {
    let mut limit = outside.unwrap_or(Border::UNREACHED);
    for _ in 0..HALVINGS {
        let middle = (low + high) / 2.0;
        let found = at(middle);
        if let Err(broken) = found {
            limit = broken;
        }
        match found.is_ok() == leaves {
            true => low = middle,
            false => high = middle,
        }
    }
    (if leaves { low } else { high }, limit)
}

/// The two ends of a leg.
#[derive(Clone, Copy)]
enum End {
    Base,
    Platform,
}

fn pyramids(
    config: &MachineConfig,
    limits: &study::Limits,
    end: End,
    home: &[Vector3<f64>],
) -> Result<Vec<Pyramid>, String> {
    let (name, most, axes) = match end {
        End::Base => ("base", limits.base_pyramid_deg, &limits.base_axes),
        End::Platform => ("platform", limits.platform_pyramid_deg, &limits.platform_axes),
    };
    let given = axes.as_deref().unwrap_or(&[]);
    if !given.is_empty() && given.len() != home.len() {
        return Err(format!("{name}_axes: expected {} axes; found {}", home.len(), given.len()));
    }
    let Some(most) = most else { return Ok(vec![]) };
    let axis = |i: usize| -> Result<Vector3<f64>, String> {
        let strut = match (config.geometry.legs()[i].kind, end) {
            (LegKind::Strut(strut), End::Base) => Some(strut.base_axis),
            (LegKind::Strut(strut), End::Platform) => Some(strut.platform_axis),
            _ => None,
        };
        let axis = Vector3::from(given.get(i).copied().or(strut).unwrap_or_default());
        match axis.norm() > 0.0 {
            true => Ok(axis.normalize()),
            false => Err(format!("{name}_pyramid_deg: leg {i} has no axis; name {name}_axes")),
        }
    };
    // The platform is level at home: there both ends see the leg alike.
    let pyramid = |(i, home): (usize, &Vector3<f64>)| {
        axis(i).map(|axis| Pyramid { axis, home: *home, most: most.map(|m| m.0) })
    };
    home.iter().enumerate().map(pyramid).collect()
}

/// Level, and tilted by an angle in `directions` directions about Z, without a turn about the
/// tool: A B C in degrees; those that the machine can take.
pub fn tilts(config: &MachineConfig, tilt: f64, directions: usize) -> Vec<[f64; 3]> {
    let held = |letter| config.machine.layout().is_held(letter);
    let mut all = vec![[0.0; 3]];
    for k in 0..directions {
        let azimuth = 2.0 * PI * k as f64 / directions as f64;
        let (sin, cos) = tilt.to_radians().sin_cos();
        let z = Vector3::new(sin * azimuth.cos(), sin * azimuth.sin(), cos);
        let (a, b) = (-z.y.asin().to_degrees(), z.x.atan2(z.z).to_degrees());
        // Rounding of the sine.
        let moves = |letter, angle: f64| angle.abs() < 1e-9 || !held(letter);
        if moves(Letter::A, a) && moves(Letter::B, b) {
            all.push([
                if held(Letter::A) { 0.0 } else { a },
                if held(Letter::B) { 0.0 } else { b },
                0.0,
            ]);
        }
    }
    all
}

/// The body that rays in all directions see.
#[derive(Clone, Debug)]
pub struct Body {
    /// Where the rays begin.
    pub from: Vector3<f64>,
    /// Rings of rays from below (elevation −90) to above (90); the first and the last ring have
    /// one ray, the others as many as `around`, from azimuth 0.
    pub rings: Vec<Vec<Ray>>,
    /// Rays of a ring.
    pub around: usize,
}

/// How finely a workspace is looked at, and by how many threads.
pub struct Effort<'a> {
    /// Rays from pole to pole; twice as many go around.
    pub bands: usize,
    /// Length of a step along a ray, machine units.
    pub step: f64,
    /// Points of the grid along its longest side.
    pub grid: usize,
    /// Threads.
    pub threads: NonZero<usize>,
    /// Shown the share of the work done.
    pub progress: &'a (dyn Fn(f64) + Sync),
}

impl Effort<'_> {
    /// `f` of every item, progress shown from `from` to `to`.
    fn each<T: Sync, U: Send>(
        &self,
        items: &[T],
        (from, to): (f64, f64),
        f: impl Fn(&T) -> U + Sync,
    ) -> Vec<U> {
        let done = AtomicUsize::new(0);
        batch::each(items, self.threads, |item| {
            let result = f(item);
            let count = done.fetch_add(1, Ordering::Relaxed) + 1;
            (self.progress)(from + (to - from) * count as f64 / items.len() as f64);
            result
        })
    }
}

impl Body {
    /// From a place inside.
    ///
    /// # Errors
    /// The limit that the place itself breaks.
    pub fn seen(
        workspace: &Workspace,
        from: Vector3<f64>,
        effort: &Effort,
    ) -> Result<Self, Border> {
        workspace.check(&from)?;
        let around = 2 * effort.bands;
        let elevation = |ring: usize| PI * (ring as f64 / effort.bands as f64 - 0.5);
        let mut directions = vec![];
        for ring in 0..=effort.bands {
            let (sin, cos) = elevation(ring).sin_cos();
            let pole = ring == 0 || ring == effort.bands;
            for k in 0..if pole { 1 } else { around } {
                let (y, x) = (2.0 * PI * k as f64 / around as f64).sin_cos();
                let level = if pole { 0.0 } else { cos };
                directions.push(Vector3::new(level * x, level * y, sin));
            }
        }
        let look = |direction: &Vector3<f64>| workspace.ray(&from, direction, effort.step);
        let mut rays = effort.each(&directions, (0.0, 0.5), look).into_iter();
        let ring = |ring: usize| {
            let pole = ring == 0 || ring == effort.bands;
            rays.by_ref().take(if pole { 1 } else { around }).collect()
        };
        Ok(Self { from, rings: (0..=effort.bands).map(ring).collect(), around })
    }

    /// All rays, each with the solid angle it stands for.
    pub fn rays(&self) -> impl Iterator<Item = (f64, &Ray)> {
        let band = PI / (self.rings.len() - 1) as f64;
        self.rings.iter().enumerate().flat_map(move |(ring, rays)| {
            let middle = band * ring as f64 - PI / 2.0;
            let edge = |side: f64| (middle + side * band / 2.0).clamp(-PI / 2.0, PI / 2.0).sin();
            let angle = 2.0 * PI * (edge(1.0) - edge(-1.0)) / rays.len() as f64;
            rays.iter().map(move |ray| (angle, ray))
        })
    }

    /// Volume of all pieces of the rays.
    pub fn volume(&self) -> f64 {
        let piece = |[from, to]: &[f64; 2]| (to.powi(3) - from.powi(3)) / 3.0;
        self.rays().map(|(angle, ray)| angle * ray.inside.iter().map(piece).sum::<f64>()).sum()
    }

    /// Positions looked at.
    pub fn looked(&self) -> usize {
        self.rays().map(|(_, ray)| ray.looked).sum()
    }

    /// Share of the directions that every limit ends, largest first.
    pub fn shares(&self) -> Vec<(Border, f64)> {
        let mut shares: Vec<(Border, f64)> = vec![];
        for (angle, ray) in self.rays() {
            let share = angle / (4.0 * PI);
            match shares.iter_mut().find(|(limit, _)| *limit == ray.limit) {
                Some((_, sum)) => *sum += share,
                None => shares.push((ray.limit, share)),
            }
        }
        shares.sort_by(|a, b| b.1.total_cmp(&a.1));
        shares
    }

    /// Corners of a box around all pieces.
    pub fn corners(&self) -> [Vector3<f64>; 2] {
        let ends = self.rays().flat_map(|(_, ray)| {
            let far = ray.inside.last().map_or(0.0, |piece| piece[1]);
            [self.from + ray.direction * far, self.from + ray.direction * ray.exit()]
        });
        ends.fold([self.from, self.from], |[low, high], end| [low.inf(&end), high.sup(&end)])
    }

    /// Points of the surface around the place where the rays begin, and its triangles, seen from
    /// outside counterclockwise.
    pub fn mesh(&self) -> (Vec<Vector3<f64>>, Vec<[usize; 3]>) {
        let points = self.rays().map(|(_, ray)| self.from + ray.direction * ray.exit()).collect();
        let last = self.rings.len() - 1;
        let point = |ring: usize, k: usize| match ring {
            0 => 0,
            _ if ring == last => 1 + (last - 1) * self.around,
            _ => 1 + (ring - 1) * self.around + k % self.around,
        };
        let mut triangles = vec![];
        for ring in 0..last {
            for k in 0..self.around {
                let (a, b) = (point(ring, k), point(ring, k + 1));
                let (c, d) = (point(ring + 1, k), point(ring + 1, k + 1));
                let halves = [[a, b, d], [a, d, c]];
                triangles.extend(halves.iter().filter(|[a, b, c]| a != b && b != c && c != a));
            }
        }
        (points, triangles)
    }
}

/// Volume of a closed surface.
pub fn mesh_volume((points, triangles): &(Vec<Vector3<f64>>, Vec<[usize; 3]>)) -> f64 {
    let corner = |[a, b, c]: &[usize; 3]| points[*a].dot(&points[*b].cross(&points[*c])) / 6.0;
    triangles.iter().map(corner).sum()
}

/// The surface as a Wavefront OBJ file.
pub fn obj(unit: &str, (points, triangles): &(Vec<Vector3<f64>>, Vec<[usize; 3]>)) -> String {
    let mut text = format!("# workspace, lengths in {unit}\n");
    for point in points {
        text.push_str(&format!("v {} {} {}\n", point.x, point.y, point.z));
    }
    for [a, b, c] in triangles {
        text.push_str(&format!("f {} {} {}\n", a + 1, b + 1, c + 1));
    }
    text
}

/// A volume counted on a grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Counted {
    /// Volume of the cells whose middles are within the limits.
    pub volume: f64,
    /// Points of the grid.
    pub points: usize,
}

/// Counts a grid over a box that holds the body.
pub fn counted(workspace: &Workspace, corners: &[Vector3<f64>; 2], effort: &Effort) -> Counted {
    // What rays between those looked along see is a little more.
    let margin = Vector3::repeat(0.02 * (corners[1] - corners[0]).max());
    let (low, high) = (corners[0] - margin, corners[1] + margin);
    let cell = (high - low).max() / effort.grid as f64;
    let count = (high - low).map(|side| (side / cell).ceil() as usize);
    let columns: Vec<[usize; 2]> =
        (0..count.x).flat_map(|i| (0..count.y).map(move |j| [i, j])).collect();
    let middle = |k: usize, n: usize| low[k] + (n as f64 + 0.5) * cell;
    let inside = |[i, j]: &[usize; 2]| {
        let at = |n: usize| Vector3::new(middle(0, *i), middle(1, *j), middle(2, n));
        (0..count.z).filter(|n| workspace.check(&at(*n)).is_ok()).count()
    };
    let cells: usize = effort.each(&columns, (0.5, 1.0), inside).into_iter().sum();
    Counted { volume: cells as f64 * cell.powi(3), points: columns.len() * count.z }
}

/// A plane through the place where the rays begin.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    /// Name for people.
    pub name: String,
    /// Unit vectors across and up.
    pub axes: [Vector3<f64>; 2],
}

impl Plane {
    /// `xy`, `xz`, `yz`, or the three components of a normal, separated by commas.
    pub fn parse(text: &str) -> Option<Self> {
        let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
        let axes = match text.to_ascii_lowercase().as_str() {
            "xy" => [x, y],
            "xz" => [x, z],
            "yz" => [y, z],
            _ => {
                let words: Vec<f64> =
                    text.split(',').map(|w| w.trim().parse()).collect::<Result<_, _>>().ok()?;
                let [a, b, c] = words[..] else { return None };
                let normal = Vector3::new(a, b, c).try_normalize(0.0)?;
                // Across lies level, up as steep as the plane allows.
                let across = z.cross(&normal).try_normalize(1e-9).unwrap_or(x);
                [across, normal.cross(&across)]
            }
        };
        Some(Self { name: text.to_ascii_uppercase(), axes })
    }
}

/// What rays in a plane see.
#[derive(Clone, Debug)]
pub struct Slice {
    /// The plane.
    pub plane: Plane,
    /// Where the rays begin.
    pub from: Vector3<f64>,
    /// Evenly around.
    pub rays: Vec<Ray>,
}

impl Slice {
    /// From a place inside, along `rays` rays.
    pub fn seen(
        workspace: &Workspace,
        plane: Plane,
        from: Vector3<f64>,
        rays: usize,
        effort: &Effort,
    ) -> Self {
        let direction = |k: usize| {
            let (sin, cos) = (2.0 * PI * k as f64 / rays as f64).sin_cos();
            plane.axes[0] * cos + plane.axes[1] * sin
        };
        let directions: Vec<_> = (0..rays).map(direction).collect();
        let look = |direction: &Vector3<f64>| workspace.ray(&from, direction, effort.step);
        let rays = effort.each(&directions, (1.0, 1.0), look);
        Self { plane, from, rays }
    }

    /// Area of all pieces.
    pub fn area(&self) -> f64 {
        let angle = 2.0 * PI / self.rays.len() as f64;
        let piece = |[from, to]: &[f64; 2]| (to * to - from * from) / 2.0;
        self.rays.iter().flat_map(|ray| &ray.inside).map(piece).sum::<f64>() * angle
    }

    /// Crossings in coordinates of the plane, counted from the machine's origin, with their limit.
    pub fn outline(&self) -> Vec<([f64; 2], Border)> {
        let point = |ray: &Ray, distance: f64| {
            let place = self.from + ray.direction * distance;
            self.plane.axes.map(|axis| axis.dot(&place))
        };
        let crossings = |ray: &Ray| -> Vec<_> {
            ray.crossings().map(|(distance, limit)| (point(ray, distance), limit)).collect()
        };
        self.rays.iter().flat_map(crossings).collect()
    }

    /// Angles between which the slice is seen from the machine's origin (its place in the plane),
    /// degrees from the plane's first axis; `None` where the origin lies in it.
    pub fn sector(&self) -> Option<[f64; 2]> {
        let from = self.plane.axes.map(|axis| axis.dot(&self.from));
        let towards = from[1].atan2(from[0]);
        let beside = |[x, y]: [f64; 2]| {
            let angle = y.atan2(x) - towards;
            angle - 2.0 * PI * (angle / (2.0 * PI)).round()
        };
        let angles: Vec<f64> = self.outline().iter().map(|(point, _)| beside(*point)).collect();
        let low = angles.iter().copied().fold(f64::INFINITY, f64::min);
        let high = angles.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let seen = high - low < PI && from.iter().any(|value| *value != 0.0);
        seen.then(|| [low, high].map(|angle| (angle + towards).to_degrees()))
    }
}

/// Ends of the rays as CSV.
pub fn csv(body: &Body) -> String {
    let mut text = String::from("direction_x,direction_y,direction_z,distance,x,y,z,limit\n");
    for (_, ray) in body.rays() {
        for (distance, limit) in ray.crossings() {
            let (way, place) = (ray.direction, body.from + ray.direction * distance);
            text.push_str(&format!(
                "{},{},{},{distance},{},{},{},{limit}\n",
                way.x, way.y, way.z, place.x, place.y, place.z
            ));
        }
    }
    text
}
