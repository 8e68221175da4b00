// SPDX-License-Identifier: GPL-2.0-or-later
//! Structure of a machine as counted in the papers, and the mobility that its legs actually constrain.
//!
//! Every leg is a chain of two links and three joints between base and platform: a drive
//! (telescope, carriage or arm), a cardan joint and a spherical one, f = 1 + 2 + 3 degrees of freedom.
//! For n links (base and platform included), p joints and e independent loops paper 003
//! (equation 1) has n + e - p = 1. The degrees of freedom by Kutzbach, F = 6 (n - 1) - Σ (6 - f),
//! are 6 for any number of such legs: counting does not show which motions the legs constrain
//! once their drives are locked. The rank of their Jacobian rows does.

use kinematics::{Fault, Letter, Vector3};
use machine::read::legs::platform_anchor;
use machine::read::mechanism::Mechanism;
use machine::rows::{RANK_TOLERANCE, Rows};

/// Degrees of freedom of a leg's joints: drive, cardan joint, spherical joint.
const FREEDOMS: [i32; 3] = [1, 2, 3];

/// Returns the rows of the leg constraints at home: for each leg the speed of its platform anchor along the leg,
/// per unit speed of X Y Z, and of A B C times the platform radius, about the center; also of
/// coordinates that the legs do not move. A B C rotate about the axes of base there.
///
/// # Errors
/// As [`kinematics::Machine::at`].
pub fn rows_at_home(config: &Mechanism) -> Result<Rows, Fault> {
    let at = config.machine.at(&config.home_pose(), &config.spindle)?;
    let mut rows = Rows::zeros();
    for (i, leg) in config.geometry.legs().iter().enumerate() {
        let along = at.segments()[i].span().normalize();
        let anchor = platform_anchor(leg, &at.segments()[i], &at.rotation());
        let arm = anchor - Vector3::from(config.geometry.centre);
        let moment = arm.cross(&along) / config.machine.radius();
        for k in 0..3 {
            (rows[(i, k)], rows[(i, k + 3)]) = (along[k], moment[k]);
        }
    }
    Ok(rows)
}

/// Returns how many independent motions among these coordinates the rows constrain.
pub fn rank(rows: &Rows, letters: &[Letter]) -> usize {
    let values = singular_values(rows, letters);
    values.iter().filter(|value| **value > RANK_TOLERANCE * values[0]).count()
}

/// Returns the singular values of the columns of these coordinates, largest first; others are 0.
pub fn singular_values(rows: &Rows, letters: &[Letter]) -> [f64; 6] {
    let mut rows = *rows;
    for letter in Letter::ALL.into_iter().filter(|letter| !letters.contains(letter)) {
        rows.column_mut(letter.index()).fill(0.0);
    }
    rows.singular_values().into()
}

/// Structure of a machine by counting and by its leg rows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Structure {
    pub legs: usize,
    /// Rank of the leg rows over X Y Z A B C.
    pub rank: usize,
    /// Rank over the coordinates that the legs move.
    pub active_rank: usize,
    /// Coordinates that the legs move.
    pub active: Vec<Letter>,
    /// Coordinates that joints or guides of the platform must constrain, table letters included:
    /// a table moves the workpiece.
    pub held: Vec<Letter>,
    /// Number of constraints by passive joints, redundant ones included.
    pub constraints: usize,
}

impl Structure {
    /// Computes the structure of this machine, with ranks at home.
    ///
    /// # Errors
    /// As [`rows_at_home`].
    pub fn of(config: &Mechanism) -> Result<Self, Fault> {
        let rows = rows_at_home(config)?;
        let coordinates = config.machine.layout().coordinates();
        let (active, held): (Vec<Letter>, Vec<Letter>) =
            Letter::ALL.into_iter().partition(|letter| coordinates.contains(*letter));
        Ok(Self {
            legs: config.legs(),
            rank: rank(&rows, &Letter::ALL),
            active_rank: rank(&rows, &active),
            active,
            held,
            constraints: config.machine.layout().constraints(),
        })
    }

    /// Returns the number of links n: two per leg, base and platform.
    pub fn links(&self) -> usize {
        2 * self.legs + 2
    }

    pub fn joints(&self) -> usize {
        FREEDOMS.len() * self.legs
    }

    /// Returns the number of independent loops e: every leg after the first one closes one.
    pub fn independent_loops(&self) -> usize {
        self.legs - 1
    }

    /// Returns the degrees of freedom F by counting, drives included.
    pub fn freedoms(&self) -> i32 {
        let lost: i32 = FREEDOMS.iter().map(|f| 6 - f).sum();
        6 * (self.links() as i32 - 1) - self.legs as i32 * lost
    }

    /// Returns the number of legs beyond those needed for the coordinates.
    pub fn redundancy(&self) -> usize {
        self.legs - self.active_rank
    }

    /// Describes the count in one line.
    pub fn loops(&self) -> String {
        let (n, p, e) = (self.links(), self.joints(), self.independent_loops());
        format!(
            "{n} links + {e} loops - {p} joints = {}; mobility by count {}",
            n + e - p,
            self.freedoms()
        )
    }

    /// Describes the constraints by the legs in one line.
    pub fn mobility(&self) -> String {
        let text = format!(
            "legs constrain {} of 6 motions, {} of {}",
            self.rank,
            self.active_rank,
            letters(&self.active)
        );
        let redundant = match self.redundancy() {
            0 => String::new(),
            legs => format!("; redundant legs: {legs}"),
        };
        let held = match self.held.as_slice() {
            [] => String::new(),
            held if self.constraints > 0 => format!(
                "; with {} constraints, {} follow from {}",
                self.constraints,
                letters(held),
                letters(&self.active)
            ),
            held => format!("; joints or guides constrain {}", letters(held)),
        };
        text + &redundant + &held
    }
}

fn letters(letters: &[Letter]) -> String {
    letters.iter().map(|letter| letter.name()).collect()
}
