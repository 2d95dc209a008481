//! Which keys take whole numbers alone.

use super::overrides::Override;
use super::source::Source;
use super::text::Text;

/// Whether a key of a scenario takes whole numbers alone: whether the type of its value asks for one. What the value must be
/// beside that, such as positive, is no matter here.
#[must_use]
pub fn takes_whole_numbers_alone(source: &Source, overrides: &[Override], key: &str) -> bool {
    let Ok(set) = Override::parse(&format!("{key}=0.5")) else { return false };
    let Ok((name, toml)) = source.text() else { return false };
    let overrides = [overrides, &[set]].concat();
    Text { name: &name, toml: &toml, overrides: &overrides }.asks_for_whole_number()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_whole(builtin: &str, sets: &[&str], key: &str) -> bool {
        let overrides: Vec<_> = sets.iter().map(|set| Override::parse(set).expect("an override")).collect();
        takes_whole_numbers_alone(&Source::Builtin(builtin.to_owned()), &overrides, key)
    }

    #[test]
    fn keys_that_count_take_whole_numbers() {
        for (key, sets) in [
            ("start.seed", &[][..]),
            ("noise.seed", &[]),
            ("time.max_halvings", &[]),
            ("swarm.count", &[]),
            ("law.neighbours_max", &["law.kind=orca"]),
            ("failure.1.vehicle", &["failure=[{vehicle=1, kind=\"silent\", at_s=1}]"]),
            ("graph.edges.1.2", &["graph={kind=\"edges\", edges=[[1, 2], [2, 3], [3, 4], [4, 5]]}"]),
        ] {
            assert!(is_whole("pentagon", sets, key), "{key}");
        }
    }

    #[test]
    fn keys_that_measure_take_any_number_whatever_is_refused_between() {
        for (builtin, key) in [
            ("crazyflies", "sensing.latency_s"),
            ("crazyflies", "time.control_hz"),
            ("pentagon", "time.record_hz"),
            ("pentagon", "time.dt_s"),
            ("pentagon", "law.alpha"),
            ("pentagon", "start.positions_m.2.x"),
            ("pentagon", "wind.mean_m_s"),
            ("gusts", "wind.mean_m_s.1"),
            ("pentagon", "law.kind"),
            ("pentagon", "law.alfa"),
            ("pentagon", "law..alpha"),
        ] {
            assert!(!is_whole(builtin, &[], key), "{builtin} {key}");
        }
    }
}
