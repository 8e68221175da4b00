// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm view`.

use super::failure::{Failure, refused, report_error};
use super::preflight::{Judging, judged};
use super::{Bar, MachineFile, Verdict, output, print_text};
use machine::files::{Folder, Locate, Whole, read, write_whole};
use machine::read::machine::MachineConfig;
use program::report::Time;
use program::timeline::Course;
use serde_json::json;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;
use view::data::Data;
use view::film::{self, Camera};
use view::page::page;
use view::track::Track;

/// Show a machine, and a program on it, as a page for browsers
///
/// Writes one file that works offline: the machine in 3D, which you can turn, cut open and move
/// by its coordinates, with the distance to every limit, and its workspace. With a program also
/// the path, colored by the distance to the nearest limit; the machine at any time; the findings
/// of `pkm preflight` as marks to click; and curves of joints, speeds and margins. The page uses
/// the same kinematics as the module. `pkm help reference/view` shows it.
///
/// Videos and pictures need a browser such as chromium, which runs without a window; videos also
/// need ffmpeg.
///
/// Exit status: with a program that of `pkm preflight`, without one 0; 2 if the machine cannot be
/// read or a file cannot be written. If the program cannot be read, the page shows the machine
/// and the reason.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
    /// Program to show
    #[arg(value_name = "PROGRAM.ngc", value_hint = clap::ValueHint::FilePath, value_parser = super::input::Program)]
    program: Option<PathBuf>,
    /// Write the page here [default: MACHINE.html in this folder, unless --video or --picture is
    /// given]
    #[arg(long, value_name = "FILE.html", value_hint = clap::ValueHint::FilePath)]
    html: Option<PathBuf>,
    /// Make a page that follows a running LinuxCNC, for pkm-live
    #[arg(long, conflicts_with = "program")]
    live: bool,
    /// Write a video of the program, 25 frames per second
    #[arg(long, value_name = "FILE.mp4", requires = "program", value_hint = clap::ValueHint::FilePath)]
    video: Option<PathBuf>,
    /// Duration of the video, regardless of that of the program
    #[arg(long, value_name = "SECONDS", default_value_t = 20.0, value_parser = seconds)]
    video_seconds: f64,
    /// Write a picture: the machine at home with its workspace, or halfway through the program
    #[arg(long, value_name = "FILE.png", value_hint = clap::ValueHint::FilePath)]
    picture: Option<PathBuf>,
    /// Size of video and picture in pixels
    #[arg(long, num_args = 2, value_names = ["WIDTH", "HEIGHT"], default_values_t = [1280, 720], value_parser = pixels)]
    size: Vec<usize>,
    /// View of video and picture
    #[arg(long, value_name = "NAME", default_value = "3D", value_parser = ["3D", "front", "side", "top"])]
    from: String,
    /// Browser that draws them [default: the first of chromium and similar browsers in PATH]
    #[arg(long, value_name = "PROGRAM", value_hint = clap::ValueHint::ExecutablePath)]
    browser: Option<PathBuf>,
    /// Time limit of the browser for 50 frames
    #[arg(long, value_name = "SECONDS", default_value_t = 600.0, value_parser = patience)]
    browser_seconds: f64,
    #[command(flatten)]
    judging: Judging,
}

/// Longest video, seconds: an hour of drawing.
const LONGEST: f64 = 600.0;

/// Largest number of pixels of a side, as supported by browsers.
const MOST_PIXELS: usize = 4096;

fn seconds(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|value| *value >= 0.1 && *value <= LONGEST);
    value.ok_or_else(|| format!("expected 0.1 to {LONGEST} seconds"))
}

/// Longest wait for the browser, seconds: a day.
const MOST_PATIENCE: f64 = 86_400.0;

fn patience(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|value| *value >= 1.0 && *value <= MOST_PATIENCE);
    value.ok_or_else(|| format!("expected 1 to {MOST_PATIENCE} seconds"))
}

