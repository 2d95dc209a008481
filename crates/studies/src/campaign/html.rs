//! The answer of a campaign as a page.

use super::bins::Varied;
use super::result::{LawSummary, Quantiles, Summary};
use super::words::{interval, number, p_value, percent};
use crate::statistics::{Estimate, Proportion};
use tautline_core::text::metres;
use tautline_report::figures::{Figure, Share as Point, histograms, shares};
use tautline_report::replay::{NoReplay, Replay};
use tautline_report::report::page::{self, Badge, Markup, Page, Picture, Render as _, Start, Tone, noted, section};

/// What a page shows beside the answer.
#[derive(Clone, Debug)]
pub struct CampaignPage<'a> {
    /// The command that flies the same campaign again.
    pub command: &'a str,
    /// The specification, with everything that was set.
    pub spec: &'a str,
    /// The flights to look at, the worst of each law first.
    pub worst: &'a [WorstFlight],
}

/// A flight to look at.
#[derive(Clone, Debug, PartialEq)]
pub struct WorstFlight {
    /// Number of the run.
    pub run: u64,
    /// The law.
    pub law: String,
    /// What is to be seen, in a sentence.
    pub said: String,
    /// The command that flies it again.
    pub command: String,
    /// Where its recording is, from the page.
    pub recording: Option<String>,
    /// It at its worst moment.
    pub picture: Option<Picture>,
    /// The flight itself, or why it cannot be replayed.
    pub replay: Option<Result<Replay, NoReplay>>,
}

/// What the numbers rest on.
const ASSUMED: [&str; 4] = [
    "Runs are independent draws of what varies: a share is about that distribution, and about no other. Where only grids vary, \
     runs are all of their points, and shares have no interval.",
    "A flight violates where the independent judge finds two vehicles closer than delta, or one nearer to an obstacle than its \
     clearance, between steps too. Flights that ended \
     early, or of which the judge cannot tell, count at the upper end of an interval.",
    "Shares of a number of runs that was fixed beforehand have the two-sided interval of Clopper and Pearson, which leaves out 2.5 % on \
     either side; the bound of the verdict is one-sided and leaves out 5 % above. Where flying stopped as soon as enough was known, \
     both are those of a confidence sequence.",
    "An interval holds the true value in at least 95 of 100 campaigns. Of many intervals on one page some will miss.",
];

/// What estimates of rare violations rest on.
const ASSUMED_OF_SPLITTING: [&str; 2] = [
    "Each estimate is without bias for any number of flights; their mean has Student's interval, which is that of normal values.",
    "Flights from one start differ by their noise from step to step; a run draws its start, and whatever else is varied, anew.",
];

impl Summary {
    /// The answer as a self-contained page.
    #[must_use]
    pub fn to_html(&self, page: &CampaignPage<'_>) -> String {
        if self.laws.iter().any(|law| law.splitting.is_some()) {
            return self.rare_page(page);
        }
        let is_clear = self.is_clear();
        let mut sections =
            vec![section("How flights ended", &[self.shares_table(), page::figures(&self.histograms())])];
        sections.push(section("Numbers of flights", &self.laws.iter().map(numbers).collect::<Vec<_>>()));
        if !self.pairs.is_empty() {
            sections.push(section("Laws on the same runs", &[self.pairs_table()]));
        }
        for varied in &self.varied {
            sections.push(section(&format!("Over {}", varied.key), &self.over(varied)));
        }
        let notes = self.notes();
        if !notes.is_empty() {
            sections.push(section("What to know", &[page::list(&notes)]));
        }
        sections.push(section("The flights with the least clearance", &worst(page)));
        sections.push(section("What was assumed", &[page::list(&ASSUMED)]));
        sections.push(section("Repeat it", &[page::command(page.command), page::command(page.spec)]));
        let (tone, word) = match (is_clear, self.laws.iter().any(|law| law.violated.count > 0)) {
            (true, _) => (Tone::Good, "no violation"),
            (false, true) => (Tone::Bad, "violations"),
            (false, false) => (Tone::Bad, "not all known"),
        };
        Page {
            title: self.name.clone(),
            kind: "Campaign",
            badge: Badge { tone, word: word.to_owned() },
            verdict: self.headline(),
            reasons: Vec::new(),
            warnings: Vec::new(),
            sections,
        }
        .render_with_replays()
    }

