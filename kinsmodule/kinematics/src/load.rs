// SPDX-License-Identifier: GPL-2.0-or-later
//! The module's load parameters: `legs=KIND:COUNT[,KIND:COUNT] coordinates=LETTERS table=LETTERS
//! axes=LETTERS boxes=COUNT constraints=COUNT`, and those of a second mechanism: `second=KIND:COUNT[,KIND:COUNT]
//! second_coordinates=LETTERS second_angles=LETTERS second_boxes=COUNT`. `sparm` has `identityfirst` and any of the
//! others, separated by slashes: a caller outside real time passes `coordinates` and `sparm` alone.

use crate::boxes::MAX_BOXES;
use crate::extra::ExtraAxes;
use crate::geometry::Fnv1a;
use crate::layout::{Layout, MAX_LEGS, PerLeg};
use crate::leg::Kind;
use crate::letters::Letters;
use crate::load_error::LoadError;
use crate::second::Second;

/// Requested configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Load {
    kinds: [Kind; MAX_LEGS],
    /// Numbers and letters.
    pub layout: Layout,
    /// Axes after legs and table, including those of a second mechanism.
    pub extra: ExtraAxes,
    boxes: usize,
    second: Option<Beside>,
    is_identity_first: bool,
}

/// The second mechanism.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Beside {
    kinds: [Kind; MAX_LEGS],
    letters: Second,
    boxes: usize,
}

/// Names of the load parameters.
pub const LOAD_PARAMETERS: [&str; 11] = [
    "legs",
    "coordinates",
    "table",
    "axes",
    "boxes",
    "second",
    "second_coordinates",
    "second_angles",
    "second_boxes",
    "constraints",
    SPARM,
];

const SPARM: &str = "sparm";

impl Load {
    /// Parses the load parameters in the order of [`LOAD_PARAMETERS`], including those in `sparm`.
    ///
    /// # Errors
    /// The [`LoadError`] of the first invalid parameter; [`LoadError::SparmTwice`] if one stands outside `sparm` as
    /// well, with another value.
    pub fn of(mut texts: [Option<&[u8]>; LOAD_PARAMETERS.len()]) -> Result<Self, LoadError> {
        let [.., sparm] = texts;
        let mut own = None;
        for item in given(sparm).into_iter().flat_map(|text| text.split(|c| *c == b'/')) {
            if item.is_empty() {
                continue;
            }
            let mut parts = item.splitn(2, |c| *c == b'=');
            let (Some(name), Some(value)) = (parts.next(), parts.next()) else {
                // Of two words one would be lost.
                if own.replace(item).is_some() {
                    return Err(LoadError::SparmUnknown);
                }
                continue;
            };
            let mut places = LOAD_PARAMETERS.iter().zip(&mut texts);
            let place = places.find(|(known, _)| known.as_bytes() == name && **known != SPARM);
            let (_, place) = place.ok_or(LoadError::SparmUnknown)?;
            if given(*place).is_some_and(|outside| outside != value) {
                return Err(LoadError::SparmTwice);
            }
            *place = Some(value);
        }
        let [legs, coordinates, table, axes, boxes, second @ ..] = texts;
        let [second, second_coordinates, second_angles, second_boxes, constraints, _] = second;
        Self::parse(legs, coordinates, table)?
            .with_second(second, second_coordinates, second_angles)?
            .with_axes(axes)?
            .with_boxes(boxes)?
            .with_second_boxes(second_boxes)?
            .with_constraints(constraints)?
            .with_sparm(own)
    }

    /// Combines the hash of a geometry and its chain with the other values that affect the joints: the joint
    /// offsets, the spindle offset, and those load parameters that the geometry's hash does not contain.
    pub fn hash(&self, of_chain: u32, offset: &PerLeg, spindle_offset: f64) -> u32 {
        let mut hash = Fnv1a(of_chain);
        hash.add(offset);
        let counts = [self.joints() as f64, f64::from(u8::from(self.is_identity_first))];
        hash.add(&[spindle_offset]);
        hash.add(&counts);
        self.other_places().for_each(|place| hash.add(&[place as f64]));
        hash.0
    }

