// SPDX-License-Identifier: GPL-2.0-or-later
//! A spindle: a shaft on two elastic supports, and the compliance of its nose.
//!
//! The shaft is a beam of cylinders (Euler and Bernoulli: slender, no shear), divided into elements
//! with cubic displacements, which are exact for forces at their ends. Each bearing is a spring
//! against displacement, and against rotation if its angular compliance is given; a compliance
//! of 0 is rigid. At a joint the shaft is divided, and springs connect the two parts. Damping is that of
//! the bearings, projected on each mode, plus a damping ratio of the shaft itself. N, mm, s, t.

use crate::dynamics::mode::Mode;
use crate::stability::lag::Term;
use crate::study::spindle::{Section, Spindle};
use nalgebra::{DMatrix, DVector, Matrix3, Matrix4};
use std::f64::consts::{PI, TAU};

/// Largest length of an element, as a share of the shaft: frequencies of the modes used are
/// accurate to 1e-6.
const ELEMENT: f64 = 1.0 / 48.0;

/// A support of the shaft.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Support {
    /// mm/N.
    linear: f64,
    /// rad/(N mm); `None` if rotation is free.
    angular: Option<f64>,
    /// N s/mm.
    damping: f64,
}

/// Why a spindle cannot be computed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoSpindle {
    #[error("[[spindle.bearings]] at_mm = {at}: beyond the end of the shaft, {length} mm")]
    Beside { at: f64, length: f64 },
    #[error("[[spindle.bearings]] at_mm = {0} twice: expected two positions")]
    Together(f64),
    #[error("[[spindle.sections]] bore_mm = {bore}: expected less than the diameter of {outer} mm")]
    Bore { bore: f64, outer: f64 },
    #[error(
        "[[spindle.joints]] at_mm = {at}: expected less than the length of the shaft, {length} mm"
    )]
    Joint { at: f64, length: f64 },
    #[error(
        "[[spindle.joints]] at_mm = {0} is rigid: give compliance_um_per_n or angular_rad_per_n_m above 0, or remove it"
    )]
    Rigid(f64),
    #[error("[spindle] has no [[spindle.sections]]: add one or more")]
    Empty,
    #[error("[spindle] modes = 0: expected at least 1")]
    Modeless,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShaftMode {
    pub omega: f64,
    pub zeta: f64,
    /// Displacement of the nose in the mass-normalized mode, 1/√t.
    pub nose: f64,
}

