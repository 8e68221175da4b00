// SPDX-License-Identifier: GPL-2.0-or-later
//! A whole curve with its laws: poses of the tool tip, with derivatives, over every part of it.

use crate::base::{Explicit, Form, Part};
use crate::expression::{Expression, ExpressionError, Trouble};
use crate::file::{CurveKeys, Follow, Formula, PathFile};
use crate::free::{FreeError, check_keys, free};
use crate::implicit::Families;
use crate::laws::{self, Laws, NAMES, SPEED_NAMES, Tilt};
use crate::length::Lengths;
use crate::trace::{TraceError, Turning, Wanted, trace};
use machine::proof::interval::Interval;
use machine::proof::jet::Taylor;
use std::sync::Arc;

/// Halvings of a range that may contain a pole: 1e-12 of it remains.
const HALVINGS: u32 = 40;

/// A pose of the tool tip in work coordinates, with its derivatives with respect to the part's parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Here {
    /// x y z in mm, a b c in degrees.
    pub pose: [Taylor; 6],
    /// The curve's parameter.
    pub t: Taylor,
}

/// Why a curve cannot be created or evaluated.
#[derive(Debug, thiserror::Error)]
pub enum CurveError {
    #[error("{0}")]
    Keys(String),
    #[error("{key}: {error}")]
    Expression { key: String, error: ExpressionError },
    #[error("at t = {t}: {trouble}")]
    Trouble { t: f64, trouble: Trouble },
    #[error(transparent)]
    Trace(#[from] TraceError),
    #[error(transparent)]
    Free(#[from] FreeError),
}

#[derive(Clone, Debug)]
pub struct Curve {
    /// Parts in order; each begins where the previous one ends, or the tool is retracted between.
    pub parts: Vec<Part>,
    lengths: Vec<Lengths>,
    pub laws: Laws,
    /// Arc length in mm: in x and y for families, in space for free-form curves.
    pub length: f64,
    /// Turning points of t.
    pub turnings: Vec<Turning>,
    /// Whether it ends at its start.
    pub is_closed: bool,
    /// Whether it is given by F(x, y) = 0.
    pub is_level: bool,
    /// The start, if it is not at `start_mm`.
    pub moved_start: Option<MovedStart>,
    uses_length: bool,
}

/// The point of the curve at which a path starts in place of `start_mm`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovedStart {
    /// x and y, mm.
    pub at: [f64; 2],
    /// Distance from `start_mm`, mm.
    pub distance: f64,
}

impl MovedStart {
    /// Returns the start of a curve if it differs from the given one by more than the rounding of a number in a file.
    fn between(given: [f64; 2], at: [f64; 2]) -> Option<Self> {
        let distance = (at[0] - given[0]).hypot(at[1] - given[1]);
        (distance >= SAME_START).then_some(Self { at, distance })
    }
}

/// Distance in mm that six decimals of `start_mm` do not express.
const SAME_START: f64 = 5e-7;

/// Parses the expressions of a file.
struct Reader<'a>(&'a PathFile);

