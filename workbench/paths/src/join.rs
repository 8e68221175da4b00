// SPDX-License-Identifier: GPL-2.0-or-later
//! Joins the unordered entities of a drawing end to end.

use crate::element::Element;
use crate::spline::SplineError;
use nalgebra::Vector3;

/// Ends nearer than this coincide, mm; others are connected by a line.
const ONE_PLACE: f64 = 1e-6;

/// Why entities cannot be joined.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum JoinError {
    #[error("at X {x:.6} Y {y:.6} Z {z:.6} ends of {names} meet, so the path is ambiguous; list the entities of one path in dxf_handles", x = at.x, y = at.y, z = at.z)]
    Branch {
        /// The position, mm.
        at: Vector3<f64>,
        names: String,
    },
    #[error(transparent)]
    Line(#[from] SplineError),
}

/// Elements end to end, from one entity of a drawing.
#[derive(Clone, Debug)]
pub struct Strand {
    name: String,
    elements: Vec<Element>,
    /// First and last point, cached because they are compared with many others.
    ends: [Vector3<f64>; 2],
}

impl Strand {
    /// Creates a strand of one or more elements, with a name for messages; returns `None` without elements.
    pub fn new(name: String, elements: Vec<Element>) -> Option<Self> {
        let ends = [elements.first()?.ends()[0], elements.last()?.ends()[1]];
        Some(Self { name, elements, ends })
    }

    fn is_closed(&self, within: f64) -> bool {
        let [start, end] = self.ends;
        (start - end).norm() <= within
    }
}

/// Joins strands whose ends lie within `within` mm of each other, in their order; strands that
/// reach no other follow one after the other.
///
/// The first strand of a chain keeps its direction and determines that of the others.
///
/// # Errors
/// See [`JoinError`].
pub fn joined(strands: Vec<Strand>, within: f64) -> Result<Vec<Element>, JoinError> {
    check_branches(&strands, within)?;
    let mut left: Vec<Option<Strand>> = strands.into_iter().map(Some).collect();
    let mut all = vec![];
    for k in 0..left.len() {
        let Some(first) = left[k].take() else { continue };
        let is_closed = first.is_closed(within);
        let mut chain = first.elements;
        if !is_closed {
            extend(&mut chain, &mut left, within)?;
            // The start is extended as the end of the reversed chain.
            chain = turned(chain);
            extend(&mut chain, &mut left, within)?;
            chain = turned(chain);
            bridge(&mut chain, within)?;
        }
        all.append(&mut chain);
    }
    Ok(all)
}

fn turned(elements: Vec<Element>) -> Vec<Element> {
    elements.into_iter().rev().map(Element::reversed).collect()
}

/// Appends all strands that reach the end of a chain.
fn extend(
    chain: &mut Vec<Element>,
    left: &mut [Option<Strand>],
    within: f64,
) -> Result<(), JoinError> {
    loop {
        let end = chain[chain.len() - 1].ends()[1];
        let reached = |strand: &Strand| {
            let near = |k: usize| (strand.ends[k] - end).norm() <= within;
            !strand.is_closed(within) && (near(0) || near(1))
        };
        let Some(next) = left.iter_mut().find(|next| next.as_ref().is_some_and(reached)) else {
            return Ok(());
        };
        let Some(mut next) = next.take() else { return Ok(()) };
        let [start, other] = next.ends;
        if (other - end).norm() < (start - end).norm() {
            next.elements = turned(next.elements);
            next.ends.reverse();
        }
        line(chain, next.ends[0])?;
        chain.append(&mut next.elements);
    }
}

/// Closes a chain whose ends meet.
fn bridge(chain: &mut Vec<Element>, within: f64) -> Result<(), JoinError> {
    let (start, end) = (chain[0].ends()[0], chain[chain.len() - 1].ends()[1]);
    if chain.len() > 1 && (start - end).norm() <= within { line(chain, start) } else { Ok(()) }
}