    /// The page of estimates of rare violations.
    fn rare_page(&self, page: &CampaignPage<'_>) -> String {
        let columns = ["Law", "Estimates", "Probability of a violation", "Came to nothing", "Steps flown"];
        let rows = self.laws.iter().filter_map(|law| {
            let of = law.splitting.as_ref()?;
            let said = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.2e}"));
            let interval = format!("{} to {}", said(of.probability.low), said(of.probability.high));
            Some([
                law.name.render(),
                number(of.repetitions).render(),
                noted(&said(of.probability.value), &interval),
                number(of.extinct.count).render(),
                number(of.steps).render(),
            ])
        });
        let table = page::numbers("By adaptive multilevel splitting, with 95 % intervals", &columns, rows);
        let notes = [self.notes(), ASSUMED_OF_SPLITTING.map(str::to_owned).to_vec()].concat();
        let found = self.laws.iter().any(|law| !law.bad.is_empty());
        Page {
            title: self.name.clone(),
            kind: "Rare violations",
            badge: Badge { tone: Tone::Bad, word: if found { "violations" } else { "nothing known" }.to_owned() },
            verdict: self.headline(),
            reasons: Vec::new(),
            warnings: Vec::new(),
            sections: vec![
                section("How rare a violation is", &[table]),
                section("What to know", &[page::list(&notes)]),
                section("Flights that were violated", &worst(page)),
                section("Repeat it", &[page::command(page.command), page::command(page.spec)]),
            ],
        }
        .render()
    }

    fn shares_table(&self) -> Markup {
        let columns = ["Law", "Flights", "Violated", "Clear", "Not known", "Reached", "Passed"];
        let rows = self.laws.iter().map(|law| {
            let share = |share: &Proportion| noted(&number(share.count), &interval(share));
            [
                law.name.render(),
                number(law.violated.of).render(),
                share(&law.violated),
                share(&law.clear),
                number(law.unknown).render(),
                share(&law.reached),
                share(&law.pass),
            ]
        });
        page::numbers("Flights, with two-sided 95 % intervals of their shares", &columns, rows)
    }

    fn histograms(&self) -> Vec<Figure> {
        let of = |pick: &dyn Fn(&LawSummary) -> Option<tautline_report::figures::Histogram>| {
            self.laws.iter().filter_map(|law| Some((law.name.clone(), pick(law)?))).collect::<Vec<_>>()
        };
        let clearance = of(&|law| law.clearance_histogram_m.clone());
        let reached = of(&|law| law.reached_histogram_s.clone());
        let drawn = (!clearance.is_empty()).then(|| {
            let limit = Some((0.0, "delta"));
            histograms("clearance", "Smallest separation less delta", "clearance [m]", &clearance, limit)
        });
        let arrived = (!reached.is_empty())
            .then(|| histograms("reached", "When the formation was reached", "time [s]", &reached, None));
        drawn.into_iter().chain(arrived).collect()
    }

    fn pairs_table(&self) -> Markup {
        let columns = [
            "Two laws",
            "Only the first clear",
            "Only the second",
            "p",
            "Only the first reached",
            "Only the second",
            "p",
        ];
        let rows = self.pairs.iter().map(|pair| {
            let said =
                |of: &crate::statistics::Paired| [number(of.only_first), number(of.only_second), p_value(of.p_value)];
            let name = vec![format!("{} and {}", pair.laws[0], pair.laws[1])];
            [name, said(&pair.clear).to_vec(), said(&pair.reached).to_vec()].concat()
        });
        page::numbers("Runs that two laws ended differently, with McNemar's exact test", &columns, rows)
    }

    fn over(&self, varied: &Varied) -> Vec<Markup> {
        let names: Vec<_> = self.laws.iter().map(|law| law.name.as_str()).collect();
        let headings = names.iter().flat_map(|law| [format!("{law}: violated"), format!("{law}: reached")]);
        let headings: Vec<_> = std::iter::once(varied.key.clone()).chain(headings).collect();
        let columns: Vec<_> = headings.iter().map(String::as_str).collect();
        let rows = varied.bins.iter().map(|bin| {
            let shares = bin.laws.iter().flat_map(|of| [of.violated, of.reached]);
            let cell = |share: Proportion| {
                let value = share.share.map_or_else(|| "-".to_owned(), percent);
                noted(&format!("{value} of {}", number(share.of)), &interval(&share))
            };
            std::iter::once(bin.said.render()).chain(shares.map(cell)).collect::<Vec<_>>()
        });
        let table = page::numbers("Shares with two-sided 95 % intervals", &columns, rows);
        let middle = |bin: &super::bins::Bin| Some(f64::midpoint(bin.low?, bin.high?));
        let series = |pick: &dyn Fn(&super::bins::BinShares) -> Proportion| {
            let of_law = |law: usize| {
                let point = |bin: &super::bins::Bin| {
                    let share = pick(bin.laws.get(law)?);
                    Some(Point { value: middle(bin)?, share: share.share?, interval: Some([share.low, share.high]) })
                };
                varied.bins.iter().filter_map(point).collect::<Vec<_>>()
            };
            names.iter().enumerate().map(|(law, name)| ((*name).to_owned(), of_law(law))).collect::<Vec<_>>()
        };
        if varied.bins.iter().any(|bin| bin.low.is_none()) {
            return vec![table];
        }
        let figures = [
            shares("violated", &varied.key, "violated", &series(&|of| of.violated), varied.logarithmic),
            shares("reached", &varied.key, "reached", &series(&|of| of.reached), varied.logarithmic),
        ];
        vec![page::figures(&figures), table]
    }
}

