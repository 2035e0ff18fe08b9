//! Places in a text, for messages.

/// A place in a text, both from 1, columns in characters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Position {
    pub line: usize,
    pub column: usize,
}

impl Position {
    /// The place of a byte of `text`.
    pub fn of(text: &str, byte: usize) -> Self {
        let byte = (0..=byte.min(text.len())).rev().find(|b| text.is_char_boundary(*b)).unwrap_or(0);
        let before = &text[..byte];
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().map_or(0, |line| line.chars().count()) + 1;
        Self { line, column }
    }
}

/// The line of `text` with the bytes `from..to`, and below it a line that marks them.
pub(crate) fn underlined(text: &str, from: usize, to: usize) -> String {
    let start = text[..from].rfind('\n').map_or(0, |i| i + 1);
    let end = text[from..].find('\n').map_or(text.len(), |i| from + i);
    let width = |part: &str| part.chars().count();
    let marks = width(&text[from..to.clamp(from, end)]).max(1);
    format!("    {}\n    {}{}", &text[start..end], " ".repeat(width(&text[start..from])), "^".repeat(marks))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_count_characters() {
        let text = "a·b\nρ + c";
        assert_eq!(Position::of(text, text.find('c').unwrap()), Position { line: 2, column: 5 });
        assert_eq!(underlined(text, text.find('c').unwrap(), text.len()), "    ρ + c\n        ^");
    }
}