/// Appends a line from the end of a chain to a point, unless they coincide.
fn line(chain: &mut Vec<Element>, to: Vector3<f64>) -> Result<(), JoinError> {
    let end = chain[chain.len() - 1].ends()[1];
    if (to - end).norm() > ONE_PLACE {
        chain.push(Element::bezier(&[end, to])?);
    }
    Ok(())
}

/// Refuses ends that meet two or more others.
fn check_branches(strands: &[Strand], within: f64) -> Result<(), JoinError> {
    let open = strands.iter().filter(|strand| !strand.is_closed(within));
    let ends: Vec<(&Strand, Vector3<f64>)> =
        open.flat_map(|strand| strand.ends.map(|end| (strand, end))).collect();
    for (_, at) in &ends {
        let near = ends.iter().filter(|(_, end)| (end - at).norm() <= within);
        let names: Vec<&str> = near.map(|(strand, _)| strand.name.as_str()).collect();
        if names.len() > 2 {
            return Err(JoinError::Branch { at: *at, names: names.join(", ") });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(name: &str, a: [f64; 2], b: [f64; 2]) -> Strand {
        let place = |p: [f64; 2]| Vector3::new(p[0], p[1], 0.0);
        Strand::new(name.into(), vec![Element::bezier(&[place(a), place(b)]).unwrap()]).unwrap()
    }

    fn places(elements: &[Element]) -> Vec<[f64; 2]> {
        let start = elements[0].ends()[0];
        let ends = elements.iter().map(|element| element.ends()[1]);
        std::iter::once(start).chain(ends).map(|p| [p.x, p.y]).collect()
    }

    #[test]
    fn lines_in_any_order_and_direction_become_one_chain_in_the_direction_of_the_first() {
        let lines = vec![
            line("b", [1.0, 0.0], [2.0, 0.0]),
            line("d", [3.0, 1.0], [3.0, 0.0]),
            line("a", [1.0, 0.0], [0.0, 0.0]),
            line("c", [3.0, 0.0], [2.0, 0.0]),
        ];
        let chain = joined(lines, 1e-3).unwrap();
        let expected = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [3.0, 1.0]];
        assert_eq!(places(&chain), expected);
    }

    #[test]
    fn a_gap_within_what_is_allowed_becomes_a_line_and_a_larger_one_stays() {
        let lines = |gap: f64| {
            vec![line("a", [0.0, 0.0], [1.0, 0.0]), line("b", [1.0 + gap, 0.0], [2.0, 0.0])]
        };
        assert_eq!(joined(lines(0.0), 1e-3).unwrap().len(), 2);
        assert_eq!(places(&joined(lines(5e-4), 1e-3).unwrap())[2], [1.0005, 0.0]);
        let apart = joined(lines(2e-3), 1e-3).unwrap();
        assert_eq!(apart.len(), 2);
        assert_eq!(apart[1].ends()[0].x, 1.002);
        // A triangle with a gap as small is closed.
        let triangle = vec![
            line("a", [0.0, 0.0], [1.0, 0.0]),
            line("b", [1.0, 0.0], [0.0, 1.0]),
            line("c", [0.0, 1.0], [0.0, 5e-4]),
        ];
        let closed = joined(triangle, 1e-3).unwrap();
        assert_eq!((closed.len(), places(&closed)[4]), (4, [0.0, 0.0]));
    }

    #[test]
    fn three_ends_at_one_place_are_refused_with_the_place_and_the_names() {
        let lines = vec![
            line("a", [0.0, 0.0], [1.0, 2.0]),
            line("b", [1.0, 2.0], [2.0, 0.0]),
            line("c", [5.0, 2.0], [1.0, 2.0]),
        ];
        let message = joined(lines, 1e-3).unwrap_err().to_string();
        assert!(
            message.starts_with("at X 1.000000 Y 2.000000 Z 0.000000 ends of a, b, c meet"),
            "{message}"
        );
    }
}
