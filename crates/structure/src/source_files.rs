//! All Rust files of the workspace as tokens: libraries, programs, tests, examples, benches and fuzz targets.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use proc_macro2::{TokenStream, TokenTree};

use crate::error::StructureError;
use crate::sources::read_text;

/// Folders without sources that a person wrote: products of builds, of the demo and of `depthcal formula --rust`, and the
/// fuzzers' inputs.
const SKIPPED: [&str; 4] = ["target", "demo", "emitted", "corpus"];

/// A file and its tokens.
pub struct SourceFile {
    /// Path below the workspace's root.
    pub path: PathBuf,
    /// The file's lines.
    pub lines: Vec<String>,
    /// The file's tokens, with their lines.
    pub tokens: TokenStream,
}

impl SourceFile {
    /// A file with this text.
    ///
    /// # Errors
    /// [`StructureError::Syntax`] if the text is not made of Rust's tokens.
    pub fn new(path: impl Into<PathBuf>, text: &str) -> Result<Self, StructureError> {
        let path = path.into();
        match TokenStream::from_str(text) {
            Ok(tokens) => Ok(Self { path, lines: text.lines().map(str::to_owned).collect(), tokens }),
            Err(error) => {
                let line = error.span().start().line;
                Err(StructureError::Syntax { path, line, message: error.to_string() })
            }
        }
    }

    /// The comments as pairs of line number, from 1, and trimmed line. Comments behind code are left out, and so are lines of
    /// string literals that look like comments.
    pub fn comments(&self) -> Vec<(usize, &str)> {
        let mut in_literal = vec![false; self.lines.len() + 1];
        mark_literals(self.tokens.clone(), &mut in_literal);
        let numbered = self.lines.iter().enumerate().map(|(i, line)| (i + 1, line.trim_start()));
        numbered.filter(|(number, line)| line.starts_with("//") && !in_literal[*number]).collect()
    }

    /// A violation in this file.
    pub fn violation(&self, line: usize, text: &str) -> String {
        format!("{}:{line}: {text}", self.path.display())
    }
}

/// Marks the lines that begin inside a literal.
fn mark_literals(tokens: TokenStream, in_literal: &mut [bool]) {
    for token in tokens {
        match token {
            TokenTree::Group(group) => mark_literals(group.stream(), in_literal),
            TokenTree::Literal(literal) => {
                let (start, end) = (literal.span().start().line, literal.span().end().line);
                in_literal[start + 1..=end.max(start)].fill(true);
            }
            _ => {}
        }
    }
}

/// All `.rs` files below `root` in order of their paths.
///
/// # Errors
/// A folder or file that cannot be read, or a file that is not made of Rust's tokens.
pub fn source_files(root: &Path) -> Result<Vec<SourceFile>, StructureError> {
    let mut files = Vec::new();
    add_folder(root, Path::new(""), &mut files)?;
    files.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(files)
}

fn add_folder(root: &Path, folder: &Path, files: &mut Vec<SourceFile>) -> Result<(), StructureError> {
    let absolute = root.join(folder);
    let failed = |source| StructureError::Read { path: absolute.clone(), source };
    for entry in std::fs::read_dir(&absolute).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let path = folder.join(&name);
        let file_type = entry.file_type().map_err(failed)?;
        if file_type.is_dir() && !name.starts_with('.') && !SKIPPED.contains(&name.as_str()) {
            add_folder(root, &path, files)?;
        } else if file_type.is_file() && name.ends_with(".rs") {
            files.push(SourceFile::new(path, &read_text(&entry.path())?)?);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_are_lines_of_their_own_outside_of_literals() {
        let text = "//! a\nfn f() { // b\n    /// c\n    let text = \"\n// d\n//\";\n    // e\n}";
        let file = SourceFile::new("a.rs", text).unwrap();
        assert_eq!(file.comments(), [(1, "//! a"), (3, "/// c"), (7, "// e")]);
        let error = SourceFile::new("a.rs", "fn f() {}\n\"").err().unwrap().to_string();
        assert!(error.starts_with("a.rs:2: not valid Rust"), "{error}");
    }

    #[test]
    fn all_rust_files_but_products_and_inputs_are_read() {
        let folder = tempfile::tempdir().unwrap();
        for path in ["a.rs", "b/c.rs", "b/d.txt", "target/e.rs", ".git/f.rs", "fuzz/corpus/g.rs", "fuzz/h.rs"] {
            let path = folder.path().join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        }
        let files = source_files(folder.path()).unwrap();
        let paths: Vec<_> = files.iter().map(|file| file.path.to_str().unwrap()).collect();
        assert_eq!(paths, ["a.rs", "b/c.rs", "fuzz/h.rs"]);
    }
}
