// SPDX-License-Identifier: GPL-2.0-or-later
//! Bodies and joints of each kind of leg, and the values of the joints at a pose.
//!
//! | leg | bodies and joints, from base or platform outward | closed by |
//! | --- | --- | --- |
//! | strut | base, universal joint, cylinder, drive, rod | ball at the platform |
//! | strut with a lead | base, universal joint, cylinder, drive, nut, thread, rod, universal joint, end | rigid at the platform |
//! | strut to a ring | platform, bearing of the ring, hinge along it, rod, drive, cylinder | ball at the base |
//! | rod on a carriage | base, drive, carriage, universal joint, rod | ball at the platform |
//! | rod on an arm | base, drive, arm, universal joint, rod | ball at the platform |
//!
//! The thread is a hinge along the strut and a slide that moves by lead / 2π per radian of it: the drive moves the nut,
//! and what the universal joints turn the rod changes the length by itself. The correction of the core is not used.

use crate::assemble::Builder;
use crate::mass::{Masses, about, ball, bar, sum};
use crate::model::{Joint, Loop, LoopKind, Mass, Motion, Rod, Role, Screw};
use crate::universal::{Universal, angle_about, turn};
use kinematics::{At, LegKind, Matrix3, Vector3};
use machine::read::mechanism::Mechanism;

/// Radius of rods, as a share of the machine's size: a drawing, and a mass without a study.
pub(crate) const RADIUS: f64 = 0.018;

/// Shares of a strut's length at home that its cylinder and its rod have.
const CYLINDER: f64 = 0.55;
const SHAFT: f64 = 0.6;

/// A leg: its joints at home.
pub struct Leg {
    /// Number of its section.
    number: usize,
    /// Value of its driven joint at home.
    home: f64,
    /// Ends at home.
    base: Vector3<f64>,
    platform: Vector3<f64>,
    /// Direction at home.
    along: Vector3<f64>,
    kind: Kind,
}

enum Kind {
    Strut(Universal),
    Screw {
        base: Universal,
        platform: Universal,
        per_radian: f64,
    },
    /// Center of the ring, its axis, direction from there to the strut.
    Ring {
        centre: Vector3<f64>,
        up: Vector3<f64>,
        outward: Vector3<f64>,
    },
    Slider {
        guide: Vector3<f64>,
        rod: Universal,
    },
    Crank {
        axis: Vector3<f64>,
        hip: Vector3<f64>,
        home: f64,
        rod: Universal,
    },
}

impl Leg {
    /// Creates leg `i` of a mechanism; `at` is the mechanism at home, `meters` the length of a machine unit.
    pub fn new(config: &Mechanism, i: usize, at: &At, meters: f64) -> Self {
        let given = &config.geometry.legs()[i];
        let segment = at.segments()[i];
        let along = segment.span().normalize();
        let kind = match given.kind {
            LegKind::Strut(strut) => {
                let first = Vector3::from(strut.base_axis);
                let last = at.rotation() * Vector3::from(strut.platform_axis);
                let (base, platform) =
                    (Universal::new(&first, &along), Universal::new(&last, &along));
                // Axes entered in opposite directions belong to a right-hand thread.
                let across = |axis: &Vector3<f64>| axis - along * along.dot(axis);
                let hand = -across(&first).dot(&across(&last)).signum();
                let per_radian = hand * strut.lead * meters / std::f64::consts::TAU;
                if strut.lead == 0.0 {
                    Kind::Strut(base)
                } else {
                    Kind::Screw { base, platform, per_radian }
                }
            }
            LegKind::Ring(_) => {
                let up = at.rotation() * Vector3::z();
                let outward = (up * up.dot(&along) - along).try_normalize(0.0);
                Kind::Ring {
                    centre: at_platform(config, at, &given.platform) * meters,
                    up,
                    outward: outward.unwrap_or_else(|| at.rotation() * Vector3::x()),
                }
            }
            LegKind::Slider(slider) => {
                let guide = Vector3::from(slider.guide).normalize();
                Kind::Slider { guide, rod: Universal::new(&guide.cross(&along), &along) }
            }
            LegKind::Crank(crank) => {
                let axis = Vector3::from(crank.axis).normalize();
                Kind::Crank {
                    axis,
                    hip: Vector3::from(given.base) * meters,
                    home: (at.joints()[i] + config.offsets[i]).to_radians(),
                    rod: Universal::new(&axis, &along),
                }
            }
        };
        Self {
            number: config.place.first_leg + i,
            home: at.joints()[i]
                * if given.kind.is_angular() { 1.0_f64.to_radians() } else { meters },
            base: segment.base * meters,
            platform: segment.platform * meters,
            along,
            kind,
        }
    }