    /// Parses the load parameters; `None` or empty = default
    /// (`legs=strut:6 coordinates=XYZABC`, no table).
    ///
    /// # Errors
    /// The [`LoadError`] of the first invalid parameter.
    pub fn parse(
        legs: Option<&[u8]>,
        coordinates: Option<&[u8]>,
        table: Option<&[u8]>,
    ) -> Result<Self, LoadError> {
        let (kinds, count) = legs_of(given(legs).unwrap_or(b"strut:6"))?;
        let coordinates = match given(coordinates) {
            None => Letters::XYZABC,
            Some(text) => Letters::parse(text).ok_or(LoadError::CoordinatesWrong)?,
        };
        let table = Letters::parse(table.unwrap_or(b"")).ok_or(LoadError::TableWrong)?;
        let layout = Layout::new(count, coordinates, table)?;
        Ok(Self {
            kinds,
            layout,
            extra: ExtraAxes::NONE,
            boxes: 0,
            second: None,
            is_identity_first: false,
        })
    }

    /// Adds a second mechanism with these legs, coordinates and letters of its angles, see [`Second`];
    /// without legs, none. Must be called before the extra axes are added.
    ///
    /// # Errors
    /// As [`Load::parse`] and [`Second::new`]; [`LoadError::SecondAlone`] if coordinates or angles are
    /// given without legs.
    pub fn with_second(
        self,
        legs: Option<&[u8]>,
        coordinates: Option<&[u8]>,
        angles: Option<&[u8]>,
    ) -> Result<Self, LoadError> {
        let [legs, coordinates, angles] = [legs, coordinates, angles].map(given);
        let Some(legs) = legs else {
            let is_alone = coordinates.or(angles).is_some();
            return if is_alone { Err(LoadError::SecondAlone) } else { Ok(self) };
        };
        let (kinds, count) = legs_of(legs)?;
        let coordinates =
            coordinates.and_then(Letters::parse).ok_or(LoadError::SecondCoordinates)?;
        let angles = Letters::parse(angles.unwrap_or(b"")).ok_or(LoadError::SecondAngles)?;
        let letters = Second::new(count, coordinates, angles, &self.layout)?;
        Ok(Self { second: Some(Beside { kinds, letters, boxes: 0 }), ..self })
    }

    /// Sets the number of workspace boxes of the second mechanism; `None` or empty = none.
    ///
    /// # Errors
    /// [`LoadError::BoxesWrong`]; [`LoadError::SecondAlone`] without a second mechanism.
    pub fn with_second_boxes(self, text: Option<&[u8]>) -> Result<Self, LoadError> {
        let boxes = boxes_of(text)?;
        let Some(second) = self.second else {
            return if given(text).is_some() { Err(LoadError::SecondAlone) } else { Ok(self) };
        };
        Ok(Self { second: Some(Beside { boxes, ..second }), ..self })
    }

    /// Adds the extra axes that `text` names; `None` or empty = none.
    ///
    /// # Errors
    /// As [`ExtraAxes::parse`].
    pub fn with_axes(self, text: Option<&[u8]>) -> Result<Self, LoadError> {
        let extra = ExtraAxes::parse(text.unwrap_or(b""), &self.layout)?;
        let mut of_second = self.second.iter().flat_map(|second| second.letters.places());
        if of_second.any(|taken| extra.has(taken)) {
            return Err(LoadError::AxisTaken);
        }
        Ok(Self { extra, ..self })
    }

    /// Sets the number of workspace boxes; `None` or empty = none.
    ///
    /// # Errors
    /// [`LoadError::BoxesWrong`].
    pub fn with_boxes(self, text: Option<&[u8]>) -> Result<Self, LoadError> {
        Ok(Self { boxes: boxes_of(text)?, ..self })
    }

    /// Sets the number of constraints of the platform; `None` or empty = none.
    ///
    /// # Errors
    /// [`LoadError::ConstraintsWrong`]; as [`Layout::with_constraints`]; [`LoadError::ConstraintsAlone`].
    pub fn with_constraints(self, text: Option<&[u8]>) -> Result<Self, LoadError> {
        let Some(text) = given(text) else { return Ok(self) };
        let layout =
            self.layout.with_constraints(number(text).ok_or(LoadError::ConstraintsWrong)?)?;
        if layout.constraints() > 0 && (self.second.is_some() || self.boxes > 0) {
            return Err(LoadError::ConstraintsAlone);
        }
        Ok(Self { layout, ..self })
    }

    /// Applies the item of `sparm` that is no other parameter: `identityfirst` makes the identity kinematics
    /// number 0 and those of the machine number 1; `None` or empty = the reverse. Must be called
    /// last.
    ///
    /// # Errors
    /// [`LoadError::SparmUnknown`] for other text; [`LoadError::IdentityImpossible`].
    pub fn with_sparm(self, text: Option<&[u8]>) -> Result<Self, LoadError> {
        match given(text) {
            None => Ok(self),
            Some(b"identityfirst") if !self.has_identity() => Err(LoadError::IdentityImpossible),
            Some(b"identityfirst") => Ok(Self { is_identity_first: true, ..self }),
            Some(_) => Err(LoadError::SparmUnknown),
        }
    }

