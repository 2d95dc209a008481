//! The picture of modules has no circle: what a file takes from another leads, over any number of files, never back.

use std::collections::{BTreeMap, BTreeSet};

use crate::{code, source_files};

/// A file of `src/`, and what it says of others.
struct Module<'a> {
    file: &'a str,
    imports: Vec<Import<'a>>,
    /// Paths of two or more names in bodies, and single names that stand alone.
    mentions: Vec<Vec<&'a str>>,
}

/// One leaf of a `use`.
struct Import<'a> {
    /// The name that it gives, `*` where it gives all.
    name: &'a str,
    path: Vec<&'a str>,
    /// Handed on to others, and no sign that this file needs it.
    shared: bool,
}

/// For each file, the others that it takes from, with one path that says so.
type Arrows<'a> = BTreeMap<&'a str, BTreeMap<&'a str, String>>;

/// Modules by their path from the root of the crate, which is empty.
struct Picture<'a>(BTreeMap<Vec<&'a str>, Module<'a>>);

impl<'a> Picture<'a> {
    fn of(files: &'a [(String, String)]) -> Self {
        Self(files.iter().map(|(file, text)| (path_of(file), Module::of(file, text))).collect())
    }

    /// The module that defines what a path says, as seen from a module; re-exports are followed to where they lead.
    fn home(&self, from: &[&'a str], path: &[&'a str], depth: usize) -> Option<Vec<&'a str>> {
        let (first, mut rest) = path.split_first()?;
        let mut at = from.to_vec();
        match *first {
            "crate" => at.clear(),
            "self" => {}
            "super" => drop(at.pop()),
            _ => rest = path,
        }
        let named = rest.len() < path.len();
        for (k, name) in rest.iter().enumerate() {
            let inner = [&at[..], &[name]].concat();
            if *name == "super" {
                at.pop();
            } else if self.0.contains_key(&inner) {
                at = inner;
            } else if let Some(import) = self.0.get(&at)?.imports.iter().find(|import| import.name == *name) {
                let on = [&import.path[..], &rest[k + 1..]].concat();
                return if depth == 0 { None } else { self.home(&at, &on, depth - 1) };
            } else {
                return (named || k > 0).then_some(at);
            }
        }
        (named || !rest.is_empty()).then_some(at)
    }

    /// From which others each file takes something.
    fn arrows(&self) -> Arrows<'a> {
        let mut arrows = Arrows::new();
        for (path, module) in &self.0 {
            let imported = module.imports.iter().filter(|import| !import.shared || module.says(import.name));
            let said = imported.map(|import| &import.path).chain(module.mentions.iter().filter(|said| said.len() > 1));
            let homes = said.filter_map(|said| Some((self.0[&self.home(path, said, 8)?].file, said.join("::"))));
            arrows.insert(module.file, homes.filter(|(home, _)| *home != module.file).collect());
        }
        arrows
    }

    /// Files from which arrows lead back to themselves: of each circle, the arrows in it.
    fn circles(&self) -> Vec<String> {
        let arrows = self.arrows();
        let circle = |from: &&'a str| -> BTreeSet<_> {
            reached(&arrows, from).into_iter().filter(|to| reached(&arrows, to).contains(from)).collect()
        };
        let circles: BTreeSet<_> = arrows.keys().map(circle).filter(|circle| !circle.is_empty()).collect();
        let inside = |circle: &BTreeSet<&str>| {
            let arrows = circle.iter().flat_map(|from| arrows[from].iter().map(move |(to, said)| (from, to, said)));
            let inside = arrows.filter(|(_, to, _)| circle.contains(*to));
            inside.map(|(from, to, said)| format!("{from} -> {to} ({said})")).collect::<Vec<_>>().join("\n")
        };
        circles.iter().map(inside).collect()
    }
}

/// The files that arrows lead to from one.
fn reached<'a>(arrows: &Arrows<'a>, from: &'a str) -> BTreeSet<&'a str> {
    let (mut seen, mut open) = (BTreeSet::new(), vec![from]);
    while let Some(at) = open.pop() {
        open.extend(arrows[at].keys().filter(|next| seen.insert(**next)));
    }
    seen
}

