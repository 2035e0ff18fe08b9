//! Suggestions for misspelt names.

/// The candidate most similar to `name`, if it is similar enough for `name` to be a misspelling.
pub(crate) fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let plain = |text: &str| text.to_lowercase().replace(['-', '_', ' '], "");
    let name = plain(name);
    candidates
        .into_iter()
        .map(|candidate| (strsim::jaro_winkler(&name, &plain(candidate)), candidate))
        .filter(|(similarity, _)| *similarity >= 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, candidate)| candidate)
}

/// Names for a message: the first eight, quoted, and the number of the others.
pub(crate) fn listed<S: AsRef<str>>(names: &[S]) -> String {
    const SHOWN: usize = 8;
    let shown: Vec<_> = names.iter().take(SHOWN).map(|name| format!("\"{}\"", name.as_ref())).collect();
    match names.len().saturating_sub(SHOWN) {
        0 => shown.join(", "),
        more => format!("{} and {more} more", shown.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_slips_and_leaves_strangers_alone() {
        let keys = ["columns", "rows", "spacing_mm", "circle_diameter_mm"];
        assert_eq!(nearest("colums", keys), Some("columns"));
        assert_eq!(nearest("Spacing-MM", keys), Some("spacing_mm"));
        assert_eq!(nearest("spacing", keys), Some("spacing_mm"));
        assert_eq!(nearest("zzz", keys), None);
    }

    #[test]
    fn long_lists_are_cut() {
        assert_eq!(listed(&["a", "b"]), "\"a\", \"b\"");
        let many: Vec<_> = (0..20).map(|i| i.to_string()).collect();
        assert!(listed(&many).ends_with("\"7\" and 12 more"));
    }
}
