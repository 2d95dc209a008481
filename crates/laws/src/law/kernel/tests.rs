use super::*;
use crate::formation::Formation;
use crate::law::EdgeTension;
use tautline_core::swarm::{row, separation, set_row};

/// Error of a sum of a hundred pulls, relative to the sum of their magnitudes.
const SUM_ROUNDING: f64 = 1e-14;
const DELTA_M: f64 = 0.1;

/// Returns a kernel for the distances of a formation, and positions with other distances.
fn fixture(graph: &Graph) -> (Kernel, Rows, Formation) {
    let count = graph.count();
    let wider = if count < BANDED_FROM { 1.0 } else { 10.0 };
    let formation = Formation::sphere(count, 3.0 * wider);
    let mut positions_m = Formation::sphere(count, 4.0 * wider).slots_m;
    for i in 0..count {
        positions_m[(i, 0)] += libm::sin(i as f64);
        positions_m[(i, 2)] *= 1.5;
    }
    let mut kernel = Kernel::new(graph, DELTA_M).expect("memory");
    for ((i, j), inverse_k_per_m) in graph.edges().zip(kernel.inverse_k_per_m_mut()) {
        *inverse_k_per_m = 1.0 / tension(&formation, i, j).k_m();
    }
    (kernel, positions_m, formation)
}

fn tension(formation: &Formation, i: usize, j: usize) -> EdgeTension {
    EdgeTension::new(1.0, DELTA_M, formation.desired_distance(i, j)).expect("slots are far apart")
}

fn graphs() -> Vec<Graph> {
    let complete = [1, 2, 3, 5, 9, LISTED_UP_TO, LISTED_UP_TO + 1, 33, 40, 41, 64].map(Graph::complete);
    complete.into_iter().chain([Graph::star(30), Graph::ring(17), Graph::path(10)]).collect()
}

/// Complete graphs whose rows take more than one block.
fn graphs_of_long_rows() -> Vec<Graph> {
    [ROW_BLOCK + 1, ROW_BLOCK + 2, 2 * ROW_BLOCK + 3].map(Graph::complete).into()
}

fn all_graphs() -> impl Iterator<Item = Graph> {
    graphs().into_iter().chain(graphs_of_long_rows())
}

#[test]
fn the_sums_match_the_tension_edge_by_edge() {
    for graph in all_graphs() {
        let (mut kernel, positions_m, formation) = fixture(&graph);
        let (mut expected, mut sizes, mut potential) = (Rows::zeros(graph.count()), vec![0.0; graph.count()], 0.0);
        for (i, j) in graph.edges() {
            let tension = tension(&formation, i, j);
            let distance_m = separation(&positions_m, i, j);
            let pull = (row(&positions_m, i) - row(&positions_m, j)) * (tension.derivative(distance_m) / distance_m);
            let (of_i, of_j) = (row(&expected, i) + pull, row(&expected, j) - pull);
            set_row(&mut expected, i, of_i);
            set_row(&mut expected, j, of_j);
            sizes[i] += pull.norm();
            sizes[j] += pull.norm();
            potential += tension.value(distance_m);
        }
        let mut sums = Rows::zeros(graph.count());
        let found = kernel.add_pulls(&positions_m, &mut sums).unwrap_or(f64::NAN);
        for (i, size) in sizes.iter().enumerate() {
            let error = (row(&sums, i) - row(&expected, i)).norm();
            assert!(error <= SUM_ROUNDING * size, "N = {}, vehicle {i}: {error:e} of {size:e}", graph.count());
        }
        assert!((found - potential).abs() <= SUM_ROUNDING * potential, "N = {}: {found} {potential}", graph.count());
    }
}

#[test]
fn the_bits_do_not_depend_on_the_vector_instructions() {
    for graph in all_graphs() {
        let (mut kernel, positions_m, _) = fixture(&graph);
        let (mut dispatched, mut baseline) = (Rows::zeros(graph.count()), Rows::zeros(graph.count()));
        let potential = kernel.add_pulls(&positions_m, &mut dispatched);
        // Without vector instructions.
        kernel.arch = pulp::Arch::Scalar;
        assert_eq!(potential, kernel.add_pulls(&positions_m, &mut baseline));
        assert!(potential.is_ok());
        assert_eq!(dispatched, baseline);
    }
}