    /// Returns whether the identity kinematics are number 0, with which LinuxCNC starts.
    pub fn is_identity_first(&self) -> bool {
        self.is_identity_first
    }

    /// Returns whether identity kinematics exist, with a letter for each joint.
    pub fn has_identity(&self) -> bool {
        let of_second =
            self.second().is_none_or(|second| second.layout().joint_letters().is_some());
        of_second && self.layout.joint_letters().is_some()
    }

    /// Returns the number of boxes for the start without a seed.
    pub fn boxes(&self) -> usize {
        self.boxes
    }

    /// Returns the number of joints: legs, table, legs of a second mechanism and extra axes.
    pub fn joints(&self) -> usize {
        self.first_extra_joint() + self.extra.len()
    }

    /// Returns the number of the first joint of the extra axes, or the number it would have.
    pub fn first_extra_joint(&self) -> usize {
        self.layout.joints() + self.second().map_or(0, |second| second.layout().joints())
    }

    /// Returns the letters of the second mechanism.
    pub fn second(&self) -> Option<&Second> {
        self.second.as_ref().map(|second| &second.letters)
    }

    /// Returns the configuration of the second mechanism alone.
    pub fn of_second(&self) -> Option<Self> {
        let Beside { kinds, letters, boxes } = self.second?;
        let (layout, extra) = (*letters.layout(), ExtraAxes::NONE);
        let is_identity_first = self.is_identity_first;
        Some(Self { kinds, layout, extra, boxes, second: None, is_identity_first })
    }

    /// Returns the indices in LinuxCNC's pose that belong neither to legs nor to table of the first mechanism.
    pub fn other_places(&self) -> impl Iterator<Item = usize> + '_ {
        self.extra.places().chain(self.second().into_iter().flat_map(Second::places))
    }

    /// Returns the kind of every leg, in joint order.
    pub fn kinds(&self) -> &[Kind] {
        self.kinds.get(..self.layout.legs()).unwrap_or(&self.kinds)
    }
}

fn given(text: Option<&[u8]>) -> Option<&[u8]> {
    text.filter(|t| !t.is_empty())
}

fn boxes_of(text: Option<&[u8]>) -> Result<usize, LoadError> {
    match given(text) {
        None => Ok(0),
        Some(text) => number(text).filter(|n| *n <= MAX_BOXES).ok_or(LoadError::BoxesWrong),
    }
}

/// Parses the kinds of the legs and their number.
fn legs_of(text: &[u8]) -> Result<([Kind; MAX_LEGS], usize), LoadError> {
    let mut kinds = [Kind::Strut; MAX_LEGS];
    let mut sum = 0;
    for group in text.split(|c| *c == b',') {
        let mut parts = group.split(|c| *c == b':');
        let (Some(kind), Some(count), None) = (parts.next(), parts.next(), parts.next()) else {
            return Err(LoadError::LegsMalformed);
        };
        if kind.is_empty() {
            return Err(LoadError::LegsMalformed);
        }
        let known = Kind::ALL.iter().find(|known| known.name().as_bytes() == kind);
        let kind = *known.ok_or(LoadError::KindUnknown)?;
        let count = number(count).ok_or(LoadError::LegsMalformed)?;
        for place in kinds.iter_mut().skip(sum).take(count) {
            *place = kind;
        }
        sum += count;
    }
    Ok((kinds, sum))
}

