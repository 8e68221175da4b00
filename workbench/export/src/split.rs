// SPDX-License-Identifier: GPL-2.0-or-later
//! A model in links with at most one joint each, for formats whose links have no more. Every value is 0 at home.

use crate::model::{Body, Joint, Model};
use kinematics::Vector3;

/// A link, and the joint to its parent.
pub struct Link<'a> {
    pub name: String,
    /// Origin of its frame at home, parallel to the machine's.
    pub origin: Vector3<f64>,
    pub parent: Option<usize>,
    /// `None` for a fixed joint.
    pub joint: Option<&'a Joint>,
    /// The body, in the last link of each.
    pub body: Option<(usize, &'a Body)>,
}

/// Returns the links of a model, parents first, and the link of each body.
pub fn links(model: &Model) -> (Vec<Link<'_>>, Vec<usize>) {
    let (mut links, mut ends): (Vec<Link>, Vec<usize>) = (vec![], vec![]);
    for (n, body) in model.bodies.iter().enumerate() {
        let mut parent = body.parent.map(|parent| ends[parent]);
        for joint in &body.joints {
            let origin = match joint.motion {
                crate::model::Motion::Slide => body.origin,
                crate::model::Motion::Hinge => joint.point,
            };
            let name = format!("{}_{}", body.name, joint.name);
            links.push(Link { name, origin, parent, joint: Some(joint), body: None });
            parent = Some(links.len() - 1);
        }
        // The last link is the body if its frame is the body's.
        match links.last_mut().filter(|last| !body.joints.is_empty() && last.origin == body.origin)
        {
            Some(last) => (last.name, last.body) = (body.name.clone(), Some((n, body))),
            None => links.push(Link {
                name: body.name.clone(),
                origin: body.origin,
                parent,
                joint: None,
                body: Some((n, body)),
            }),
        }
        ends.push(links.len() - 1);
    }
    (links, ends)
}

/// Returns the limits of a joint whose value is 0 at home.
pub fn range(joint: &Joint) -> Option<[f64; 2]> {
    joint.range.map(|range| range.map(|value| value - joint.home))
}
