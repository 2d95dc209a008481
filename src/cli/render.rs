//! `tautline render`: pictures, films and contact sheets of a recording.

use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};

use clap::Args;
use rayon::iter::{IntoParallelRefIterator as _, ParallelIterator as _};

use super::console::{Console, Terminal};
use super::reading::ReadArguments;
use super::{Exit, completions, drawing};
use tautline_core::files::{write_atomically, write_atomically_with};
use tautline_core::option::FILM_FPS;
use tautline_core::swarm::Pair;
use tautline_render::{
    CameraSpec, Colouring, Extent, Film, FilmFormat, Layers, Picture, RenderError, Renderer, Scene, Theme, Timeline,
    View, contact_sheet,
};
use tautline_report::request::audit::recording_in;
use tautline_report::request::outputs::{self, NamedPath};
use tautline_report::request::{Failure, Monitor as _, try_to_write_in};

/// Largest number of pictures of one command.
const MOST_PICTURES: f64 = 100_000.0;
/// Default frame rate of a film.
const FPS: u32 = 30;
/// Longest duration of a film at the default speed \[s\].
const LONGEST_FILM_S: f64 = 20.0;
/// Largest memory of pictures that wait for their encoder.
const WAITING_BYTES: usize = 256 << 20;

/// Arguments of `tautline render`.
#[derive(Debug, Args)]
#[command(mut_arg("recording", |what| {
    let help = "Recording, scenario file, or name of a built-in scenario, which is flown without a recording";
    what.value_name("RECORDING|SCENARIO").help(help).long_help(help).add(completions::scenario())
}))]
pub(super) struct RenderArguments {
    /// Safety distance for a recording without one [m]: vehicles get shells of half of it, and violations are those of
    /// straight lines between samples.
    #[arg(long, value_name = "METRES", allow_negative_numbers = true)]
    delta: Option<f64>,
    /// Times of pictures: start, closest, end, or seconds, separated by commas [default: start,closest,end, unless
    /// another output is given].
    #[arg(long, value_name = "TIMES", value_delimiter = ',', allow_negative_numbers = true)]
    at: Vec<String>,
    /// Time between two pictures of the flight [s].
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    every: Option<f64>,
    /// Write a film: .mp4 (H.264; needs ffmpeg, or a build with --features film) or .gif.
    #[arg(long, value_name = "FILE")]
    film: Option<PathBuf>,
    /// Write a contact sheet with C columns and R rows.
    #[arg(long, value_name = "CxR", value_parser = drawing::sheet)]
    sheet: Option<[u32; 2]>,
    /// Draw another recording or scenario to the right, on the same scale and at the same times.
    #[arg(long, value_name = "RECORDING|SCENARIO", add = completions::scenario())]
    beside: Option<PathBuf>,
    /// Last time of films, sheets and --every [s] [default: the end].
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    until: Option<f64>,
    /// Folder for the pictures [default: `snapshots` beside the recording, or in out/NAME for a scenario].
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Width and height of a picture, or of the whole sheet, in pixels.
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = drawing::size)]
    size: [u32; 2],
    /// Frames per second of the film [default: 30].
    #[arg(long, value_name = "N", requires = "film")]
    film_fps: Option<u32>,
    /// Seconds of flight per second of film [default: 1, or more to keep the film below 20 s].
    #[arg(long, value_name = "X", allow_negative_numbers = true, requires = "film")]
    speed: Option<f64>,
    /// Camera: auto, perspective, top, front, side, follow, follow:ID, closest, or AZIMUTH,ELEVATION,DISTANCE in
    /// degrees and metres [default: follow with lights, else auto, which follows a swarm that travels far].
    #[arg(long, allow_hyphen_values = true, add = completions::camera())]
    camera: Option<String>,
    /// Colour of vehicles and trails [default: vehicle; lights for sixty vehicles or more in several flat formations].
    #[arg(long, value_parser = drawing::colouring())]
    colour: Option<Colouring>,
    /// Length of trails [s] [default: the whole flight up to 24 vehicles, 5 up to 99, else 1].
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    trail: Option<f64>,
    /// Theme.
    #[arg(long, default_value = "dark", value_parser = drawing::theme())]
    theme: Theme,
    /// Graphics adapter: best, hardware, software, none, or a part of its name.
    #[arg(long, value_name = "NAME", default_value = "best")]
    adapter: String,
    /// Print no summary and no progress.
    #[arg(long, short)]
    quiet: bool,
    // Last, because its help heading also applies to all later arguments.
    #[command(flatten)]
    reading: ReadArguments,
}

