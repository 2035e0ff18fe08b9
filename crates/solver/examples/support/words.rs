//! Words and numbers of a text file, with the line for errors.

use std::fmt::Display;
use std::io;
use std::path::{Path, PathBuf};

/// A problem file cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ProblemFileError {
    /// The file cannot be opened or read.
    #[error("{path}: cannot read the file: {error}")]
    Read {
        /// The file.
        path: PathBuf,
        /// The error of the operating system or of the decompression.
        error: io::Error,
    },
    /// A line does not follow the format.
    #[error("{path}:{line}: {problem}")]
    Line {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// The fault, and what is expected.
        problem: String,
    },
}

/// The error for a line that does not follow the format.
pub fn line_error(path: &Path, line: usize, problem: impl Display) -> ProblemFileError {
    ProblemFileError::Line { path: path.to_owned(), line, problem: problem.to_string() }
}

/// The contents of a file as text; the error names the line of the first byte that is not UTF-8.
pub fn utf8<'a>(path: &Path, bytes: &'a [u8]) -> Result<&'a str, ProblemFileError> {
    std::str::from_utf8(bytes).map_err(|error| {
        let line = 1 + bytes[..error.valid_up_to()].iter().filter(|byte| **byte == b'\n').count();
        line_error(path, line, "this is not text; check that the file has this format")
    })
}

/// The words of a text in order, across lines.
pub struct Words<'a> {
    path: &'a Path,
    words: Box<dyn Iterator<Item = (usize, &'a str)> + 'a>,
    line: usize,
}

impl<'a> Words<'a> {
    /// The words of `text`, whose first line has the number `first_line`.
    pub fn new(path: &'a Path, text: &'a str, first_line: usize) -> Self {
        let words = text
            .lines()
            .enumerate()
            .flat_map(move |(i, line)| line.split_whitespace().map(move |word| (i + first_line, word)));
        Words { path, words: Box::new(words), line: first_line }
    }

    /// An error in the line of the last word.
    pub fn error(&self, problem: impl Display) -> ProblemFileError {
        line_error(self.path, self.line, problem)
    }

    /// The next word, if there is one.
    pub fn next(&mut self) -> Option<&'a str> {
        let (line, word) = self.words.next()?;
        self.line = line;
        Some(word)
    }

    fn required(&mut self, what: &str) -> Result<&'a str, ProblemFileError> {
        self.next().ok_or_else(|| self.error(format_args!("ends before {what}")))
    }

    /// The next word as a finite number; `what` describes it in errors.
    pub fn number(&mut self, what: &str) -> Result<f64, ProblemFileError> {
        let word = self.required(what)?;
        match word.parse() {
            Ok(number) if f64::is_finite(number) => Ok(number),
            _ => Err(self.error(format_args!("\"{word}\" should be {what}, a finite number"))),
        }
    }

    /// The next `N` words as finite numbers.
    pub fn numbers<const N: usize>(&mut self, what: &str) -> Result<[f64; N], ProblemFileError> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = self.number(what)?;
        }
        Ok(numbers)
    }

    /// The next word as a whole number, 0 or more.
    pub fn count(&mut self, what: &str) -> Result<usize, ProblemFileError> {
        let word = self.required(what)?;
        word.parse().map_err(|_| self.error(format_args!("\"{word}\" should be {what}, a whole number")))
    }

    /// An error if there are more words.
    pub fn end(&mut self) -> Result<(), ProblemFileError> {
        match self.next() {
            Some(word) => Err(self.error(format_args!("\"{word}\" follows where nothing should"))),
            None => Ok(()),
        }
    }
}