impl Reader<'_> {
    fn read(&self, key: &str, of: &Formula, names: &[&str]) -> Result<Expression, CurveError> {
        let known = &self.0.parameters;
        Expression::parse(&of.0, names, known)
            .map_err(|error| CurveError::Expression { key: key.into(), error })
    }

    fn or(
        &self,
        key: &str,
        of: Option<&Formula>,
        otherwise: &str,
        names: &[&str],
    ) -> Result<Expression, CurveError> {
        self.read(key, of.unwrap_or(&Formula(otherwise.into())), names)
    }

    fn number(&self, key: &str, of: &Formula) -> Result<f64, CurveError> {
        let found = self.read(key, of, &[])?.at(&[]);
        found
            .map(|found| found.value.middle())
            .map_err(|trouble| CurveError::Keys(format!("{key}: {trouble}")))
    }

    fn laws(&self, is_plane: bool) -> Result<Laws, CurveError> {
        let (keys, split) = (&self.0.laws, &self.0.split);
        if !is_plane && keys.z_mm.is_some() {
            return Err(CurveError::Keys(
                "[laws] z_mm: a space curve has its own z; remove the key".into(),
            ));
        }
        let own = |key: &str, of: &Option<Formula>| self.or(key, of.as_ref(), "t", &["t"]);
        let z = is_plane
            .then(|| self.or("[laws] z_mm", keys.z_mm.as_ref(), "0", &NAMES[..5]))
            .transpose()?;
        let speed = keys.speed_mm_per_s.as_ref();
        Ok(Laws {
            z,
            tilt: self.tilt()?,
            own: [
                own("[split] t_z", &split.t_z)?,
                own("[split] t_a", &split.t_a)?,
                own("[split] t_b", &split.t_b)?,
                own("t_c", &None)?,
            ],
            speed: speed
                .map(|law| self.read("[laws] speed_mm_per_s", law, &SPEED_NAMES))
                .transpose()?,
        })
    }

    fn tilt(&self) -> Result<Tilt, CurveError> {
        let keys = &self.0.laws;
        let angle = |key: &str, of: &Option<Formula>| self.or(key, of.as_ref(), "0", &NAMES);
        let has_angles = [&keys.a_deg, &keys.b_deg, &keys.c_deg].iter().any(|key| key.is_some());
        match &keys.normal {
            Some(_) if has_angles => Err(CurveError::Keys(
                "[laws]: use either normal or a_deg b_deg c_deg, not both".into(),
            )),
            Some([x, y, z]) => {
                let of = |law| self.read("[laws] normal", law, &NAMES);
                Ok(Tilt::Normal([of(x)?, of(y)?, of(z)?]))
            }
            None => Ok(Tilt::Angles([
                angle("[laws] a_deg", &keys.a_deg)?,
                angle("[laws] b_deg", &keys.b_deg)?,
                angle("[laws] c_deg", &keys.c_deg)?,
            ])),
        }
    }

    fn range(&self, keys: &CurveKeys) -> Result<[f64; 2], CurveError> {
        let missing = || CurveError::Keys("[curve] t: missing; expected [first, last]".into());
        let [first, last] = keys.t.as_ref().ok_or_else(missing)?;
        let range = [self.number("[curve] t", first)?, self.number("[curve] t", last)?];
        match range[0] == range[1] {
            true => {
                Err(CurveError::Keys(format!("[curve] t: both ends are {}: use a range", range[0])))
            }
            false => Ok(range),
        }
    }

    fn explicit(&self, keys: &CurveKeys, x: &Formula, y: &Formula) -> Result<Part, CurveError> {
        let split = &self.0.split;
        let own = |key: &str, of: &Option<Formula>| self.or(key, of.as_ref(), "t", &["t"]);
        let both = [self.read("[curve] x_mm", x, &["t"])?, self.read("[curve] y_mm", y, &["t"])?];
        let own = [own("[split] t_x", &split.t_x)?, own("[split] t_y", &split.t_y)?];
        let [first, last] = self.range(keys)?;
        if !(first < last) {
            let text = format!("[curve] t: {first} to {last}: expected the smaller number first");
            return Err(CurveError::Keys(text));
        }
        Ok(Part { form: Form::Explicit(Arc::new(Explicit { both, own })), range: [first, last] })
    }

    fn families(&self, keys: &CurveKeys) -> Result<(Arc<Families>, Wanted), CurveError> {
        let missing = |key: &str| CurveError::Keys(format!("[curve] {key}: missing"));
        if self.0.split.t_x.is_some() || self.0.split.t_y.is_some() {
            let text = "[split] t_x, t_y: families define x and y together; only t_z, t_a and t_b may \
                        differ";
            return Err(CurveError::Keys(text.into()));
        }
        let start = || keys.start_mm.ok_or_else(|| missing("start_mm"));
        let stops_at_turning = keys.follow == Follow::T;
        let given = keys.t_bounds.as_ref().map(|[low, high]| {
            let number = |of| self.number("[curve] t_bounds", of);
            Ok::<_, CurveError>([number(low)?, number(high)?])
        });
        let given = given.transpose()?;
        if let Some(f) = &keys.f {
            if keys.t.is_some() {
                let text = "[curve] t: along F(x, y) = 0 t is x and starts at start_mm; use t_bounds or length_mm for \
                            the end";
                return Err(CurveError::Keys(text.into()));
            }
            // Lines across X meet the curve; they touch it only where it is singular in x, y and t as well.
            let lines = Formula("x - t".into());
            let both = [
                self.read("[curve] f", f, &["x", "y"])?,
                self.read("[curve] f", &lines, &["x", "y", "t"])?,
            ];
            let bounds = given.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
            let families = Families { both, t_unit: 1.0 };
            let wanted = Wanted { start: start()?, t: None, bounds, stops_at_turning };
            return Ok((Arc::new(families), wanted));
        }
        let names = ["x", "y", "t"];
        let alpha = keys.alpha.as_ref().ok_or_else(|| missing("alpha"))?;
        let beta = keys.beta.as_ref().ok_or_else(|| missing("beta"))?;
        let both =
            [self.read("[curve] alpha", alpha, &names)?, self.read("[curve] beta", beta, &names)?];
        let t = self.range(keys)?;
        let bounds = given.unwrap_or([t[0].min(t[1]), t[0].max(t[1])]);
        let families = Families { both, t_unit: (t[1] - t[0]).abs() };
        Ok((Arc::new(families), Wanted { start: start()?, t: Some(t), bounds, stops_at_turning }))
    }
}

