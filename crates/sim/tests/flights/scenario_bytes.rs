//! Neither arbitrary bytes, nor changes of a scenario file, nor overrides make the reader panic.

use proptest::prelude::*;
use tautline_sim::scenario::{Override, builtin};

use super::scenario_files::{read, read_builtin};

proptest! {
    #[test]
    fn no_bytes_make_the_reader_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let text = String::from_utf8_lossy(&bytes).into_owned();
        if let Err(error) = read(&text) {
            prop_assert!(!error.to_string().is_empty());
        }
        let _ = Override::parse(&text).map(|set| read_builtin("pentagon", &[set.text()]));
    }

    #[test]
    fn no_change_of_a_built_in_makes_the_reader_panic(
        which in 0..4_usize,
        edits in prop::collection::vec(
            (any::<prop::sample::Index>(), 0..9_usize, "[-\\[\\]{}=.,\"0-9a-z\n]{0,6}"),
            1..6
        ),
    ) {
        let mut text: Vec<char> = builtin::all()[which].toml.chars().collect();
        for (at, cut, insert) in edits {
            let at = at.index(text.len() + 1);
            text.splice(at..(at + cut).min(text.len()), insert.chars());
        }
        let text: String = text.into_iter().collect();
        match read(&text) {
            Ok(scenario) => prop_assert_eq!(read(&scenario.resolved().toml), Ok(scenario)),
            Err(error) => prop_assert!(!error.to_string().is_empty()),
        }
    }

    #[test]
    fn no_override_makes_the_reader_panic(
        key in prop::sample::select(vec![
            "name", "swarm.count", "swarm.mass_kg", "start.positions_m.2", "start.positions_m.2.x", "start.shape",
            "start.velocities_m_s", "start.jitter_m", "formation.shape", "formation", "law.kind", "law.delta_m",
            "graph.kind", "graph.edges", "time.dt_s", "time.duration_s", "arrival.hold_s", "nothing.at.all",
        ]),
        value in prop_oneof![
            any::<f64>().prop_map(|x| format!("{x:?}")),
            any::<i64>().prop_map(|x| x.to_string()),
            "[a-z]{1,9}",
            Just("[[1,2],[3,4],[5,6],[7,8],[9,10]]".to_owned()),
            Just("{kind=\"edges\",edges=[[1,2]]}".to_owned()),
        ],
    ) {
        if let Err(error) = read_builtin("pentagon", &[&format!("{key}={value}")]) {
            prop_assert!(!error.to_string().is_empty());
        }
    }
}
