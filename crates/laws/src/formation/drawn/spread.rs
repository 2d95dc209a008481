//! Choice of slots among samples of a drawing, as evenly spaced as it allows.
//!
//! Slots start at equal numbers of samples along the walk through the drawing. They then move to the centres of their
//! Voronoi cells (Lloyd 1982), or to the nearest sample if a centre is off the drawing. A slot that is still too near
//! another one moves into a wider gap beside it.

use super::outline::Point;

/// Least and largest number of consecutive Lloyd rounds: fewer for more samples.
const ROUNDS: [usize; 2] = [10, 40];
/// Largest move, as a fraction of a cell, at which the Lloyd rounds end.
const SETTLED: f64 = 1e-3;
/// Least and largest number of gap moves followed by Lloyd rounds: fewer for more samples.
const SPREADS: [usize; 2] = [1, 6];
/// Approximate number of sample visits in all rounds above which the rounds are reduced.
const LOOKED_AT: usize = 40_000_000;
/// Fraction of the median nearest distance below which a slot moves into a gap before the next Lloyd rounds.
const NEAR: f64 = 0.9;
/// Fraction of the median nearest distance below which a slot moves into a gap after the last Lloyd round.
const TOO_NEAR: f64 = 0.7;
/// Largest number of gap rounds after the last Lloyd round.
const GAP_ROUNDS: usize = 8;
/// Factor by which cells are enlarged until there are no more cells than slots.
const LARGER: f64 = 1.3;

/// Returns `count` places on the drawing, in the order of their start samples. `step` is the approximate distance of
/// neighbouring samples. A place may be off the nearest sample by at most `off`.
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
    /// Samples, grouped by cell.
    samples: Vec<Point>,
    /// Index of the first sample of each cell, and the number of samples at the end.
    begins: Vec<usize>,
    /// Cells around each cell, itself included.
    around: Vec<Vec<usize>>,
    slots: Vec<Slot>,
    /// Slots in each cell.
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
        let begins = (0..=cells.len()).map(|cell| order.partition_point(|&(own_cell, _)| own_cell < cell)).collect();
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

    /// Rebuilds the lists of slots per cell.
    fn gather(&mut self) {
        self.members.iter_mut().for_each(Vec::clear);
        for (i, slot) in self.slots.iter().enumerate() {
            self.members[slot.cell].push(i);
        }
    }

    /// Collects the slots in and around a cell, with number and place.
    fn near(&self, cell: usize, near: &mut Vec<(usize, Point)>) {
        near.clear();
        let members = self.around[cell].iter().flat_map(|&cell| &self.members[cell]);
        near.extend(members.map(|&i| (i, self.slots[i].place)));
    }

    /// Runs at most `rounds` Lloyd rounds, until no slot moves far.
    fn settle(&mut self, rounds: usize, off: f64) {
        for _ in 0..rounds {
            if self.step_to_centroids(off) <= SETTLED * self.side {
                break;
            }
        }
    }

    /// Moves every slot to the centre of the samples nearest to it, or to the nearest of these samples if the centre is
    /// off the drawing. Returns the largest move.
    fn step_to_centroids(&mut self, off: f64) -> f64 {
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
            let apart = distance_squared(place, middles[owner]);
            if nearest[owner].is_none_or(|(least, _)| apart < least) {
                nearest[owner] = Some((apart, Slot { place, cell }));
            }
        }
        let mut farthest = 0.0_f64;
        for (slot, (nearest, middle)) in self.slots.iter_mut().zip(nearest.into_iter().zip(middles)) {
            let Some((apart, sample)) = nearest else { continue };
            let place = if apart <= off * off { middle } else { sample.place };
            farthest = farthest.max(distance_squared(place, slot.place).sqrt());
            *slot = Slot { place, cell: sample.cell };
        }
        self.gather();
        farthest
    }

    /// Returns the nearest slot of each sample, `None` without a slot in reach. Ties go to the lower number.
    fn owners(&self) -> Vec<Option<usize>> {
        let mut owners = Vec::with_capacity(self.samples.len());
        let mut near = Vec::new();
        for cell in 0..self.around.len() {
            self.near(cell, &mut near);
            for &sample in &self.samples[self.begins[cell]..self.begins[cell + 1]] {
                let apart = |&(i, place): &(usize, Point)| (distance_squared(sample, place), i);
                owners.push(near.iter().map(apart).reduce(|a, b| if b < a { b } else { a }).map(|(_, i)| i));
            }
        }
        owners
    }

    /// Moves each slot whose nearest distance is below `near_part` of the median one: to the sample around it that is
    /// farthest from all other slots. Returns whether a slot has moved. No slot ends up nearer to another one than the
    /// moved slot was before.
    fn fill_gaps(&mut self, near_part: f64) -> bool {
        let mut near = Vec::new();
        let mut apart: Vec<f64> = (0..self.slots.len()).map(|i| self.nearest_distance_squared(i, &mut near)).collect();
        let middle = apart.len() / 2;
        let median = if apart.is_empty() { 0.0 } else { *apart.select_nth_unstable_by(middle, f64::total_cmp).1 };
        let mut moved = false;
        for i in 0..self.slots.len() {
            let now = self.nearest_distance_squared(i, &mut near);
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

    /// Returns the sample around a slot that is farthest from the nearest other slot, with the square of that distance.
    /// If no sample is farther than `least`, returns the slot itself and `least`.
    fn widest(&self, i: usize, least: f64, near: &mut Vec<(usize, Point)>) -> (f64, Slot) {
        let mut widest = (least, self.slots[i]);
        for &cell in &self.around[self.slots[i].cell] {
            self.near(cell, near);
            for &place in &self.samples[self.begins[cell]..self.begins[cell + 1]] {
                let others = near.iter().filter(|&&(other, _)| other != i);
                let apart = others.map(|&(_, other)| distance_squared(place, other)).fold(f64::INFINITY, f64::min);
                if apart > widest.0 && apart.is_finite() {
                    widest = (apart, Slot { place, cell });
                }
            }
        }
        widest
    }

    /// Returns the square of the distance of a slot to the nearest other one; infinite without another slot in reach.
    fn nearest_distance_squared(&self, i: usize, near: &mut Vec<(usize, Point)>) -> f64 {
        self.near(self.slots[i].cell, near);
        let others = near.iter().filter(|&&(other, _)| other != i);
        others.map(|&(_, other)| distance_squared(self.slots[i].place, other)).fold(f64::INFINITY, f64::min)
    }
}

/// Returns the cells that hold a sample, in order.
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
        reason = "a drawing is within 1 x 1, and cells are at least as large as the sample spacing"
    )]
    let number = point.map(|x| (x / side).floor() as i64);
    number
}

fn distance_squared([x0, y0]: Point, [x1, y1]: Point) -> f64 {
    (x1 - x0) * (x1 - x0) + (y1 - y0) * (y1 - y0)
}