#[test]
fn the_bits_are_the_same_in_every_build() {
    // Fingerprints of all sums; they change only with the arithmetic.
    for (graphs, expected) in [(graphs(), 0x9e37_5d5d_f36d_abe2), (graphs_of_long_rows(), 0xee01_68e6_acc8_fe23)] {
        let mut fingerprint = 0_u64;
        for graph in graphs {
            let (mut kernel, positions_m, _) = fixture(&graph);
            let mut sums = Rows::zeros(graph.count());
            let potential = kernel.add_pulls(&positions_m, &mut sums).unwrap_or(f64::NAN);
            for number in sums.iter().chain([&potential]) {
                fingerprint = fingerprint.rotate_left(5) ^ number.to_bits().wrapping_mul(0x9e37_79b9_7f4a_7c15);
            }
        }
        assert_eq!(fingerprint, expected, "{fingerprint:#x}");
    }
}

#[test]
fn a_pair_out_of_domain_is_noticed_at_every_edge() {
    for graph in [Graph::complete(7), Graph::complete(ROW_BLOCK + 3), Graph::ring(2 * LIST_BLOCK + 3)] {
        let (mut kernel, positions_m, _) = fixture(&graph);
        for (i, j) in graph.edges() {
            let mut touching = positions_m.clone();
            let beside = row(&touching, i) + nalgebra::Vector3::new(0.0, 0.5 * DELTA_M, 0.0);
            set_row(&mut touching, j, beside);
            let mut sums = Rows::zeros(graph.count());
            assert_eq!(kernel.add_pulls(&touching, &mut sums), Err(OutOfDomain), "{i} {j}");
            assert_eq!(kernel.potential(&touching), Err(OutOfDomain));
        }
        for i in 0..graph.count() {
            let mut far = positions_m.clone();
            for number in [1e200, f64::MAX, f64::INFINITY, f64::NAN] {
                far[(i, 2)] = number;
                assert_eq!(kernel.potential(&far), Err(OutOfDomain), "{i} {number}");
            }
        }
    }
}

#[test]
fn the_bits_of_bands_do_not_depend_on_the_number_of_threads() {
    let graph = Graph::complete(BANDED_FROM);
    let (mut kernel, positions_m, _) = fixture(&graph);
    let mut whole = Rows::zeros(graph.count());
    let mut in_one = kernel.clone();
    in_one.bands = Some(Bands::new(graph.count(), 1, LANES, PADDING_M));
    let potential = in_one.add_pulls(&positions_m, &mut whole).expect("far apart");

    let mut on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        let mut sums = Rows::zeros(graph.count());
        let found = pool.install(|| kernel.add_pulls(&positions_m, &mut sums)).expect("far apart");
        assert_eq!(kernel.potential(&positions_m), Ok(found));
        (sums, found)
    };
    let one = on(1);
    assert!([2, 3, 7].into_iter().all(|threads| on(threads) == one));
    assert!((one.1 - potential).abs() <= SUM_ROUNDING * potential);
    // The pulls of a row cancel, so the rounding is relative to the sum of their magnitudes: 640 of up to 1 each.
    let largest = (&one.0 - &whole).amax();
    assert!(largest > 0.0 && largest < SUM_ROUNDING * BANDED_FROM as f64, "{largest:e}");
}

#[test]
fn a_pair_out_of_domain_is_noticed_in_every_band() {
    let (mut kernel, positions_m, _) = fixture(&Graph::complete(BANDED_FROM));
    for i in (0..BANDED_FROM).step_by(20) {
        let mut touching = positions_m.clone();
        let beside = row(&touching, i) + nalgebra::Vector3::new(0.0, 0.5 * DELTA_M, 0.0);
        set_row(&mut touching, (i + 7) % BANDED_FROM, beside);
        assert_eq!(kernel.add_pulls(&touching, &mut Rows::zeros(BANDED_FROM)), Err(OutOfDomain), "{i}");
        assert_eq!(kernel.potential(&touching), Err(OutOfDomain));
    }
}

const BANDS: usize = 16;

#[test]
fn bands_partition_the_rows_with_about_equal_edges() {
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
fn an_error_in_one_band_is_returned() {
    let mut sums = [(); 3].map(|()| vec![0.0; 100]);
    let sums = sums.each_mut().map(Vec::as_mut_slice);
    let evaluate = |rows: Range<usize>, _: [&[f64]; 3], _: [&mut [f64]; 3]| {
        if rows.contains(&40) { Err(OutOfDomain) } else { Ok(1.0) }
    };
    assert_eq!(Bands::new(100, BANDS, 0, 0.0).add_to([&[]; 3], sums, evaluate), Err(OutOfDomain));
}