impl Curve {
    /// Creates the curve of a file.
    ///
    /// # Errors
    /// See [`CurveError`].
    pub fn of(file: &PathFile) -> Result<Self, CurveError> {
        let keys = file.curve.as_ref().ok_or_else(|| CurveError::Keys("no [curve]".into()))?;
        check_keys(keys)?;
        let reader = Reader(file);
        let (mut turnings, mut is_closed, mut moved_start) = (vec![], false, None);
        let is_free = [&keys.points, &keys.svg, &keys.dxf].iter().any(|file| file.is_some());
        let mut is_plane = true;
        let (is_of_families, is_level) =
            (keys.alpha.is_some() || keys.beta.is_some(), keys.f.is_some());
        let parts = match (&keys.x_mm, &keys.y_mm, is_free) {
            (Some(x), Some(y), false) if !is_of_families && !is_level => {
                vec![reader.explicit(keys, x, y)?]
            }
            (None, None, false) if is_of_families != is_level => {
                let (families, wanted) = reader.families(keys)?;
                let most = keys.length_mm.map_or(f64::INFINITY, |most| most.0);
                let found = trace(&families, &wanted, most)?;
                moved_start = MovedStart::between(wanted.start, found.start);
                (turnings, is_closed) = (found.turnings, found.is_closed);
                found.parts
            }
            (None, None, true) if !is_of_families && !is_level => {
                let found = free(keys, &file.folder)?;
                is_plane = found.is_plane;
                found.parts
            }
            _ => {
                let text = "[curve]: expected x_mm and y_mm, or alpha and beta, or f, or one of points, svg and dxf";
                return Err(CurveError::Keys(text.into()));
            }
        };
        let laws = reader.laws(is_plane)?;
        let mut curve = Self {
            parts,
            lengths: vec![],
            uses_length: laws.use_length(),
            laws,
            length: 0.0,
            turnings,
            is_closed,
            is_level,
            moved_start,
        };
        curve.measure()?;
        if let Some(most) = keys.length_mm {
            curve.cut(most.0)?;
        }
        (0..curve.parts.len()).try_for_each(|k| curve.check(k, curve.parts[k].range, HALVINGS))?;
        Ok(curve)
    }

    fn measure(&mut self) -> Result<(), CurveError> {
        for part in &self.parts {
            let lengths =
                Lengths::of(part, self.length).map_err(|trouble| first_trouble(part, trouble))?;
            self.length = lengths.end();
            self.lengths.push(lengths);
        }
        match self.length > 0.0 && self.length.is_finite() {
            true => Ok(()),
            false => Err(CurveError::Keys("[curve]: its length is 0; check the range of t".into())),
        }
    }

    /// Proves that the pose is bounded everywhere in a range: no pole lies between points at which it
    /// has a value.
    fn check(&self, part: usize, [from, to]: [f64; 2], left: u32) -> Result<(), CurveError> {
        let found = self.over(part, Interval::new(from, to))?;
        let is_bounded = |here: &Here| here.pose.iter().all(|x| x.value.magnitude().is_finite());
        if found.as_ref().is_some_and(is_bounded) {
            return Ok(());
        }
        let middle = 0.5 * (from + to);
        if left == 0 {
            // If one of them has no value, report that reason.
            [from, middle, to].into_iter().try_for_each(|at| self.at(part, at).map(drop))?;
            return Err(self.trouble(part, middle, Trouble::Pole));
        }
        self.check(part, [from, middle], left - 1)?;
        self.check(part, [middle, to], left - 1)
    }

