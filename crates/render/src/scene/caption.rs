//! Text of a picture: caption, verdict, legend, names of vehicles, and separations of pairs.

use super::camera::Projected;
use super::colour::{Colour, Colouring};
use super::compose::SceneBuilder;
use super::geometry::has_few_edges;
use super::labels::{LabelLayout, width};
use super::{Annotation, pixels};
use tautline_audit::{Status, Violation};
use tautline_core::swarm::{Bounce, Pair};
use tautline_core::text::{at_least, beside_limit, exact};
use tautline_report::drawing::LIMITS;
use tautline_report::drawing::colours::{ALARM, GOOD, INK, ON_ALARM, PAPER, SHELL, SOFT_INK};
use tautline_sim::plan::Plan;

/// Largest number of pairs closer than delta whose separation is drawn; the closest pairs are chosen.
const MAX_LABELLED: usize = 3;
/// Number of colours on each side of the legend's scale.
const SHADES: i16 = 16;
/// Number of vehicles up to which the areas of all stay free of texts; in a larger swarm only those of named vehicles.
const MAX_RESERVED: usize = 60;
/// Smallest radius of the area of a vehicle that stays free of texts, relative to the height of a line.
const LEAST_ROOM: f32 = 0.4;
/// Opacity of the name of the farthest vehicle.
const FAINT: f32 = 0.45;
/// Longest name that is drawn in full \[characters\].
const LONGEST_NAME: usize = 40;
/// Smallest number of letters to which a name is cut.
const MIN_LETTERS: usize = 4;
/// Width of the frame of a violation in a picture 720 pixels high \[pixels\].
const FRAME_PX: f32 = 5.0;
/// Opacity of the background of text.
const BACKING: f32 = 0.88;

