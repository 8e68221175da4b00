// SPDX-License-Identifier: GPL-2.0-or-later
//! Curves of DXF drawings in ASCII form: LINE, ARC, CIRCLE, ELLIPSE, LWPOLYLINE, POLYLINE and
//! SPLINE, without approximation.

use crate::element::Element;
use crate::ellipse::Ellipse;
use crate::file::CurveKeys;
use crate::join::{JoinError, Strand, joined};
use crate::spline::{Spline, SplineError};
use ::dxf::entities::{Entity, EntityType};
use ::dxf::enums::Units;
use ::dxf::{Drawing, Point, Vector};
use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeSet;
use std::f64::consts::TAU;

/// Largest gap between joined ends of entities, mm: accepts ends that a drawing program writes with four
/// decimals.
const JOIN: f64 = 1e-3;

/// Why the curves of a drawing cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum DxfError {
    #[error("not a DXF drawing: {0}")]
    Read(#[from] ::dxf::DxfError),
    #[error("{0}")]
    Form(String),
    #[error("[curve] {0}")]
    Keys(String),
    #[error("{name}: {text}")]
    Entity { name: String, text: String },
    #[error(transparent)]
    Join(#[from] JoinError),
}

/// Reads the curves of a drawing, joined end to end, mm.
///
/// # Errors
/// See [`DxfError`].
pub fn elements(bytes: &[u8], keys: &CurveKeys) -> Result<Vec<Element>, DxfError> {
    check(bytes)?;
    let drawing = Drawing::load(&mut &bytes[..])?;
    let unit = match keys.dxf_unit_mm {
        Some(unit) => unit.0,
        None => unit_of(drawing.header.default_drawing_units)?,
    };
    let taken = taken(&drawing, keys)?;
    let strands: Vec<Strand> =
        taken.iter().map(|entity| strand(entity, unit)).collect::<Result<_, _>>()?;
    Ok(joined(strands, keys.dxf_join_mm.map_or(JOIN, |join| join.0))?)
}

/// Rejects what the library would ignore: a truncated drawing, and coordinates that are not finite
/// numbers.
fn check(bytes: &[u8]) -> Result<(), DxfError> {
    let form = |text: String| Err(DxfError::Form(text));
    if bytes.starts_with(b"AutoCAD Binary DXF") {
        return form("a binary DXF drawing: save it as ASCII DXF".into());
    }
    if !bytes.trim_ascii_end().ends_with(b"EOF") {
        return form("not a complete DXF drawing: the line EOF at its end is missing".into());
    }
    let lines: Vec<&[u8]> = bytes.split(|byte| *byte == b'\n').map(<[u8]>::trim_ascii).collect();
    for (k, [code, value]) in lines.as_chunks().0.iter().enumerate() {
        let line = 2 * k + 1;
        let code: Option<i32> = std::str::from_utf8(code).ok().and_then(|code| code.parse().ok());
        let Some(code) = code else {
            return form(format!("not a DXF drawing: line {line}: expected a group code"));
        };
        let value = String::from_utf8_lossy(value);
        let is_finite = || value.parse().is_ok_and(f64::is_finite);
        if matches!(code, 10..60 | 210..240) && !is_finite() {
            return form(format!("line {}: {value}: expected a finite number", line + 1));
        }
    }
    Ok(())
}

/// Returns the millimeters per unit of the drawing.
fn unit_of(units: Units) -> Result<f64, DxfError> {
    Ok(match units {
        Units::Millimeters => 1.0,
        Units::Centimeters => 10.0,
        Units::Decimeters => 100.0,
        Units::Meters => 1000.0,
        Units::Microns => 1e-3,
        Units::Inches => 25.4,
        Units::Feet => 304.8,
        Units::Yards => 914.4,
        Units::Mils => 0.0254,
        Units::Microinches => 25.4e-6,
        other => {
            let text = format!(
                "dxf_unit_mm is missing, and $INSUNITS of the drawing is {}, {other:?}: set 1 for a \
                 drawing in mm, 25.4 for inches",
                other as i16
            );
            return Err(DxfError::Keys(text));
        }
    })
}

/// Returns the entities that the keys select, with their numbers.
fn taken<'a>(drawing: &'a Drawing, keys: &CurveKeys) -> Result<Vec<(usize, &'a Entity)>, DxfError> {
    let all = || drawing.entities().filter(|entity| !entity.common.is_in_paper_space);
    if let Some(handles) = &keys.dxf_handles {
        let own: Vec<String> = all().map(|entity| entity.common.handle.as_string()).collect();
        let is_own = |handle: &str| own.iter().any(|own| own.eq_ignore_ascii_case(handle));
        if let Some(handle) = handles.iter().find(|handle| !is_own(handle)) {
            let text = format!("dxf_handles: the drawing has no entity {handle:?}");
            return Err(DxfError::Keys(text));
        }
    }
    let is_taken = |entity: &Entity| {
        let own = entity.common.handle.as_string();
        let is_named = |handle: &String| handle.eq_ignore_ascii_case(&own);
        let by_layer = |layer: &String| layer.eq_ignore_ascii_case(&entity.common.layer);
        keys.dxf_layer.as_ref().is_none_or(by_layer)
            && keys.dxf_handles.as_ref().is_none_or(|handles| handles.iter().any(is_named))
    };
    let found: Vec<_> = (1..).zip(all()).filter(|(_, entity)| is_taken(entity)).collect();
    if !found.is_empty() {
        return Ok(found);
    }
    let layers: BTreeSet<&str> = all().map(|entity| entity.common.layer.as_str()).collect();
    let layers = Vec::from_iter(layers).join(", ");
    Err(match (&keys.dxf_layer, layers.is_empty()) {
        (_, true) => DxfError::Form("the drawing has no entities: check the file".into()),
        (Some(layer), false) => DxfError::Keys(format!(
            "dxf_layer: nothing usable on {layer:?}; there are entities on {layers}"
        )),
        (None, false) => DxfError::Keys("dxf_handles: expected at least one".into()),
    })
}