/// Parses a count of one or two digits.
fn number(text: &[u8]) -> Option<usize> {
    if text.is_empty() || text.len() > 2 || !text.iter().all(u8::is_ascii_digit) {
        return None;
    }
    Some(text.iter().fold(0, |n, digit| 10 * n + usize::from(digit - b'0')))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::letters::Letter;

    fn legs(text: &str) -> Result<Load, LoadError> {
        Load::parse(Some(text.as_bytes()), None, None)
    }

    #[test]
    fn six_struts_are_the_default_however_they_are_grouped() {
        let default = Load::parse(None, None, None).unwrap();
        assert_eq!(default.layout, Layout::new(6, Letters::XYZABC, Letters::NONE).unwrap());
        assert_eq!(default.kinds(), [Kind::Strut; 6]);
        for text in ["", "strut:6", "strut:06", "strut:4,strut:2"] {
            assert_eq!(legs(text), Ok(default), "{text}");
        }
    }

    #[test]
    fn kinds_stand_in_joint_order() {
        let hybrid = Load::parse(Some(b"strut:1,slider:2,crank:1"), Some(b"ZAB"), Some(b"xy"));
        let hybrid = hybrid.unwrap();
        assert_eq!(hybrid.kinds(), [Kind::Strut, Kind::Slider, Kind::Slider, Kind::Crank]);
        assert_eq!(hybrid.layout.joints(), 6);
    }

    #[test]
    fn extra_axes_stand_behind_legs_and_table() {
        let lathe = Load::parse(Some(b"slider:4"), Some(b"XZB"), Some(b"Y")).unwrap();
        let lathe = lathe.with_axes(Some(b"CW")).unwrap();
        assert_eq!((lathe.layout.joints(), lathe.joints()), (5, 7));
        assert_eq!(lathe.with_axes(None).unwrap().joints(), 5);
    }

    #[test]
    fn a_second_mechanism_stands_between_the_first_and_the_extra_axes() {
        let given = |text: &'static [u8]| Some(text);
        let first = Load::parse(given(b"slider:4"), given(b"XYZB"), None).unwrap();
        let pair = first.with_second(given(b"slider:3"), given(b"XZB"), given(b"c")).unwrap();
        let pair = pair.with_axes(given(b"VA")).unwrap().with_second_boxes(given(b"2")).unwrap();
        assert_eq!((pair.joints(), pair.first_extra_joint(), pair.layout.joints()), (9, 7, 4));
        assert!(pair.other_places().eq([7, 3, 6, 8, 5]));
        let second = pair.of_second().unwrap();
        let alone = Load::parse(given(b"slider:3"), given(b"XZB"), None).unwrap();
        assert_eq!(second, alone.with_boxes(given(b"2")).unwrap());
        assert_eq!(first.with_second(None, given(b""), None), Ok(first));
        assert_eq!(pair.with_axes(given(b"U")), Err(LoadError::AxisTaken));
        for refused in [
            first.with_second(None, given(b"XYZ"), None),
            first.with_second(None, None, given(b"C")),
            first.with_second_boxes(given(b"1")),
        ] {
            assert_eq!(refused, Err(LoadError::SecondAlone));
        }
        let second = |legs, coordinates, angles| {
            first.with_second(given(legs), given(coordinates), given(angles)).map(|_| ())
        };
        assert_eq!(second(b"slider", b"XYZ", b""), Err(LoadError::LegsMalformed));
        assert_eq!(second(b"rail:4", b"XYZ", b""), Err(LoadError::KindUnknown));
        assert_eq!(second(b"slider:4", b"XYU", b""), Err(LoadError::SecondCoordinates));
        assert_eq!(second(b"slider:4", b"", b""), Err(LoadError::SecondCoordinates));
        assert_eq!(second(b"slider:4", b"XYZB", b"W"), Err(LoadError::SecondAngles));
        assert_eq!(second(b"slider:5", b"XYZB", b"C"), Err(LoadError::LegsTogether));
    }

    #[test]
    fn boxes_are_counted_from_none_to_eight() {
        let hexapod = legs("").unwrap();
        for (text, boxes) in [(None, 0), (Some(&b""[..]), 0), (Some(b"1"), 1), (Some(b"8"), 8)] {
            assert_eq!(hexapod.with_boxes(text).unwrap().boxes(), boxes);
        }
        for text in [&b"9"[..], b"-1", b"one", b"1.5"] {
            assert_eq!(hexapod.with_boxes(Some(text)), Err(LoadError::BoxesWrong));
        }
    }

    #[test]
    fn no_word_of_sparm_is_lost() {
        let of = |coordinates: &'static str, sparm: &'static str| {
            let mut texts = [None; LOAD_PARAMETERS.len()];
            texts[1] = Some(coordinates.as_bytes());
            texts[LOAD_PARAMETERS.len() - 1] = Some(sparm.as_bytes());
            Load::of(texts)
        };
        for sparm in ["identityfirst/", "/identityfirst", "identityfirst/legs=strut:6/"] {
            assert!(of("", sparm).unwrap().is_identity_first(), "{sparm}");
        }
        for sparm in ["junk/identityfirst", "legs/identityfirst", "identityfirst/identityfirst"] {
            assert_eq!(of("", sparm), Err(LoadError::SparmUnknown), "{sparm}");
        }
        assert!(of("", "coordinates=XYZABC").is_ok());
        assert_eq!(of("XYZ", "coordinates=XYZABC"), Err(LoadError::SparmTwice));
    }

    #[test]
    fn the_identity_kinematics_may_come_first_where_each_joint_has_a_letter() {
        let hexapod = legs("").unwrap();
        for (text, first) in
            [(None, false), (Some(&b""[..]), false), (Some(b"identityfirst"), true)]
        {
            assert_eq!(hexapod.with_sparm(text).unwrap().is_identity_first(), first, "{text:?}");
        }
        for text in [&b"identity"[..], b"identityfirst,", b"IDENTITYFIRST", b"0"] {
            assert_eq!(hexapod.with_sparm(Some(text)), Err(LoadError::SparmUnknown));
        }
        let first = Load::parse(Some(b"slider:4"), Some(b"XYZB"), None).unwrap();
        let pair =
            |coordinates| first.with_second(Some(b"slider:3"), Some(coordinates), None).unwrap();
        let sparm = Some(&b"identityfirst"[..]);
        assert!(pair(b"XYZ").with_sparm(sparm).unwrap().of_second().unwrap().is_identity_first());
        let pyramid = Load::parse(Some(b"slider:4"), Some(b"ZAB"), Some(b"XY")).unwrap();
        for held in [pyramid, pair(b"XZ")] {
            assert_eq!(held.with_sparm(sparm), Err(LoadError::IdentityImpossible));
        }
    }

    /// Parses a load line such as `legs=slider:4 table=XY`.
    fn line(text: &'static str) -> Result<Load, LoadError> {
        let mut texts = [None; LOAD_PARAMETERS.len()];
        for (name, value) in text.split(' ').filter_map(|word| word.split_once('=')) {
            texts[LOAD_PARAMETERS.iter().position(|known| *known == name).unwrap()] =
                Some(value.as_bytes());
        }
        Load::of(texts)
    }

    #[test]
    fn sparm_may_contain_the_other_parameters() {
        let pyramid = line("legs=slider:4 coordinates=ZAB table=XY axes=CW boxes=2").unwrap();
        for text in [
            "coordinates=ZAB sparm=legs=slider:4/table=XY/axes=CW/boxes=2",
            "coordinates=ZAB legs=slider:4 sparm=legs=slider:4/table=XY/axes=CW/boxes=2",
            "sparm=boxes=2/table=XY/coordinates=ZAB/axes=CW/legs=slider:4",
        ] {
            assert_eq!(line(text), Ok(pyramid), "{text}");
        }
        let delta = line("legs=slider:3 coordinates=XYZ sparm=identityfirst").unwrap();
        assert!(delta.is_identity_first());
        assert_eq!(line("coordinates=XYZ sparm=identityfirst/legs=slider:3"), Ok(delta));
        for text in ["sparm=sparm=identityfirst", "sparm=legs", "sparm=leg=strut:6", "sparm=a/b"] {
            assert_eq!(line(text), Err(LoadError::SparmUnknown), "{text}");
        }
        for text in ["legs=slider:4 sparm=legs=slider:3", "sparm=axes=U/axes=V"] {
            assert_eq!(line(text), Err(LoadError::SparmTwice), "{text}");
        }
        assert_eq!(line("sparm=legs=strut:5"), Err(LoadError::TooManyCoordinates));
    }

    #[test]
    fn constraints_complete_as_many_legs_as_coordinates_to_six() {
        let tricept = line("legs=strut:3 coordinates=XYZ constraints=3").unwrap();
        assert_eq!(tricept.layout.constraints(), 3);
        assert!(Letter::ALL[3..].iter().all(|letter| tricept.layout.is_dependent(*letter)));
        assert!(!tricept.layout.is_dependent(Letter::X));
        let head = line("legs=slider:3 coordinates=ZAB table=XY constraints=3").unwrap();
        assert!(head.layout.is_dependent(Letter::X) && !head.layout.is_held(Letter::X));
        assert!(head.layout.is_dependent(Letter::C) && head.layout.is_held(Letter::C));
        assert!(!line("legs=strut:3 coordinates=XYZ").unwrap().layout.is_dependent(Letter::A));
        for (text, error) in [
            ("legs=strut:3 coordinates=XYZ constraints=2", LoadError::ConstraintsFew),
            ("legs=strut:3 coordinates=XYZ constraints=7", LoadError::ConstraintsWrong),
            ("legs=strut:3 coordinates=XYZ constraints=-3", LoadError::ConstraintsWrong),
            ("legs=strut:4 coordinates=XYZ constraints=3", LoadError::ConstraintsLegs),
            ("legs=strut:3 coordinates=XYZ constraints=3 boxes=1", LoadError::ConstraintsAlone),
            (
                "legs=strut:3 coordinates=XYZ constraints=3 second=strut:3 second_coordinates=XYZ",
                LoadError::ConstraintsAlone,
            ),
        ] {
            assert_eq!(line(text), Err(error), "{text}");
        }
        assert_eq!(
            line("legs=strut:3 coordinates=XYZ constraints=0"),
            line("legs=strut:3 coordinates=XYZ")
        );
    }

    #[test]
    fn the_hash_changes_with_every_value_that_the_geometrys_does_not_have() {
        let (none, hexapod) = ([0.0; MAX_LEGS], line("boxes=1").unwrap());
        let first = hexapod.hash(7, &none, 0.0);
        let mut offset = none;
        offset[2] = 1.0;
        for other in [
            hexapod.hash(8, &none, 0.0),
            hexapod.hash(7, &offset, 0.0),
            hexapod.hash(7, &none, 1.0),
            line("axes=U").unwrap().hash(7, &none, 0.0),
            line("axes=V").unwrap().hash(7, &none, 0.0),
            line("sparm=identityfirst").unwrap().hash(7, &none, 0.0),
        ] {
            assert_ne!(other, first);
        }
        assert_eq!(line("boxes=2").unwrap().hash(7, &none, 0.0), first);
    }

    #[test]
    fn every_reason_names_what_to_write() {
        for (error, reported) in [
            (LoadError::LegsMalformed, "legs="),
            (LoadError::KindUnknown, "kind of leg"),
            (LoadError::LegsWrong, "one to eight"),
            (LoadError::CoordinatesWrong, "coordinates="),
            (LoadError::TooManyCoordinates, "coordinates="),
            (LoadError::TableWrong, "table="),
            (LoadError::LetterTwice, "table="),
            (LoadError::AxesWrong, "axes="),
            (LoadError::AxisTaken, "axes="),
            (LoadError::BoxesWrong, "boxes="),
            (LoadError::LegsTogether, "second="),
            (LoadError::SecondCoordinates, "second_coordinates="),
            (LoadError::SecondAngles, "second_angles="),
            (LoadError::SecondTaken, "second_angles="),
            (LoadError::SecondAlone, "second="),
            (LoadError::ConstraintsWrong, "constraints="),
            (LoadError::ConstraintsLegs, "constraints="),
            (LoadError::ConstraintsFew, "constraints="),
            (LoadError::ConstraintsAlone, "constraints="),
            (LoadError::SparmUnknown, "identityfirst"),
            (LoadError::SparmTwice, "sparm="),
            (LoadError::IdentityImpossible, "sparm=identityfirst"),
        ] {
            assert!(error.text().contains(reported), "{error:?}");
        }
    }

    #[test]
    fn what_does_not_fit_is_refused_with_its_reason() {
        for (text, error) in [
            ("strut", LoadError::LegsMalformed),
            ("strut:", LoadError::LegsMalformed),
            (":6", LoadError::LegsMalformed),
            ("strut:6,", LoadError::LegsMalformed),
            ("strut:-6", LoadError::LegsMalformed),
            ("strut:6:1", LoadError::LegsMalformed),
            ("strut:100", LoadError::LegsMalformed),
            ("hexapod:6", LoadError::KindUnknown),
            ("strut:0", LoadError::LegsWrong),
            ("strut:9", LoadError::LegsWrong),
            ("strut:6,strut:99", LoadError::LegsWrong),
            ("strut:5", LoadError::TooManyCoordinates),
        ] {
            assert_eq!(legs(text), Err(error), "{text}");
        }
        for (coordinates, table, error) in [
            ("XYZAA", "", LoadError::CoordinatesWrong),
            ("XYZU", "", LoadError::CoordinatesWrong),
            ("ZAB", "XX", LoadError::TableWrong),
            ("ZAB", "XC", LoadError::TableWrong),
            ("ZAB", "XU", LoadError::TableWrong),
            ("XZAB", "XY", LoadError::LetterTwice),
            ("XYZAB", "", LoadError::TooManyCoordinates),
        ] {
            let load = Load::parse(
                Some(b"slider:4"),
                Some(coordinates.as_bytes()),
                Some(table.as_bytes()),
            );
            assert_eq!(load, Err(error), "{coordinates} {table}");
        }
    }
}
