//! Slots among samples of a drawing, as evenly as it allows.
//!
//! Slots begin at equal numbers of samples from each other in the order of their walk, then move to the middles of
//! what is nearest to them (Lloyd 1982), never off the drawing. What still stands too near another one moves into a
//! wider gap beside it.

use super::outline::Point;

/// Rounds in a row in which all slots move to the middles of their parts: fewer, the more samples there are.
const ROUNDS: [usize; 2] = [10, 40];
/// A round that moves no slot by more than this part of a cell is the last.
const SETTLED: f64 = 1e-3;
/// How often slots move into gaps and settle again: less often, the more samples there are.
const SPREADS: [usize; 2] = [1, 6];
/// Samples that are looked at in all rounds, about, before rounds are fewer.
const LOOKED_AT: usize = 40_000_000;
/// Nearer to its neighbour than this part of what the median slot is, a slot moves into a gap before all settle again,
const NEAR: f64 = 0.9;
/// and than this part in the end, to stay there.
const TOO_NEAR: f64 = 0.7;
/// Most rounds in the end.
const GAP_ROUNDS: usize = 8;
/// Cells are enlarged by this factor until they are not more than there are slots.
const LARGER: f64 = 1.3;

/// `count` places on the drawing, in the order of the samples where they begin. `step` is about the distance of
/// neighbouring samples; a place may be off all samples by `off` at most.
pub(super) fn spread(samples: &[Point], count: usize, step: f64, off: f64) -> Vec<Point> {
    if samples.is_empty() {
        return Vec::new();
    }
    let mut field = Field::new(samples, count, step);
    let few = |[least, most]: [usize; 2], samples: usize| (LOOKED_AT / samples).clamp(least, most);
    let rounds = few(ROUNDS, samples.len());
    for _ in 0..few(SPREADS, samples.len() * rounds) {
        field.settle(rounds, off);
        if !field.fill_gaps(NEAR) {
            break;
        }
    }
    field.settle(rounds, off);
    for _ in 0..GAP_ROUNDS {
        if !field.fill_gaps(TOO_NEAR) {
            break;
        }
    }
    field.slots.into_iter().map(|slot| slot.place).collect()
}

#[derive(Clone, Copy)]
struct Slot {
    place: Point,
    cell: usize,
}

/// Samples and slots in square cells.
struct Field {
    side: f64,
    /// Samples, those of a cell after each other.
    samples: Vec<Point>,
    /// Where the samples of each cell begin, and the end.
    begins: Vec<usize>,
    /// The cells around each cell, itself among them.
    around: Vec<Vec<usize>>,
    slots: Vec<Slot>,
    /// The slots in each cell.
    members: Vec<Vec<usize>>,
}

impl Field {
    fn new(samples: &[Point], count: usize, step: f64) -> Self {
        let mut side = step * (samples.len() as f64 / count as f64).sqrt();
        let mut cells = occupied(samples, side);
        while cells.len() > count.max(1) {
            side *= LARGER;
            cells = occupied(samples, side);
        }
        let cell_of = |point: Point| cells.binary_search(&cell(point, side)).unwrap_or_default();
        let mut order: Vec<(usize, usize)> = samples.iter().map(|&point| cell_of(point)).zip(0..).collect();
        order.sort_unstable();
        let begins = (0..=cells.len()).map(|cell| order.partition_point(|&(of, _)| of < cell)).collect();
        let near = |[x, y]: [i64; 2]| {
            let block = (-1..=1).flat_map(move |dy| (-1..=1).map(move |dx| [x + dx, y + dy]));
            block.filter_map(|cell| cells.binary_search(&cell).ok()).collect()
        };
        let around = cells.iter().map(|&cell| near(cell)).collect();
        let first = |i: usize| samples[(2 * i + 1) * samples.len() / (2 * count)];
        let slots = (0..count).map(|i| Slot { place: first(i), cell: cell_of(first(i)) }).collect();
        let samples = order.into_iter().map(|(_, sample)| samples[sample]).collect();
        let mut field = Self { side, samples, begins, around, slots, members: vec![Vec::new(); cells.len()] };
        field.gather();
        field
    }

    /// Writes down anew which slots are in which cell.
    fn gather(&mut self) {
        self.members.iter_mut().for_each(Vec::clear);
        for (i, slot) in self.slots.iter().enumerate() {
            self.members[slot.cell].push(i);
        }
    }

    /// The slots in and around a cell, by number and place.
    fn near(&self, cell: usize, near: &mut Vec<(usize, Point)>) {
        near.clear();
        let members = self.around[cell].iter().flat_map(|&cell| &self.members[cell]);
        near.extend(members.map(|&i| (i, self.slots[i].place)));
    }

    /// Moves all slots to the middles of their parts until none moves far, or for so many rounds.
    fn settle(&mut self, rounds: usize, off: f64) {
        for _ in 0..rounds {
            if self.step_to_middles(off) <= SETTLED * self.side {
                break;
            }
        }
    }

