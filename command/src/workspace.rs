// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm workspace`.

use super::failure::{Failure, refused};
use super::poses::Tool;
use super::{Bar, MachineFile, StudyFile, Verdict, output};
use draw::plot::Plot;
use draw::workspace::of_workspace;
use kinematics::{Letter, Vector3};
use machine::digits::plain;
use machine::files::write_whole;
use machine::read::ini::Ini;
use machine::read::machine::{Lenient, MachineConfig};
use machine::read::mechanism::Mechanism;
use serde_json::{Value, json};
use std::io::Write;
use std::num::NonZero;
use std::path::PathBuf;
use std::time::Instant;
use studies::study::body::{Body, Counted, Effort, counted, csv, obj};
use studies::study::file::Study;
use studies::study::slice::{Plane, Slice};
use studies::study::workspace::{Border, Ray, Stand, Workspace, tilts};

/// Number of directions of a tilt.
const DIRECTIONS: usize = 12;
/// Number of rays of a slice.
const SLICE_RAYS: usize = 720;
/// Names of the axes of positions.
const NAMES: [&str; 3] = ["X", "Y", "Z"];
/// Number of steps along a ray.
const STEPS: f64 = 300.0;

/// Compute the workspace of the tool, and what limits it
///
/// Follows rays from one point (home, or --from) to the first violated limit: joint ranges,
/// cones, ROD_CLEARANCE and reach from the INI file; rod diameter, minimum conditioning, and the
/// rotations of cardan joints at base and platform about their two axes from a study file.
/// [AXIS_*] limits do not count. Positions count if one orientation is possible, or all
/// orientations of a set: several --orientation, or --tilt in twelve directions. Reports the
/// extent along X Y Z, the volume within the boundary and by counting grid points, the share of
/// directions that each limit ends, and for each slice its area and the angles that it spans as
/// seen from the machine's origin. Features thinner than a step along a ray can be missed. On a
/// planar machine, such as a five-bar, all rays are in its plane, and the report has its area.
///
/// For two mechanisms it reports each one alone; with the other one at home; and with the other
/// one anywhere: at home and, one after another, in the reachable corners of its axis limits.
/// Rods and platforms keep [PKM]MECHANISM_CLEARANCE.
///
///     [legs]
///     rod_diameter_mm = 30
///     [limits]
///     conditioning = 0.1
///     base_pyramid_deg = [40, 30]  # about the fixed axis of the base joint, and across it
///     base_axes = [[0, 1, 0], ...] # one per leg [default: BASE_N of the INI file]
///     platform_pyramid_deg = [40, 30] # for the platform joints, in the platform frame
///     platform_axes = [[1, 0, 0], ...] # one per leg [default: PLATFORM_N]
///
/// Exit status: 0, or 2 if there is no workspace around the point, or input or output failed.
#[derive(clap::Args, Debug)]
#[command(verbatim_doc_comment)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
    #[command(flatten)]
    study: StudyFile,
    #[command(flatten)]
    tool: Tool,
    /// Point inside the workspace from which the rays start [default: home]
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_negative_numbers = true)]
    from: Option<Vec<f64>>,
    /// Orientation that every position must allow; repeatable
    #[arg(long, num_args = 3, value_names = ["A", "B", "C"], allow_negative_numbers = true)]
    orientation: Vec<f64>,
    /// Tilt that every position must allow in every direction, as well as a level platform
    #[arg(long, value_name = "DEGREES", conflicts_with = "orientation")]
    tilt: Option<f64>,
    /// With --mechanism: keep MECHANISM_CLEARANCE from the other mechanism, at home or anywhere
    /// (home and the corners of its axis limits)
    #[arg(long, value_name = "STAND", value_enum, requires = "mechanism")]
    beside: Option<Beside>,
    /// Plane of a slice: xy, xz, yz, or a normal such as 1,1,0; repeatable [default: xz and yz, or
    /// the plane of a planar machine]
    #[arg(long, value_name = "PLANE")]
    plane: Vec<String>,
    /// Number of rays from pole to pole; twice as many around
    #[arg(long, value_name = "N", default_value_t = 60, value_parser = clap::value_parser!(u16).range(4..=2000))]
    bands: u16,
    /// Number of grid points along the longest side
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u16).range(4..=2000))]
    grid: u16,
    /// Number of threads [default: number of cores]
    #[arg(long, value_name = "N")]
    threads: Option<NonZero<usize>>,
    /// Write the points of the boundary as CSV
    #[arg(long, value_name = "FILE.csv", value_hint = clap::ValueHint::FilePath)]
    csv: Option<PathBuf>,
    /// Write the surface around the point as a Wavefront OBJ file
    #[arg(long, value_name = "FILE.obj", value_hint = clap::ValueHint::FilePath)]
    mesh: Option<PathBuf>,
    /// Draw body and slices as SVG files into this folder (created if needed)
    #[arg(long, value_name = "FOLDER", value_hint = clap::ValueHint::DirPath)]
    plots: Option<PathBuf>,
}

