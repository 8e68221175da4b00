// SPDX-License-Identifier: GPL-2.0-or-later
//! Legibility of every picture of every study: all text is
//! inside the sheet and overlaps nothing, axes have units, lines have keys, slices are closed.

use crate::commands::Bench;
use crate::measure;
use draw::curve::of_route;
use paths::file::PathFile;
use paths::route::route;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use test_support::shipped::{MACHINES, config, configs, ini};

/// Words of units; names of dimensionless axes say so.
const UNITS: [&str; 7] =
    [" in ", "no unit", "share", "number of the", "line of the program", "scaled", "µm/"];

/// Width of a sign in a key, pixels.
const SIGN: f64 = 32.0;

fn shared(path: &str) -> String {
    configs().join("..").join(path).display().to_string()
}

/// Returns the SVG files that commands draw, by their folders and names.
fn drawn() -> BTreeMap<String, String> {
    let study = "[legs]\nstiffness_n_per_um = 10\njoint_sigma_um = 10\nrod_diameter_mm = 30\n";
    let noise = fs::read_to_string(shared("configs/hexapod/dynamics.toml")).unwrap();
    let noise = noise.replace("seconds = 5", "seconds = 1");
    let bench = Bench::new()
        .with("study.toml", study)
        .with("dynamics.toml", &noise)
        .with("dial.csv", &measure::lab().table(2, 2.0))
        .with("turn.ngc", "G21 G90\nG1 C90 W700 F6000\nM2\n")
        .with("curve.ngc", "G21 G90\nG1 X10 F3000\nG1 Y10 Z80\nG1 X0 Y0\nM2\n");
    let hexapod = shared("configs/hexapod/hexapod.ini");
    let surface = shared("configs/hexapod/programs/five-axis-surface.ngc");
    let cutting = shared("configs/hexapod/cutting.toml");
    let lag = shared("docs/studies/examples/paper-002.toml");
    let law = shared("docs/studies/examples/paper-001.toml");
    let few = "--bands 24 --grid 8";
    let commands = [
        format!("workspace {hexapod} {few} --plane xy --plane xz --plane 1,1,0"),
        format!("workspace linear-delta.ini {few}"),
        format!("rods {hexapod} {surface} --period 0.1 --study study.toml --point 0 0 -50"),
        "rods linear-delta.ini curve.ngc --period 0.1".into(),
        format!("sensitivity {hexapod} --study {law} --law --draws 100 --rays 50"),
        format!("stiffness {hexapod} --study study.toml --grid 11"),
        "stiffness linear-delta.ini --study study.toml --grid 11".into(),
        format!("dynamics {hexapod} --study dynamics.toml --shake noise"),
        format!("stability lag --study {lag} --overhang 70 300"),
        format!("stability pose {hexapod} --study {cutting} --columns 9"),
        format!("stability map {hexapod} --study {cutting} --rpm 6000 --grid 7"),
        format!("replay {hexapod} {surface} --period 0.02"),
        "replay linear-delta.ini curve.ngc --period 0.02".into(),
        format!("replay {} turn.ngc --period 0.02", ini("lathe-counter-spindle").display()),
        format!("calibrate {} dial.csv --tolerance 0.1", ini("lab-hexapod").display()),
    ];
    let mut found = BTreeMap::new();
    for (number, words) in commands.iter().enumerate() {
        let folder = format!("{number:02}");
        let answer = bench.answer(&format!("{words} --plots {folder}"), "");
        let files = fs::read_dir(bench.0.path().join(&folder));
        let files = files.unwrap_or_else(|_| panic!("{words}: {answer}"));
        for file in files.map(|file: Result<_, _>| -> PathBuf { file.unwrap().path() }) {
            let name = file.file_name().unwrap().to_string_lossy().into_owned();
            found.insert(format!("{folder}/{name}"), fs::read_to_string(&file).unwrap());
        }
    }
    found.extend(of_paths());
    found.extend(of_machines(&bench));
    found
}

