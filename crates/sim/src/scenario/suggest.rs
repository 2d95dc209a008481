//! What was perhaps meant by a name that is not known.

/// A remedy for a name that is not known: the nearest one, if it is near, and all of them.
pub(super) fn suggest(name: &str, known: &[&str]) -> String {
    let list = known.iter().map(|known| format!("`{known}`")).collect::<Vec<_>>().join(", ");
    let nearest = known.iter().map(|known| (edit_distance(name, known), known)).min();
    match nearest {
        None => "none is known here".to_owned(),
        Some((distance, nearest)) if distance <= 1 + nearest.chars().count() / 3 => {
            format!("did you mean `{nearest}`? Known here: {list}")
        }
        Some(_) => format!("known here: {list}"),
    }
}

/// Fewest insertions, deletions and replacements of a character that turn one word into another (Levenshtein). Words
/// of more than 64 characters are compared by their first 64.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().take(64).collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().take(64).enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, &y) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edit_distance_counts_single_character_changes() {
        assert_eq!(edit_distance("", "abc"), 3);
        assert_eq!(edit_distance("side_m", "side_m"), 0);
        assert_eq!(edit_distance("sied_m", "side_m"), 2);
        assert_eq!(edit_distance("pentagram", "pentagon"), 3);
    }
}