fn strand((number, entity): &(usize, &Entity), unit: f64) -> Result<Strand, DxfError> {
    let (kind, found) = curves(&entity.specific, entity.common.elevation, unit);
    let (layer, handle) = (&entity.common.layer, entity.common.handle.as_string());
    let name = format!("entity {number} ({kind} {handle} on layer {layer})");
    let refused = |text: String| DxfError::Entity { name: name.clone(), text };
    let elements = found.map_err(refused)?;
    if !elements.iter().all(Element::is_finite) {
        return Err(refused("a number is too large".into()));
    }
    Strand::new(name.clone(), elements).ok_or_else(|| refused("its length is 0: remove it".into()))
}

/// Returns the type of an entity, and its curves.
fn curves(
    entity: &EntityType,
    elevation: f64,
    unit: f64,
) -> (&'static str, Result<Vec<Element>, String>) {
    match entity {
        EntityType::Line(line) => ("LINE", straight(place(&line.p1), place(&line.p2), unit)),
        EntityType::Arc(arc) => {
            let angles = [arc.start_angle, arc.end_angle].map(f64::to_radians);
            ("ARC", circle(&arc.center, arc.radius, &arc.normal, angles, unit))
        }
        EntityType::Circle(own) => {
            ("CIRCLE", circle(&own.center, own.radius, &own.normal, [0.0, TAU], unit))
        }
        EntityType::Ellipse(own) => ("ELLIPSE", ellipse(own, unit)),
        EntityType::LwPolyline(line) => {
            let of = |v: &::dxf::LwPolylineVertex| (Vector3::new(v.x, v.y, elevation), v.bulge);
            let vertices: Vec<_> = line.vertices.iter().map(of).collect();
            let own = axes(&line.extrusion_direction).map(|axes| axes * unit);
            ("LWPOLYLINE", own.and_then(|own| bulged(&vertices, line.is_closed(), &own)))
        }
        EntityType::Polyline(line) => ("POLYLINE", polyline(line, unit)),
        EntityType::Spline(spline) => ("SPLINE", free(spline, unit)),
        EntityType::Insert(_) => {
            ("INSERT", Err("a block: explode it in the drawing program".into()))
        }
        _ => {
            let text = "not a curve: put curves on a separate layer, and name it in dxf_layer";
            ("another kind", Err(text.into()))
        }
    }
}

fn place(p: &Point) -> Vector3<f64> {
    Vector3::new(p.x, p.y, p.z)
}

/// Returns the axes of an entity's coordinate system from its extrusion direction, by the arbitrary axis
/// algorithm of the DXF reference.
fn axes(normal: &Vector) -> Result<Matrix3<f64>, String> {
    let z = Vector3::new(normal.x, normal.y, normal.z);
    let z = z.try_normalize(0.0).ok_or("its extrusion direction is zero")?;
    let is_near_z = z.x.abs() < 1.0 / 64.0 && z.y.abs() < 1.0 / 64.0;
    let x = if is_near_z { Vector3::y().cross(&z) } else { Vector3::z().cross(&z) }.normalize();
    Ok(Matrix3::from_columns(&[x, z.cross(&x), z]))
}

fn line(a: Vector3<f64>, b: Vector3<f64>) -> Result<Option<Element>, String> {
    let line = (a != b).then(|| Element::bezier(&[a, b])).transpose();
    line.map_err(|error: SplineError| error.to_string())
}

fn straight(a: Vector3<f64>, b: Vector3<f64>, unit: f64) -> Result<Vec<Element>, String> {
    Ok(line(a * unit, b * unit)?.into_iter().collect())
}

