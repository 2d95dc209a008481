//! Words about what is seen: caption, verdict, legend, numbers of the vehicles, the closest pair.

use super::placing::{Placing, width};
use super::world::MOST_EDGES;
use super::{Colour, Mark, Painting, Scene, Theme};
use crate::swarm::Pair;
use crate::text::at_least;

/// Most vehicles whose names are written on them; of more, those that are closer than delta to another are named.
const NAMED: usize = 64;
/// Most pairs closer than delta whose distance is written beside them: the worst ones.
const LABELLED: usize = 3;
/// Colours of the scale in the legend.
const SHADES: i16 = 16;
/// Widest picture \[pixels\] that has no room for a legend, and lowest.
const NO_LEGEND_PX: [u32; 2] = [420, 260];
/// Longest name that is written in full.
const LONGEST_NAME: usize = 40;
/// Fewest letters of a name that are worth writing.
const FEWEST_LETTERS: usize = 4;
/// Opacity of what is behind words.
const BACKING: f32 = 0.72;
const WHITE: Colour = Colour::hex(0xFF_FF_FF);

impl Painting<'_> {
    pub(super) fn annotate(&self, scene: &mut Scene) {
        let layers = self.view.layers;
        let mut marks = std::mem::take(&mut scene.marks);
        let mut placing = Placing::new(&mut marks, self.view.size_px);
        if layers.caption {
            self.caption(&mut placing);
            self.legend(&mut placing);
        }
        if layers.labels {
            self.keep_off_vehicles(&mut placing);
        }
        if layers.closest {
            self.distances(&mut placing);
        }
        if layers.ground {
            self.scale(&mut placing);
        }
        if layers.labels {
            self.names(&mut placing);
        }
        scene.marks = marks;
    }

    fn caption(&self, placing: &mut Placing<'_>) {
        let (theme, size_px, margin) = (self.view.theme, self.view.text_px(1.0), self.margin());
        let width_px = self.view.size_px[0] as f32;
        let mut y = self.banner(placing);
        let (ground, room_px) = (theme.background().at(BACKING), 0.3 * size_px);
        let (bottom, taken) = placing.placed();
        // What has no room is left out: first the closest approach, then the name, then the verdict, then the time.
        let large_px = 1.35 * size_px;
        let time = format!("t = {:.2} s", self.moment.time_s);
        let mut free_px = width_px - 2.0 * margin;
        if width(large_px, &time) > free_px {
            return;
        }
        free_px = placing.write([width_px - margin, y], [1.0, 0.0], large_px, theme.ink(), &time)[0][0] - 2.0 * margin;
        let below = y + 1.8 * size_px;
        let (verdicts, colour) = self.verdict();
        let verdict = verdicts.iter().find(|text| width(size_px, text) <= width_px - 2.0 * margin);
        let verdict_px =
            verdict.map(|text| placing.write([width_px - margin, below], [1.0, 0.0], size_px, colour, text));
        placing.back(taken, bottom, ground, room_px);
        let (_, taken) = placing.placed();
        if let Some(name) = cut(&shortened(&self.footage.name), large_px, free_px) {
            placing.write([margin, y], [0.0, 0.0], large_px, theme.ink(), &name);
            placing.back(taken, bottom, ground, room_px);
        }
        y = below;
        let (_, taken) = placing.placed();
        let free_px = verdict_px.map_or(0.0, |corners_px| corners_px[0][0] - 2.0 * margin);
        if let Some(text) = self.closest_so_far().iter().find(|text| width(size_px, text) <= free_px) {
            placing.write([margin, y], [0.0, 0.0], size_px, theme.soft_ink(), text);
            placing.back(taken, bottom, ground, room_px);
        }
    }

    /// A violation that lasts is written across the top, and the picture is framed; gives where the caption begins.
    fn banner(&self, placing: &mut Placing<'_>) -> f32 {
        let (alarm, size_px) = (self.view.theme.alarm(), self.view.text_px(1.1));
        let (Some(&(pair, distance_m)), Some(delta_m)) = (self.violated.first(), self.footage.delta_m) else {
            return self.margin();
        };
        let [width_px, height_px] = self.view.size_px.map(|size| size as f32);
        let (pair, distance) = (self.pair(pair), metres(distance_m));
        let more = match self.violated.len() - 1 {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        let texts = [
            format!("VIOLATION  vehicles {pair} {distance} apart, delta {}{more}", metres(delta_m)),
            format!("VIOLATION {pair} {distance} apart"),
            "VIOLATION".to_owned(),
        ];
        let text = texts.iter().find(|text| width(size_px, text) <= width_px).unwrap_or(&texts[2]);
        let bottom = 1.9 * size_px;
        placing.draw(Mark::Box { corners_px: [[0.0, 0.0], [width_px, bottom]], colour: alarm, round_px: 0.0 });
        let corners_px = [[0.0, 0.0], [width_px, height_px]];
        placing.draw(Mark::Outline { corners_px, colour: alarm, width_px: 5.0 * self.view.unit_px() });
        let on_alarm = if self.view.theme == Theme::Dark { Colour::hex(0x14_00_02) } else { WHITE };
        placing.write([width_px / 2.0, bottom / 2.0], [0.5, 0.5], size_px, on_alarm, text);
        placing.take([[0.0, 0.0], [width_px, bottom]]);
        bottom + 0.6 * self.margin()
    }

    /// What can be said up to now, in a few words and in fewer.
    fn verdict(&self) -> (Vec<String>, Colour) {
        let theme = self.view.theme;
        if self.footage.delta_m.is_none() {
            return (vec!["not judged: no delta".to_owned(), "not judged".to_owned()], theme.soft_ink());
        }
        let began: Vec<_> = self.footage.violations().iter().filter(|span| span.from_s <= self.moment.time_s).collect();
        match began.first() {
            None => (vec!["clear so far".to_owned()], theme.good()),
            Some(span) => {
                let at = match began.len() {
                    1 => format!("violated at {:.2} s", span.from_s),
                    many => format!("{many} violations, the first at {:.2} s", span.from_s),
                };
                let texts = vec![format!("{at} by {}", self.pair(span.pair)), at, "violated".to_owned()];
                (texts, theme.alarm())
            }
        }
    }

    /// The closest approach up to now, at length and in short.
    fn closest_so_far(&self) -> Vec<String> {
        let Some(approach) = self.moment.so_far else { return Vec::new() };
        let (separation, pair) = (metres(approach.separation_m), self.pair(approach.pair));
        let at = format!("{:.2} s", approach.time_s);
        let delta = self.footage.delta_m.map_or(String::new(), |delta_m| format!("  (delta {})", metres(delta_m)));
        vec![
            format!("closest so far {separation}, vehicles {pair} at {at}{delta}"),
            format!("closest so far {separation}, {pair}{delta}"),
            format!("closest so far {separation}"),
        ]
    }

    fn legend(&self, placing: &mut Placing<'_>) {
        let [width_px, height_px] = self.view.size_px;
        if width_px < NO_LEGEND_PX[0] || height_px < NO_LEGEND_PX[1] {
            return;
        }
        let (theme, size_px, margin) = (self.view.theme, self.view.text_px(0.85), self.margin());
        let (layers, plan) = (self.view.layers, self.footage.plan.as_ref());
        let y = height_px as f32 - margin;
        let mut x = margin;
        let (bottom, taken) = placing.placed();
        let ink = theme.soft_ink();
        let room_px = width_px as f32 - margin;
        let fits = |x: f32, text: &str| x + width(size_px, text) <= room_px;
        if let Some(plan) = plan.filter(|_| layers.edges) {
            if plan.graph.edge_count() <= MOST_EDGES {
                let [left, scale] = [x, 9.0 * size_px];
                let colours = (-SHADES..=SHADES).map(|k| theme.tension(f32::from(k) / f32::from(SHADES))).collect();
                let corners_px = [[left, y - 0.6 * size_px], [left + scale, y]];
                placing.draw(Mark::Scale { corners_px, colours });
                placing.take(corners_px);
                let above = y - 0.9 * size_px;
                placing.write([left, above], [0.0, 1.0], size_px, ink, "push");
                placing.write([left + scale / 2.0, above], [0.5, 1.0], size_px, ink, "rest");
                placing.write([left + scale, above], [1.0, 1.0], size_px, ink, "pull");
                x += scale + 2.0 * size_px;
            } else {
                let text = format!("{} edges, not drawn", plan.graph.edge_count());
                if fits(x, &text) {
                    x = placing.write([x, y], [0.0, 1.0], size_px, ink, &text)[1][0] + 1.5 * size_px;
                }
            }
        }
        let stroke = 1.6 * self.view.unit_px();
        let arm = 0.32 * size_px;
        let middle = y - size_px / 2.0;
        if layers.marks && fits(x + size_px, "start") {
            for down in [arm, -arm] {
                let ends_px = [[x, middle - down], [x + 2.0 * arm, middle + down]];
                placing.draw(Mark::Stroke { ends_px, colour: ink, width_px: stroke });
            }
            x = placing.write([x + size_px, y], [0.0, 1.0], size_px, ink, "start")[1][0] + 1.5 * size_px;
        }
        if layers.marks && plan.is_some() && fits(x + size_px, "goal slot") {
            placing.draw(Mark::Ring { at_px: [x + arm, middle], radius_px: 1.1 * arm, colour: ink, width_px: stroke });
            x = placing.write([x + size_px, y], [0.0, 1.0], size_px, ink, "goal slot")[1][0] + 1.5 * size_px;
        }
        let shell = "keep-out shell, radius delta/2";
        if layers.shells && self.footage.delta_m.is_some() && fits(x + size_px, shell) {
            let (at_px, colour) = ([x + arm, middle], theme.shell());
            placing.draw(Mark::Ring { at_px, radius_px: 1.4 * arm, colour, width_px: 1.6 * stroke });
            placing.write([x + 1.2 * size_px, y], [0.0, 1.0], size_px, ink, shell);
        }
        placing.back(taken, bottom, theme.background().at(BACKING), 0.3 * size_px);
    }

    /// Keeps words off the vehicles that have names.
    fn keep_off_vehicles(&self, placing: &mut Placing<'_>) {
        for k in self.named() {
            if let Some(at) = self.vehicle(k).and_then(|place| self.camera.project(place)) {
                #[expect(clippy::cast_possible_truncation, reason = "pixels")]
                let [x, y, radius] =
                    [at.at_px[0], at.at_px[1], self.footage.radius_m[k] * at.px_per_m].map(|v| v as f32);
                placing.take([[x - radius, y - radius], [x + radius, y + radius]]);
            }
        }
    }

    /// The distance of the closest pair, and of the worst pairs closer than delta, beside the line that joins them; not
    /// where that is outside the picture or has no room.
    fn distances(&self, placing: &mut Placing<'_>) {
        let theme = self.view.theme;
        let size_px = self.view.text_px(1.0);
        let alarmed = self.violated.iter().take(LABELLED).map(|&(pair, distance_m)| (pair, distance_m, true));
        let nearest = self.clear_nearest().map(|(pair, distance_m)| (pair, distance_m, false));
        for (pair, distance_m, alarm) in alarmed.chain(nearest) {
            let (Some(first), Some(second)) = (self.vehicle(pair.first()), self.vehicle(pair.second())) else {
                continue;
            };
            let Some(middle) = self.camera.project((first + second) / 2.0) else { continue };
            let text = metres(distance_m);
            let distances_px = [1.1 * size_px, 1.8 * size_px, 3.0 * size_px];
            let Some(at) = placing.find(middle.at_px, &distances_px, size_px, &text) else { continue };
            let half = width(size_px, &text) / 2.0 + 0.25 * size_px;
            let corners_px = [[at[0] - half, at[1] - 0.68 * size_px], [at[0] + half, at[1] + 0.68 * size_px]];
            let (ground, ink) = if alarm {
                (theme.alarm(), if theme == Theme::Dark { Colour::hex(0x14_00_02) } else { WHITE })
            } else {
                (theme.background().at(0.82), theme.ink())
            };
            placing.draw(Mark::Box { corners_px, colour: ground, round_px: 0.3 * size_px });
            placing.write(at, [0.5, 0.5], size_px, ink, &text);
            placing.take(corners_px);
        }
    }

    /// The vehicles that have names: all of few, else those of the worst violations.
    fn named(&self) -> Vec<usize> {
        if self.footage.count() <= NAMED {
            return (0..self.footage.count()).collect();
        }
        let mut named = Vec::new();
        for k in self.violated.iter().flat_map(|(pair, _)| [pair.first(), pair.second()]) {
            if named.len() < NAMED && !named.contains(&k) {
                named.push(k);
            }
        }
        named
    }

    /// The names of the vehicles, on those that are large enough and beside the others.
    fn names(&self, placing: &mut Placing<'_>) {
        let (theme, size_px, alarmed) = (self.view.theme, self.view.text_px(0.85), self.alarmed());
        for k in self.named() {
            let Some(at) = self.vehicle(k).and_then(|place| self.camera.project(place)) else { continue };
            // One that is too close to another is often behind it.
            let is_hidden = self.is_hidden(k);
            if is_hidden && !alarmed[k] {
                continue;
            }
            let name = shortened(&self.footage.vehicles[k]);
            #[expect(clippy::cast_possible_truncation, reason = "pixels")]
            let ([x, y], radius) = (at.at_px.map(|v| v as f32), (self.footage.radius_m[k] * at.px_per_m) as f32);
            let fitting = (1.5 * radius).min(1.7 * radius / width(1.0, &name).max(0.4)).min(size_px);
            if fitting >= 8.0 && !is_hidden {
                placing.draw(Mark::Words {
                    at_px: [x, y],
                    anchor: [0.5, 0.5],
                    size_px: fitting,
                    colour: theme.background(),
                    text: name,
                });
                continue;
            }
            let offset = f64::from(radius + 0.2 * size_px);
            let colour = if alarmed[k] { theme.alarm() } else { self.colour(k) };
            // Above to the right, above to the left, below to the right, below to the left: where there is room.
            for [left, above] in [[0.0, 1.0], [1.0, 1.0], [0.0, 0.0], [1.0, 0.0]] {
                let beside = [
                    at.at_px[0] + offset * (1.0 - 2.0 * f64::from(left)),
                    at.at_px[1] + offset * (1.0 - 2.0 * f64::from(above)),
                ];
                if placing.words_at(beside, [left, above], 0.85 * size_px, colour, &name) {
                    break;
                }
            }
        }
    }

    /// Whether another vehicle is in front of the middle of this one.
    fn is_hidden(&self, k: usize) -> bool {
        let seen = |k: usize| self.camera.project(self.vehicle(k)?);
        let Some(own) = seen(k) else { return true };
        (0..self.footage.count()).filter(|&other| other != k).filter_map(|other| Some((other, seen(other)?))).any(
            |(other, at)| {
                let apart = (at.at_px[0] - own.at_px[0]).hypot(at.at_px[1] - own.at_px[1]);
                at.depth_m < own.depth_m && apart < self.footage.radius_m[other] * at.px_per_m
            },
        )
    }

    /// A pair by the names of its vehicles.
    fn pair(&self, pair: Pair) -> String {
        let name = |k: usize| self.footage.vehicles.get(k).map_or_else(|| (k + 1).to_string(), |name| shortened(name));
        format!("{}-{}", name(pair.first()), name(pair.second()))
    }

    fn margin(&self) -> f32 {
        16.0 * self.view.unit_px()
    }
}