impl<'a> Module<'a> {
    fn of(file: &'a str, text: &'a str) -> Self {
        let (mut imports, mut mentions) = (Vec::new(), Vec::new());
        let words = words(text);
        // Depths of braces at which modules within the file opened: from there `super` is the file itself.
        let (mut depth, mut inner) = (0_usize, Vec::new());
        let mut k = 0;
        while k < words.len() {
            depth += usize::from(words[k] == "{");
            if k > 1 && words[k] == "{" && words[k - 2] == "mod" {
                inner.push(depth);
            }
            if words[k] == "}" {
                inner.pop_if(|opened| *opened == depth);
                depth = depth.saturating_sub(1);
            }
            let (imported, said) = (imports.len(), mentions.len());
            if words[k] == "use" {
                let shared = k > 0 && matches!(words[k - 1], "pub" | ")");
                let end = k + words[k..].iter().position(|word| *word == ";").unwrap_or(words.len() - k);
                tree(&words[k + 1..end], &mut Vec::new(), shared, &mut imports);
                k = end;
            } else if is_name(words[k]) && !matches!(words[..k], [.., "." | "::"] | [.., "(", "in"]) {
                let mut path = vec![words[k]];
                while k + 2 < words.len() && words[k + 1] == "::" && is_name(words[k + 2]) {
                    path.push(words[k + 2]);
                    k += 2;
                }
                mentions.push(path);
            }
            if !inner.is_empty() {
                imports[imported..].iter_mut().for_each(|import| {
                    import.name = "";
                    outward(&mut import.path);
                });
                mentions[said..].iter_mut().for_each(|said| outward(said));
            }
            k += 1;
        }
        Self { file, imports, mentions }
    }

    fn says(&self, name: &str) -> bool {
        self.mentions.iter().any(|said| said[0] == name)
    }
}

/// A path in a module within a file, as the file says it.
fn outward(path: &mut [&str]) {
    if path[0] == "super" {
        path[0] = "self";
    }
}

/// The leaves of a tree of imports. Returns how many words it took.
fn tree<'a>(words: &[&'a str], stem: &mut Vec<&'a str>, shared: bool, found: &mut Vec<Import<'a>>) -> usize {
    let depth = stem.len();
    let mut k = 0;
    while let Some(&word) = words.get(k) {
        match word {
            "{" => {
                k += 1;
                while words.get(k).is_some_and(|word| *word != "}") {
                    k += tree(&words[k..], stem, shared, found);
                    k += usize::from(words.get(k) == Some(&","));
                }
                stem.truncate(depth);
                return k + 1;
            }
            "::" => {}
            "," | "}" => break,
            "as" => {
                k += 1;
                stem.push("as");
                stem.push(words[k]);
            }
            name => stem.push(name),
        }
        k += 1;
    }
    let renamed = stem.len() > 1 && stem[stem.len() - 2] == "as";
    let name = *stem.last().expect("an import names something");
    let mut path = stem[..stem.len() - if renamed { 2 } else { 0 }].to_vec();
    path.retain(|name| *name != "*");
    if path.last() == Some(&"self") && path.len() > 1 {
        path.pop();
    }
    let name = if name == "self" { path.last().copied().unwrap_or(name) } else { name };
    found.push(Import { name, path, shared });
    stem.truncate(depth);
    k
}

fn is_name(word: &str) -> bool {
    word.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

/// Names and marks of a source, without what strings and characters hold.
fn words(text: &str) -> Vec<&str> {
    let mut words = Vec::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let length = match first {
            '"' => string(rest),
            'r' if rest.starts_with("r\"") || rest.starts_with("r#\"") => raw_string(rest),
            '\'' => character(rest),
            _ if first.is_alphanumeric() || first == '_' => {
                rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len())
            }
            ':' if rest.starts_with("::") => 2,
            _ => first.len_utf8(),
        };
        let (word, after) = rest.split_at(length);
        if !first.is_whitespace() && !word.contains(['"', '\'']) {
            words.push(word);
        }
        rest = after;
    }
    words
}

fn string(text: &str) -> usize {
    let mut escaped = true;
    let end = text.find(|c| {
        let ends = c == '"' && !escaped;
        escaped = c == '\\' && !escaped;
        ends
    });
    end.map_or(text.len(), |end| end + 1)
}

fn raw_string(text: &str) -> usize {
    let hashes = text[1..].find('"').unwrap_or(0);
    let end = format!("\"{}", "#".repeat(hashes));
    let from = 2 + hashes;
    text[from..].find(&end).map_or(text.len(), |at| from + at + end.len())
}

/// A character, or the mark of a lifetime.
fn character(text: &str) -> usize {
    let mut inner = text[1..].char_indices();
    match (inner.next(), inner.next()) {
        (Some((_, '\\')), Some((at, _))) => {
            text[1 + at + 1..].find('\'').map_or(text.len(), |end| 1 + at + 1 + end + 1)
        }
        (Some(_), Some((at, '\''))) => at + 2,
        _ => 1,
    }
}