    fn name(&self, part: &str) -> String {
        format!("leg_{}_{part}", self.number)
    }

    /// Returns the values of all its joints but the driven one, by their names, at a pose: `rotation` is that of the platform since
    /// home, `value` that of the driven joint, in SI units.
    pub fn values(
        &self,
        ends: [Vector3<f64>; 2],
        rotation: &Matrix3<f64>,
        value: f64,
        offset: f64,
    ) -> Vec<(String, f64)> {
        let along = (ends[1] - ends[0]).normalize();
        let pair = |[first, second]: [f64; 2]| {
            vec![(self.name("base_1"), first), (self.name("base_2"), second)]
        };
        match &self.kind {
            Kind::Strut(base) | Kind::Slider { rod: base, .. } => pair(base.angles(&along)),
            Kind::Crank { axis, home, rod, .. } => {
                let arm = turn(axis, value + offset - home);
                pair(rod.angles(&arm.tr_mul(&along)))
            }
            Kind::Screw { base, platform, per_radian } => {
                let (lower, upper) =
                    (base.angles(&along), platform.angles(&rotation.tr_mul(&along)));
                let [from, to] = [base.rotation(lower), rotation * platform.rotation(upper)];
                let turned = angle_about(&self.along, &from.tr_mul(&to));
                let mut values = pair(lower);
                values.push((self.name("turn"), turned));
                values.push((self.name("thread"), turned * per_radian));
                values.push((self.name("platform_2"), -upper[1]));
                values.push((self.name("platform_1"), -upper[0]));
                values
            }
            Kind::Ring { up, outward, .. } => {
                // From the platform to the base, as the platform sees it.
                let inward = -rotation.tr_mul(&along);
                let across = |v: &Vector3<f64>| v - up * up.dot(v);
                let ring = outward.cross(&inward).dot(up).atan2(outward.dot(&inward));
                let lean = |v: &Vector3<f64>| up.dot(v).atan2(across(v).norm());
                // Positive about the direction of the circle: from outward, down.
                let hinge = lean(&-self.along) - lean(&inward);
                vec![(self.name("ring"), ring), (self.name("hinge"), hinge)]
            }
        }
    }