    /// Truncates the curve at a length.
    fn cut(&mut self, most: f64) -> Result<(), CurveError> {
        if most >= self.length {
            return Ok(());
        }
        let (part, at) = self.at_length(most)?;
        self.parts.truncate(part + 1);
        self.parts[part].range[1] = at;
        self.is_closed = false;
        (self.lengths, self.length) = (vec![], 0.0);
        self.measure()
    }

    /// Returns part and parameter at an arc length.
    ///
    /// # Errors
    /// See [`CurveError`].
    pub fn at_length(&self, length: f64) -> Result<(usize, f64), CurveError> {
        let ends = self.lengths.iter().position(|lengths| lengths.end() >= length);
        let part = ends.unwrap_or(self.parts.len() - 1);
        let at = self.lengths[part].parameter(&self.parts[part], length);
        Ok((part, at.map_err(|trouble| self.trouble(part, f64::NAN, trouble))?))
    }

    /// Returns the arc length at a parameter of a part.
    ///
    /// # Errors
    /// See [`CurveError`].
    pub fn length_at(&self, part: usize, at: f64) -> Result<f64, CurveError> {
        let found = self.lengths[part].at(&self.parts[part], at);
        found.map_err(|trouble| self.trouble(part, at, trouble))
    }

    /// Encloses the poses over a range of a part's parameter; returns `None` if they cannot be enclosed.
    ///
    /// # Errors
    /// See [`CurveError`].
    pub fn over(&self, part: usize, over: Interval) -> Result<Option<Here>, CurveError> {
        let trouble = |trouble| self.trouble(part, over.middle(), trouble);
        let own = &self.parts[part];
        let Some(place) = own.at(over).map_err(trouble)? else { return Ok(None) };
        let length = match self.uses_length {
            true => {
                let ends = [self.length_at(part, over.low)?, self.length_at(part, over.high)?];
                laws::length(&place, own.dimensions(), ends)
            }
            false => Taylor::constant(0.0),
        };
        let pose = self.laws.pose(&place, length, self.length).map_err(trouble)?;
        Ok(Some(Here { pose, t: place.t }))
    }

    /// Returns the pose at a parameter of a part.
    ///
    /// # Errors
    /// See [`CurveError`].
    pub fn at(&self, part: usize, at: f64) -> Result<Here, CurveError> {
        let unsure = || {
            let text = format!("part {part} of the curve cannot be evaluated at {at}");
            CurveError::Keys(text)
        };
        self.over(part, Interval::point(at))?.ok_or_else(unsure)
    }

    /// Returns the speed of the tool tip if the file gives one, mm/s.
    ///
    /// # Errors
    /// See [`CurveError`]; a speed of 0 or less is an error.
    pub fn speed(&self, part: usize, at: f64) -> Result<Option<f64>, CurveError> {
        let Some(law) = &self.laws.speed else { return Ok(None) };
        let t = self.t(part, at);
        let length = self.length_at(part, at)?;
        let slots = [t, length, length / self.length].map(Taylor::constant);
        let trouble = |trouble| CurveError::Trouble { t, trouble };
        let speed = law.at(&slots).map_err(trouble)?.value.middle();
        match speed > 0.0 {
            true => Ok(Some(speed)),
            false => Err(CurveError::Keys(format!(
                "[laws] speed_mm_per_s: {speed} at t = {t}: expected more than 0"
            ))),
        }
    }

    fn t(&self, part: usize, at: f64) -> f64 {
        let place = self.parts[part].at(Interval::point(at)).ok().flatten();
        place.map_or(at, |place| place.t.value.middle())
    }

    fn trouble(&self, part: usize, at: f64, trouble: Trouble) -> CurveError {
        CurveError::Trouble { t: self.t(part, at), trouble }
    }
}

/// Returns the first fault among many points of a part; if there is none, the fault of its length.
fn first_trouble(part: &Part, of_length: Trouble) -> CurveError {
    const PLACES: usize = 4096;
    let [a, b] = part.range;
    let place = |k: usize| a + (b - a) * k as f64 / PLACES as f64;
    let mut troubles = (0..=PLACES).map(place).filter_map(|t| {
        let trouble = part.at(Interval::point(t)).err()?;
        Some(CurveError::Trouble { t, trouble })
    });
    troubles.next().unwrap_or(CurveError::Trouble { t: f64::NAN, trouble: of_length })
}
