//! `tautline attack`: the worst start, wind or loss within bounds.

use std::path::PathBuf;

use clap::Args;
use clap::builder::{PossibleValue, TypedValueParser};

use super::Exit;
use super::console::{Console, Terminal};
use super::pictures::pictures;
use super::reading::one_of;
use super::scenario::ScenarioArguments;
use tautline_report::request::Failure;
use tautline_report::request::outputs::is_standard_output;
use tautline_studies::attack::{
    Asked, AttackRequest, FLIGHTS, Method, SEEDS_OF_A_CANDIDATE, Variation, attack as answer,
};

/// Arguments of `tautline attack`.
#[derive(Debug, Args)]
#[command(after_help = "\
Exits with 0 where the search found no violation, with 1 where it found one or was interrupted. What it did not find may be \
there all the same: it is a search, not a proof. docs/attack.md says more.")]
pub(super) struct AttackArguments {
    #[command(flatten)]
    what: ScenarioArguments,
    /// A key that is a number, and the values between which it may be: `network.loss=0..0.3`; may be given several times.
    #[arg(long, value_name = "KEY=LOW..HIGH")]
    vary: Vec<String>,
    /// Every start may be up to R metres from that of the scenario, along each axis.
    #[arg(long, value_name = "R", allow_negative_numbers = true)]
    start: Option<f64>,
    /// Every velocity at the start may be up to V m/s from that of the scenario, along each axis.
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    velocity: Option<f64>,
    /// No two start nearer than this many metres to each other, more than delta; without it any start that can be flown will do.
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    apart: Option<f64>,
    /// Flights of the whole search.
    #[arg(long, value_name = "F", default_value_t = 1000, value_parser = clap::value_parser!(u64).range(FLIGHTS))]
    flights: u64,
    /// Fly each candidate with K seeds of noise, that of the scenario and those that follow; the worst counts.
    #[arg(long, value_name = "K", default_value_t = 1, value_parser = clap::value_parser!(u64).range(SEEDS_OF_A_CANDIDATE))]
    seeds: u64,
    /// How candidates are found.
    #[arg(long, value_name = "HOW", default_value = "cma-es", value_parser = method())]
    method: Method,
    /// Seed of the search; noise has that of the scenario.
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,
    /// Fly the worst again and leave its recording, report and pictures in this folder, as `tautline run` does.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write everything as JSON; - is standard output, for this and the next two.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write a row for each candidate that was worse than all before it as CSV.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write a page with a plot.
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Overwrite files that exist, and a folder that holds a finished run.
    #[arg(long)]
    force: bool,
    /// Print no table and no progress.
    #[arg(long)]
    quiet: bool,
    /// Threads to use, by default one a core; the result is the same for any number.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
}

fn method() -> impl TypedValueParser<Value = Method> {
    let help = |method| match method {
        Method::CmaEs => "CMA-ES, started again with twice the population where it has come to rest",
        Method::Random => "Uniform within the bounds",
    };
    one_of(Method::ALL.map(|method| (PossibleValue::new(method.name()).help(help(method)), method)).into())
}

impl AttackArguments {
    /// Whether pictures are taken.
    #[cfg(all(feature = "viewer", target_os = "linux"))]
    pub(super) fn draws(&self) -> bool {
        self.out.is_some()
    }

    fn request(&self) -> Result<AttackRequest, Failure> {
        let vary = self.vary.iter().map(|text| Variation::parse(text)).collect::<Result<Vec<_>, _>>();
        let vary = vary.map_err(|why| {
            Failure::input(
                "attack/variation",
                format!("--vary: {why}"),
                "write a key that is a number and two different finite numbers, the smaller one first, as in \
                 --vary network.loss=0..0.3",
            )
        })?;
        let asked = Asked {
            vary,
            start_m: self.start,
            velocity_m_s: self.velocity,
            apart_m: self.apart,
            method: self.method,
            flights: self.flights,
            seeds: self.seeds,
            seed: self.seed,
        };
        Ok(AttackRequest {
            out: self.out.clone(),
            json: self.json.clone(),
            csv: self.csv.clone(),
            html: self.html.clone(),
            force: self.force,
            threads: self.threads.map(usize::from),
            ..AttackRequest::new(self.what.request()?, asked)
        })
    }
}

pub(super) fn attack(arguments: &AttackArguments) -> Result<Exit, Failure> {
    let request = arguments.request()?;
    let data_on_stdout = request.outputs().any(|(_, file)| is_standard_output(file));
    let monitor = Terminal::new(Console { data_on_stdout, quiet: arguments.quiet })?;
    let attack = answer(&request, &*pictures("best", true), &monitor)?;
    Ok(Exit::good_if(attack.is_some_and(|attack| !attack.is_bad() && !attack.interrupted)))
}