    /// Adds its bodies to a model, between these of base and platform.
    pub fn build(
        &self,
        to: &mut Builder,
        config: &Mechanism,
        i: usize,
        masses: &Masses,
        [base, platform]: [usize; 2],
    ) {
        let radius = RADIUS * to.model.size;
        let rod = |ends: [Vector3<f64>; 2], share: f64| Rod { ends, radius: radius * share };
        let length = (self.platform - self.base).norm();
        let own = masses.drives.as_ref().map(|drives| drives[i]);
        let of_rod = |rod: &Rod, is_moved: bool| self.mass_of_rod(masses, i, rod, is_moved, radius);
        match &self.kind {
            Kind::Strut(joint) | Kind::Screw { base: joint, .. } => {
                let slide =
                    self.driven(to, config, i, masses, (Motion::Slide, self.along, self.base));
                let housing = rod([self.base, self.base + self.along * (CYLINDER * length)], 1.5);
                let shaft =
                    rod([self.platform - self.along * (SHAFT * length), self.platform], 1.0);
                let lower = match masses.legs {
                    Some(_) => self.turned(masses, i, radius),
                    None => bar(&housing),
                };
                let joints = self.hinges(joint, "base", self.base, config.angles[i].pyramids[0]);
                let cylinder =
                    to.body(self.name("cylinder"), base, self.base, joints, lower, vec![housing]);
                let mut lower = cylinder;
                let mut joints = vec![slide];
                if let Kind::Screw { per_radian, .. } = &self.kind {
                    // The nut separates drive and thread, whose slides have one axis.
                    let place = housing.ends[1];
                    let mass = ball(place, radius);
                    let nut = [-0.5, 0.5].map(|side| place + self.along * (side * radius));
                    let nut = vec![rod(nut, 2.0)];
                    lower = to.body(self.name("nut"), cylinder, place, joints, mass, nut);
                    joints = vec![
                        self.joint("turn", Motion::Hinge, self.along, self.platform),
                        self.joint("thread", Motion::Slide, self.along, self.platform),
                    ];
                    to.model.screws.push(Screw {
                        name: self.name("screw"),
                        turn: self.name("turn"),
                        slide: self.name("thread"),
                        per_radian: *per_radian,
                    });
                }
                let mass = of_rod(&shaft, true);
                let upper =
                    to.body(self.name("rod"), lower, self.platform, joints, mass, vec![shaft]);
                let Kind::Screw { platform: joint, .. } = &self.kind else {
                    return self.close(to, LoopKind::Ball, [upper, platform], self.platform);
                };
                let mut joints =
                    self.hinges(joint, "platform", self.platform, config.angles[i].pyramids[1]);
                joints.reverse();
                // From the rod to the platform: the angles of the platform's rod, backward.
                for joint in &mut joints {
                    joint.range = joint.range.map(|[low, high]| [-high, -low]);
                }
                let mass = ball(self.platform, radius);
                let end = to.body(self.name("end"), upper, self.platform, joints, mass, vec![]);
                self.close(to, LoopKind::Rigid, [end, platform], self.platform);
            }
            Kind::Ring { centre, up, outward } => {
                let hinge = self.joint("ring", Motion::Hinge, *up, *centre);
                let arm = rod([*centre, self.platform], 0.6);
                let mass = ball(self.platform, radius);
                let ring =
                    to.body(self.name("bearing"), platform, *centre, vec![hinge], mass, vec![arm]);
                let along = up.cross(outward);
                let hinge = self.joint("hinge", Motion::Hinge, along, self.platform);
                let shaft =
                    rod([self.platform - self.along * (SHAFT * length), self.platform], 1.0);
                let mass = of_rod(&shaft, true);
                let upper =
                    to.body(self.name("rod"), ring, self.platform, vec![hinge], mass, vec![shaft]);
                let slide =
                    self.driven(to, config, i, masses, (Motion::Slide, -self.along, self.base));
                let housing = rod([self.base, self.base + self.along * (CYLINDER * length)], 1.5);
                let mass = match masses.legs {
                    Some(_) => self.turned(masses, i, radius),
                    None => bar(&housing),
                };
                let cylinder = to.body(
                    self.name("cylinder"),
                    upper,
                    self.base,
                    vec![slide],
                    mass,
                    vec![housing],
                );
                self.close(to, LoopKind::Ball, [cylinder, base], self.base);
            }
            Kind::Slider { guide, rod: joint } => {
                let slide = self.driven(to, config, i, masses, (Motion::Slide, *guide, self.base));
                let ends = slide
                    .range
                    .map(|range| range.map(|value| self.base + guide * (value - slide.home)));
                to.model.bodies[base].rods.extend(ends.map(|ends| rod(ends, 0.5)));
                let block =
                    rod([-1.0, 1.0].map(|side| self.base + guide * (side * 2.0 * radius)), 2.0);
                let mass = bar(&block);
                let mass = own.map_or(mass, |own| scaled(mass, own));
                let carriage =
                    to.body(self.name("carriage"), base, self.base, vec![slide], mass, vec![block]);
                self.rod(
                    to,
                    carriage,
                    platform,
                    joint,
                    of_rod(&rod([self.base, self.platform], 1.0), false),
                    radius,
                );
            }
            Kind::Crank { axis, hip, rod: joint, .. } => {
                let hinge = self.driven(to, config, i, masses, (Motion::Hinge, *axis, *hip));
                let arm = rod([*hip, self.base], 1.5);
                let mass = if own.is_some() { ball(*hip, radius) } else { bar(&arm) };
                let body = to.body(self.name("arm"), base, *hip, vec![hinge], mass, vec![arm]);
                self.rod(
                    to,
                    body,
                    platform,
                    joint,
                    of_rod(&rod([self.base, self.platform], 1.0), false),
                    radius,
                );
            }
        }
    }