/// Increases the second angle to be above the first one.
fn ahead([from, to]: [f64; 2]) -> [f64; 2] {
    let turn = (to - from).rem_euclid(TAU);
    [from, from + if turn > 0.0 { turn } else { TAU }]
}

fn circle(
    centre: &Point,
    radius: f64,
    normal: &Vector,
    angles: [f64; 2],
    unit: f64,
) -> Result<Vec<Element>, String> {
    if !(radius > 0.0) {
        return Err(format!("radius {radius}: expected more than 0"));
    }
    let own = axes(normal)? * unit;
    let half = |axis: Vector3<f64>| own * axis * radius;
    let halves = [half(Vector3::x()), half(Vector3::y())];
    Ok(vec![Element::Ellipse(Ellipse::new(own * place(centre), halves, ahead(angles)))])
}

fn ellipse(own: &::dxf::entities::Ellipse, unit: f64) -> Result<Vec<Element>, String> {
    let major = Vector3::new(own.major_axis.x, own.major_axis.y, own.major_axis.z) * unit;
    let ratio = own.minor_axis_ratio;
    if !(ratio > 0.0 && major.norm() > 0.0) {
        let text =
            format!("a ratio of {ratio} to an axis of {}: expected more than 0", major.norm());
        return Err(text);
    }
    let minor = axes(&own.normal)?.column(2).cross(&major) * ratio;
    let angles = ahead([own.start_parameter, own.end_parameter]);
    Ok(vec![Element::Ellipse(Ellipse::new(place(&own.center) * unit, [major, minor], angles))])
}

/// Connects vertices by lines and arcs. The bulge of a vertex is that of the segment after it: the tangent of a
/// quarter of the arc's angle.
fn bulged(
    vertices: &[(Vector3<f64>, f64)],
    is_closed: bool,
    own: &Matrix3<f64>,
) -> Result<Vec<Element>, String> {
    let mut all = vec![];
    let next = vertices.iter().cycle().skip(1);
    let count = if is_closed { vertices.len() } else { vertices.len().saturating_sub(1) };
    for ((a, bulge), (b, _)) in vertices.iter().zip(next).take(count) {
        if a == b {
            continue;
        }
        match *bulge == 0.0 {
            true => all.extend(line(own * a, own * b)?),
            false => all.push(bulge_of(a, b, *bulge, own)),
        }
    }
    Ok(all)
}

fn bulge_of(a: &Vector3<f64>, b: &Vector3<f64>, bulge: f64, own: &Matrix3<f64>) -> Element {
    let left = |v: Vector3<f64>| Vector3::new(-v.y, v.x, 0.0);
    let centre = (a + b) * 0.5 + left(b - a) * ((1.0 - bulge * bulge) / (4.0 * bulge));
    let first = a - centre;
    let halves = [own * first, own * left(first)];
    Element::Ellipse(Ellipse::new(own * centre, halves, [0.0, 4.0 * bulge.atan()]))
}

fn polyline(line: &::dxf::entities::Polyline, unit: f64) -> Result<Vec<Element>, String> {
    if line.is_3d_polygon_mesh() || line.is_polyface_mesh() {
        return Err("a mesh is not a curve: remove it".into());
    }
    if line.curve_fit_vertices_added() || line.spline_fit_vertices_added() {
        return Err("a polyline with a fitted curve: save it as SPLINE, or without the fit".into());
    }
    let own = match line.is_3d_polyline() {
        true => Matrix3::identity(),
        false => axes(&line.normal)?,
    };
    // Vertices of a planar polyline have the polyline's height, not their own.
    let height = |z: f64| if line.is_3d_polyline() { z } else { line.location.z };
    let of = |v: &::dxf::entities::Vertex| {
        (Vector3::new(v.location.x, v.location.y, height(v.location.z)), v.bulge)
    };
    let vertices: Vec<_> = line.vertices().map(of).collect();
    bulged(&vertices, line.is_closed(), &(own * unit))
}

fn free(own: &::dxf::entities::Spline, unit: f64) -> Result<Vec<Element>, String> {
    if own.control_points.is_empty() {
        return Err("only fit points: save the spline with its control points".into());
    }
    let degree = usize::try_from(own.degree_of_curve).unwrap_or(0);
    let points: Vec<[f64; 3]> =
        own.control_points.iter().map(|p| [p.x, p.y, p.z].map(|x| x * unit)).collect();
    let weights = (!own.weight_values.is_empty()).then_some(&own.weight_values[..]);
    let spline = Spline::new(degree, &points, weights, Some(own.knot_values.clone()));
    let spline = spline.map_err(|error| error.to_string())?;
    let [start, end] = spline.ends().map(Vector3::from);
    let gap = (start - end).norm();
    if own.is_closed() && gap > JOIN {
        return Err(format!("it is marked as closed, but its ends are {gap:.6} mm apart"));
    }
    Ok(vec![Element::Spline(spline)])
}