/// Where the other one of two mechanisms stands.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Beside {
    Home,
    Anywhere,
}

impl Beside {
    fn stand(self) -> Stand {
        match self {
            Self::Home => Stand::Home,
            Self::Anywhere => Stand::Anywhere,
        }
    }
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let ini = Ini::read(&arguments.machine.machine)?;
    let whole = MachineConfig::leniently(&ini, Some(Lenient::Constraints))?;
    let study = arguments.study.read()?;
    // 0: as many as there are processors.
    let threads = arguments.threads.map_or(0, NonZero::get);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
    let (meant, other) = match arguments.machine.mechanism {
        None if whole.mechanisms.len() > 1 => return both(arguments, &whole, &study, &pool),
        meant => arguments.machine.of(&whole, meant)?,
    };
    let mut workspace = workspace(arguments, meant, &study)?;
    if let Some(beside) = arguments.beside {
        let text = "--beside: the file has only one mechanism; remove --beside";
        let other = other.ok_or_else(|| refused(text))?;
        workspace = workspace.beside(whole.first(), other, beside.stand())?;
    }
    let planes = planes(arguments, &workspace)?;
    let from = match arguments.from.as_deref() {
        Some(from) => Vector3::from_column_slice(from),
        // Home need not keep the clearance from the other mechanism.
        None if arguments.beside.is_some() => {
            workspace.place_inside().unwrap_or(meant.home_pose().position)
        }
        None => meant.home_pose().position,
    };
    let start = Instant::now();
    let seen = pool.install(|| look(arguments, &workspace, from, planes))?;
    let seconds = start.elapsed().as_secs_f64();
    let Seen { body, counted, slices } = &seen;
    if let Some(file) = &arguments.csv {
        write_whole(file, &csv(body))?;
    }
    if let Some(file) = &arguments.mesh {
        write_whole(file, &obj(meant.length_unit(), &body.mesh()))?;
    }
    if let Some(folder) = &arguments.plots {
        // From its center, if inside, the resolution is the same on all sides.
        let step = workspace.extent() / STEPS;
        let bar = Bar::new("drawing the workspace");
        let progress = |share| bar.set(share);
        let effort = Effort { bands: arguments.bands.into(), step, grid: 0, progress: &progress };
        let pictured = pool.install(|| Body::seen(&workspace, body.middle(), &effort));
        let plots = of_workspace(meant, pictured.as_ref().unwrap_or(body), slices, arguments.tilt)?;
        Plot::write_all(&plots, folder)?;
    }
    let mut out = output::people();
    let answer = report(&mut out, meant, &workspace, &seen)?;
    out.flush()?;
    output::answer(&answer)?;
    let rays = slices.iter().flat_map(|slice| &slice.rays).map(|ray| ray.looked).sum::<usize>();
    let looked = (body.looked() + counted.points + rays) as f64;
    output::remark(&format!(
        "{looked} positions, {:.2} million a second, threads: {}",
        looked / seconds * 1e-6,
        pool.current_num_threads()
    ));
    Ok(Verdict::Fits)
}

fn workspace<'a>(
    arguments: &Arguments,
    config: &'a Mechanism,
    study: &Study,
) -> Result<Workspace<'a>, Failure> {
    let orientations = orientations(arguments, config)?;
    Ok(Workspace::new(config, arguments.tool.vector(config), orientations, study)?)
}

