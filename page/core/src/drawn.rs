// SPDX-License-Identifier: GPL-2.0-or-later
//! The drawing of a machine at a pose.

use core::ops::ControlFlow;
use kinematics::{
    At, Fault, Joints, Letter, Limits, MAX_JOINTS, MAX_LEGS, Machine, Margin, Matrix3, Part, Pose,
    Segment, Vector3,
};

/// Largest number of margins of a pose: of axes, joints, dead points, cones, pyramids, and of the whole machine.
pub const MOST_MARGINS: usize = 6 + MAX_JOINTS + 7 * MAX_LEGS + 3;

/// Numbers of a margin: index of the limit in the list, kind of part (0 whole, 1 axis, 2 joint, 3 leg, 4 two
/// legs), its two numbers, value, smallest and largest allowed value, remaining fraction of the range.
pub const MARGIN: usize = 8;

/// Numbers of a [`Drawn`].
pub const NUMBERS: usize = 2 * MAX_JOINTS + 6 * MAX_LEGS + 9 + 9 + 6 + 2 + MARGIN * MOST_MARGINS;

/// A machine at a pose.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawn {
    /// Joint values of legs and table.
    pub joints: Joints,
    /// Largest joint motion for a unit translation of the control point; NaN if it has none.
    pub ratios: Joints,
    /// The legs, from moving base anchor to platform anchor.
    pub segments: [Segment; MAX_LEGS],
    /// Base from platform.
    pub rotation: Matrix3<f64>,
    /// Origin of the platform's frame, at which the tool begins.
    pub nose: Vector3<f64>,
    /// Tip of the tool.
    pub tip: Vector3<f64>,
    /// Displacement of the workpiece by the table.
    pub table: Vector3<f64>,
    /// The pose of the control point in base, with the coordinates that constraints determine.
    pub full: [f64; 6],
    /// Smallest singular value of the legs' constraint rows.
    pub conditioning: f64,
    margins: [Option<Margin>; MOST_MARGINS],
}

impl Drawn {
    /// Draws a pose (x y z in machine units, a b c in degrees) with the tool vector o, spindle included.
    ///
    /// # Errors
    /// As [`Machine::at`].
    pub fn new(
        machine: &Machine,
        centre: [f64; 3],
        limits: &Limits,
        pose: [f64; 6],
        tool: [f64; 3],
    ) -> Result<Self, Fault> {
        let (tool, centre) = (Vector3::from(tool), Vector3::from(centre));
        let pose = Pose::from_degrees(pose);
        let at = machine.at(&pose, &tool)?;
        let rotation = at.rotation();
        let full = at.full_pose();
        let reference = full.position - tool + rotation * (tool + centre);
        let layout = machine.layout();
        let by_letter = |of: &Vector3<f64>, is_taken: &dyn Fn(Letter) -> bool| {
            Vector3::from_fn(|k, _| if is_taken(Letter::ALL[k]) { of[k] } else { 0.0 })
        };
        let is_bound = layout.constraints() > 0;
        let moves = |letter| is_bound || layout.coordinates().contains(letter);
        let nose = by_letter(&reference, &moves) - rotation * centre;
        // With constraints the legs move the platform in all letters, and the table adds the rest.
        let by_table = if is_bound { pose.position - full.position } else { reference };
        Ok(Self {
            // Identical bit by bit to the module's commands.
            joints: machine.inverse(&pose, &tool)?,
            ratios: at.speed_ratios().unwrap_or([f64::NAN; MAX_JOINTS]),
            segments: *at.segments(),
            rotation,
            nose,
            tip: nose - rotation * tool,
            table: -by_letter(&by_table, &|letter| layout.table().contains(letter)),
            full: full.to_degrees(),
            conditioning: at.smallest_singular_value(),
            margins: margins(&at, limits),
        })
    }

    /// Returns the margins of all limits that are set.
    pub fn margins(&self) -> impl Iterator<Item = &Margin> {
        self.margins.iter().flatten()
    }

    /// Writes it as numbers: joints, ratios, base and platform end of each leg, the rotation by columns, origin of the
    /// platform's frame, tip, table, full pose, conditioning, number of margins, and [`MARGIN`] numbers for each.
    pub fn write(&self, mut put: impl FnMut(f64)) {
        let mut all = |values: &[f64]| values.iter().for_each(|value| put(*value));
        all(&self.joints);
        all(&self.ratios);
        for Segment { base, platform } in &self.segments {
            all(base.as_slice());
            all(platform.as_slice());
        }
        all(self.rotation.as_slice());
        for point in [&self.nose, &self.tip, &self.table] {
            all(point.as_slice());
        }
        all(&self.full);
        all(&[self.conditioning, self.margins().count() as f64]);
        for margin in self.margins() {
            let ([kind, first, second], [low, high]) = (numbers(margin.part), margin.range);
            let limit = margin.limit.index() as f64;
            all(&[limit, kind, first, second, margin.value, low, high, margin.share()]);
        }
    }
}

fn margins(at: &At, limits: &Limits) -> [Option<Margin>; MOST_MARGINS] {
    let mut all = [None; MOST_MARGINS];
    let mut places = all.iter_mut();
    let _ = at.margins(limits, |margin| {
        // A held coordinate always has the value 0, so leave it out.
        let is_held = matches!(margin.part, Part::Axis(letter) if at.layout().is_held(letter));
        if let Some(place) = (!is_held).then(|| places.next()).flatten() {
            *place = Some(margin);
        }
        ControlFlow::<()>::Continue(())
    });
    all
}

/// Returns the kind of part, and its numbers.
pub fn numbers(part: Part) -> [f64; 3] {
    match part {
        Part::Whole => [0.0; 3],
        Part::Axis(letter) => [1.0, letter.index() as f64, 0.0],
        Part::Joint(i) => [2.0, i as f64, 0.0],
        Part::Leg(i) => [3.0, i as f64, 0.0],
        Part::Legs([i, j]) => [4.0, i as f64, j as f64],
    }
}