/// The path of modules of a file below `src/`.
fn path_of(file: &str) -> Vec<&str> {
    let mut path: Vec<_> = file.trim_end_matches(".rs").split('/').collect();
    if matches!(path[..], [.., "mod"] | ["lib"]) {
        path.pop();
    }
    path
}

/// Files of the library, with their product part.
fn library() -> Vec<(String, String)> {
    let files = source_files().into_iter().filter(|(file, _)| file != "main.rs" && !file.ends_with("tests.rs"));
    files.map(|(file, text)| (file, code(&text))).collect()
}

#[test]
fn no_circle_of_modules() {
    let files = library();
    let picture = Picture::of(&files);
    let arrows: usize = picture.arrows().values().map(BTreeMap::len).sum();
    assert!(arrows > 200, "only {arrows} arrows were found");
    let circles = picture.circles();
    assert!(circles.is_empty(), "circles:\n{}", circles.join("\n\n"));
}

#[test]
fn a_circle_is_seen() {
    // The files of the only circle.
    let circle = |files: &[(&str, &str)]| {
        let files: Vec<_> = files.iter().map(|(file, text)| ((*file).to_owned(), code(text))).collect();
        let circles = Picture::of(&files).circles();
        assert!(circles.len() <= 1, "{circles:?}");
        let names =
            circles.iter().flat_map(|circle| circle.lines()).map(|line| line.split(' ').next().expect("a file"));
        names.collect::<BTreeSet<_>>().into_iter().map(str::to_owned).collect::<Vec<_>>().join(" ")
    };
    let both = "a/b.rs a/mod.rs";
    // A child takes from its parent, which takes from the child: as an import, in a body, by another name.
    assert_eq!(circle(&[("a/mod.rs", "mod b;\nuse b::f;"), ("a/b.rs", "use super::Error;")]), both);
    assert_eq!(circle(&[("a/mod.rs", "mod b;\nfn g() { b::f() }"), ("a/b.rs", "fn f() -> super::Error {}")]), both);
    assert_eq!(
        circle(&[("a/mod.rs", "mod b;\nuse self::b::{f as g};"), ("a/b.rs", "use crate::a::{Error, X};")]),
        both
    );
    assert_eq!(circle(&[("a/mod.rs", "mod b;\npub use b::F;\nfn g(f: F) {}"), ("a/b.rs", "use super::*;")]), both);
    // A parent may declare its children, call them, and hand on what is theirs.
    assert_eq!(circle(&[("a/mod.rs", "mod b;\npub use b::F;"), ("a/b.rs", "use super::Error;")]), "");
    assert_eq!(circle(&[("a/mod.rs", "mod b;\nfn g() { b::f() }"), ("a/b.rs", "fn f() {}")]), "");
    // What is handed on belongs to where it was made: siblings take from each other over their parent.
    let parent = ("a/mod.rs", "mod b;\nmod c;\npub use c::C;");
    assert_eq!(circle(&[parent, ("a/b.rs", "use super::C;"), ("a/c.rs", "use super::b::B;")]), "a/b.rs a/c.rs");
    assert_eq!(circle(&[parent, ("a/b.rs", "use super::C;"), ("a/c.rs", "struct C;")]), "");
    // Rooms, over a third.
    let rooms = [("a.rs", "use crate::b::B;"), ("b.rs", "use crate::c::{self, d::D};"), ("c.rs", "use crate::a::A;")];
    assert_eq!(circle(&rooms), "a.rs b.rs c.rs");
    // A module within a file is a part of the file.
    let within = "mod inner {\n    use super::Own;\n    fn f() { super::g() }\n}";
    assert_eq!(circle(&[("a/mod.rs", "mod b;\nuse b::f;"), ("a/b.rs", within)]), "");
    let seen_by = "pub(in super::super) fn g() {}";
    assert_eq!(circle(&[("a/mod.rs", "mod b;\nuse b::f;"), ("a/b.rs", seen_by)]), "");
    let outside = "mod inner {\n    use super::super::Error;\n}";
    assert_eq!(circle(&[("a/mod.rs", "mod b;\nuse b::f;"), ("a/b.rs", outside)]), both);
    // Comments, strings and tests take nothing.
    for quiet in [
        "// use super::Error;",
        "const A: &str = \"\\\"super::Error\"; const B: &str = r#\"\"super::Error\"#; const C: char = '\"';",
        "\n#[cfg(test)]\nmod tests {\n    use super::super::Error;\n}",
    ] {
        assert_eq!(circle(&[("a/mod.rs", "mod b;\nuse b::f;"), ("a/b.rs", quiet)]), "", "{quiet}");
    }
}
