//! Channels of run recordings round-trip, whatever their content.

use tautline_core::record::{Channel, OwnedSample, ReadFault};

use super::run_recording::{Run, fault, hash, read, recorded};

/// Returns a channel of a synthetic sensor that measures `columns` of every vehicle.
fn channel(name: &str, columns: &[&str], vehicles: usize, seed: f64) -> Channel {
    let values = (0..vehicles * columns.len()).map(|k| (seed + k as f64).sin() / 3.0).collect();
    Channel { values, ..Channel::new(name, columns) }
}

#[test]
fn channels_round_trip_bit_for_bit() {
    let mut run = Run::new(5, 150);
    for (k, sample) in run.samples.iter_mut().enumerate() {
        let mut odour = channel("odour", &["rose_mol_m3", "tar_mol_m3"], 5, k as f64);
        odour.values[..3].copy_from_slice(&[-0.0, f64::MIN_POSITIVE / 4.0, f64::INFINITY]);
        let mood = channel("mood", &["mood"], 5, -(k as f64));
        sample.channels = match k % 4 {
            0 => Vec::new(),
            1 => vec![odour],
            2 => vec![mood, odour],
            _ => vec![odour, channel("nothing", &[], 5, 0.0), mood],
        };
    }
    let bytes = recorded(&run);
    let (_, samples, events, complete) = read(&bytes).expect("read back");
    assert!(complete);
    assert_eq!((&samples, &events), (&run.samples, &run.events));
    let bits = |samples: &[OwnedSample]| {
        let values = samples.iter().flat_map(|sample| &sample.channels).flat_map(|channel| &channel.values);
        values.map(|x| x.to_bits()).collect::<Vec<_>>()
    };
    assert_eq!(bits(&samples), bits(&run.samples));
    assert_eq!(hash(&samples), hash(&Run::new(5, 150).samples), "the hash is of the states");

    let mut odours = 0;
    for message in mcap::MessageStream::new(&bytes).expect("an MCAP file") {
        let message = message.expect("a message");
        if message.channel.topic == "/vehicles/odour" {
            let schema = message.channel.schema.as_ref().expect("a schema");
            assert_eq!((schema.name.as_str(), schema.encoding.as_str()), ("tautline_msgs/msg/Channel", "ros2msg"));
            odours += 1;
        }
    }
    assert_eq!(odours, samples.iter().filter(|sample| !sample.channels.is_empty()).count());
}

#[test]
fn channel_with_a_wrong_value_count_is_refused() {
    let mut run = Run::new(5, 3);
    run.samples[2].channels = vec![channel("odour", &["rose_mol_m3", "tar_mol_m3"], 4, 0.0)];
    let reason = "it has 8 numbers, which is not 2 for each of 5 vehicles".to_owned();
    assert_eq!(fault(&recorded(&run)), ReadFault::Message { topic: "/vehicles/odour".to_owned(), reason });
}
