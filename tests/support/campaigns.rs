//! Tables of docs/campaigns.md: results of each law from random starts.

use std::path::Path;

use tautline::campaign::{Campaign, LawSummary, Program, Spec, Summary};
use tautline::request::Silent;
use tautline::statistics::Proportion;
use tautline::studies::Batch;

/// Random starts of `vehicles` vehicles.
struct Starts {
    vehicles: u32,
    dimensions: u32,
    half_extent_m: f64,
    formation: &'static str,
    runs: u64,
}

/// Start boxes, hardly larger than the 1.5 m of each vehicle require, so that vehicles block each other.
const STARTS: [Starts; 6] = [
    Starts {
        vehicles: 5,
        dimensions: 2,
        half_extent_m: 3.0,
        formation: "{ shape = \"circle\", radius_m = 2.0 }",
        runs: 1000,
    },
    Starts {
        vehicles: 5,
        dimensions: 3,
        half_extent_m: 2.5,
        formation: "{ shape = \"sphere\", radius_m = 2.0 }",
        runs: 1000,
    },
    Starts {
        vehicles: 12,
        dimensions: 2,
        half_extent_m: 5.0,
        formation: "{ shape = \"circle\", radius_m = 4.0 }",
        runs: 1000,
    },
    Starts {
        vehicles: 12,
        dimensions: 3,
        half_extent_m: 3.0,
        formation: "{ shape = \"sphere\", radius_m = 3.0 }",
        runs: 1000,
    },
    Starts {
        vehicles: 30,
        dimensions: 2,
        half_extent_m: 8.0,
        formation: "{ shape = \"circle\", radius_m = 10.0 }",
        runs: 200,
    },
    Starts {
        vehicles: 30,
        dimensions: 3,
        half_extent_m: 4.0,
        formation: "{ shape = \"sphere\", radius_m = 4.0 }",
        runs: 200,
    },
];

const LAWS: [&str; 6] = ["edge-tension", "displacement", "potential", "orca", "cbf-qp", "flocking"];
const DURATION_S: f64 = 60.0;

impl Starts {
    fn scenario(&self) -> String {
        let Self { vehicles, dimensions, half_extent_m, formation, .. } = self;
        format!(
            "name = \"random-starts\"\nformation = {formation}\n[swarm]\ncount = {vehicles}\n\
             dimensions = {dimensions}\n[start]\nshape = \"random\"\nhalf_extent_m = {half_extent_m:?}\n\
             [law]\ndelta_m = 1.0\n[time]\nduration_s = {DURATION_S:?}\n"
        )
    }

    fn named(&self) -> String {
        let space = if self.dimensions == 2 { "plane" } else { "space" };
        format!("{}, {space}", self.vehicles)
    }
}

/// Flies a specification on all cores and returns its summary.
fn answer(spec: &str, folder: &Path) -> Summary {
    let spec = Spec::read("spec", spec).expect("a specification");
    let campaign =
        Campaign::plan(&spec, "docs", folder, None, Program::running().expect("a program"), None).expect("a plan");
    let monitor = Silent::default();
    campaign.fly(&Batch::new(None, &monitor).expect("threads")).expect("it flies").expect("nobody interrupts")
}

fn percent(share: &Proportion) -> String {
    let said = |share: f64| format!("{:.1}", 100.0 * share);
    format!("{} % ({} to {})", said(share.share.unwrap_or(f64::NAN)), said(share.low), said(share.high))
}

fn cells(law: &LawSummary) -> Vec<String> {
    let number =
        |number: Option<f64>, unit: &str| number.map_or("-".to_owned(), |number| format!("{number:.3} {unit}"));
    vec![
        percent(&law.violated),
        percent(&law.reached),
        number(law.reached_at_s.median.value, "s"),
        number(law.clearance_m.min, "m"),
        number(law.clearance_m.median.value, "m"),
    ]
}

fn row(cells: &[String]) -> String {
    format!("| {} |\n", cells.join(" | "))
}

/// Passes the rows of the table to `tell` as they are known: reach and clearance of each law, at most `most_runs` runs.
pub(crate) fn table(most_runs: u64, tell: &mut dyn FnMut(&str)) {
    let folder = std::env::temp_dir().join(format!("tautline-campaigns-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let heading =
        ["vehicles", "law", "flights", "violated", "reached", "reached at, median", "least clearance", "median"];
    tell(&(row(&heading.map(str::to_owned)) + &row(&heading.map(|_| "---".to_owned()))));
    for starts in &STARTS {
        std::fs::write(folder.join("scenario.toml"), starts.scenario()).expect("written");
        let laws = LAWS.map(|law| format!("{law:?}")).join(", ");
        let runs = starts.runs.min(most_runs);
        let spec = format!("scenario = \"scenario.toml\"\nruns = {runs}\nseed = 1\nlaws = [{laws}]\n");
        for law in &answer(&spec, &folder).laws {
            let named = vec![starts.named(), format!("`{}`", law.name), law.violated.of.to_string()];
            tell(&row(&[named, cells(law)].concat()));
        }
    }
    std::fs::remove_dir_all(&folder).expect("removed");
}

/// Returns the result of the leader star over a network that loses 2 % of its messages.
pub(crate) fn lossy(runs: u64) -> String {
    let spec = format!("scenario = \"leader-lossy\"\nruns = {runs}\nseed = 1\n[set]\nnetwork.loss = 0.02\n");
    let summary = answer(&spec, Path::new("."));
    let heading = ["flights", "violated", "reached", "reached at, median", "least clearance", "median"];
    let law = &summary.laws[0];
    let cells = [vec![law.violated.of.to_string()], cells(law)].concat();
    row(&heading.map(str::to_owned)) + &row(&heading.map(|_| "---".to_owned())) + &row(&cells)
}