    /// Moves every slot to the middle of the samples that it is the nearest slot of, or else, where that is off the
    /// drawing, to the one of them that is nearest to there; the farthest move.
    fn step_to_middles(&mut self, off: f64) -> f64 {
        let owners = self.owners();
        let mut sums = vec![([0.0, 0.0], 0.0); self.slots.len()];
        for (&owner, sample) in owners.iter().zip(&self.samples) {
            if let Some((sum, count)) = owner.and_then(|owner| sums.get_mut(owner)) {
                *sum = [sum[0] + sample[0], sum[1] + sample[1]];
                *count += 1.0;
            }
        }
        let middles: Vec<Point> = sums.iter().map(|(sum, count)| sum.map(|x| x / count)).collect();
        let mut nearest: Vec<Option<(f64, Slot)>> = vec![None; self.slots.len()];
        let cells = self.begins.windows(2).enumerate().flat_map(|(cell, ends)| (ends[0]..ends[1]).map(move |_| cell));
        for ((&owner, &place), cell) in owners.iter().zip(&self.samples).zip(cells) {
            let Some(owner) = owner else { continue };
            let apart = square(place, middles[owner]);
            if nearest[owner].is_none_or(|(least, _)| apart < least) {
                nearest[owner] = Some((apart, Slot { place, cell }));
            }
        }
        let mut farthest = 0.0_f64;
        for (slot, (nearest, middle)) in self.slots.iter_mut().zip(nearest.into_iter().zip(middles)) {
            let Some((apart, sample)) = nearest else { continue };
            let place = if apart <= off * off { middle } else { sample.place };
            farthest = farthest.max(square(place, slot.place).sqrt());
            *slot = Slot { place, cell: sample.cell };
        }
        self.gather();
        farthest
    }

    /// The nearest slot of each sample, none where no slot is near; the lower number of two that are as near.
    fn owners(&self) -> Vec<Option<usize>> {
        let mut owners = Vec::with_capacity(self.samples.len());
        let mut near = Vec::new();
        for cell in 0..self.around.len() {
            self.near(cell, &mut near);
            for &sample in &self.samples[self.begins[cell]..self.begins[cell + 1]] {
                let apart = |&(i, place): &(usize, Point)| (square(sample, place), i);
                owners.push(near.iter().map(apart).reduce(|a, b| if b < a { b } else { a }).map(|(_, i)| i));
            }
        }
        owners
    }

    /// Moves each slot that is nearer to another one than this part of what the median slot is: to where, among the
    /// samples around it, it is farthest from all others. Whether any has moved; no slot comes nearer to another one
    /// than the one that moved was before.
    fn fill_gaps(&mut self, near_part: f64) -> bool {
        let mut near = Vec::new();
        let mut apart: Vec<f64> = (0..self.slots.len()).map(|i| self.apart(i, &mut near)).collect();
        let middle = apart.len() / 2;
        let median = if apart.is_empty() { 0.0 } else { *apart.select_nth_unstable_by(middle, f64::total_cmp).1 };
        let mut moved = false;
        for i in 0..self.slots.len() {
            let now = self.apart(i, &mut near);
            if now >= near_part * near_part * median {
                continue;
            }
            let (widest, place) = self.widest(i, now, &mut near);
            if widest > now * (1.0 + SETTLED) {
                let left = self.slots[i].cell;
                self.members[left].retain(|&member| member != i);
                self.members[place.cell].push(i);
                self.slots[i] = place;
                moved = true;
            }
        }
        moved
    }

    /// The place among the samples around a slot that is farthest from the nearest other slot, if that is farther than
    /// `least`; and the square of how far.
    fn widest(&self, i: usize, least: f64, near: &mut Vec<(usize, Point)>) -> (f64, Slot) {
        let mut widest = (least, self.slots[i]);
        for &cell in &self.around[self.slots[i].cell] {
            self.near(cell, near);
            for &place in &self.samples[self.begins[cell]..self.begins[cell + 1]] {
                let others = near.iter().filter(|&&(other, _)| other != i);
                let apart = others.map(|&(_, other)| square(place, other)).fold(f64::INFINITY, f64::min);
                if apart > widest.0 && apart.is_finite() {
                    widest = (apart, Slot { place, cell });
                }
            }
        }
        widest
    }

    /// Square of the distance of a slot to the nearest other one; infinite where none is near.
    fn apart(&self, i: usize, near: &mut Vec<(usize, Point)>) -> f64 {
        self.near(self.slots[i].cell, near);
        let others = near.iter().filter(|&&(other, _)| other != i);
        others.map(|&(_, other)| square(self.slots[i].place, other)).fold(f64::INFINITY, f64::min)
    }
}

/// The cells that hold a sample, in order.
fn occupied(samples: &[Point], side: f64) -> Vec<[i64; 2]> {
    let mut cells: Vec<[i64; 2]> = samples.iter().map(|&point| cell(point, side)).collect();
    cells.dedup();
    cells.sort_unstable();
    cells.dedup();
    cells
}

fn cell(point: Point, side: f64) -> [i64; 2] {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a drawing is within 1 x 1, and a cell not smaller than a sample's step"
    )]
    let number = point.map(|x| (x / side).floor() as i64);
    number
}

fn square([x0, y0]: Point, [x1, y1]: Point) -> f64 {
    (x1 - x0) * (x1 - x0) + (y1 - y0) * (y1 - y0)
}
