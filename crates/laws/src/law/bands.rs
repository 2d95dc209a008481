//! The rows of a large complete graph in bands, which threads share.

use std::ops::Range;

use rayon::iter::{IndexedParallelIterator as _, IntoParallelRefMutIterator as _, ParallelIterator as _};

use super::tension::OutOfDomain;

/// Bands of rows of the complete graph, with room for what each adds to the sums, and the positions that all of them read: 48
/// bytes a vehicle for one band, some 290 for 16.
#[derive(Clone, Debug)]
pub(super) struct Bands {
    /// Along each axis \[m\]; behind the last vehicle there is a number of others, all in one place.
    axes: [Vec<f64>; 3],
    bands: Vec<Band>,
}

#[derive(Clone, Debug)]
struct Band {
    rows: Range<usize>,
    /// What its edges add to the sums of every vehicle from its first row on, along each axis.
    sums: [Vec<f64>; 3],
    potential: Result<f64, OutOfDomain>,
}

impl Bands {
    /// Of so many vehicles, with `room` for others at `beyond_m` behind the last. The number of bands fixes the order of all sums,
    /// however many threads there are.
    pub(super) fn new(count: usize, bands: usize, room: usize, beyond_m: f64) -> Self {
        // The rows from r on have about (N - r)^2/2 edges.
        let start = |band: usize| count - (count * count * (bands - band) / bands).isqrt();
        let band = |k: usize| {
            let rows = start(k)..if k + 1 == bands { count } else { start(k + 1) };
            let sums = [(); 3].map(|()| vec![0.0; count - rows.start + room]);
            Band { rows, sums, potential: Ok(0.0) }
        };
        Self { axes: [(); 3].map(|()| vec![beyond_m; count + room]), bands: (0..bands).map(band).collect() }
    }

    /// Lets every thread at hand evaluate bands, each once: `evaluate` gets the positions with room behind them, adds what the edges
    /// of these rows do to sums that begin with the first of the rows, along each axis, with room as well, and returns their
    /// potential. Adds all of it to `sums` band by band, so that the bits are the same for any number of threads; returns the
    /// whole potential.
    pub(super) fn add_to(
        &mut self,
        axes: [&[f64]; 3],
        mut sums: [&mut [f64]; 3],
        evaluate: impl Fn(Range<usize>, [&[f64]; 3], [&mut [f64]; 3]) -> Result<f64, OutOfDomain> + Sync,
    ) -> Result<f64, OutOfDomain> {
        for (own, axis) in self.axes.iter_mut().zip(axes) {
            own[..axis.len()].copy_from_slice(axis);
        }
        let axes = self.axes.each_ref().map(Vec::as_slice);
        let of_band = |band: &mut Band| {
            band.sums.iter_mut().for_each(|sums| sums.fill(0.0));
            band.potential = evaluate(band.rows.clone(), axes, band.sums.each_mut().map(Vec::as_mut_slice));
        };
        if self.bands.len() > 1 && rayon::current_num_threads() > 1 {
            self.bands.par_iter_mut().with_max_len(1).for_each(of_band);
        } else {
            self.bands.iter_mut().for_each(of_band);
        }
        for band in &self.bands {
            for (sums, of_band) in sums.iter_mut().zip(&band.sums) {
                sums[band.rows.start..].iter_mut().zip(of_band).for_each(|(sum, add)| *sum += add);
            }
        }
        self.bands.iter().map(|band| band.potential).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BANDS: usize = 16;

    #[test]
    fn every_row_is_in_one_band_and_bands_have_about_as_many_edges() {
        for count in [0, 1, 2, 17, 640, 1000, 12_345] {
            let mut bands = Bands::new(count, BANDS, 3, -1.0);
            let rows: Vec<_> = bands.bands.iter().flat_map(|band| band.rows.clone()).collect();
            assert_eq!(rows, (0..count).collect::<Vec<_>>());
            let edges = |rows: &Range<usize>| rows.clone().map(|i| count - 1 - i).sum::<usize>();
            let even = count * count / 2 / BANDS;
            for band in bands.bands.iter().filter(|_| count >= 640) {
                assert!(edges(&band.rows).abs_diff(even) <= 2 * count, "{count}: {:?}", band.rows);
            }
            let mut sums = [vec![1.0; count], vec![2.0; count], vec![3.0; count]];
            let heights: Vec<_> = (0..count).map(|i| i as f64).collect();
            let axes = [&[], &[], heights.as_slice()];
            let potential = bands.add_to(axes, sums.each_mut().map(Vec::as_mut_slice), |rows, axes, sums| {
                assert_eq!(axes[2][count..], [-1.0; 3]);
                rows.clone().for_each(|i| sums[1][i - rows.start] += axes[2][i]);
                Ok(rows.len() as f64)
            });
            assert_eq!(potential, Ok(count as f64));
            assert_eq!(sums[1], (0..count).map(|i| 2.0 + i as f64).collect::<Vec<_>>());
            assert_eq!((sums[0].clone(), sums[2].clone()), (vec![1.0; count], vec![3.0; count]));
        }
    }

    #[test]
    fn one_band_without_a_potential_leaves_all_without() {
        let mut sums = [(); 3].map(|()| vec![0.0; 100]);
        let sums = sums.each_mut().map(Vec::as_mut_slice);
        let evaluate = |rows: Range<usize>, _: [&[f64]; 3], _: [&mut [f64]; 3]| {
            if rows.contains(&40) { Err(OutOfDomain) } else { Ok(1.0) }
        };
        assert_eq!(Bands::new(100, BANDS, 0, 0.0).add_to([&[]; 3], sums, evaluate), Err(OutOfDomain));
    }
}
