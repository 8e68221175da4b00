// SPDX-License-Identifier: GPL-2.0-or-later
//! Reasons why load parameters, and the layouts that they request, are refused.

/// Why load parameters are refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LoadError {
    /// `legs` is not `KIND:COUNT[,KIND:COUNT]`.
    LegsMalformed,
    /// An unknown kind of leg.
    KindUnknown,
    /// No leg, or more than the module supports.
    LegsWrong,
    /// `coordinates` is empty, repeats a letter, or contains a character other than X Y Z A B C.
    CoordinatesWrong,
    /// More coordinates than legs.
    TooManyCoordinates,
    /// `table` repeats a letter or contains a character other than X Y Z.
    TableWrong,
    /// A letter in both `coordinates` and `table`.
    LetterTwice,
    /// `axes` repeats a letter or contains a character that is not a pose letter.
    AxesWrong,
    /// A letter of `axes` that legs or table move.
    AxisTaken,
    /// `boxes` or `second_boxes` is not a number from 0 to [`crate::MAX_BOXES`].
    BoxesWrong,
    /// The second mechanism has no legs, or both together have more than the module supports.
    LegsTogether,
    /// `second_coordinates` is empty, repeats a letter, contains a character other than X Y Z A B C, or has
    /// more letters than the second mechanism has legs.
    SecondCoordinates,
    /// `second_angles` does not name as many of A B C as `second_coordinates` has angles, each once.
    SecondAngles,
    /// A letter of the second mechanism that the first one moves.
    SecondTaken,
    /// A parameter of the second mechanism without `second`.
    SecondAlone,
    /// `constraints` is not a number from 0 to [`crate::MAX_CONSTRAINTS`].
    ConstraintsWrong,
    /// Constraints with more legs than coordinates.
    ConstraintsLegs,
    /// Fewer than six legs and constraints.
    ConstraintsFew,
    /// Constraints with a second mechanism or with workspace boxes.
    ConstraintsAlone,
    /// `sparm` contains something other than `identityfirst` and load parameters.
    SparmUnknown,
    /// A load parameter with another value in `sparm`.
    SparmTwice,
    /// `sparm=identityfirst` although some joint has no letter.
    IdentityImpossible,
}

impl LoadError {
    /// Returns one sentence for the user, with the solution.
    pub const fn text(self) -> &'static str {
        match self {
            Self::LegsMalformed => {
                "legs= must be KIND:COUNT[,KIND:COUNT], such as strut:6 or slider:4"
            }
            Self::KindUnknown => "legs= has an unknown kind of leg: use strut, slider, crank, ring",
            Self::LegsWrong => "legs= must have one to eight legs in all",
            Self::CoordinatesWrong => {
                "coordinates= must be letters of X Y Z A B C, each at most once"
            }
            Self::TooManyCoordinates => {
                "coordinates= has more letters than legs= has legs: each needs a leg, as in \
                 legs=slider:4 coordinates=XYZB"
            }
            Self::TableWrong => "table= must be letters of X Y Z, each at most once",
            Self::LetterTwice => {
                "a letter is in both coordinates= and table=: remove it from one of them"
            }
            Self::AxesWrong => "axes= must be letters of X Y Z A B C U V W, each at most once",
            Self::AxisTaken => {
                "a letter of axes= is also in coordinates= or table=, or belongs to the second \
                 mechanism: remove it from one of them"
            }
            Self::BoxesWrong => "boxes= and second_boxes= must be a number from 0 to 8",
            Self::LegsTogether => {
                "legs= and second= must have one to eight legs together, each at least one"
            }
            Self::SecondCoordinates => {
                "second_coordinates= must be letters of X Y Z A B C, each at most once, and no \
                 more than second= has legs"
            }
            Self::SecondAngles => {
                "second_angles= must have one letter of A B C for each angle of \
                 second_coordinates=; X Y Z become U V W automatically"
            }
            Self::SecondTaken => {
                "a letter of second_angles= is also in coordinates=: remove it from one of them"
            }
            Self::SecondAlone => {
                "a second_...= parameter needs second=KIND:COUNT, the legs of the second mechanism"
            }
            Self::ConstraintsWrong => "constraints= must be a number from 0 to 6",
            Self::ConstraintsLegs => {
                "constraints= needs as many coordinates as legs, as in legs=strut:3 coordinates=XYZ \
                 constraints=3"
            }
            Self::ConstraintsFew => {
                "legs= and constraints= must be at least six together: with fewer the platform is free"
            }
            Self::ConstraintsAlone => {
                "constraints= is not supported with second= or boxes=: remove one of them"
            }
            Self::SparmUnknown => {
                "sparm= must be identityfirst and load parameters, separated by slashes, such as \
                 sparm=legs=slider:4/table=XY"
            }
            Self::SparmTwice => {
                "sparm= has a load parameter that is given twice with different values: remove one"
            }
            Self::IdentityImpossible => {
                "sparm=identityfirst needs as many coordinates as legs, so that each joint has a letter"
            }
        }
    }
}