/// Computes both of two mechanisms: alone, and with the other one at home and anywhere.
fn both(
    arguments: &Arguments,
    whole: &MachineConfig,
    study: &Study,
    pool: &rayon::ThreadPool,
) -> Result<Verdict, Failure> {
    if arguments.from.is_some()
        || arguments.csv.is_some()
        || arguments.mesh.is_some()
        || arguments.plots.is_some()
    {
        let text = "--from, --csv, --mesh and --plots work for one mechanism: add --mechanism 1 or --mechanism 2";
        return Err(refused(text));
    }
    let mut out = output::people();
    let mut answers = vec![];
    for number in [1, 2] {
        let (meant, other) = arguments.machine.of(whole, Some(number))?;
        let other = other.expect("a file with two mechanisms");
        writeln!(
            out,
            "{}",
            ["The first mechanism", "\nThe second mechanism"][usize::from(number) - 1]
        )?;
        let alone = workspace(arguments, meant, study)?;
        let home = meant.home_pose().position;
        let seen = pool.install(|| look(arguments, &alone, home, planes(arguments, &alone)?))?;
        let mut answer = report(&mut out, meant, &alone, &seen)?;
        for (beside, key, name) in [
            (Beside::Home, "beside_home", "the other one at home"),
            (Beside::Anywhere, "beside_anywhere", "the other one anywhere"),
        ] {
            let shared =
                workspace(arguments, meant, study)?.beside(whole.first(), other, beside.stand())?;
            answer[key] = match shared.place_inside() {
                Some(from) => {
                    let seen = pool.install(|| look(arguments, &shared, from, vec![]))?;
                    report_beside(&mut out, meant, &seen, name)?
                }
                None => {
                    writeln!(
                        out,
                        "  {name}: it collides at home and in every corner of its axis limits"
                    )?;
                    Value::Null
                }
            };
        }
        answers.push(answer);
    }
    out.flush()?;
    output::answer(&json!({ "machine": whole.file, "mechanisms": answers }))?;
    Ok(Verdict::Fits)
}

/// Reports the rest of a workspace next to another mechanism.
fn report_beside(
    out: &mut impl Write,
    config: &Mechanism,
    seen: &Seen,
    name: &str,
) -> Result<Value, Failure> {
    let (unit, [boundary, grid]) =
        (config.length_unit(), [seen.body.volume(), seen.counted.volume]);
    let from = &seen.body.from;
    let share: f64 = seen
        .body
        .shares()
        .iter()
        .filter(|(limit, _)| limit.is_between)
        .map(|(_, share)| share)
        .sum();
    writeln!(
        out,
        "  {name}: {boundary:.3} {unit}^3 by the boundary, {grid:.3} on a grid; it ends {:.1} % of the \
         directions from {}",
        100.0 * share,
        words(from)
    )?;
    Ok(json!({
        "from": [from.x, from.y, from.z],
        "volume_by_boundary": boundary,
        "volume_by_grid": grid,
        "grid_points": seen.counted.points,
        "ended_by_the_other": share,
    }))
}

/// A computed workspace.
struct Seen {
    body: Body,
    counted: Counted,
    slices: Vec<Slice>,
}

fn look(
    arguments: &Arguments,
    workspace: &Workspace,
    from: Vector3<f64>,
    planes: Vec<Plane>,
) -> Result<Seen, Failure> {
    let bar = Bar::new("looking along rays");
    let effort = Effort {
        bands: arguments.bands.into(),
        step: workspace.extent() / STEPS,
        grid: arguments.grid.into(),
        progress: &|share| bar.set(share),
    };
    let body = Body::seen(workspace, from, &effort).map_err(|limit| empty(&from, limit))?;
    let counted = counted(workspace, &body.corners(), &effort);
    let slice = |plane| Slice::seen(workspace, plane, from, SLICE_RAYS, &effort);
    let slices = planes.into_iter().map(slice).collect();
    Ok(Seen { body, counted, slices })
}

fn empty(from: &Vector3<f64>, limit: Border) -> Failure {
    refused(format!(
        "{} is not in the workspace: {limit}; give a point inside with --from, or a smaller tilt",
        words(from)
    ))
}

/// Formats a position as in a program.
fn words(position: &Vector3<f64>) -> String {
    let [x, y, z] = <[f64; 3]>::from(*position).map(plain);
    format!("X{x} Y{y} Z{z}")
}

fn orientations(arguments: &Arguments, config: &Mechanism) -> Result<Vec<[f64; 3]>, Failure> {
    match arguments.tilt {
        Some(tilt) if (0.0..90.0).contains(&tilt) => {
            let all = tilts(config, tilt, DIRECTIONS);
            if tilt > 0.0 && all.len() == 1 {
                return Err(refused(format!("--tilt {tilt}: {}; remove --tilt", untilted(config))));
            }
            Ok(all)
        }
        Some(tilt) => Err(refused(format!("--tilt {tilt}: expected 0 or more, and less than 90"))),
        None if arguments.orientation.is_empty() => Ok(vec![[0.0; 3]]),
        None => Ok(arguments.orientation.chunks(3).map(|abc| [abc[0], abc[1], abc[2]]).collect()),
    }
}

