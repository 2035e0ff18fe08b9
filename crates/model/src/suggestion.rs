//! The known name that a misspelt one was meant to be.

/// Largest number of letters to insert, remove or replace, per three letters of the name.
const PER_THREE: usize = 1;

/// The known name that is nearest to `name`, as a clause that begins with a space; empty where none is near.
pub(crate) fn did_you_mean(name: &str, known: &[String]) -> String {
    let nearest = known.iter().map(|candidate| (distance(name, candidate), candidate)).min();
    let most = PER_THREE * name.chars().count().div_ceil(3);
    nearest
        .filter(|(edits, _)| *edits <= most)
        .map_or_else(String::new, |(_, name)| format!(" (did you mean '{name}'?)"))
}

/// Number of letters to insert, remove or replace between two words (Levenshtein's distance).
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, letter) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (k, other) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(letter != *other);
            diagonal = row[k + 1];
            row[k + 1] = replaced.min(row[k] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_name_is_proposed_and_no_other() {
        let known = ["cyclic_depth", "radial_range", "thin_prism"].map(str::to_owned);
        assert_eq!(did_you_mean("cyclic_dept", &known), " (did you mean 'cyclic_depth'?)");
        assert_eq!(did_you_mean("thinprism", &known), " (did you mean 'thin_prism'?)");
        assert_eq!(did_you_mean("warp", &known), "");
        assert_eq!(did_you_mean("", &[]), "");
        assert_eq!((distance("kitten", "sitting"), distance("", "abc"), distance("abc", "abc")), (3, 3, 0));
    }
}