    /// Adds a rod of fixed length on a carriage or an arm.
    fn rod(
        &self,
        to: &mut Builder,
        lower: usize,
        platform: usize,
        joint: &Universal,
        mass: Mass,
        radius: f64,
    ) {
        let joints = self.hinges(joint, "base", self.base, None);
        let shape = Rod { ends: [self.base, self.platform], radius };
        let rod = to.body(self.name("rod"), lower, self.base, joints, mass, vec![shape]);
        self.close(to, LoopKind::Ball, [rod, platform], self.platform);
    }

    fn close(&self, to: &mut Builder, kind: LoopKind, bodies: [usize; 2], point: Vector3<f64>) {
        to.model.loops.push(Loop { name: self.name("loop"), kind, bodies, point });
    }

    fn joint(&self, part: &str, motion: Motion, axis: Vector3<f64>, point: Vector3<f64>) -> Joint {
        Joint {
            name: self.name(part),
            motion,
            axis,
            point,
            home: 0.0,
            range: None,
            role: Role::Passive,
        }
    }

    /// Returns the two hinges of a universal joint, with limits from its pyramid, in degrees.
    fn hinges(
        &self,
        joint: &Universal,
        end: &str,
        point: Vector3<f64>,
        pyramid: Option<[f64; 2]>,
    ) -> Vec<Joint> {
        let hinge = |n: usize, axis: Vector3<f64>| Joint {
            range: pyramid.map(|most| [-most[n].to_radians(), most[n].to_radians()]),
            ..self.joint(&format!("{end}_{}", n + 1), Motion::Hinge, axis, point)
        };
        vec![hinge(0, joint.first), hinge(1, joint.second)]
    }

    /// Returns the driven joint of leg `i`.
    fn driven(
        &self,
        to: &Builder,
        config: &Mechanism,
        i: usize,
        masses: &Masses,
        (motion, axis, point): (Motion, Vector3<f64>, Vector3<f64>),
    ) -> Joint {
        let own = masses.drives.as_ref().map(|drives| drives[i]);
        // The mass of a carriage is that of its body.
        let is_carriage = config.geometry.legs()[i].kind.guide().is_some();
        let rotor = if is_carriage { own.map(|_| 0.0) } else { own };
        let most = masses.most.get(i).copied().flatten();
        Joint { home: self.home, ..to.driven(config, i, (motion, axis, point), rotor, most) }
    }

    /// Returns the mass that moves along the leg, from the study; `is_moved` if another body has what only turns.
    fn mass_of_rod(
        &self,
        masses: &Masses,
        i: usize,
        rod: &Rod,
        is_moved: bool,
        radius: f64,
    ) -> Mass {
        let Some([axial, across]) = &masses.legs else { return bar(rod) };
        let (length, least) = ((self.platform - self.base).norm(), ball(self.platform, radius));
        let distance = self.distance(axial[i], across[i]);
        let compact =
            scaled(ball(self.base + self.along * distance, radius), axial[i].max(least.mass));
        if is_moved || distance < length {
            return compact;
        }
        sum(&[compact, self.turned(masses, i, radius)])
    }

    /// Returns the distance from the base joint of the mass that moves along the leg, as `studies` has it.
    fn distance(&self, axial: f64, across: f64) -> f64 {
        let length = (self.platform - self.base).norm();
        length * if across < axial { (across / axial).sqrt() } else { 1.0 }
    }

    /// Returns the body of the masses that only turn about the base joint.
    fn turned(&self, masses: &Masses, i: usize, radius: f64) -> Mass {
        let least = ball(self.base, radius);
        let Some([axial, across]) = &masses.legs else { return least };
        let length = (self.platform - self.base).norm();
        let distance = self.distance(axial[i], across[i]);
        let turned = (across[i] * length * length - axial[i] * distance * distance).max(0.0);
        let across = about(1.0, &self.along) * turned;
        Mass { inertia: least.inertia + across, ..least }
    }
}

/// Returns the body with another mass.
fn scaled(body: Mass, mass: f64) -> Mass {
    Mass { mass, inertia: body.inertia * (mass / body.mass), ..body }
}

/// Returns a point of the platform in base, machine units.
fn at_platform(config: &Mechanism, at: &At, point: &[f64; 3]) -> Vector3<f64> {
    crate::state::platform_origin(config, at) + at.rotation() * Vector3::from(*point)
}
