// SPDX-License-Identifier: GPL-2.0-or-later
//! Joint changes over the length of a path (the carriage curves of paper 003, table 2, summed step
//! by step).

use kinematics::MAX_JOINTS;

/// One point of a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Along<const N: usize = MAX_JOINTS> {
    /// Length of the path of the control point so far, machine units.
    pub length: f64,
    /// Change of every joint so far, in its unit.
    pub change: [f64; N],
}

/// Computes path length and joint changes since the first of these poses (x y z …) with their joints.
pub fn along<const N: usize>(
    places: impl IntoIterator<Item = ([f64; 6], [f64; N])>,
) -> Vec<Along<N>> {
    let mut places = places.into_iter();
    let Some(mut last) = places.next() else { return vec![] };
    let mut now = Along { length: 0.0, change: [0.0; N] };
    let mut all = vec![now];
    for (pose, joints) in places {
        let squares = pose.iter().zip(&last.0).take(3).map(|(a, b)| (a - b) * (a - b));
        now.length += squares.sum::<f64>().sqrt();
        for (i, change) in now.change.iter_mut().enumerate() {
            *change += joints[i] - last.1[i];
        }
        last = (pose, joints);
        all.push(now);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_and_changes_add_up_and_turns_have_no_length() {
        let joints = |first: f64| [first, 7.0];
        let places = [
            ([1.0, 0.0, 0.0, 0.0, 0.0, 0.0], joints(10.0)),
            ([4.0, 4.0, 0.0, 0.0, 0.0, 0.0], joints(12.5)),
            ([4.0, 4.0, 0.0, 9.0, 0.0, 0.0], joints(11.0)),
        ];
        let found: Vec<_> = along(places).iter().map(|a| (a.length, a.change[0])).collect();
        assert_eq!(found, [(0.0, 0.0), (5.0, 2.5), (5.0, 1.0)]);
        assert!(along::<2>([]).is_empty());
    }
}
