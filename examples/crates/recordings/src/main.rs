//! Reads a recording from any source and audits it: `cargo run -p example-recordings -- RECORDING DELTA_M`.

use std::error::Error;
use std::path::Path;

use tautline_audit::recorded::{Settings, TrackAuditor};
use tautline_recordings::{ReadOptions, open};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [path, delta_m] = arguments.as_slice() else { return Err("usage: RECORDING DELTA_M".into()) };
    let mut recording = open(Path::new(path), &ReadOptions::default())?;
    let mut auditor = TrackAuditor::new(Settings::delta(delta_m.parse()?))?;
    let mut items = Vec::new();
    while recording.read(&mut items)? {
        auditor.push(recording.vehicles(), &items)?;
        items.clear();
    }
    let outcome = auditor.finish()?;
    println!("{:?}", outcome.status);
    recording.notes().iter().for_each(|note| println!("note: {note}"));
    Ok(())
}