/// A length to the millimetre, rounded down: what is said to be clear is clear.
pub(crate) fn metres(length_m: f64) -> String {
    format!("{} m", at_least(length_m, 3))
}

/// As much of a name as has room, with an ellipsis where it is cut; none where even a few letters have none.
fn cut(name: &str, size_px: f32, room_px: f32) -> Option<String> {
    if width(size_px, name) <= room_px {
        return Some(name.to_owned());
    }
    let start = |letters: usize| name.chars().take(letters).chain(['…']).collect::<String>();
    (FEWEST_LETTERS..name.chars().count()).rev().map(start).find(|start| width(size_px, start) <= room_px)
}

fn shortened(name: &str) -> String {
    let name: String = name.chars().filter(|c| !c.is_control()).collect();
    if name.chars().count() <= LONGEST_NAME {
        return name;
    }
    name.chars().take(LONGEST_NAME - 1).chain(['…']).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_distance_is_never_shown_larger_than_it_is() {
        assert_eq!([1.999_999, 2.46, 2.0, 0.0].map(metres), ["1.999 m", "2.460 m", "2.000 m", "0.000 m"]);
    }

    #[test]
    fn a_name_is_cut_to_its_room_or_left_out() {
        assert_eq!(cut("pentagon", 10.0, 100.0).as_deref(), Some("pentagon"));
        assert_eq!(cut("pentagon", 10.0, 40.0).as_deref(), Some("penta…"));
        assert_eq!(cut("pentagon", 10.0, 20.0), None);
    }
}