/// Returns `pkm frames` of every shipped machine.
fn of_machines(bench: &Bench) -> impl Iterator<Item = (String, String)> {
    MACHINES.into_iter().map(|machine| {
        let ini = shared(&format!("configs/{machine}/{machine}.ini"));
        let answer = bench.answer(&format!("frames {ini} -o frames.svg"), "");
        assert!(answer.ends_with("exit 0\n"), "{answer}");
        (
            format!("frames/{machine}"),
            fs::read_to_string(bench.0.path().join("frames.svg")).unwrap(),
        )
    })
}

fn of_paths() -> impl Iterator<Item = (String, String)> {
    ["pyramid-cross/paths/cycloid.toml", "hexaglide/paths/dome.toml"].into_iter().flat_map(|path| {
        let machine = path.split('/').next().unwrap();
        let file = PathFile::read(Path::new(&shared(&format!("configs/{path}")))).unwrap();
        let config = config(machine);
        let plots = of_route(&config, &route(&config, &file).unwrap()).unwrap();
        plots.into_iter().map(move |plot| (format!("{machine}/{}", plot.file), plot.svg))
    })
}

/// A text with its bounding box: left, right, top, bottom.
struct Text {
    words: String,
    bounds: [f64; 4],
    is_upright: bool,
}

fn number(node: roxmltree::Node, name: &str) -> f64 {
    node.attribute(name).unwrap_or_else(|| panic!("{name}")).parse().unwrap()
}

fn texts(sheet: &roxmltree::Document) -> Vec<Text> {
    let nodes = sheet.descendants().filter(|node| node.has_tag_name("text"));
    let text = |node: roxmltree::Node| {
        let words = node.text().unwrap_or_default().trim().to_string();
        let (x, y, size) = (number(node, "x"), number(node, "y"), number(node, "font-size"));
        // Letters of usual fonts are half as wide as high, and extend this far above and below their center.
        let (wide, high) = (0.5 * size * words.chars().count() as f64, 0.8 * size);
        let left = match node.attribute("text-anchor").unwrap() {
            "start" => 0.0,
            "middle" => -wide / 2.0,
            _ => -wide,
        };
        let top = match node.attribute("dy").unwrap() {
            "0.76em" => 0.0,
            "-0.5ex" => -high,
            _ => -high / 2.0,
        };
        let is_upright = node.attribute("transform").is_some();
        let bounds = match is_upright {
            // Rotated about its position by three quarters.
            true => [x + top, x + top + high, y - left - wide, y - left],
            false => [x + left, x + left + wide, y + top, y + top + high],
        };
        Text { words, bounds, is_upright }
    };
    nodes.map(text).collect()
}

/// A line with its color and width.
type Line<'a> = ((&'a str, &'a str), Vec<(f64, f64)>);

fn lines<'a>(sheet: &'a roxmltree::Document) -> Vec<Line<'a>> {
    let nodes = sheet.descendants().filter(|node| node.has_tag_name("polyline"));
    let line = |node: roxmltree::Node<'a, '_>| {
        let pair = |pair: &str| -> (f64, f64) {
            let (x, y) = pair.split_once(',').unwrap();
            (x.parse().unwrap(), y.parse().unwrap())
        };
        let points = node.attribute("points").unwrap().split_whitespace().map(pair).collect();
        let style = (node.attribute("stroke").unwrap(), node.attribute("stroke-width").unwrap());
        (style, points)
    };
    nodes.map(line).collect()
}

fn is_sign(points: &[(f64, f64)]) -> bool {
    matches!(points, [a, b] if a.1 == b.1 && b.0 - a.0 == SIGN)
}

fn size(sheet: &roxmltree::Document) -> [f64; 2] {
    ["width", "height"].map(|name| number(sheet.root_element(), name))
}

fn nothing_overlaps(name: &str, sheet: &roxmltree::Document) {
    let [width, height] = size(sheet);
    let texts = texts(sheet);
    for (k, text) in texts.iter().enumerate() {
        let [left, right, top, bottom] = text.bounds;
        let is_inside = left >= 0.0 && right <= width && top >= 0.0 && bottom <= height;
        assert!(is_inside, "{name}: {:?} at {:?}", text.words, text.bounds);
        for other in &texts[..k] {
            let [l, r, t, b] = other.bounds;
            let is_apart = right <= l || r <= left || bottom <= t || b <= top;
            assert!(is_apart, "{name}: {:?} covers {:?}", text.words, other.words);
        }
    }
}

