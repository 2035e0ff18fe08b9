//! Words and numbers of a text file that know their line.

use std::fmt::Display;
use std::path::Path;

use crate::FileError;

/// A fault in a line of a text file.
pub(crate) fn line_error(path: &Path, line: usize, problem: impl Display) -> FileError {
    FileError::Line { path: path.to_owned(), line, problem: problem.to_string() }
}

/// The text of a file, or the line of the first byte that is no text.
pub(crate) fn utf8<'a>(path: &Path, bytes: &'a [u8]) -> Result<&'a str, FileError> {
    std::str::from_utf8(bytes).map_err(|error| {
        let line = 1 + bytes[..error.valid_up_to()].iter().filter(|byte| **byte == b'\n').count();
        line_error(path, line, "this is not text; is the file of this format?")
    })
}

/// The words of a text, one after the other across lines.
pub(crate) struct Words<'a> {
    path: &'a Path,
    words: Box<dyn Iterator<Item = (usize, &'a str)> + 'a>,
    line: usize,
}

impl<'a> Words<'a> {
    /// The words of `text`, whose first line counts as `first_line`.
    pub fn new(path: &'a Path, text: &'a str, first_line: usize) -> Self {
        let words = text
            .lines()
            .enumerate()
            .flat_map(move |(i, line)| line.split_whitespace().map(move |word| (i + first_line, word)));
        Words { path, words: Box::new(words), line: first_line }
    }

    pub fn error(&self, problem: impl Display) -> FileError {
        line_error(self.path, self.line, problem)
    }

    /// The next word, if there is one.
    pub fn next(&mut self) -> Option<&'a str> {
        let (line, word) = self.words.next()?;
        self.line = line;
        Some(word)
    }

    fn required(&mut self, what: &str) -> Result<&'a str, FileError> {
        self.next().ok_or_else(|| self.error(format_args!("ends before {what}")))
    }

    /// A finite number; `what` names it in errors.
    pub fn number(&mut self, what: &str) -> Result<f64, FileError> {
        let word = self.required(what)?;
        match word.parse() {
            Ok(number) if f64::is_finite(number) => Ok(number),
            _ => Err(self.error(format_args!("\"{word}\" should be {what}, a finite number"))),
        }
    }

    /// `N` finite numbers.
    pub fn numbers<const N: usize>(&mut self, what: &str) -> Result<[f64; N], FileError> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = self.number(what)?;
        }
        Ok(numbers)
    }

    /// A whole number that is not negative.
    pub fn count(&mut self, what: &str) -> Result<usize, FileError> {
        let word = self.required(what)?;
        word.parse().map_err(|_| self.error(format_args!("\"{word}\" should be {what}, a whole number")))
    }

    /// Nothing may follow.
    pub fn end(&mut self) -> Result<(), FileError> {
        match self.next() {
            Some(word) => Err(self.error(format_args!("\"{word}\" follows where nothing should"))),
            None => Ok(()),
        }
    }
}
