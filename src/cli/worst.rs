//! Pictures of the worst moment of each law.

use std::ops::ControlFlow;

use super::Failure;
use super::snapshots::on_page;
use tautline_render::{Renderer, Theme, Timeline, View, data_uri};
use tautline_report::report::page::Picture;
use tautline_report::run::run_while;
use tautline_sim::preflight::Preflight;
use tautline_sim::scenario::NamedLaw;
use tautline_studies::compare::{Comparison, FlightRow, Plan};

/// One picture a law, of its flight with the smallest separation at that instant. The flight is flown again up to there.
pub(super) fn pictures(plan: &Plan, comparison: &Comparison, adapter: &str) -> Result<Vec<Picture>, Failure> {
    let mut renderer = Renderer::open(&adapter.into())?;
    let view = View { theme: Theme::Light, ..View::default() };
    let mut pictures = Vec::new();
    for (law, row) in plan.laws().iter().zip(&comparison.laws) {
        let Some((worst, min_m, min_at_s)) = row.worst().and_then(|worst| Some((worst, worst.min_m?, worst.min_at_s?)))
        else {
            continue;
        };
        let timeline = flown_to(plan, law, worst, min_at_s)?;
        let png = on_page(&renderer.shoot(&timeline, min_at_s, &view)?, comparison.laws.len())?;
        let pair = worst.min_pair.map_or_else(String::new, |[a, b]| format!(", vehicles {a} and {b}"));
        let description = format!(
            "{}: {} m apart at {min_at_s:.2} s{pair}, the closest of {} flights (start.seed {}).",
            law.name,
            tautline_core::text::at_least(min_m, 3),
            comparison.runs,
            worst.seed
        );
        pictures.push(Picture { description, data_uri: data_uri(&png) });
    }
    Ok(pictures)
}

/// A flight up to just after an instant, with every step of it.
fn flown_to(plan: &Plan, law: &NamedLaw, flight: &FlightRow, time_s: f64) -> Result<Timeline, Failure> {
    let mut scenario = plan.scenario(law, flight.seed)?;
    scenario.time.record_hz = 1.0 / scenario.time.dt_s;
    let mut timeline = Timeline::of(&scenario);
    timeline.name = format!("{}, {}", scenario.name, law.name);
    let mut carry_on = |step: u64| {
        if scenario.time.end_s(step) > time_s { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    run_while(&scenario, &Preflight::of(&scenario)?, &mut timeline, &mut carry_on)?;
    Ok(timeline)
}