impl SceneBuilder<'_> {
    pub(super) fn caption(&self, labels: &mut LabelLayout) {
        let (theme, size_px, margin) = (self.view.theme, self.view.text_px(1.0), self.view.margin_px());
        let width_px = self.view.size_px[0] as f32;
        let mut y = self.banner(labels);
        let (ground, room_px) = (theme.pick(PAPER).at(BACKING), 0.3 * size_px);
        let has_banner = y > margin;
        let [top_px, _] = self.bands_px();
        self.band([if has_banner { self.view.banner_px() } else { 0.0 }, top_px], has_banner, labels);
        let (bottom, taken) = labels.placed();
        // Without room texts are left out in this order: closest approach, name, verdict, time.
        let large_px = 1.35 * size_px;
        let (time_s, leg_at) =
            (self.frame.time_s, |time_s| self.timeline.plan.as_ref().map(|plan| plan.leg_at(time_s)));
        let leg = leg_at(time_s);
        // The last instant of a leg shows the time at which the next leg begins.
        let shown_s = if leg_at(time_s.next_up()) == leg { time_s } else { time_s.next_up() };
        let time = match leg {
            Some((leg, legs)) if legs > 1 => format!("leg {} of {legs}, t = {shown_s:.2} s", leg + 1),
            _ => format!("t = {shown_s:.2} s"),
        };
        let mut free_px = width_px - 2.0 * margin;
        if width(large_px, &time) > free_px {
            return;
        }
        free_px = labels.put([width_px - margin, y], [1.0, 0.0], large_px, theme.pick(INK), &time)[0][0] - 2.0 * margin;
        let below = y + 1.8 * size_px;
        let (verdicts, colour) = self.verdict();
        let verdict = verdicts.iter().find(|text| width(size_px, text) <= width_px - 2.0 * margin);
        let verdict_px = verdict.map(|text| labels.put([width_px - margin, below], [1.0, 0.0], size_px, colour, text));
        labels.insert_background(taken, bottom, ground, room_px);
        let (_, taken) = labels.placed();
        if let Some(name) = cut(&shortened(&self.timeline.name), large_px, free_px) {
            labels.put([margin, y], [0.0, 0.0], large_px, theme.pick(INK), &name);
            labels.insert_background(taken, bottom, ground, room_px);
        }
        y = below;
        let (_, taken) = labels.placed();
        let free_px = verdict_px.map_or(0.0, |corners_px| corners_px[0][0] - 2.0 * margin);
        if let Some(text) = self.closest_so_far().iter().find(|text| width(size_px, text) <= free_px) {
            labels.put([margin, y], [0.0, 0.0], size_px, theme.pick(SOFT_INK), text);
            labels.insert_background(taken, bottom, ground, room_px);
        }
    }

    /// Returns the lower end of the caption and the upper end of the legend \[pixels\].
    fn bands_px(&self) -> [f32; 2] {
        let [top_px, bottom_px] = pixels(self.view.area(self.extent.has_violations).texts_px);
        [top_px, self.view.size_px[1] as f32 - bottom_px]
    }

    /// Covers a band of the picture if a vehicle is in it, so that texts do not lie on vehicles.
    fn band(&self, [from_px, to_px]: [f32; 2], is_framed: bool, labels: &mut LabelLayout) {
        let width_px = self.view.size_px[0] as f32;
        let is_inside = |([x, y], radius): &([f64; 2], f64)| {
            let [x, y, radius] = pixels([*x, *y, *radius]);
            y + radius > from_px && y - radius < to_px && x + radius > 0.0 && x - radius < width_px
        };
        if self.covered_areas_px().iter().any(is_inside) {
            let inset = if is_framed { FRAME_PX * self.view.unit_px() } else { 0.0 };
            let corners_px = [[inset, from_px], [width_px - inset, to_px - inset.min(to_px - from_px)]];
            labels.draw(Annotation::Box { corners_px, colour: self.view.theme.pick(PAPER), round_px: 0.0 });
        }
    }

    /// Draws a banner for a current violation, and a frame around the picture; returns the top of the caption. A
    /// violation of two vehicles comes before one of an obstacle.
    fn banner(&self, labels: &mut LabelLayout) -> f32 {
        let (long, short, count) = if let Some(&(violation, distance_m)) = self.violated.first() {
            let Violation { min_m, min_at_s, limit_m, .. } = violation;
            let [pair, short] = self.pair(violation.pair);
            let apart = if distance_m < limit_m {
                format!("{} m apart", beside_limit(distance_m, limit_m, 3))
            } else if min_m < limit_m {
                format!("{} m apart at {min_at_s:.2} s", beside_limit(min_m, limit_m, 3))
            } else {
                "too close".to_owned()
            };
            let long = format!("vehicles {pair} {apart}, delta {} m", exact(limit_m));
            (long, format!("{short} {apart}"), self.violated.len())
        } else if let Some(&[vehicle, obstacle]) = self.too_close_to_obstacle.first() {
            let (vehicle, obstacle) = (&self.timeline.vehicles[vehicle], self.timeline.obstacle(obstacle));
            let long = format!("vehicle {vehicle} too close to {obstacle}");
            (long, format!("{vehicle} {obstacle}"), self.too_close_to_obstacle.len())
        } else {
            return self.view.margin_px();
        };
        let more = if count > 1 { format!(" and {} more", count - 1) } else { String::new() };
        let texts = [format!("VIOLATION  {long}{more}"), format!("VIOLATION {short}"), "VIOLATION".to_owned()];
        let (alarm, size_px) = (self.view.theme.pick(ALARM), self.view.text_px(1.1));
        let [width_px, height_px] = self.view.size_px.map(|size| size as f32);
        let text = texts.iter().find(|text| width(size_px, text) <= width_px).unwrap_or(&texts[2]);
        let bottom = self.view.banner_px();
        labels.draw(Annotation::Box { corners_px: [[0.0, 0.0], [width_px, bottom]], colour: alarm, round_px: 0.0 });
        let corners_px = [[0.0, 0.0], [width_px, height_px]];
        labels.draw(Annotation::Outline { corners_px, colour: alarm, width_px: FRAME_PX * self.view.unit_px() });
        let ink = self.view.theme.pick(ON_ALARM);
        labels.put([width_px / 2.0, bottom / 2.0], [0.5, 0.5], size_px, ink, text);
        labels.reserve([[0.0, 0.0], [width_px, bottom]]);
        bottom + 0.6 * self.view.margin_px()
    }

    /// Returns whether the frame is the last one of a flight that was judged to its end.
    fn is_end(&self) -> bool {
        self.timeline.status.is_some() && self.frame.time_s >= self.timeline.log.range_s()[1]
    }

    /// Returns the verdict so far, or the final one at the end, from the longest wording to the shortest.
    fn verdict(&self) -> (Vec<String>, Colour) {
        let (theme, now_s) = (self.view.theme, self.frame.time_s);
        if let Some(why) = self.timeline.unjudged() {
            return (vec![format!("not judged: {why}"), "not judged".to_owned()], theme.pick(SOFT_INK));
        }
        let began: Vec<_> = self.timeline.violations_by(now_s).collect();
        let undecided_s = self.timeline.undecided_s.filter(|from_s| *from_s <= now_s);
        if began.is_empty()
            && let Some((found, [vehicle, obstacle])) = self.timeline.obstacle_violations_by(now_s).next()
        {
            let when = format!("violated at {:.2} s", found.from_s);
            let (vehicle, obstacle) = (&self.timeline.vehicles[vehicle], self.timeline.obstacle(obstacle));
            let texts = vec![format!("{when} by {vehicle} near {obstacle}"), when, "violated".to_owned()];
            return (texts, theme.pick(ALARM));
        }
        match (began.first(), undecided_s) {
            (None, None) if self.is_end() && self.timeline.status == Some(Status::Undecided) => {
                (vec!["undecided".to_owned()], theme.pick(SOFT_INK))
            }
            (None, None) => {
                let clear = if self.is_end() {
                    let [from_s, to_s] = self.timeline.log.range_s();
                    format!("clear from {from_s:.2} s to {to_s:.2} s")
                } else {
                    "clear so far".to_owned()
                };
                if !self.timeline.assumes_straight {
                    return (vec![clear], theme.pick(GOOD));
                }
                let texts = [" between samples", ""].map(|between| format!("{clear}, if straight{between}"));
                (texts.into_iter().chain(["if straight: clear".to_owned()]).collect(), theme.pick(GOOD))
            }
            (None, Some(from_s)) => {
                let since = format!("undecided from {:.2} s on", from_s.max(self.timeline.log.range_s()[0]));
                (vec![since, "undecided".to_owned()], theme.pick(SOFT_INK))
            }
            (Some(span), _) => {
                let when = match began.len() {
                    1 => format!("violated at {:.2} s", span.from_s),
                    many => format!("{many} violations, the first at {:.2} s", span.from_s),
                };
                let [pair, short] = self.pair(span.pair).map(|pair| format!("{when} by {pair}"));
                let mut texts = vec![pair, short, when, "violated".to_owned()];
                let hit = self.timeline.log.hits().0.first().filter(|hit| hit.time_s <= now_s);
                if let Some(&Bounce { time_s: hit_s, pair, closing_m_s }) = hit {
                    let [pair, _] = self.pair(pair);
                    let hit = format!("hulls of {pair} hit at {hit_s:.2} s, {closing_m_s:.2} m/s");
                    texts.splice(..0, [format!("{}; {hit}", texts[0]), hit, "violated, hulls hit".to_owned()]);
                }
                (texts, theme.pick(ALARM))
            }
        }
    }

    /// Returns the closest approach so far, from the longest wording to the shortest.
    fn closest_so_far(&self) -> Vec<String> {
        let Some(approach) = self.frame.so_far else { return Vec::new() };
        let shown_m = |delta_m| beside_limit(approach.separation_m, delta_m, 3);
        let separation = self.timeline.delta_m.map_or(metres(approach.separation_m), |delta_m| shown_m(delta_m) + " m");
        let [pair, short] = self.pair(approach.pair);
        let when = format!("{:.2} s", approach.time_s);
        let scaled = if self.timeline.log.metric().is_metres() { "" } else { ", scaled" };
        let delta = |delta_m| format!("  (delta {} m{scaled})", exact(delta_m));
        let delta = self.timeline.delta_m.map_or(String::new(), delta);
        let closest = if self.is_end() { "closest" } else { "closest so far" };
        vec![
            format!("{closest} {separation}, vehicles {pair} at {when}{delta}"),
            format!("{closest} {separation}, vehicles {pair} at {when}"),
            format!("{closest} {separation}, {short}"),
            format!("{closest} {separation}"),
        ]
    }

    /// Draws the legend of what is in the picture.
    pub(super) fn legend(&self, labels: &mut LabelLayout) {
        let [width_px, height_px] = self.view.size_px.map(|size| size as f32);
        let (theme, size_px, margin) = (self.view.theme, self.view.text_px(0.85), self.view.margin_px());
        let (layers, plan, ink) = (self.view.layers, self.timeline.plan.as_ref(), self.view.theme.pick(SOFT_INK));
        let (mut x, y) = (margin, height_px - margin);
        let [_, bottom_px] = self.bands_px();
        let is_framed = !self.violated.is_empty() || !self.too_close_to_obstacle.is_empty();
        self.band([bottom_px, height_px], is_framed, labels);
        let (bottom, taken) = labels.placed();
        let fits = |x: f32, text: &str| x + width(size_px, text) <= width_px - margin;
        // Draws text from the left; returns the start of the next text.
        let write = |labels: &mut LabelLayout, x: f32, text: &str| {
            labels.put([x, y], [0.0, 1.0], size_px, ink, text)[1][0] + 1.5 * size_px
        };
        // Draws a scale with texts above its ends and its middle; returns the start of the next text.
        let scale = |labels: &mut LabelLayout, x: f32, texts: [&str; 3], colour: &dyn Fn(f32) -> Colour| {
            let [first, middle, last] = texts.map(|text| width(size_px, text));
            let width_px = (2.0 * first.max(last) + middle + 1.2 * size_px).max(9.0 * size_px);
            let colours = (-SHADES..=SHADES).map(|k| colour(f32::from(k) / f32::from(SHADES))).collect();
            let corners_px = [[x, y - 0.6 * size_px], [x + width_px, y]];
            labels.draw(Annotation::Scale { corners_px, colours });
            labels.reserve(corners_px);
            for (text, part) in texts.into_iter().zip([0.0, 0.5, 1.0]) {
                labels.put([x + part * width_px, y - 0.9 * size_px], [part, 1.0], size_px, ink, text);
            }
            x + width_px + 2.0 * size_px
        };
        match self.view.colouring {
            Colouring::Vehicle | Colouring::Lights => {}
            Colouring::Speed => {
                let most = format!("{:.2} m/s", self.extent.max_speed_m_s);
                x = scale(labels, x, ["0", "speed", &most], &|part| theme.ramp(f32::midpoint(1.0, part)));
            }
            Colouring::Clearance => {
                let most = format!("{:.1} m", self.max_clearance_m());
                x = scale(labels, x, ["0", "clearance", &most], &|part| theme.ramp(f32::midpoint(1.0, -part)));
            }
        }
        if let Some(plan) = plan.filter(|plan| layers.edges && plan.graph.edge_count() > 0) {
            let hidden = format!("{} edges, not drawn", plan.graph.edge_count());
            if has_few_edges(plan) {
                x = scale(labels, x, ["push", "rest", "pull"], &|part| theme.tension(part));
            } else if fits(x, &hidden) {
                x = write(labels, x, &hidden);
            }
        }
        let (stroke_px, arm, middle) = (1.6 * self.view.unit_px(), 0.32 * size_px, y - size_px / 2.0);
        let strokes = |labels: &mut LabelLayout, ends: &[[[f32; 2]; 2]], colour, width_px| {
            for &ends_px in ends {
                labels.draw(Annotation::Stroke { ends_px, colour, width_px });
            }
        };
        let ring =
            |x, radius_px, colour, width_px| Annotation::Ring { at_px: [x, middle], radius_px, colour, width_px };
        if layers.marks && !self.starts().is_empty() && fits(x + size_px, "start") {
            let cross = [arm, -arm].map(|down| [[x, middle - down], [x + 2.0 * arm, middle + down]]);
            strokes(labels, &cross, ink, stroke_px);
            x = write(labels, x + size_px, "start");
        }
        if layers.marks && self.slots().is_some() && fits(x + size_px, "goal slot") {
            labels.draw(ring(x + arm, 1.1 * arm, ink, stroke_px));
            x = write(labels, x + size_px, "goal slot");
        }
        let has_reference = plan.is_some_and(|plan| plan.reference_at(self.frame.time_s).is_some());
        if layers.marks && has_reference && fits(x + size_px, "reference") {
            let middle_x = x + arm;
            let corners = [[middle_x, middle - arm], [middle_x + arm, middle], [middle_x, middle + arm], [x, middle]];
            strokes(labels, &[0, 1, 2, 3].map(|side| [corners[side], corners[(side + 1) % 4]]), ink, stroke_px);
            x = write(labels, x + size_px, "reference");
        }
        let is_ball = self.timeline.log.metric().is_metres();
        let shell = if is_ball { "keep-out shell, radius delta/2" } else { "keep-out shell, delta wide" };
        let shell = [shell, "keep-out shell"].into_iter().find(|shell| fits(x + size_px, shell));
        if let Some(shell) = shell.filter(|_| layers.shells && self.timeline.delta_m.is_some()) {
            labels.draw(ring(x + arm, 1.4 * arm, theme.pick(SHELL), 1.6 * stroke_px));
            x = write(labels, x + 1.2 * size_px, shell);
        }
        let is_red = layers.trails && self.violating_s.iter().any(|violating_s| !violating_s.is_empty());
        if is_red && fits(x + 2.0 * size_px, "violation") {
            strokes(labels, &[[[x, middle], [x + 1.4 * size_px, middle]]], theme.pick(ALARM), 2.0 * stroke_px);
            write(labels, x + 2.0 * size_px, "violation");
        }
        labels.insert_background(taken, bottom, theme.pick(PAPER).at(BACKING), 0.3 * size_px);
    }

    /// Reserves the areas of vehicles.
    pub(super) fn reserve_vehicles(&self, labels: &mut LabelLayout) {
        let count = self.timeline.count();
        let reserved = if count <= MAX_RESERVED {
            (0..count).filter_map(|k| Some((k, self.projected(k)?))).collect()
        } else {
            self.labelled_vehicles()
        };
        for (k, place) in reserved {
            let least = f64::from(self.view.text_px(LEAST_ROOM));
            let radius = (self.timeline.radius_m[k] * place.px_per_m).max(least);
            let [x, y, radius] = pixels([place.at_px[0], place.at_px[1], radius]);
            labels.reserve([[x - radius, y - radius], [x + radius, y + radius]]);
        }
    }

    /// Draws the separation of the closest pair, and of the closest pairs below delta, beside the line between them, if
    /// there is room in the picture.
    pub(super) fn separations(&self, labels: &mut LabelLayout) {
        let theme = self.view.theme;
        let size_px = self.view.text_px(1.0);
        let alarmed =
            self.violated.iter().take(MAX_LABELLED).map(|&(violation, distance_m)| (violation.pair, distance_m, true));
        let nearest = self.closest_clear_pair().map(|(pair, distance_m)| (pair, distance_m, false));
        for (pair, distance_m, alarm) in alarmed.chain(nearest) {
            let middle = self.ends(pair).and_then(|[first, second]| self.camera.project((first + second) / 2.0));
            let is_closest = self.frame.so_far.is_none_or(|so_far| distance_m <= so_far.separation_m);
            let text = metres(distance_m) + if alarm || is_closest { "" } else { " now" };
            let distances_px = [1.1 * size_px, 1.8 * size_px, 3.0 * size_px];
            let spot = middle.and_then(|middle| labels.find(middle.at_px, &distances_px, size_px, &text));
            let Some(spot) = spot else { continue };
            let half = width(size_px, &text) / 2.0 + 0.25 * size_px;
            let corners_px = [[spot[0] - half, spot[1] - 0.68 * size_px], [spot[0] + half, spot[1] + 0.68 * size_px]];
            let (ground, ink) = if alarm {
                (theme.pick(ALARM), theme.pick(ON_ALARM))
            } else {
                (theme.pick(PAPER).at(0.82), theme.pick(INK))
            };
            labels.draw(Annotation::Box { corners_px, colour: ground, round_px: 0.3 * size_px });
            labels.put(spot, [0.5, 0.5], size_px, ink, &text);
            labels.reserve(corners_px);
        }
    }

    /// Returns the vehicles with names and their projections: all vehicles of a small swarm, else the picked one, the
    /// closest pair and the worst violations.
    fn labelled_vehicles(&self) -> Vec<(usize, Projected)> {
        let mut labelled: Vec<usize> = self.view.picked.into_iter().filter(|&k| k < self.timeline.count()).collect();
        let violated = self.violated.iter().take(MAX_LABELLED).map(|(violation, _)| violation.pair);
        let nearest = self.closest_clear_pair().filter(|_| self.view.layers.closest).map(|(pair, _)| pair);
        labelled.extend(violated.chain(nearest).flat_map(|pair| [pair.first(), pair.second()]));
        if self.timeline.count() <= LIMITS.named {
            labelled.extend(0..self.timeline.count());
        }
        let mut seen = vec![false; self.timeline.count()];
        labelled.retain(|&k| !std::mem::replace(&mut seen[k], true));
        labelled.into_iter().filter_map(|k| Some((k, self.projected(k)?))).collect()
    }

    /// Draws the names of vehicles: on vehicles that are large enough, else beside them.
    pub(super) fn names(&self, labels: &mut LabelLayout) {
        let (theme, size_px) = (self.view.theme, self.view.text_px(0.85));
        let labelled = self.labelled_vehicles();
        let closest = self.closest_clear_pair().filter(|_| self.view.layers.closest);
        let closest = closest.map_or([usize::MAX; 2], |(pair, _)| [pair.first(), pair.second()]);
        let depths = || labelled.iter().map(|(_, projection)| projection.depth_m);
        let [near, far] = [depths().fold(f64::INFINITY, f64::min), depths().fold(0.0, f64::max)];
        for &(k, projection) in &labelled {
            #[expect(clippy::cast_possible_truncation, reason = "an opacity")]
            let part = ((projection.depth_m - near) / far.max(1e-9)).clamp(0.0, 1.0) as f32;
            let strength = if self.alarmed[k] || closest.contains(&k) || self.view.picked == Some(k) {
                1.0
            } else {
                1.0 - (1.0 - FAINT) * part
            };
            // A vehicle of the closest pair is often hidden by the other one, and is named anyway.
            let is_hidden = self.is_hidden(k, projection);
            let is_urgent = self.alarmed[k] || closest.contains(&k);
            if is_hidden && !is_urgent {
                continue;
            }
            let leads = self.timeline.plan.as_ref().and_then(Plan::leader) == Some(k);
            let name = shortened(&self.timeline.vehicles[k]) + if leads { " leads" } else { "" };
            let [x, y, radius] =
                pixels([projection.at_px[0], projection.at_px[1], self.timeline.radius_m[k] * projection.px_per_m]);
            let fitting = (1.5 * radius).min(1.7 * radius / width(1.0, &name).max(0.4)).min(size_px);
            if fitting >= 8.0 && !is_hidden {
                let (at_px, anchor, colour) = ([x, y], [0.5, 0.5], theme.pick(PAPER));
                labels.draw(Annotation::Words { at_px, anchor, size_px: fitting, colour, text: name });
                continue;
            }
            let offset = f64::from(radius.max(self.view.text_px(LEAST_ROOM)) + 0.2 * size_px);
            let colour = if self.alarmed[k] { theme.pick(ALARM) } else { self.colour(k).at(strength) };
            // First free position of: above right, above left, below right, below left. Names of the closest pair are
            // farther away if there is no room near by.
            let distances = if is_urgent { [1.0, 2.0, 3.5].as_slice() } else { &[1.0] };
            let corners = [[0.0, 1.0], [1.0, 1.0], [0.0, 0.0], [1.0, 0.0]];
            distances.iter().flat_map(|far| corners.map(|corner| (far, corner))).any(|(far, [left, above])| {
                let beside = [
                    projection.at_px[0] + far * offset * (1.0 - 2.0 * f64::from(left)),
                    projection.at_px[1] + far * offset * (1.0 - 2.0 * f64::from(above)),
                ];
                labels.put_if_free(beside, [left, above], 0.85 * size_px, colour, &name)
            });
        }
    }

    /// Returns whether another vehicle or an obstacle covers the centre of this one.
    fn is_hidden(&self, k: usize, own: Projected) -> bool {
        if self.vehicle(k).is_some_and(|place| self.extent.is_behind_obstacle(self.timeline, &self.camera, place)) {
            return true;
        }
        let others = (0..self.timeline.count()).filter(|&other| other != k);
        others.filter_map(|other| Some((other, self.projected(other)?))).any(|(other, projection)| {
            let apart = (projection.at_px[0] - own.at_px[0]).hypot(projection.at_px[1] - own.at_px[1]);
            projection.depth_m < own.depth_m && apart < self.timeline.radius_m[other] * projection.px_per_m
        })
    }

    /// Returns the names of the two vehicles of a pair, in words and in short.
    fn pair(&self, pair: Pair) -> [String; 2] {
        let name = |k: usize| self.timeline.vehicles.get(k).map_or_else(|| (k + 1).to_string(), |name| shortened(name));
        [" and ", "-"].map(|between| format!("{}{between}{}", name(pair.first()), name(pair.second())))
    }
}

/// Formats a length to the millimetre, rounded down, so that no separation is shown larger than it is.
pub(crate) fn metres(length_m: f64) -> String {
    format!("{} m", at_least(length_m, 3))
}

/// Cuts a name to the available width, with an ellipsis; `None` if a few letters do not fit.
fn cut(name: &str, size_px: f32, room_px: f32) -> Option<String> {
    if width(size_px, name) <= room_px {
        return Some(name.to_owned());
    }
    let start = |letters: usize| name.chars().take(letters).chain(['…']).collect::<String>();
    (MIN_LETTERS..name.chars().count()).rev().map(start).find(|start| width(size_px, start) <= room_px)
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
    fn a_length_is_rounded_down() {
        assert_eq!([1.999_999, 2.46, 2.0, 0.0].map(metres), ["1.999 m", "2.460 m", "2.000 m", "0.000 m"]);
    }

    #[test]
    fn a_name_is_cut_to_its_width_or_left_out() {
        assert_eq!(cut("pentagon", 10.0, 100.0).as_deref(), Some("pentagon"));
        assert_eq!(cut("pentagon", 10.0, 40.0).as_deref(), Some("penta…"));
        assert_eq!(cut("pentagon", 10.0, 20.0), None);
    }
}
