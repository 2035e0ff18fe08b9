//! Bindings whose names do not say what they hold.

use proc_macro2::{Delimiter, Spacing, TokenStream, TokenTree};

use crate::source_files::SourceFile;

/// Names that only say that there is something.
const EMPTY_NAMES: [&str; 6] = ["of", "own", "at", "rest", "found", "kept"];

/// Names of `let` (and of `if let`, `while let`) that say nothing, in the arguments of macros too. Fields of a struct's pattern
/// are left out: their names are those of the struct.
pub fn check_bindings(file: &SourceFile) -> Vec<String> {
    let mut violations = Vec::new();
    scan(file, file.tokens.clone(), &mut violations);
    violations
}

fn scan(file: &SourceFile, tokens: TokenStream, violations: &mut Vec<String>) {
    let mut in_pattern = false;
    let mut in_path = false;
    for token in tokens {
        match &token {
            TokenTree::Ident(keyword) if keyword == "let" => in_pattern = true,
            // Of `::` only the first is joined to what follows.
            TokenTree::Punct(colon) if colon.as_char() == ':' => {
                in_pattern &= in_path || colon.spacing() == Spacing::Joint;
                in_path = colon.spacing() == Spacing::Joint;
            }
            TokenTree::Punct(punct) if matches!(punct.as_char(), '=' | ';') => in_pattern = false,
            _ if in_pattern => scan_pattern(file, &token, violations),
            _ => {}
        }
        if let TokenTree::Group(group) = token {
            scan(file, group.stream(), violations);
        }
    }
}

fn scan_pattern(file: &SourceFile, pattern: &TokenTree, violations: &mut Vec<String>) {
    match pattern {
        TokenTree::Ident(name) if EMPTY_NAMES.iter().any(|empty| name == empty) => {
            let text = format!("a binding called `{name}`: name it after what it holds");
            violations.push(file.violation(name.span().start().line, &text));
        }
        TokenTree::Group(group) if group.delimiter() != Delimiter::Brace => {
            group.stream().into_iter().for_each(|token| scan_pattern(file, &token, violations));
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_say_nothing_are_seen_wherever_they_are_bound() {
        for (text, name) in [
            ("fn f() { let of = 1; }", "of"),
            ("fn f() { let mut own: Vec<u8> = vec![]; }", "own"),
            ("fn f() { let (a, &[ref at, _]) = b; }", "at"),
            ("fn f() { if let Some::<u8>(rest) = b {} }", "rest"),
            ("fn f() { while let A::B((c, found)) = b {} }", "found"),
            ("fn f() { let a = || { let kept = 1; kept }; }", "kept"),
            ("fn f() { assert!({ let kept = 1; kept }); }", "kept"),
        ] {
            let file = SourceFile::new("a.rs", &format!("\n{text}")).unwrap();
            let message = format!("a.rs:2: a binding called `{name}`: name it after what it holds");
            assert_eq!(check_bindings(&file), [message], "{text}");
        }
    }

    #[test]
    fn other_uses_of_these_words_are_no_bindings() {
        for text in [
            "fn f() { let a = at(of); a.rest(); }",
            "fn f() { let a: found = 1; let b = kept::own; }",
            "fn f() { let S { own, at: here, .. } = s; }",
            "fn at(own: u8) {}",
            "fn f() { let offset = 1; } // let at = 2;",
            "const A: &str = \"let at = 2;\";",
        ] {
            assert_eq!(check_bindings(&SourceFile::new("a.rs", text).unwrap()), [] as [String; 0], "{text}");
        }
    }
}
