//! Draws a picture of a recording: `cargo run --example snapshot -- out/pentagon/run.mcap 2.15 closest.png`.

use std::error::Error;
use std::path::Path;

use tautline::render::{AdapterChoice, CameraSpec, Renderer, Theme, Timeline, View};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [recording, time_s, picture] = arguments.as_slice() else {
        return Err("usage: snapshot RECORDING TIME_S PICTURE".into());
    };
    let timeline = Timeline::read_mcap(Path::new(recording))?;
    let view = View { camera: CameraSpec::Top, theme: Theme::Light, size_px: [1600, 900], ..View::default() };
    let mut renderer = Renderer::open(&AdapterChoice::Best)?;
    std::fs::write(picture, renderer.shoot(&timeline, time_s.parse()?, &view)?.to_png()?)?;
    println!("{picture}, drawn by {}", renderer.adapter());
    Ok(())
}
