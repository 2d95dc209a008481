//! Flies the built-in circle and writes a film, without a recording: `cargo run --release --example film`.

use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use tautline::flight_log::FlightLog;
use tautline::render::scene::Extent;
use tautline::render::{AdapterChoice, Film, FilmFormat, Renderer, Scene, Timeline, View};
use tautline::scenario::{Override, Scenario, Source};
use tautline::sim::{self, Components};

const FPS: u32 = 25;
/// Seconds of the flight in a second of the film.
const SPEED: f64 = 6.0;

fn main() -> Result<(), Box<dyn Error>> {
    let shorter = Override::parse("time.duration_s=60")?;
    let scenario = Scenario::read(&Source::resolve("circle")?, &[shorter])?;
    let mut log = FlightLog::of(&scenario);
    sim::fly(&scenario, Components::of(&scenario)?, &mut log, &mut |_step| ControlFlow::Continue(()))?;
    let timeline = Timeline::flown(&scenario, Arc::new(log));

    let path = Path::new("circle.gif");
    let view = View { size_px: [960, 540], ..View::default() };
    let (extent, [start_s, end_s]) = (Extent::of(&timeline), timeline.log.range_s());
    let mut renderer = Renderer::open(&AdapterChoice::Best)?;
    let times: Vec<f64> = (0..u16::MAX)
        .map(|k| start_s + f64::from(k) * SPEED / f64::from(FPS))
        .take_while(|&time_s| time_s <= end_s)
        .collect();
    let mut out = BufWriter::new(File::create(path)?);
    let pictures = u32::try_from(times.len())?;
    let mut film = Film::new(&mut out, FilmFormat::of(path)?, view.size_px, FPS, pictures)?;
    for time_s in times {
        let Some(frame) = timeline.log.at(time_s) else { break };
        let camera = extent.camera(&timeline, &frame, &view)?;
        let scene = Scene::compose(&timeline, &extent, &frame, &view, camera);
        film.add(&[renderer.paint(&scene)?])?;
    }
    film.finish()?;
    out.flush()?;
    println!("{}, drawn by {}", path.display(), renderer.adapter());
    Ok(())
}