impl ShaftMode {
    /// Returns the logarithmic decrement, of neighboring peaks as the vibration decays; infinite if
    /// there is no second peak.
    pub fn decrement(&self) -> f64 {
        TAU * self.zeta / (1.0 - self.zeta * self.zeta).max(0.0).sqrt()
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Nose {
    /// Static displacement per force at the nose, mm/N.
    pub compliance: f64,
    /// The modes used, lowest first.
    pub modes: Vec<ShaftMode>,
}

impl Nose {
    /// Returns the modes as terms of a receptance.
    pub fn terms(&self) -> Vec<Term> {
        let term = |mode: &ShaftMode| Term {
            gain: mode.nose * mode.nose,
            rate: 2.0 * mode.zeta * mode.omega,
            square: mode.omega * mode.omega,
        };
        self.modes.iter().map(term).collect()
    }

    /// Returns the modes at the tool tip, once along each of the two directions across the axis, which are
    /// the first two columns of `axes`. The spindle's housing counts as fixed to the platform, whose
    /// mass includes the shaft's.
    pub fn modes_across(&self, axes: &Matrix3<f64>) -> Vec<Mode> {
        let mode = |mode: &ShaftMode, k: usize| Mode {
            omega: mode.omega,
            zeta: mode.zeta,
            tip: axes.column(k) * mode.nose,
        };
        self.modes.iter().flat_map(|own| [mode(own, 0), mode(own, 1)]).collect()
    }

    /// Returns the share of the static compliance that the modes used contribute.
    pub fn share(&self) -> f64 {
        let modal = |mode: &ShaftMode| (mode.nose / mode.omega).powi(2);
        self.modes.iter().map(modal).sum::<f64>() / self.compliance
    }
}

impl Spindle {
    /// Returns the spindle with rigid joints.
    pub fn without_joints(&self) -> Self {
        Self { joints: vec![], ..self.clone() }
    }

    /// Returns the spindle with another length of its last cylinder, mm.
    pub fn with_overhang(&self, length: f64) -> Self {
        let mut other = self.clone();
        if let Some(last) = other.sections.last_mut() {
            last.length_mm.0 = length;
        }
        other
    }

    /// Returns the length of the shaft, mm.
    pub fn length(&self) -> f64 {
        self.sections.iter().map(|section| section.length_mm.0).sum()
    }

    /// Computes compliance and modes at the nose.
    ///
    /// # Errors
    /// See [`NoSpindle`].
    pub fn nose(&self) -> Result<Nose, NoSpindle> {
        self.check()?;
        let shaft = Shaft::new(self);
        Ok(shaft.nose(self.modes.into(), self.damping_ratio.0))
    }

    fn check(&self) -> Result<(), NoSpindle> {
        if self.sections.is_empty() {
            return Err(NoSpindle::Empty);
        }
        if self.modes == 0 {
            return Err(NoSpindle::Modeless);
        }
        for Section { diameter_mm, bore_mm, .. } in &self.sections {
            if !(bore_mm.0 < diameter_mm.0) {
                return Err(NoSpindle::Bore { bore: bore_mm.0, outer: diameter_mm.0 });
            }
        }
        let length = self.length();
        for bearing in &self.bearings {
            if !(bearing.at_mm.0 <= length) {
                return Err(NoSpindle::Beside { at: bearing.at_mm.0, length });
            }
        }
        for joint in &self.joints {
            if !(joint.at_mm.0 < length) {
                return Err(NoSpindle::Joint { at: joint.at_mm.0, length });
            }
            if joint.compliance_um_per_n.0 == 0.0 && joint.angular_rad_per_n_m.0 == 0.0 {
                return Err(NoSpindle::Rigid(joint.at_mm.0));
            }
        }
        let [first, second] = self.bearings.map(|bearing| bearing.at_mm.0);
        if first == second { Err(NoSpindle::Together(first)) } else { Ok(()) }
    }

    /// Returns bending stiffness (N mm²) and mass per length (t/mm) of a cylinder.
    fn cross_section(&self, section: &Section) -> [f64; 2] {
        let [outer, bore] = [section.diameter_mm.0, section.bore_mm.0];
        let bending = self.youngs_n_per_mm2.0 * PI / 64.0 * (outer.powi(4) - bore.powi(4));
        // kg/m³ is 1e-12 t/mm³.
        let area = PI / 4.0 * (outer.powi(2) - bore.powi(2));
        [bending, self.density_kg_per_m3.0 * 1e-12 * area]
    }
}

/// The matrices of a shaft, over displacement and rotation of each free node, and of both sides of a joint.
struct Shaft {
    stiffness: DMatrix<f64>,
    mass: DMatrix<f64>,
    damping: DMatrix<f64>,
    /// Row of the displacement of the nose; `None` if the nose is on a rigid support.
    nose: Option<usize>,
}

impl Shaft {
    fn new(spindle: &Spindle) -> Self {
        let nodes = nodes(spindle);
        let joints = Joints::new(spindle, &nodes);
        let size = joints.size;
        let mut stiffness = DMatrix::zeros(size, size);
        let mut mass = DMatrix::zeros(size, size);
        let mut damping = DMatrix::zeros(size, size);
        for (k, pair) in nodes.windows(2).enumerate() {
            let middle = (pair[0] + pair[1]) / 2.0;
            let [bending, density] = spindle.cross_section(section_at(spindle, middle));
            let length = pair[1] - pair[0];
            let (own, inert) = (beam_stiffness(length) * bending, beam_mass(length) * density);
            let [[a, b], [c, d]] = [joints.front[k], joints.rear[k + 1]];
            let rows = [a, b, c, d];
            for (i, row) in rows.into_iter().enumerate() {
                for (j, column) in rows.into_iter().enumerate() {
                    stiffness[(row, column)] += own[(i, j)];
                    mass[(row, column)] += inert[(i, j)];
                }
            }
        }
        for ([one, other], spring) in joints.springs {
            stiffness[(one, one)] += spring;
            stiffness[(other, other)] += spring;
            stiffness[(one, other)] -= spring;
            stiffness[(other, one)] -= spring;
        }
        let mut held = vec![];
        for bearing in &spindle.bearings {
            let row = joints.rear[nearest(&nodes, bearing.at_mm.0)][0];
            let support = Support {
                linear: bearing.compliance_um_per_n.0 * 1e-3,
                // rad/(N m) is 1e-3 rad/(N mm).
                angular: bearing.angular_rad_per_n_m.map(|value| value.0 * 1e-3),
                damping: bearing.damping_n_s_per_mm.0,
            };
            match support.linear > 0.0 {
                true => stiffness[(row, row)] += 1.0 / support.linear,
                false => held.push(row),
            }
            match support.angular {
                Some(angular) if angular > 0.0 => stiffness[(row + 1, row + 1)] += 1.0 / angular,
                Some(_) => held.push(row + 1),
                None => {}
            }
            damping[(row, row)] += support.damping;
        }
        let free: Vec<usize> = (0..size).filter(|row| !held.contains(row)).collect();
        let kept = |matrix: DMatrix<f64>| matrix.select_rows(&free).select_columns(&free);
        let end = joints.rear[nodes.len() - 1][0];
        let nose = free.iter().position(|row| *row == end);
        Self { stiffness: kept(stiffness), mass: kept(mass), damping: kept(damping), nose }
    }

    fn nose(&self, modes: usize, own: f64) -> Nose {
        let rigid = Nose { compliance: 0.0, modes: vec![] };
        // Two supports prevent rigid motion. The nose may be on a rigid support.
        let (Some(nose), Some(solved), Some(root)) =
            (self.nose, self.stiffness.clone().cholesky(), self.mass.clone().cholesky())
        else {
            return rigid;
        };
        let size = self.stiffness.nrows();
        let mut force = DVector::zeros(size);
        force[nose] = 1.0;
        let compliance = solved.solve(&force)[nose];
        // The largest eigenvalues of Lᵀ K⁻¹ L are the lowest frequencies, to full accuracy.
        let root = root.l();
        let yields = root.transpose() * solved.solve(&root);
        let eigen = ((&yields + yields.transpose()) / 2.0).symmetric_eigen();
        let mut order: Vec<usize> = (0..size).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        let mode = |k: usize| {
            let omega = eigen.eigenvalues[k].recip().sqrt();
            // φ = K⁻¹ L y ω², with the eigenvector y.
            let shape = solved.solve(&(&root * eigen.eigenvectors.column(k))) * (omega * omega);
            let lost = shape.dot(&(&self.damping * &shape));
            ShaftMode { omega, zeta: own + lost / (2.0 * omega), nose: shape[nose] }
        };
        Nose { compliance, modes: order.into_iter().take(modes).map(mode).collect() }
    }
}

/// Rows of displacement and rotation of the nodes, and the springs of the joints.
struct Joints {
    size: usize,
    /// Of the side of a node towards the rear end, which bearings support.
    rear: Vec<[usize; 2]>,
    /// Of the side towards the nose; equal to those of `rear` where a joint does not yield.
    front: Vec<[usize; 2]>,
    springs: Vec<([usize; 2], f64)>,
}

impl Joints {
    fn new(spindle: &Spindle, nodes: &[f64]) -> Self {
        let mut all = Self { size: 0, rear: vec![], front: vec![], springs: vec![] };
        let mut compliance = vec![[0.0; 2]; nodes.len()];
        for joint in &spindle.joints {
            let own = &mut compliance[nearest(nodes, joint.at_mm.0)];
            // um/N and rad/(N m) are 1e-3 mm/N and 1e-3 rad/(N mm).
            own[0] += joint.compliance_um_per_n.0 * 1e-3;
            own[1] += joint.angular_rad_per_n_m.0 * 1e-3;
        }
        for own in compliance {
            let rear = [all.size, all.size + 1];
            all.size += 2;
            let mut front = rear;
            for (k, yielding) in own.into_iter().enumerate().filter(|(_, value)| *value > 0.0) {
                front[k] = all.size;
                all.size += 1;
                all.springs.push(([rear[k], front[k]], 1.0 / yielding));
            }
            all.rear.push(rear);
            all.front.push(front);
        }
        all
    }
}

fn nearest(nodes: &[f64], place: f64) -> usize {
    let away = |node: &usize| (nodes[*node] - place).abs();
    (0..nodes.len()).min_by(|a, b| away(a).total_cmp(&away(b))).unwrap_or_default()
}

/// Returns the ends of the elements: ends of cylinders, bearings, joints, and points that divide long pieces between them.
fn nodes(spindle: &Spindle) -> Vec<f64> {
    let mut ends = vec![0.0];
    for section in &spindle.sections {
        ends.push(ends[ends.len() - 1] + section.length_mm.0);
    }
    let length = spindle.length();
    ends.extend(spindle.bearings.map(|bearing| bearing.at_mm.0));
    ends.extend(spindle.joints.iter().map(|joint| joint.at_mm.0));
    ends.sort_by(f64::total_cmp);
    // A bearing or joint at the end of a cylinder shares its node.
    ends.dedup_by(|a, b| (*a - *b).abs() < 1e-9 * length);
    let mut nodes = vec![ends[0]];
    for pair in ends.windows(2) {
        let count = ((pair[1] - pair[0]) / (ELEMENT * length)).ceil().max(1.0) as usize;
        let share = |k: usize| pair[0] + (pair[1] - pair[0]) * k as f64 / count as f64;
        nodes.extend((1..=count).map(share));
    }
    nodes
}

fn section_at(spindle: &Spindle, place: f64) -> &Section {
    let mut end = 0.0;
    let reaches = |section: &&Section| {
        end += section.length_mm.0;
        place < end
    };
    let last = &spindle.sections[spindle.sections.len() - 1];
    spindle.sections.iter().find(reaches).unwrap_or(last)
}

/// Returns the matrix over displacement and rotation of both ends, for a bending stiffness of 1.
#[rustfmt::skip]
fn beam_stiffness(l: f64) -> Matrix4<f64> {
    Matrix4::new(
        12.0,     6.0 * l,      -12.0,    6.0 * l,
        6.0 * l,  4.0 * l * l,  -6.0 * l, 2.0 * l * l,
        -12.0,    -6.0 * l,     12.0,     -6.0 * l,
        6.0 * l,  2.0 * l * l,  -6.0 * l, 4.0 * l * l,
    ) / l.powi(3)
}

/// Returns the matrix over displacement and rotation of both ends, for a mass per length of 1.
#[rustfmt::skip]
fn beam_mass(l: f64) -> Matrix4<f64> {
    Matrix4::new(
        156.0,     22.0 * l,      54.0,      -13.0 * l,
        22.0 * l,  4.0 * l * l,   13.0 * l,  -3.0 * l * l,
        54.0,      13.0 * l,      156.0,     -22.0 * l,
        -13.0 * l, -3.0 * l * l,  -22.0 * l, 4.0 * l * l,
    ) * (l / 420.0)
}
