//! Comments: their width, and how documentation begins.

use crate::source_files::SourceFile;

/// Most characters of a line that is a comment, indentation included: ten more than code, which rustfmt keeps to 120.
pub const COMMENT_WIDTH: usize = 130;

/// Beginnings of a documentation comment that do not say what the item is or does.
const EMPTY_BEGINNINGS: [&str; 2] = ["What", "The same"];

/// Comment lines that are too wide.
pub fn check_comment_width(file: &SourceFile) -> Vec<String> {
    let width = |line: usize| file.lines[line - 1].chars().count();
    let wide = file.comments().into_iter().filter(|(line, _)| width(*line) > COMMENT_WIDTH);
    wide.map(|(line, _)| {
        file.violation(line, &format!("a comment of {} characters, at most {COMMENT_WIDTH} are allowed", width(line)))
    })
    .collect()
}

/// Documentation comments that begin with "What" or "The same".
pub fn check_beginnings(file: &SourceFile) -> Vec<String> {
    let mut violations = Vec::new();
    let mut previous = None;
    for (line, comment) in file.comments() {
        let Some(text) = documentation(comment) else { continue };
        let beginning = EMPTY_BEGINNINGS.into_iter().find(|words| begins_with(text, words));
        if let Some(words) = beginning.filter(|_| previous != Some(line - 1)) {
            violations
                .push(file.violation(line, &format!("documentation begins with \"{words}\": say what the item is")));
        }
        previous = Some(line);
    }
    violations
}

fn documentation(comment: &str) -> Option<&str> {
    comment.strip_prefix("///").or_else(|| comment.strip_prefix("//!")).map(str::trim_start)
}

/// Whether a text begins with these whole words.
fn begins_with(text: &str, words: &str) -> bool {
    text.strip_prefix(words).is_some_and(|after| !after.starts_with(char::is_alphanumeric))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(text: &str) -> SourceFile {
        SourceFile::new("a.rs", text).unwrap()
    }

    #[test]
    fn comments_are_at_most_130_characters_wide() {
        for prefix in ["//!", "///", "//", "    ///"] {
            let padding = COMMENT_WIDTH - prefix.len();
            // Characters are counted, not bytes.
            let widest = format!("\n{prefix}{}", "σ".repeat(padding));
            assert_eq!(check_comment_width(&file(&widest)), [] as [String; 0]);
            let message = "a.rs:2: a comment of 131 characters, at most 130 are allowed";
            assert_eq!(check_comment_width(&file(&(widest + "σ"))), [message]);
        }
        let literal = format!("const A: &str = \"\n// {}\";", "a".repeat(COMMENT_WIDTH));
        assert_eq!(check_comment_width(&file(&literal)), [] as [String; 0]);
    }

    #[test]
    fn documentation_does_not_begin_with_nothing() {
        let beginnings = |text: &str| check_beginnings(&file(text));
        let message = |line: usize, words: &str| {
            format!("a.rs:{line}: documentation begins with \"{words}\": say what the item is")
        };
        assert_eq!(beginnings("//! What a file holds.\n"), [message(1, "What")]);
        assert_eq!(beginnings("/// A.\n\n    /// The same for b.\nfn b() {}"), [message(3, "The same")]);
        let fine = "/// Whatever\nfn a() {}\n// What a comment says.\n/// A\n/// What follows.\nfn b() {}\nconst C: &str = \"\n/// What\n\";";
        assert_eq!(beginnings(fine), [] as [String; 0]);
    }
}
