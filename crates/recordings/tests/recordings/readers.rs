//! The table of formats in docs/recordings.md is that of the readers.

use std::collections::BTreeSet;
use std::fs;

use tautline_recordings::read::{READERS, Reader};

#[test]
fn the_table_of_formats_in_the_docs_has_a_row_for_each_reader() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/recordings.md");
    let docs = fs::read_to_string(path).expect("the page");
    let row = |Reader { name, extensions, docs, .. }: &Reader| {
        let extensions = extensions.iter().map(|extension| format!("`.{extension}`")).collect::<Vec<_>>().join(", ");
        format!("| `{name}` | {extensions} | {docs} |\n")
    };
    let head = "| `--format` | usual extensions | format |\n| --- | --- | --- |\n".to_owned();
    let table = READERS.iter().map(row).fold(head, |table, row| table + &row) + "\n";
    assert!(docs.contains(&table), "docs/recordings.md must hold this table:\n{table}");
    let details = docs.lines().filter_map(|line| line.split(" | ").nth(1)?.strip_prefix('`')?.strip_suffix('`'));
    let described: BTreeSet<_> = details.collect();
    assert!(READERS.iter().all(|reader| described.contains(reader.name)), "{described:?}");
}

#[test]
fn names_of_readers_differ() {
    let names: BTreeSet<_> = READERS.iter().map(|reader| reader.name).collect();
    assert_eq!(names.len(), READERS.len());
}
