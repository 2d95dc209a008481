//! The arrows of ARCHITECTURE.md hold in the sources.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

mod circles;
mod mutants;

const PAGE: &str = include_str!("../../ARCHITECTURE.md");

/// Rows of the table whose header starts with `header`: first cell -> names between backticks in the last cell.
fn table(header: &str) -> BTreeMap<String, BTreeSet<String>> {
    let names = |cell: &str| cell.split('`').skip(1).step_by(2).map(str::to_owned).collect::<BTreeSet<_>>();
    let rows: BTreeMap<_, _> = PAGE
        .lines()
        .skip_while(|line| !line.starts_with(header))
        .skip(2)
        .take_while(|line| line.starts_with('|'))
        .map(|line| {
            let cells: Vec<_> = line.trim_matches('|').split('|').collect();
            (names(cells[0]).pop_first().expect("a name in the first cell"), names(cells[cells.len() - 1]))
        })
        .collect();
    assert!(!rows.is_empty(), "no table under {header:?}");
    rows
}

/// Every source file: its path below `src/`, and its text.
fn source_files() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let (mut files, mut folders) = (Vec::new(), vec![root.clone()]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).expect("readable folder") {
            let path = entry.expect("readable entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let file = path.strip_prefix(&root).expect("below src").to_string_lossy().replace('\\', "/");
                files.push((file, fs::read_to_string(&path).expect("readable source")));
            }
        }
    }
    files.sort();
    assert!(files.len() > 10, "only {} source files were found", files.len());
    files
}

/// The product part of a source file, without comments and without its test module.
fn code(text: &str) -> String {
    let product = text.split("\n#[cfg(test)]\nmod tests").next().unwrap_or(text);
    product.lines().filter(|line| !line.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n")
}

/// Identifiers that directly follow `prefix`, one level of braces opened.
fn names_after(text: &str, prefix: &str) -> BTreeSet<String> {
    let ident = |s: &str| s.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
    let mut found = BTreeSet::new();
    for (at, _) in text.match_indices(prefix) {
        let rest = &text[at + prefix.len()..];
        match rest.strip_prefix('{') {
            Some(group) => found.extend(top_level(group).map(|item| ident(item.trim()))),
            None => {
                found.insert(ident(rest));
            }
        }
    }
    found.remove("");
    found
}

/// The items of a group of imports whose opening brace has been read, without what is nested in them.
fn top_level(group: &str) -> impl Iterator<Item = &str> {
    let mut depth = 0;
    let end = group.find(|c| {
        depth += i32::from(c == '{') - i32::from(c == '}');
        depth < 0
    });
    let mut depth = 0;
    group[..end.unwrap_or(group.len())].split(move |c| {
        depth += i32::from(c == '{') - i32::from(c == '}');
        c == ',' && depth == 0
    })
}

fn mentions(text: &str, word: &str) -> bool {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    text.match_indices(word).any(|(at, _)| {
        let rest = &text[at + word.len()..];
        !text[..at].ends_with(is_word)
            && !text[..at].ends_with("::")
            && rest.starts_with("::")
            && !rest.starts_with("::<")
    })
}

/// Whether a module of ours has this name here, and hides a crate of the same name.
fn declares(text: &str, name: &str) -> bool {
    text.contains(&format!("mod {name};"))
}

/// Every broken arrow in one file, given by its path below `src/`.
fn broken_arrows(file: &str, text: &str) -> Vec<String> {
    let (rooms, crates) = (table("| room |"), table("| crate |"));
    let text = code(text);
    let room = file.split(['/', '.']).next().expect("a first part").to_owned();
    if room == "lib" || room == "main" {
        return Vec::new();
    }
    let Some(allowed) = rooms.get(&room) else { return vec![format!("{file}: no row in ARCHITECTURE.md")] };
    let imports = names_after(&text, "crate::").into_iter().filter(|name| rooms.contains_key(name));
    let ours = imports
        .filter(|name| *name != room && !allowed.contains(name))
        .map(|name| format!("{file}: `{room}` may not import `{name}`"));
    let theirs = crates
        .iter()
        .filter(|(name, _)| !declares(&text, name))
        .filter(|(name, homes)| mentions(&text, name) && !homes.iter().any(|home| file.starts_with(home.as_str())))
        .map(|(name, _)| format!("{file}: the crate `{name}` may not be used here"));
    let prints = ["println!", "eprintln!", "print!", "dbg!"]
        .into_iter()
        .filter(|mac| room != "cli" && text.contains(mac))
        .map(|mac| format!("{file}: `{mac}` outside `cli`"));
    let climbs = text.contains("super::super::super::").then(|| format!("{file}: a path climbs out of its room"));
    ours.chain(theirs).chain(prints).chain(climbs).collect()
}

#[test]
fn every_source_file_keeps_the_arrows_of_the_architecture_page() {
    let broken: Vec<_> = source_files().iter().flat_map(|(file, text)| broken_arrows(file, text)).collect();
    assert!(broken.is_empty(), "broken arrows:\n{}", broken.join("\n"));
}

#[test]
fn every_room_of_the_page_exists() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for room in table("| room |").keys() {
        assert!(root.join(room).is_dir() || root.join(format!("{room}.rs")).is_file(), "no room `{room}`");
    }
}

#[test]
fn no_source_file_is_longer_than_450_lines() {
    for (file, text) in source_files() {
        let lines = text.lines().count();
        assert!(lines <= 450, "{file} has {lines} lines");
    }
}

#[test]
fn a_broken_arrow_is_seen() {
    let seen = |file: &str, text: &str| !broken_arrows(file, text).is_empty();
    assert!(seen("audit/mod.rs", "use crate::law::Law;"));
    assert!(seen("law/mod.rs", "use crate::{swarm::Swarm, plant::Plant};"));
    assert!(seen("law/mod.rs", "use crate::{swarm::{Pair, Swarm}, plant::Plant};"));
    assert!(seen("law/mod.rs", "let x = rapier3d::prelude::Real::MAX;"));
    assert!(seen("report/mod.rs", "println!(\"hello\");"));
    assert!(seen("attic.rs", ""));
    assert!(seen("read/text.rs", "let reader = csv::Reader::open();"));
    assert!(!seen("read/mod.rs", "mod csv;\nlet table = csv::Table::open();"));
    assert!(!seen("read/text.rs", "let message = csv::<Message>(bytes);"));
    assert!(!seen("audit/mod.rs", "use crate::swarm::Swarm;\nuse parry3d::query;"));
    assert!(!seen("cli/run.rs", "use crate::record::mcap::Header;"));
    assert!(!seen("audit/mod.rs", "// as crate::law::Law does\n"));
    assert!(!seen("cli/mod.rs", "println!(\"hello\");"));
}