fn numbers(law: &LawSummary) -> Markup {
    let columns = ["Number", "Least", "5 %", "Median", "95 %", "Most"];
    let kinds: [(&str, Quantiles); 3] = [
        ("Smallest separation less delta [m]", law.clearance_m),
        ("Formation reached at [s]", law.reached_at_s),
        ("Way flown by all vehicles [m]", law.path_length_m),
    ];
    let rows = kinds.map(|(name, of)| {
        let plain = |number: Option<f64>| number.map_or_else(|| "-".to_owned(), metres).render();
        let estimate = |Estimate { value, low, high }: Estimate| {
            let end = |number: Option<f64>| number.map_or_else(|| "-".to_owned(), metres);
            let said = (low.is_some() || high.is_some()).then(|| format!("{} to {}", end(low), end(high)));
            noted(&end(value), &said.unwrap_or_default())
        };
        [name.render(), plain(of.min), estimate(of.p05), estimate(of.median), estimate(of.p95), plain(of.max)]
    });
    page::numbers(&format!("{}: quantiles with 95 % intervals of order statistics", law.name), &columns, rows)
}

fn worst(page: &CampaignPage<'_>) -> Vec<Markup> {
    if page.worst.is_empty() {
        return vec![page::list(&["There are none."])];
    }
    let mut blocks = Vec::new();
    let pictures: Vec<_> = page.worst.iter().filter_map(|flight| flight.picture.clone()).collect();
    if !pictures.is_empty() {
        blocks.push(page::pictures(&pictures));
    }
    for flight in page.worst {
        let recording = flight.recording.as_ref().map(|path| format!("Its recording: {path}"));
        let said: Vec<_> = std::iter::once(flight.said.clone()).chain(recording).collect();
        blocks.push(page::list(&said));
        blocks.extend(flight.replay.as_ref().map(|replay| match replay {
            Ok(replay) => page::replay(&flight.said, replay, Start::OnDemand),
            Err(why) => page::no_replay(&why.to_string()),
        }));
        blocks.push(page::command(&flight.command));
    }
    blocks
}
