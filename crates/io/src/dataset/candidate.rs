//! Files that may belong to frames, and times in their names.

use std::path::PathBuf;

/// A file that may belong to a frame.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Candidate {
    pub path: PathBuf,
    /// Time of capture where a list gives it, s.
    pub time_s: Option<f64>,
}

impl Candidate {
    pub fn stem(&self) -> String {
        self.path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default()
    }

    /// Time of capture from the list, else from the name.
    pub fn time_s(&self) -> Option<f64> {
        self.time_s.or_else(|| stem_time_s(&self.stem()))
    }
}

/// Time of capture in a file's stem, s: its last number, in s with a decimal point or up to 11 digits, in ms with up to 14, in µs
/// with up to 17, in ns beyond.
pub(crate) fn stem_time_s(stem: &str) -> Option<f64> {
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let number = |c: char| c.is_ascii_digit() || c == '.';
    let start = stem[..end].rfind(|c| !number(c)).map_or(0, |i| i + stem[i..].chars().next().map_or(1, char::len_utf8));
    let text = stem[start..end].trim_start_matches('.');
    if text.contains('.') {
        return text.parse().ok();
    }
    let per_second: u64 = match text.len() {
        ..=11 => 1,
        12..=14 => 1_000,
        15..=17 => 1_000_000,
        _ => 1_000_000_000,
    };
    let ticks: u64 = text.parse().ok()?;
    // Whole seconds apart, which keeps the nanoseconds of today's clocks to 0.2 µs.
    Some((ticks / per_second) as f64 + (ticks % per_second) as f64 / per_second as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_in_names() {
        let near = |stem: &str, time: f64| {
            let read = stem_time_s(stem).unwrap();
            assert!((read - time).abs() < 1e-6, "{stem}: {read}");
        };
        near("1305031102.175304", 1305031102.175304);
        near("rgb_1305031102.175304", 1305031102.175304);
        near("1305031102175304000", 1305031102.175304);
        near("ir-1305031102175304", 1305031102.175304);
        near("1305031102175", 1305031102.175);
        near("12.5_left", 12.5);
        near("0042", 42.0);
        assert_eq!(stem_time_s("left"), None);
    }
}