/// Picture to take.
struct Still {
    time_s: f64,
    /// Pair that no obstacle may hide.
    pair: Option<Pair>,
    path: PathBuf,
}

/// Renderer of the pictures of a flight.
struct Batch<'a> {
    /// Flights, side by side.
    flights: &'a [Timeline],
    extent: Extent,
    renderer: Renderer,
    view: View,
    terminal: &'a Terminal,
    /// Complete files, in the order in which they were written.
    written: Vec<PathBuf>,
}

/// Files to write.
struct Outputs<'a> {
    stills: Vec<Still>,
    /// Path, format and frame rate of the film, and the times of its pictures.
    film: Option<(&'a Path, FilmFormat, u32, Vec<f64>)>,
    sheet: Option<Sheet>,
}

/// Contact sheet to write.
struct Sheet {
    path: PathBuf,
    columns: u32,
    /// Times and size of its pictures.
    times_s: Vec<f64>,
    size_px: [u32; 2],
}

/// Adds the option for the rate of a film to the failure of a recording that is read with a frame rate.
fn about_film_rate(failure: Failure) -> Failure {
    let help = failure.help().filter(|_| failure.code().starts_with("recording/"));
    match help {
        Some(help) => failure.clone().with_help(format!("{help}; {FILM_FPS} sets the rate of a film")),
        None => failure,
    }
}

pub(super) fn render(arguments: &RenderArguments) -> Result<Exit, Failure> {
    let console = Console { data_on_stdout: false, quiet: arguments.quiet };
    let terminal = Terminal::that_abandons(console, "interrupted: nothing was written; give the command again")?;
    if arguments.until.is_some() && arguments.film.is_none() && arguments.sheet.is_none() && arguments.every.is_none() {
        let help = "give one of these options too, or leave --until out";
        return Err(Failure::input(
            "usage/no-effect",
            "--until: has no effect without --film, --sheet or --every",
            help,
        ));
    }
    let camera: Option<CameraSpec> = arguments.camera.as_ref().map(|camera| camera.parse()).transpose()?;
    let film = arguments.film.as_deref().map(|path| Ok::<_, Failure>((path, FilmFormat::of(path)?))).transpose()?;
    let fps = arguments.film_fps.unwrap_or(FPS);
    let reading = arguments.reading.options();
    let recording = arguments.reading.only("drawn")?;
    let paths: Vec<&Path> = std::iter::once(recording).chain(arguments.beside.as_deref()).collect();
    let may_mean_film = film.is_some() && reading.times_per_second.is_some();
    let read = |path: &&Path| {
        let flight = drawing::flight(&recording_in(path), &reading, arguments.delta, console);
        flight.map_err(|failure| if may_mean_film { about_film_rate(failure) } else { failure })
    };
    let flights = paths.iter().map(read).collect::<Result<Vec<_>, _>>()?;
    let timeline = &flights[0];
    let default_folder = || match recording.parent() {
        _ if drawing::is_scenario(recording) => Path::new("out").join(&timeline.name).join("snapshots"),
        parent => parent.unwrap_or(Path::new("")).join("snapshots"),
    };
    let folder = arguments.out.clone().unwrap_or_else(default_folder);
    let range_s = range_s(&flights, arguments.until)?;
    let stills = stills(arguments, timeline, range_s, &folder)?;
    let frames = film.map_or(Ok(Vec::new()), |_| film_times(fps, arguments.speed, range_s))?;
    let sheet = arguments.sheet.map(|sheet| sheet_plan(sheet, arguments.size, range_s)).transpose()?;
    let sheet_path = folder.join("sheet.png");
    let outputs: Vec<NamedPath<'_>> = (stills.iter().map(|still| ("the picture".to_owned(), still.path.as_path())))
        .chain(sheet.iter().map(|_| ("the sheet".to_owned(), sheet_path.as_path())))
        .chain(film.map(|(path, _)| ("--film".to_owned(), path)))
        .collect();
    let inputs: Vec<NamedPath<'_>> = paths.iter().map(|path| ("the recording".to_owned(), *path)).collect();
    if let Some(folder) = &arguments.out {
        outputs::refuse_standard_output("--out", folder)?;
    }
    outputs::check(&inputs, &outputs)?;
    let trail_s = arguments.trail.map(|trail_s| positive(trail_s, "--trail")).transpose()?;
    let [width, height] = arguments.size;
    // Pictures side by side have the same width.
    let columns = u32::try_from(flights.len()).unwrap_or(1);
    let size_px = [(width / columns).max(1) * columns, height];
    let usual = View::of(timeline);
    let usual = match arguments.colour {
        Some(Colouring::Lights) => usual.with_lights(),
        Some(colouring) => View { colouring, layers: Layers::of(timeline), camera: CameraSpec::Auto, ..usual },
        None => usual,
    };
    let (camera, trail_s) = (camera.unwrap_or(usual.camera.clone()), trail_s.or(usual.trail_s));
    let view = View { camera, theme: arguments.theme, size_px, trail_s, ..usual };
    if let Some((path, format)) = film {
        if path.is_dir() {
            let message = format!("--film: {} is a folder", path.display());
            return Err(Failure::input("files/is-directory", message, "give the path of a file"));
        }
        format.check(view.size_px, fps)?;
        format.check_encoder()?;
    }
    let renderer = Renderer::open(&arguments.adapter.as_str().into())?;
    renderer.check_size(view.size_px)?;
    let extent = Extent::of_all(&flights.iter().collect::<Vec<_>>());
    for timeline in &flights {
        let start = timeline.log.at(f64::NEG_INFINITY).ok_or_else(|| RenderError::Empty(timeline.name.clone()))?;
        extent.camera(timeline, &start, &view)?;
    }
    // Outputs are checked before the work.
    if !stills.is_empty() || sheet.is_some() {
        writable(&folder)?;
    }
    if let Some((path, _)) = film {
        writable(path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new(".")))?;
    }
    let tiles = sheet.as_ref().map_or(0, |(times, _)| times.len());
    // From here on an interruption keeps the complete files and removes the temporary one.
    terminal.abandons_no_more();
    terminal.begin(&timeline.name, Some((stills.len() + frames.len() + tiles) as u64));
    let mut batch = Batch { extent, flights: &flights, renderer, view, terminal: &terminal, written: Vec::new() };
    let done = batch.write_all(&Outputs {
        stills,
        film: film.map(|(path, format)| (path, format, fps, frames)),
        sheet: sheet.zip(arguments.sheet).map(|((times_s, size_px), [columns, _])| Sheet {
            path: sheet_path,
            columns,
            times_s,
            size_px,
        }),
    });
    terminal.finish();
    if done.is_err() && terminal.is_interrupted() {
        let kept = if batch.written.is_empty() { "no picture".to_owned() } else { names(&batch.written) };
        let failure = Failure::machine(Failure::INTERRUPTED, format!("interrupted: kept {kept}"));
        return Err(failure.with_help("give the command again; it draws all pictures again"));
    }
    done?;
    terminal.say(&format!("wrote {}\ndrawn by {}", names(&batch.written), batch.renderer.adapter()));
    Ok(Exit::Good)
}