fn axes_have_units(name: &str, sheet: &roxmltree::Document) {
    let texts = texts(sheet);
    let has_unit = |words: &str| UNITS.iter().any(|unit| words.contains(unit));
    let upright: Vec<&Text> = texts.iter().filter(|text| text.is_upright).collect();
    for text in &upright {
        assert!(has_unit(&text.words), "{name}: {:?}", text.words);
    }
    // The horizontal axis has the lowest text; in space X, Y and Z have theirs.
    let lowest = texts.iter().filter(|text| !text.is_upright && !text.words.starts_with("along"));
    let lowest = lowest.max_by(|a, b| a.bounds[3].total_cmp(&b.bounds[3])).unwrap();
    if upright.is_empty() {
        let named = texts.iter().filter(|text| has_unit(&text.words)).count();
        assert!(named >= 3, "{name}: {named} names with units");
    } else if name.starts_with("frames/") {
        // The key is below both views.
        assert_eq!(texts.iter().filter(|text| text.words.contains(" in ")).count(), 4, "{name}");
    } else if !name.contains("ellipsoid") {
        let is_number = name.contains("sensitivity-");
        assert!(is_number || has_unit(&lowest.words), "{name}: {:?}", lowest.words);
    }
    let odd = texts.iter().find(|t| t.words.contains("cos") || t.words.contains("(Y"));
    assert!(odd.is_none(), "{name}: the label of an axis is not plain");
}

fn lines_have_keys_and_stay_inside(name: &str, sheet: &roxmltree::Document) {
    let [width, height] = size(sheet);
    let lines = lines(sheet);
    let keys: Vec<_> = lines.iter().filter(|(_, points)| is_sign(points)).map(|l| l.0).collect();
    let curves = || lines.iter().filter(|(_, points)| points.len() > 4);
    let mut styles: Vec<_> = curves().map(|line| line.0).collect();
    styles.sort_unstable();
    styles.dedup();
    // A strip's single line has its name next to it.
    let is_alone = styles.len() == 1 && keys.iter().all(|key| key.1 == "3");
    for style in styles.iter().filter(|_| !is_alone && !name.contains("tool-path.svg")) {
        // Isolines are labeled; the ends of limits of a map too.
        let is_isoline = style == &("#000000", "1") || style == &("#6E6E6E", "1");
        assert!(is_isoline || keys.contains(style), "{name}: {style:?} is in no key: {keys:?}");
    }
    for (style, points) in &lines {
        let inside = |(x, y): &(f64, f64)| (0.0..=width).contains(x) && (0.0..=height).contains(y);
        assert!(points.iter().all(inside), "{name}: {style:?} leaves the sheet");
    }
    let areas = sheet.descendants().filter(|node| node.has_tag_name("polygon")).count();
    let bars = sheet.descendants().filter(|node| node.has_tag_name("rect")).count() > 10;
    let flat = lines.iter().any(|(style, points)| style.1 == "2" && !is_sign(points));
    assert!(flat || areas > 0 || bars || curves().count() > 0, "{name}: an empty frame");
}

/// Checks that every end of a piece of the border is the end of another one.
fn slices_are_closed(name: &str, sheet: &roxmltree::Document) {
    let mut ends: BTreeMap<String, usize> = BTreeMap::new();
    for ((_, width), points) in lines(sheet) {
        if width == "2" && !is_sign(&points) {
            for end in [points[0], points[points.len() - 1]] {
                *ends.entry(format!("{end:?}")).or_default() += 1;
            }
        }
    }
    let open: Vec<_> = ends.iter().filter(|(_, count)| *count % 2 == 1).collect();
    assert!(!ends.is_empty() && open.is_empty(), "{name}: open at {open:?}");
}

#[test]
fn every_picture_of_every_study_can_be_read() {
    let pictures = drawn();
    assert!(pictures.len() > 100, "{:?}", pictures.keys());
    for (name, svg) in &pictures {
        let sheet = roxmltree::Document::parse(svg).unwrap_or_else(|e| panic!("{name}: {e}"));
        nothing_overlaps(name, &sheet);
        axes_have_units(name, &sheet);
        lines_have_keys_and_stay_inside(name, &sheet);
        if name.contains("/slice-") {
            slices_are_closed(name, &sheet);
        }
    }
}
