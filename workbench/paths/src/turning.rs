// SPDX-License-Identifier: GPL-2.0-or-later
//! Lathe operations of paper 003's table 2: turning, plunging, drilling; drilling also on other machines.

use crate::pen::{Pen, Plane, Step};
use serde::Deserialize;
use studies::study::number::Positive;

/// Turning in loops, then along the contour: a step of a shaft; X is a radius.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Turn {
    /// Radius of the stock.
    from_mm: f64,
    /// Radius of the step.
    to_mm: f64,
    /// Z of the face, and of the shoulder.
    face_mm: f64,
    shoulder_mm: f64,
    #[serde(default)]
    fillet_mm: f64,
    /// Largest depth of a loop.
    cut_mm: Positive,
    /// Allowance for the contour.
    #[serde(default)]
    spare_mm: f64,
    feed_mm_per_min: Positive,
}

/// A groove or chamfer: into the workpiece and out.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plunge {
    /// Start and end X.
    from_mm: f64,
    to_mm: f64,
    z_mm: f64,
    feed_mm_per_min: Positive,
}

/// A hole along the tool's axis.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drill {
    /// Center of the hole's opening.
    at_mm: [f64; 3],
    /// Tilts.
    #[serde(default)]
    a_deg: f64,
    #[serde(default)]
    b_deg: f64,
    /// Direction of the drill when the platform is level.
    points: Points,
    depth_mm: Positive,
    /// Distance from the opening at which the feed begins.
    clear_mm: Positive,
    feed_mm_per_min: Positive,
}

/// Direction of a drill when the platform is level.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum Points {
    /// Towards −Z.
    Down,
    /// Towards −X, as the cross tools of a lathe.
    Across,
}

/// Retraction of a loop from the workpiece at 45 degrees, mm.
const LEAVE: f64 = 1.0;
/// Distance before the face at which a loop begins, mm.
const BEFORE: f64 = 2.0;

impl Turn {
    pub(super) fn moves(&self) -> Vec<Step> {
        // The plane of G18: first Z, then X; loops stay in it.
        let mut pen = Pen::new(Plane::Zx, self.feed_mm_per_min);
        let rapid = |x: Option<f64>, z: Option<f64>| Step::Rapid([x, None, z, None, None, None]);
        let begin = self.face_mm + BEFORE;
        let depth = self.from_mm - self.to_mm - self.spare_mm;
        let loops = (depth / self.cut_mm.0).ceil().max(1.0);
        pen.all.push(rapid(None, Some(begin)));
        for n in 1..=loops as usize {
            let x = self.from_mm - depth * n as f64 / loops;
            let end = self.shoulder_mm + self.spare_mm;
            pen.all.push(rapid(Some(x), None));
            pen.cut(end, x);
            pen.cut(end + LEAVE, x + LEAVE);
            pen.all.push(rapid(None, Some(begin)));
        }
        let (x, z, fillet) = (self.to_mm, self.shoulder_mm, self.fillet_mm);
        pen.all.push(rapid(Some(x), None));
        pen.cut(z + fillet, x);
        if fillet > 0.0 {
            pen.all.push(Step::Turn {
                plane: Plane::Zx as usize,
                end: [z, x + fillet],
                level: None,
                centre: [z + fillet, x + fillet],
                is_left: false,
                turns: 0,
                feed: self.feed_mm_per_min.0,
            });
        }
        pen.cut(z, self.from_mm + BEFORE);
        pen.all.push(rapid(None, Some(begin)));
        pen.all
    }

    /// Returns why the operation is invalid.
    pub(super) fn refusal(&self) -> Option<String> {
        if self.from_mm <= self.to_mm + self.spare_mm {
            return Some("from_mm: expected more than to_mm and spare_mm".into());
        }
        if self.shoulder_mm >= self.face_mm {
            return Some("shoulder_mm: expected less than face_mm".into());
        }
        let is_below = self.fillet_mm < 0.0 || self.spare_mm < 0.0;
        is_below.then(|| "fillet_mm, spare_mm: expected 0 or more".into())
    }
}

impl Plunge {
    pub(super) fn moves(&self) -> Vec<Step> {
        let mut pen = Pen::new(Plane::Yz, self.feed_mm_per_min);
        let mut rapid = [None; 6];
        rapid[2] = Some(self.z_mm);
        pen.all.push(Step::Rapid(rapid));
        pen.level(self.from_mm);
        pen.sink(self.to_mm);
        pen.level(self.from_mm);
        pen.all
    }
}

impl Drill {
    pub(super) fn moves(&self) -> Vec<Step> {
        let mut pen = Pen::new(Plane::Xy, self.feed_mm_per_min);
        let (a, b) = (self.a_deg.to_radians(), self.b_deg.to_radians());
        // Columns of R = Ry(B) Rx(A): the drill points along the negative third or first column.
        let out = match self.points {
            Points::Down => [a.cos() * b.sin(), -a.sin(), a.cos() * b.cos()],
            Points::Across => [b.cos(), 0.0, -b.sin()],
        };
        let at = |along: f64| -> [Option<f64>; 6] {
            let mut place = [None; 6];
            for k in 0..3 {
                place[k] = Some(self.at_mm[k] + along * out[k]);
            }
            (place[3], place[4]) = (Some(self.a_deg), Some(self.b_deg));
            place
        };
        let above = at(self.clear_mm.0);
        pen.all.push(Step::Rapid(above));
        pen.all.push(Step::Cut(at(-self.depth_mm.0), pen.feed));
        pen.all.push(Step::Rapid(above));
        pen.all
    }

    /// Returns why the operation is invalid.
    pub(super) fn refusal(&self) -> Option<String> {
        let is_tilted = self.points == Points::Across && self.a_deg != 0.0;
        is_tilted.then(|| "a_deg: a transverse drill can lean only by b_deg; remove a_deg".into())
    }
}