/// Returns the names of files in words.
fn names(written: &[PathBuf]) -> String {
    match written {
        [first, .., last] if written.len() > 4 => {
            format!("{} pictures from {} to {}", written.len(), first.display(), last.display())
        }
        _ => written.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", "),
    }
}

impl Batch<'_> {
    /// Writes all files.
    fn write_all(&mut self, outputs: &Outputs<'_>) -> Result<(), Failure> {
        let times: Vec<_> = outputs.stills.iter().map(|still| (still.time_s, still.pair)).collect();
        let mut written = Vec::new();
        let shot = self.shoot(&times, |first, pictures| {
            let jobs: Vec<_> = outputs.stills[first..].iter().zip(pictures).collect();
            jobs.par_iter().try_for_each(|(still, picture)| write(&still.path, picture))?;
            written.extend(jobs.iter().map(|(still, _)| still.path.clone()));
            Ok(())
        });
        self.written.append(&mut written);
        shot?;
        if let Some((path, format, fps, times)) = &outputs.film {
            write_atomically_with(path, |file| {
                self.film(file, *format, *fps, times).map_err(|failure| failure.of(path))
            })?;
            self.written.push(path.to_path_buf());
        }
        if let Some(Sheet { path, columns, times_s, size_px }) = &outputs.sheet {
            self.view.size_px = *size_px;
            let mut tiles = Vec::new();
            self.shoot(&whole(times_s), |_, pictures| {
                tiles.extend_from_slice(pictures);
                Ok(())
            })?;
            write(path, &contact_sheet(&tiles, *columns)?)?;
            self.written.push(path.clone());
        }
        Ok(())
    }

    /// Takes pictures at these times, each with a pair that it shows if possible, and passes them on in order, in
    /// chunks; the next chunk is drawn meanwhile.
    fn shoot(
        &mut self,
        times: &[(f64, Option<Pair>)],
        mut take: impl FnMut(usize, &[Picture]) -> Result<(), Failure> + Send,
    ) -> Result<(), Failure> {
        let picture_bytes = self.view.size_px[0] as usize * self.view.size_px[1] as usize * 4;
        let at_a_time = (WAITING_BYTES / picture_bytes.max(1)).clamp(1, 2 * rayon::current_num_threads());
        let (mut first, mut waiting): (usize, Vec<Picture>) = (0, Vec::new());
        for times in times.chunks(at_a_time) {
            let (drawn, taken) = rayon::join(
                || times.iter().map(|&(time_s, pair)| self.picture(time_s, pair)).collect::<Result<Vec<_>, Failure>>(),
                || take(first, &waiting),
            );
            taken?;
            first += waiting.len();
            waiting = drawn?;
        }
        take(first, &waiting)
    }

    /// Writes a film with pictures at these times.
    fn film(&mut self, file: &mut File, format: FilmFormat, fps: u32, times_s: &[f64]) -> Result<(), Failure> {
        let mut out = BufWriter::new(file);
        let pictures = u32::try_from(times_s.len()).unwrap_or(u32::MAX);
        let mut film = Film::new(&mut out, format, self.view.size_px, fps, pictures)?;
        self.shoot(&whole(times_s), |_, pictures| Ok(film.add(pictures)?))?;
        film.finish()?;
        Ok(out.flush().map_err(RenderError::Write)?)
    }

    fn picture(&mut self, time_s: f64, pair: Option<Pair>) -> Result<Picture, Failure> {
        if self.terminal.is_interrupted() {
            return Err(Failure::interrupted());
        }
        let [width, height] = self.view.size_px;
        let columns = u32::try_from(self.flights.len()).unwrap_or(1);
        let view = View { size_px: [width / columns, height], ..self.view.clone() };
        let mut pictures = Vec::new();
        for timeline in self.flights {
            let frame = timeline.log.at(time_s).ok_or_else(|| RenderError::Empty(timeline.name.clone()))?;
            // Flights side by side have one direction.
            let camera = match pair.filter(|_| columns == 1) {
                Some(pair) => self.extent.camera_on(timeline, &frame, &view, pair)?,
                None => self.extent.camera(timeline, &frame, &view)?,
            };
            pictures.push(self.renderer.paint(&Scene::compose(timeline, &self.extent, &frame, &view, camera))?);
        }
        self.terminal.advance(1);
        Ok(contact_sheet(&pictures, columns)?)
    }
}

