// SPDX-License-Identifier: GPL-2.0-or-later
//! Structure of a machine as the papers count it, and what its legs really hold.
//!
//! Every leg is a chain of two links and three joints between base and platform: a drive
//! (telescope, carriage or arm), a cardan joint and a spherical one, f = 1 + 2 + 3 freedoms.
//! For n links (base and platform included), p joints and e independent loops paper 003
//! (equation 1) has n + e - p = 1. Freedoms counted with Kutzbach, F = 6 (n - 1) - Σ (6 - f),
//! come to 6 for any number of such legs: counting does not tell which motions the legs hold
//! once their drives stand still. The rank of their rows does.

use kinematics::{Fault, Letter, Vector3};
use machine::read::legs::platform_anchor;
use machine::read::mechanism::Mechanism;
use machine::rows::{RANK_TOLERANCE, Rows};

/// Freedoms of a leg's joints: drive, cardan joint, spherical joint.
const FREEDOMS: [i32; 3] = [1, 2, 3];

/// Rows of the leg constraints at home: per leg the speed of its platform anchor along the leg,
/// per unit speed of X Y Z, and of A B C times the platform radius, about the centre; also of
/// coordinates that the legs do not move. A B C turn about the axes of base there.
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

/// How many independent motions among these coordinates rows hold.
pub fn rank(rows: &Rows, letters: &[Letter]) -> usize {
    let values = singular_values(rows, letters);
    values.iter().filter(|value| **value > RANK_TOLERANCE * values[0]).count()
}

/// Singular values of the columns of these coordinates, largest first; others are 0.
pub fn singular_values(rows: &Rows, letters: &[Letter]) -> [f64; 6] {
    let mut rows = *rows;
    for letter in Letter::ALL.into_iter().filter(|letter| !letters.contains(letter)) {
        rows.column_mut(letter.index()).fill(0.0);
    }
    rows.singular_values().into()
}

/// What counting and the leg rows say about a machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Structure {
    pub legs: usize,
    /// Rank of the leg rows over X Y Z A B C.
    pub rank: usize,
    /// Rank over the coordinates that the legs move.
    pub active_rank: usize,
    /// Coordinates that the legs move.
    pub active: Vec<Letter>,
    /// Coordinates that joints or guides of the platform have to hold, table letters included:
    /// a table moves the workpiece.
    pub held: Vec<Letter>,
}

impl Structure {
    /// Structure of this machine, ranks at home.
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
        })
    }

    /// Links n: two a leg, base and platform.
    pub fn links(&self) -> usize {
        2 * self.legs + 2
    }

    pub fn joints(&self) -> usize {
        FREEDOMS.len() * self.legs
    }

    /// Independent loops e: every leg after the first one closes one.
    pub fn independent_loops(&self) -> usize {
        self.legs - 1
    }

    /// Freedoms F by count, drives included.
    pub fn freedoms(&self) -> i32 {
        let lost: i32 = FREEDOMS.iter().map(|f| 6 - f).sum();
        6 * (self.links() as i32 - 1) - self.legs as i32 * lost
    }

    /// Legs beyond what the coordinates need.
    pub fn redundancy(&self) -> usize {
        self.legs - self.active_rank
    }

    /// The count, in one line.
    pub fn loops(&self) -> String {
        let (n, p, e) = (self.links(), self.joints(), self.independent_loops());
        format!(
            "{n} links + {e} loops - {p} joints = {}; mobility by count {}",
            n + e - p,
            self.freedoms()
        )
    }

    /// What the legs hold, in one line.
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
            held => format!("; joints or guides constrain {}", letters(held)),
        };
        text + &redundant + &held
    }
}

fn letters(letters: &[Letter]) -> String {
    letters.iter().map(|letter| letter.name()).collect()
}
