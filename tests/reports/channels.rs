//! Figures of the channels of each vehicle: attitude, rotors, wind, age of messages.

use tautline::figures::{self, Criteria, Figure};
use tautline::flight_log::FlightLog;
use tautline::record::{Channel, Sample};
use tautline::swarm::{Rows, Swarm};

use crate::figures::{Drawing, TOLERANCE_PX};

/// Stroke of the line of a limit.
const LIMIT_LINE: (&str, &str) = ("#1B1F24", "1.3");

const MAX_THRUST_N: f64 = 0.12;
const NAMES: [&str; 4] = ["attitude", "rotors", "wind", "message-age"];

/// Returns the channels of vehicles that are tilted about x by 10 degrees times their index; `scale` multiplies all
/// numbers.
fn channels(count: usize, scale: f64) -> [Channel; 4] {
    let filled = |name, columns: &[&str], row: &dyn Fn(f64) -> Vec<f64>| {
        let values = (0..count).flat_map(|i| row(i as f64)).collect();
        Channel { values, ..Channel::new(name, columns) }
    };
    let turned = |i: f64| {
        let half = (5.0 * i * scale).to_radians();
        vec![half.cos(), half.sin(), 0.0, 0.0]
    };
    [
        filled("attitude", &["qw", "qx", "qy", "qz"], &turned),
        filled("rotors", &["thrust_1_n", "thrust_2_n", "thrust_3_n", "thrust_4_n"], &|i| {
            [0.01, 0.02, 0.04, 0.03].map(|thrust| thrust * i * scale).to_vec()
        }),
        filled("wind", &["wind_x_m_s", "wind_y_m_s", "wind_z_m_s"], &|i| vec![3.0 * i * scale, -4.0 * i * scale, 0.0]),
        filled("message_age", &["oldest_s", "mean_s"], &|i| vec![0.05 * i * scale, 0.01]),
    ]
}

/// Returns the figures of `samples` samples 0.05 s apart; in sample `k` the channels are multiplied by `scale(k)`.
fn figures_of(count: usize, samples: u64, scale: impl Fn(u64) -> f64) -> Vec<Figure> {
    let mut history = FlightLog::default();
    let (swarm, control) = (Swarm::at_rest(Rows::from_fn(count, |i, axis| (3 * i + axis) as f64)), Rows::zeros(count));
    for k in 0..samples {
        let channels = channels(count, scale(k));
        history.take(&Sample { channels: &channels, ..Sample::new(0.05 * k as f64, k, &swarm, &control) });
    }
    let criteria = Criteria {
        delta_m: 1.0,
        certified_m: None,
        shape: None,
        edge_error_m: None,
        disagreement_m_s: None,
        most_thrust_n: Some(MAX_THRUST_N),
        obstacles: &[],
    };
    let mut figures = figures::of_run(&history, &criteria);
    assert!(figures.iter().all(|figure| figures::NAMES_OF_RUN.contains(&figure.name.as_str())));
    figures.retain(|figure| NAMES.contains(&figure.name.as_str()));
    figures
}

#[test]
fn every_channel_has_a_figure_with_a_line_per_vehicle() {
    let figures = figures_of(3, 100, |k| if k < 50 { 1.0 } else { 0.5 });
    assert_eq!(figures.iter().map(|figure| &*figure.name).collect::<Vec<_>>(), NAMES);
    let labels =
        ["tilt from upright [°]", "largest thrust of a rotor [N]", "wind speed [m/s]", "age of the oldest message [s]"];
    for ((figure, label), third) in figures.iter().zip(labels).zip([20.0, 0.08, 10.0, 0.1]) {
        let drawing = Drawing::of(figure);
        assert!(drawing.words().iter().any(|word| word == label), "{label}: {:?}", drawing.words());
        let lines = drawing.polylines(("#3F9E8E", "1.5"));
        let (line, [first, last]) = (&lines[0], [third, 0.5 * third].map(|number| drawing.place(true, number)));
        assert!((line[0].1 - first).abs() <= TOLERANCE_PX, "{}: {line:?}", figure.name);
        assert!((line[line.len() - 1].1 - last).abs() <= TOLERANCE_PX, "{}: {line:?}", figure.name);
        let peak = format!("at most {third:.3}");
        assert!(figure.description.contains(&peak), "{}", figure.description);
    }
    let rotors = Drawing::of(&figures[1]);
    assert!((rotors.level(LIMIT_LINE) - rotors.place(true, MAX_THRUST_N)).abs() <= TOLERANCE_PX);
}

#[test]
fn an_extreme_of_one_sample_is_in_every_figure() {
    let figures = figures_of(2, 10_000, |k| if k == 7777 { 4.0 } else { 0.1 });
    for (figure, peak) in figures.iter().zip(["40.000°", "0.160 N", "20.000 m/s", "0.200 s"]) {
        assert!(figure.description.contains(&format!("at most {peak}.")), "{}", figure.description);
    }
}

#[test]
fn the_figures_of_a_large_swarm_are_bounded() {
    let figures = figures_of(3000, 60, |k| 1e-3 * (1.0 + (k as f64).sin()));
    assert_eq!(figures.len(), 4);
    for figure in &figures {
        assert!(figure.svg.len() < 60_000, "{}: {} bytes", figure.name, figure.svg.len());
        assert!(Drawing::of(figure).words().iter().any(|word| word == "5 to 95 %"), "{}", figure.name);
    }
}

#[test]
fn a_channel_with_other_columns_or_vehicles_has_no_figure() {
    let mut history = FlightLog::default();
    let (swarm, control) = (Swarm::at_rest(Rows::zeros(2)), Rows::zeros(2));
    let euler = Channel { values: vec![0.0; 6], ..Channel::new("attitude", &["roll", "pitch", "yaw"]) };
    let [_, rotors, ..] = channels(3, 1.0);
    history.take(&Sample { channels: &[euler, rotors], ..Sample::new(0.0, 0, &swarm, &control) });
    assert!(figures::channels(&history, Some(MAX_THRUST_N)).is_empty());
}
