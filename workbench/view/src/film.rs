// SPDX-License-Identifier: GPL-2.0-or-later
//! Frames of a page, drawn by a headless browser, and a video of them.
//!
//! The page draws the frames that its address requests and inserts them into itself as text; the browser prints
//! the page (`--dump-dom`). ffmpeg encodes the video.

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use std::ffi::OsStr;
use std::io::{self, Read, Write};
use std::ops::Range;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Names of supported browsers in distributions.
pub const BROWSERS: [&str; 4] =
    ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];

/// Frames that a browser draws per run: they are held in memory as text.
pub const AT_A_TIME: usize = 50;

/// Frames per second of a video.
pub const RATE: usize = 25;

/// Time on the browser's virtual clock for inserting frames into the page; the clock waits during drawing.
const BUDGET: &str = "--virtual-time-budget=60000";

/// Interval between checks whether a browser has ended.
const LOOK: Duration = Duration::from_millis(20);

const SCHEME: &str = "data:image/png;base64,";

/// Why frames or a video cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum FilmError {
    #[error(
        "no browser found (searched for {}): install chromium, or use --browser",
        BROWSERS.join(", ")
    )]
    NoBrowser,
    #[error("{}: cannot start: {error}", program.display())]
    NotStarted { program: PathBuf, error: io::Error },
    #[error("{} drew {found} of {wanted} frames; it may lack WebGL: {output}", browser.display())]
    NoFrames {
        /// The browser's executable.
        browser: PathBuf,
        found: usize,
        wanted: usize,
        /// The last line of its output.
        output: String,
    },
    #[error(
        "{} did not draw {wanted} frames in {} s and was stopped: raise --browser-seconds, or use a \
         smaller --size",
        browser.display(),
        patience.as_secs_f64()
    )]
    Hangs {
        /// The browser's executable.
        browser: PathBuf,
        wanted: usize,
        patience: Duration,
    },
    #[error("ffmpeg made no video: {0}")]
    NoVideo(String),
    #[error("{0}")]
    File(#[from] io::Error),
}

/// Settings for drawing frames.
#[derive(Clone, Debug)]
pub struct Camera {
    pub browser: PathBuf,
    /// The page's file; the browser keeps its profile next to it.
    pub page: PathBuf,
    /// Width and height, pixels.
    pub size: [usize; 2],
    /// Name of the view on the page.
    pub view: String,
    /// Time limit for one run of the browser.
    pub patience: Duration,
}

/// Returns the requested browser, or the first one installed.
///
/// # Errors
/// No browser is installed.
pub fn browser(wanted: Option<&Path>) -> Result<PathBuf, FilmError> {
    if let Some(wanted) = wanted {
        return Ok(wanted.into());
    }
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let places: Vec<PathBuf> = std::env::split_paths(&folders).collect();
    let all = BROWSERS.iter().flat_map(|name| places.iter().map(move |place| place.join(name)));
    all.into_iter().find(|file| file.is_file()).ok_or(FilmError::NoBrowser)
}

impl Camera {
    /// Draws frames of a video of `all` frames as PNG files.
    ///
    /// # Errors
    /// The browser cannot be started, exceeds the time limit, or draws fewer frames.
    pub fn frames(&self, which: Range<usize>, all: usize) -> Result<Vec<Vec<u8>>, FilmError> {
        let wanted = which.len();
        let [width, height] = self.size;
        let page = std::path::absolute(&self.page)?;
        let address = format!(
            "file://{}#frames={},{wanted},{all},{width},{height},{}",
            escaped(&page),
            which.start,
            self.view
        );
        let mut command = Command::new(&self.browser);
        command.args(["--headless", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]);
        // A separate profile, without network access.
        command.args(["--disable-background-networking", "--disable-component-update"]);
        command.args(["--disable-sync", "--disable-quic", "--no-first-run", BUDGET, "--dump-dom"]);
        if rustix::process::getuid().is_root() {
            // As root a browser cannot start its sandbox.
            command.arg("--no-sandbox");
        }
        let profile = self.page.with_file_name("profile");
        command.arg(format!("--user-data-dir={}", profile.display())).arg(address);
        let child = command.process_group(0).stdin(Stdio::null()).stdout(Stdio::piped());
        let child = child.stderr(Stdio::piped()).spawn();
        let child = child.map_err(|error| started(&self.browser, error))?;
        let (browser, patience) = (self.browser.clone(), self.patience);
        let output =
            ended(child, patience)?.ok_or(FilmError::Hangs { browser, wanted, patience })?;
        let text = String::from_utf8_lossy(&output.stdout);
        let frames = text.split(SCHEME).skip(1).map(|rest| {
            let end = rest.find(|c: char| !c.is_ascii_alphanumeric() && !"+/=".contains(c));
            BASE64_STANDARD.decode(&rest[..end.unwrap_or(rest.len())]).unwrap_or_default()
        });
        let frames: Vec<Vec<u8>> = frames.filter(|frame| !frame.is_empty()).collect();
        if frames.len() == wanted {
            return Ok(frames);
        }
        Err(FilmError::NoFrames {
            browser: self.browser.clone(),
            found: frames.len(),
            wanted,
            output: last_line(&output.stderr),
        })
    }