/// Parses a number of pixels, which must be even for videos.
fn pixels(text: &str) -> Result<usize, String> {
    let is_fine = |value: &usize| (64..=MOST_PIXELS).contains(value) && value.is_multiple_of(2);
    let value = text.parse::<usize>().ok().filter(is_fine);
    value.ok_or_else(|| format!("expected an even number from 64 to {MOST_PIXELS}"))
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let config = arguments.machine.read_named_constrained()?;
    let (data, verdict) = match &arguments.program {
        None => (Data::new(&config, arguments.live), Verdict::Fits),
        Some(program) => of_program(&config, &arguments.judging, program)?,
    };
    data.problems().iter().for_each(report_error);
    let page = page(&data);
    let html = html(arguments, &config);
    if let Some(file) = &html {
        write_whole(file, &page)?;
    }
    if let (Some(file), None) = (&html, &arguments.html) {
        Failure::unless_unread(print_text(&format!(
            "wrote {}: open it in a browser\n",
            file.display()
        )))?;
    }
    if arguments.video.is_some() && !data.moves() {
        return Err(refused(
            "--video: the program does not run, see above; correct it, or remove --video",
        ));
    }
    if arguments.video.is_some() || arguments.picture.is_some() {
        draw(arguments, &page)?;
    }
    let files: Vec<_> =
        [&html, &arguments.picture, &arguments.video].into_iter().flatten().collect();
    output::answer(
        &json!({ "machine": config.file, "program": arguments.program, "files": files }),
    )?;
    Ok(verdict)
}

/// Returns the path of the page, if requested.
fn html(arguments: &Arguments, config: &MachineConfig) -> Option<PathBuf> {
    let is_drawn = arguments.video.is_some() || arguments.picture.is_some();
    let stem = config.file.file_stem().unwrap_or_default();
    let own = (!is_drawn).then(|| PathBuf::from(format!("{}.html", stem.to_string_lossy())));
    arguments.html.clone().or(own)
}

fn draw(arguments: &Arguments, page: &str) -> Result<(), Failure> {
    let folder = Folder::new()?;
    let camera = Camera {
        browser: film::browser(arguments.browser.as_deref())?,
        page: folder.path().join("page.html"),
        size: [arguments.size[0], arguments.size[1]],
        view: arguments.from.clone(),
        patience: Duration::from_secs_f64(arguments.browser_seconds),
    };
    write_whole(&camera.page, page)?;
    if let Some(file) = &arguments.picture {
        let bar = Bar::spinner("drawing the picture");
        // The middle frame of three.
        let frames = camera.frames(1..2, 3)?;
        drop(bar);
        let mut whole = Whole::new(file)?;
        whole.write_all(&frames[0]).at(file)?;
        whole.finish()?;
    }
    if let Some(file) = &arguments.video {
        let bar = Bar::new("drawing the video");
        let all = (arguments.video_seconds * film::RATE as f64).round() as usize;
        let made = folder.path().join("video.mp4");
        camera.film(all, &made, |share| bar.set(share))?;
        let mut whole = Whole::new(file)?;
        std::io::copy(&mut std::fs::File::open(&made).at(&made)?, &mut whole).at(file)?;
        whole.finish()?;
    }
    Ok(())
}

/// Shows a program; a refused one is reported, on the page as well.
fn of_program(
    config: &MachineConfig,
    judging: &Judging,
    program: &Path,
) -> Result<(Data, Verdict), Failure> {
    let data = Data::new(config, false);
    let text = read(program)?;
    let (mut track, mut course) = (Track::new(config), Course::new(config.first()));
    let answer = judged(config, judging, program, |row| {
        track.see(config, row);
        course.see(row);
    });
    let answer = match answer {
        Ok(answer) => answer,
        Err(failure) => {
            failure.report();
            return Ok((data.with_error(failure.to_string()), Verdict::Unjudged));
        }
    };
    if let Time::NotJudged(cause) = &answer.found.time {
        report_error(&format!("times are not judged: {cause}"));
    }
    let words = [program.display().to_string(), String::from_utf8_lossy(&text).into_owned()];
    let report = serde_json::to_value(&answer)?;
    let data = data.with_program(config.first(), words, &track, Some(&course.finish()), report);
    Ok((data, answer.fits.into()))
}