/// Explains why programs cannot tilt the platform.
fn untilted(config: &Mechanism) -> String {
    let layout = config.machine.layout();
    if !layout.is_dependent(Letter::A) || !layout.is_dependent(Letter::B) {
        return "the joints move neither A nor B".into();
    }
    let commanded: Vec<String> =
        layout.coordinates().as_slice().iter().map(|letter| letter.name().to_string()).collect();
    format!("on this machine A and B follow from {}", commanded.join(" "))
}

fn planes(arguments: &Arguments, workspace: &Workspace) -> Result<Vec<Plane>, Failure> {
    let own = match workspace.axes()[..] {
        [across, up] => Some([across, up].map(|k| NAMES[k].to_ascii_lowercase()).concat()),
        _ => None,
    };
    let plane = |name: &String| {
        let text = format!("--plane {name}: expected xy, xz, yz or a normal such as 1,1,0");
        let plane = Plane::parse(name).ok_or(refused(text))?;
        match &own {
            Some(own) if !plane.name.eq_ignore_ascii_case(own) => {
                Err(refused(format!("--plane {name}: the machine moves in the plane {own} only")))
            }
            _ => Ok(plane),
        }
    };
    match (&arguments.plane[..], &own) {
        ([], Some(own)) => [own].map(plane).into_iter().collect(),
        ([], None) => ["xz", "yz"].map(|name| plane(&name.into())).into_iter().collect(),
        (given, _) => given.iter().map(plane).collect(),
    }
}

/// Prints the results as text and returns those for JSON.
fn report(
    out: &mut impl Write,
    config: &Mechanism,
    workspace: &Workspace,
    seen: &Seen,
) -> Result<Value, Failure> {
    let Seen { body, counted, slices } = seen;
    let unit = config.length_unit();
    let from = &body.from;
    let mut ways = vec![];
    writeln!(out, "{} from {}", config.file.display(), words(from))?;
    let directions = workspace.axes().into_iter().flat_map(|k| {
        let axis = Vector3::ith(k, 1.0);
        [(format!("+{}", NAMES[k]), axis), (format!("-{}", NAMES[k]), -axis)]
    });
    for (name, direction) in directions {
        let ray: Ray = workspace.ray(from, &direction, workspace.extent() / STEPS);
        writeln!(out, "  {name}      {:>14.6} {unit}: {}", ray.exit(), ray.limit)?;
        ways.push(
            json!({ "direction": name, "length": ray.exit(), "limit": ray.limit.to_string() }),
        );
    }
    let [boundary, grid] = [body.volume(), counted.volume];
    let (what, power) = if body.is_plane() { ("area", 2) } else { ("volume", 3) };
    writeln!(
        out,
        "  {what:<7} {boundary:>14.3} {unit}^{power} by the boundary, {grid:.3} on a grid of {} points: \
         {:.2} % apart",
        counted.points,
        100.0 * (boundary / grid - 1.0).abs()
    )?;
    for slice in slices {
        let seen = match slice.sector() {
            Some([low, high]) => {
                format!(
                    "seen from the origin from {low:.2} to {high:.2} degrees, {:.2} wide",
                    high - low
                )
            }
            None => "around the origin".into(),
        };
        writeln!(out, "  {:<7} {:>14.3} {unit}^2, {seen}", slice.plane.name, slice.area())?;
    }
    writeln!(out, "  share of directions by limit:")?;
    for (limit, share) in body.shares() {
        writeln!(out, "  {:>13.1} %  {limit}", 100.0 * share)?;
    }
    let slice = |slice: &Slice| json!({ "plane": slice.plane.name, "area": slice.area(), "seen_between_deg": slice.sector() });
    let shares = body.shares();
    let share =
        |(limit, share): &(Border, f64)| json!({ "limit": limit.to_string(), "share": share });
    Ok(json!({
        "machine": config.file,
        "from": [from.x, from.y, from.z],
        "ways": ways,
        (format!("{what}_by_boundary")): boundary,
        (format!("{what}_by_grid")): grid,
        "grid_points": counted.points,
        "slices": slices.iter().map(slice).collect::<Vec<_>>(),
        "limits": shares.iter().map(share).collect::<Vec<_>>(),
    }))
}