    /// Writes a video of `all` frames to a file; `done` receives the share done.
    ///
    /// # Errors
    /// As [`Camera::frames`]; ffmpeg cannot be started, or refuses the frames.
    pub fn film(&self, all: usize, file: &Path, done: impl Fn(f64)) -> Result<(), FilmError> {
        let mut ffmpeg = encoder(file)?;
        let mut sink = ffmpeg.stdin.take().expect("its standard input is a pipe");
        let mut written = Ok(());
        for first in (0..all).step_by(AT_A_TIME) {
            let frames = match self.frames(first..all.min(first + AT_A_TIME), all) {
                Ok(frames) => frames,
                Err(error) => {
                    drop(sink);
                    ffmpeg.wait()?;
                    return Err(error);
                }
            };
            written = frames.iter().try_for_each(|frame| sink.write_all(frame));
            if written.is_err() {
                break;
            }
            done(first as f64 / all as f64);
        }
        drop(sink);
        let output = ffmpeg.wait_with_output()?;
        match written.is_ok() && output.status.success() {
            true => Ok(()),
            false => Err(FilmError::NoVideo(last_line(&output.stderr))),
        }
    }
}

/// Waits for a program that leads a process group, and returns its output; returns `None` if it exceeds the time
/// limit, after which it is killed with its group.
fn ended(mut child: Child, patience: Duration) -> Result<Option<Output>, io::Error> {
    let group = rustix::process::Pid::from_child(&child);
    let (mut out, mut err) = (child.stdout.take(), child.stderr.take());
    std::thread::scope(|scope| {
        let stdout = scope.spawn(move || read(out.as_mut()));
        let stderr = scope.spawn(move || read(err.as_mut()));
        let begun = Instant::now();
        let status = loop {
            match child.try_wait()? {
                Some(status) => break Some(status),
                None if begun.elapsed() > patience => break None,
                None => std::thread::sleep(LOOK),
            }
        };
        if status.is_none() {
            // If it has just ended, no process is left to kill, which is no error.
            let _ = rustix::process::kill_process_group(group, rustix::process::Signal::KILL);
            child.wait()?;
        }
        let bytes = |reader: std::thread::ScopedJoinHandle<'_, _>| {
            reader.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        };
        let (stdout, stderr) = (bytes(stdout)?, bytes(stderr)?);
        Ok(status.map(|status| Output { status, stdout, stderr }))
    })
}

fn read(stream: Option<&mut impl Read>) -> Result<Vec<u8>, io::Error> {
    let mut bytes = vec![];
    stream.map_or(Ok(0), |stream| stream.read_to_end(&mut bytes))?;
    Ok(bytes)
}

fn encoder(file: &Path) -> Result<Child, FilmError> {
    let mut command = Command::new("ffmpeg");
    command.args(["-hide_banner", "-loglevel", "error", "-y", "-f", "image2pipe", "-c:v", "png"]);
    command.args(["-framerate", &RATE.to_string(), "-i", "-", "-c:v", "libx264"]);
    // A format that every player supports.
    command.args(["-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4"]).arg(file);
    command.stdin(Stdio::piped()).stderr(Stdio::piped());
    command.spawn().map_err(|error| started("ffmpeg", error))
}

fn started(program: impl AsRef<OsStr>, error: io::Error) -> FilmError {
    FilmError::NotStarted { program: program.as_ref().into(), error }
}

fn last_line(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    text.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("it printed nothing").into()
}

/// Escapes a path for a URL.
fn escaped(path: &Path) -> String {
    let is_plain = |byte: &u8| byte.is_ascii_alphanumeric() || b"/._-~".contains(byte);
    let bytes = path.as_os_str().as_encoded_bytes();
    let part = |byte: &u8| match is_plain(byte) {
        true => char::from(*byte).to_string(),
        false => format!("%{byte:02X}"),
    };
    bytes.iter().map(part).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_has_no_sign_of_its_own_in_a_path() {
        assert_eq!(escaped(Path::new("/a b/c#1%.html")), "/a%20b/c%231%25.html");
    }

    #[test]
    fn a_browser_that_draws_nothing_is_reported_with_its_last_words() {
        let page = PathBuf::from("/nowhere.html");
        let camera = Camera {
            browser: "/bin/false".into(),
            page,
            size: [10, 10],
            view: "3D".into(),
            patience: Duration::from_secs(60),
        };
        let error = camera.frames(0..1, 1).unwrap_err().to_string();
        assert!(error.starts_with("/bin/false drew 0 of 1 frames"), "{error}");
        let camera = Camera { browser: "/nowhere".into(), ..camera };
        let error = camera.frames(0..1, 1).unwrap_err().to_string();
        assert!(error.starts_with("/nowhere: cannot start"), "{error}");
    }

    #[test]
    fn a_browser_that_does_not_end_is_ended_with_what_it_has_started() {
        // The second process keeps the pipes open, as those of a browser do.
        let mut command = Command::new("sh");
        command.args(["-c", "sleep 600 & sleep 600"]).process_group(0);
        let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let begun = Instant::now();
        assert!(ended(child, Duration::from_millis(200)).unwrap().is_none());
        assert!(begun.elapsed() < Duration::from_secs(60));
    }
}