/// Returns times of pictures that need not show a pair.
fn whole(times_s: &[f64]) -> Vec<(f64, Option<Pair>)> {
    times_s.iter().map(|&time_s| (time_s, None)).collect()
}

fn write(path: &Path, picture: &Picture) -> Result<(), Failure> {
    Ok(write_atomically(path, &picture.to_png()?)?)
}

/// Checks before the work that a folder can be written to.
fn writable(folder: &Path) -> Result<(), Failure> {
    try_to_write_in(folder).map_err(|error| {
        Failure::machine("files/cannot-write", format!("cannot write to {}: {error}", folder.display()))
            .with_help("give a folder that can be written to with --out, or another --film")
    })
}

/// Returns the requested pictures, each with its file.
fn stills(
    arguments: &RenderArguments,
    timeline: &Timeline,
    range_s: [f64; 2],
    folder: &Path,
) -> Result<Vec<Still>, Failure> {
    let [start_s, end_s] = timeline.log.range_s();
    let nothing_else = arguments.every.is_none() && arguments.film.is_none() && arguments.sheet.is_none();
    let mut wanted: Vec<&str> = arguments.at.iter().map(|text| text.trim()).collect();
    if wanted.is_empty() && nothing_else {
        // A single vehicle has no closest approach.
        wanted = if timeline.log.closest().is_some() { vec!["start", "closest", "end"] } else { vec!["start", "end"] };
    }
    let mut stills = Vec::new();
    for text in wanted {
        let (time_s, name, pair) = match text {
            "start" => (start_s, "start".to_owned(), None),
            "end" => (end_s, "end".to_owned(), None),
            "closest" => {
                let none = "--at: `closest` needs two vehicles at a time";
                let closest = timeline
                    .log
                    .closest()
                    .ok_or_else(|| Failure::input("render/no-closest", none, "leave `closest` out of --at"))?;
                (closest.time_s, "closest".to_owned(), Some(closest.pair))
            }
            seconds => {
                let help = "give start, closest, end or seconds, such as --at start,12.5,end";
                let time_s = seconds.parse().ok().filter(|time: &f64| time.is_finite());
                let time_s = time_s
                    .ok_or_else(|| Failure::input("render/time", format!("--at: `{text}` is not a time"), help))?;
                // Two times have two names.
                let rounded = format!("{time_s:.3}");
                let digits = if rounded.parse() == Ok(time_s) { rounded } else { format!("{time_s:?}") };
                (time_s, format!("at-{digits}s"), None)
            }
        };
        if !(start_s..=end_s).contains(&time_s) {
            return Err(Failure::input(
                "render/out-of-range",
                format!("--at: must be from {start_s} s to {end_s} s, got {time_s} s"),
                "give a time within the recording with --at",
            ));
        }
        let path = folder.join(format!("{name}.png"));
        // A repeated time gives one picture.
        if stills.iter().all(|still: &Still| still.path != path) {
            stills.push(Still { time_s, pair, path });
        }
    }
    if let Some(every_s) = arguments.every {
        let times = even_times(range_s, every_s, "--every")?;
        let path = |k: usize| folder.join(format!("frame-{:05}.png", k + 1));
        stills.extend(times.into_iter().enumerate().map(|(k, time_s)| Still { time_s, pair: None, path: path(k) }));
    }
    Ok(stills)
}

