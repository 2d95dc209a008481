//! The rows of a large complete graph in bands, which threads share.

use std::ops::Range;

use rayon::iter::{IndexedParallelIterator as _, IntoParallelRefMutIterator as _, ParallelIterator as _};

/// Number of bands, each with about as many edges as any other. It is fixed, and with it the order of all sums, however many
/// threads there are; so many threads have work.
const BANDS: usize = 16;

/// Bands of rows of the complete graph, with room for what each adds to the sums: some 270 bytes a vehicle.
#[derive(Clone, Debug)]
pub(super) struct Bands(Vec<Band>);

#[derive(Clone, Debug)]
struct Band {
    rows: Range<usize>,
    /// What its edges add to the sums of every vehicle from its first row on, along each axis.
    sums: [Vec<f64>; 3],
    potential: Option<f64>,
}

impl Bands {
    /// Of so many vehicles.
    pub(super) fn new(count: usize) -> Self {
        // The rows from r on have about (N - r)^2/2 edges.
        let start = |band: usize| count - (count * count * (BANDS - band) / BANDS).isqrt();
        let band = |k: usize| {
            let rows = start(k)..if k + 1 == BANDS { count } else { start(k + 1) };
            let sums = [(); 3].map(|()| vec![0.0; count - rows.start]);
            Band { rows, sums, potential: None }
        };
        Self((0..BANDS).map(band).collect())
    }

    /// Lets every thread at hand evaluate bands, each once: `evaluate` adds what the edges of these rows do to sums that begin
    /// with the first of the rows, along each axis, and returns their potential, where it has one. Adds all of it to `sums`
    /// band by band, so that the bits are the same for any number of threads; returns the whole potential.
    pub(super) fn add_to(
        &mut self,
        mut sums: [&mut [f64]; 3],
        evaluate: impl Fn(Range<usize>, [&mut [f64]; 3]) -> Option<f64> + Sync,
    ) -> Option<f64> {
        let of_band = |band: &mut Band| {
            band.sums.iter_mut().for_each(|sums| sums.fill(0.0));
            band.potential = evaluate(band.rows.clone(), band.sums.each_mut().map(Vec::as_mut_slice));
        };
        if rayon::current_num_threads() > 1 {
            self.0.par_iter_mut().with_max_len(1).for_each(of_band);
        } else {
            self.0.iter_mut().for_each(of_band);
        }
        for band in &self.0 {
            for (sums, of_band) in sums.iter_mut().zip(&band.sums) {
                sums[band.rows.start..].iter_mut().zip(of_band).for_each(|(sum, add)| *sum += add);
            }
        }
        self.0.iter().map(|band| band.potential).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_is_in_one_band_and_bands_have_about_as_many_edges() {
        for count in [0, 1, 2, 17, 640, 1000, 12_345] {
            let mut bands = Bands::new(count);
            let rows: Vec<_> = bands.0.iter().flat_map(|band| band.rows.clone()).collect();
            assert_eq!(rows, (0..count).collect::<Vec<_>>());
            let edges = |rows: &Range<usize>| rows.clone().map(|i| count - 1 - i).sum::<usize>();
            let even = count * count / 2 / BANDS;
            for band in bands.0.iter().filter(|_| count >= 640) {
                assert!(edges(&band.rows).abs_diff(even) <= 2 * count, "{count}: {:?}", band.rows);
            }
            let mut sums = [vec![1.0; count], vec![2.0; count], vec![3.0; count]];
            let potential = bands.add_to(sums.each_mut().map(Vec::as_mut_slice), |rows, sums| {
                rows.clone().for_each(|i| sums[1][i - rows.start] += i as f64);
                Some(rows.len() as f64)
            });
            assert_eq!(potential, Some(count as f64));
            assert_eq!(sums[1], (0..count).map(|i| 2.0 + i as f64).collect::<Vec<_>>());
            assert_eq!((sums[0].clone(), sums[2].clone()), (vec![1.0; count], vec![3.0; count]));
        }
    }

    #[test]
    fn one_band_without_a_potential_leaves_all_without() {
        let mut sums = [(); 3].map(|()| vec![0.0; 100]);
        let sums = sums.each_mut().map(Vec::as_mut_slice);
        assert_eq!(Bands::new(100).add_to(sums, |rows, _| (!rows.contains(&40)).then_some(1.0)), None);
    }
}
