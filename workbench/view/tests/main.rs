// SPDX-License-Identifier: GPL-2.0-or-later
//! All integration tests of the crate in one binary, which is linked once.

mod generated;

use linuxcnc::row::{Beside, Row};
use test_support::control::standing;
use test_support::shipped::whole;
use view::track::Track;

#[test]
fn the_track_of_the_second_of_two_mechanisms_is_its_own() {
    let second = whole("lathe-mirrored").mechanism(2).unwrap();
    let own = standing(&second);
    let beside = Beside { pose: own.pose, tool: own.tool };
    let row = Row { pose: [1.0; 6], second: beside, ..own };
    let alone = second.into();
    let mut track = Track::new(&alone);
    track.see(&alone, &row);
    assert_eq!(track.points()[0].values[..6], own.pose);
}
