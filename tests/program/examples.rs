//! Examples of keys in the help of studies: each is flown.

use crate::program::{TAUTLINE, ran_by};

#[test]
fn every_example_of_a_key_in_the_help_of_a_study_is_flown() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut flown = 0;
    for (command, option, quick) in [
        ("margin", "--key", &["--scan", "2", "--halvings", "0"][..]),
        ("sweep", "--key", &["--set", "time.duration_s=2"]),
        ("attack", "--vary", &["--set", "time.duration_s=2", "--flights", "3"]),
    ] {
        let help = ran_by(TAUTLINE, folder.path(), &[command, "--help"]).out;
        let examples = help.split('`').skip(1).step_by(2).filter(|word| word.contains('=') && word.contains('.'));
        for example in examples {
            let words = [&[command, "pentagon", option, example], quick].concat();
            let ran = ran_by(TAUTLINE, folder.path(), &words);
            assert!(matches!(ran.exit, Some(0 | 1)), "{words:?}: {}", ran.err);
            for refused in ["could not be flown", "no flight was flown", "can be flown"] {
                assert!(!(ran.out.clone() + &ran.err).contains(refused), "{words:?}: {}{}", ran.out, ran.err);
            }
            flown += 1;
        }
    }
    assert_eq!(flown, 4, "the examples that are found in the help");
    // Negative twin: a key that no flight takes.
    let refused = ["sweep", "pentagon", "--key", "network.loss=0,0.1,0.2", "--set", "time.duration_s=2"];
    let refused = ran_by(TAUTLINE, folder.path(), &refused);
    assert!(refused.exit == Some(1) && refused.out.contains("could not be flown"), "{}", refused.out);
}