/// Returns times from a start to an end, `apart_s` apart \[s\].
fn even_times([start_s, end_s]: [f64; 2], apart_s: f64, option: &str) -> Result<Vec<f64>, Failure> {
    positive(apart_s, option)?;
    let count = ((end_s - start_s) / apart_s + 1e-6).floor() + 1.0;
    if count > MOST_PICTURES {
        return Err(Failure::input(
            "render/out-of-range",
            format!("{option}: must give at most {MOST_PICTURES:.0} pictures, got {count:.0}"),
            "give a larger number",
        ));
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bounded above")]
    let count = count as u32;
    Ok((0..count).map(|k| start_s + f64::from(k) * apart_s).collect())
}

fn positive(number: f64, option: &str) -> Result<f64, Failure> {
    if number > 0.0 && number.is_finite() {
        return Ok(number);
    }
    let message = format!("{option}: must be more than 0, got {number}");
    Err(Failure::input("render/out-of-range", message, format!("give a positive number with {option}")))
}

/// Returns the common range of time of flights \[s\], with an earlier end if given.
fn range_s(flights: &[Timeline], until_s: Option<f64>) -> Result<[f64; 2], Failure> {
    let ranges = flights.iter().map(|timeline| timeline.log.range_s());
    let [start_s, end_s] = ranges.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]).unwrap_or_default();
    match until_s {
        Some(until_s) if !(start_s..=end_s).contains(&until_s) => Err(Failure::input(
            "render/out-of-range",
            format!("--until: must be from {start_s} s to {end_s} s, got {until_s} s"),
            "give a time within the recording with --until",
        )),
        until_s => Ok([start_s, until_s.unwrap_or(end_s)]),
    }
}

fn film_times(fps: u32, speed: Option<f64>, [start_s, end_s]: [f64; 2]) -> Result<Vec<f64>, Failure> {
    let fps = f64::from(fps.max(1));
    let speed = match speed {
        Some(speed) => positive(speed, "--speed")?,
        // The last picture is shown for one frame.
        None => ((end_s - start_s) / (LONGEST_FILM_S - 1.0 / fps)).max(1.0),
    };
    even_times([start_s, end_s], speed / fps, "--speed")
}

/// Returns the times of the pictures of a sheet, and their size.
fn sheet_plan(
    [columns, rows]: [u32; 2],
    [width, height]: [u32; 2],
    [start_s, end_s]: [f64; 2],
) -> Result<(Vec<f64>, [u32; 2]), Failure> {
    let size_px = [width / columns, height / rows];
    if size_px.contains(&0) {
        return Err(Failure::input(
            "render/out-of-range",
            format!("--sheet: {columns} x {rows} pictures do not fit into {width} x {height} pixels"),
            "give fewer pictures with --sheet, or a larger --size",
        ));
    }
    let last = (u64::from(columns) * u64::from(rows) - 1).max(1) as f64;
    if last > MOST_PICTURES {
        return Err(Failure::input(
            "render/out-of-range",
            format!("--sheet: must have at most {MOST_PICTURES:.0} pictures, got {columns} x {rows}"),
            "give fewer pictures with --sheet",
        ));
    }
    let times = (0..columns * rows).map(|k| start_s + (end_s - start_s) * (f64::from(k) / last)).collect();
    Ok((times, size_px))
}
