//! Each broken variant of tests/mutants is a change of one line of the sources as they are. Tests must catch ten of
//! them; the other ones empty sentences, and no verdict of the golden table may depend on them.

use std::fs;
use std::path::Path;

#[test]
fn every_broken_variant_is_still_a_change_of_one_line() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let (mut caught, mut surviving) = (0, 0);
    for entry in fs::read_dir(root.join("tests/mutants")).expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        let text = fs::read_to_string(&path).expect(&name);
        let field = |key: &str| {
            let line = text.lines().find_map(|line| line.strip_prefix(key)).unwrap_or_else(|| panic!("{name}: {key}"));
            line.trim().to_owned()
        };
        let source = fs::read_to_string(root.join(field("file:"))).expect(&name);
        assert_eq!(source.matches(&field("from:")).count(), 1, "{name}: the line to break");
        assert_ne!(field("from:"), field("to:"), "{name}");
        let (_, test) = (field("what:"), field("test:"));
        let survives = text.lines().any(|line| line == "survives: yes");
        // The verdicts of a recording are in the golden table, those of a watch in the tests of its crate.
        assert!(!survives || test.contains("golden") || test.contains("--test watch"), "{name}: {test}");
        *(if survives { &mut surviving } else { &mut caught }) += 1;
    }
    assert_eq!((caught, surviving), (10, 3));
}
