//! Which image and which depth image are one frame: by equal names, by the number in their names, or by time.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use super::candidate::Candidate;

/// How the images of a dataset were paired with its depth images.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Pairing {
    /// Nothing was to be paired, or equal file stems.
    #[default]
    Stem,
    /// By what is left of the stems without the words that all files of a kind begin and end with: `ir_01_a`, `depth_01_b`.
    Rest,
    /// By the last number in the stems: `rgb_1` and `depth_1`.
    Number,
    /// The nearest times of capture.
    Time {
        /// Largest difference of the times of a pair, s.
        within_s: f64,
    },
    /// A table names the files of every frame.
    Table,
}

impl fmt::Display for Pairing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Pairing::Stem => write!(f, "images and depth are paired by equal names"),
            Pairing::Rest => {
                write!(f, "images and depth are paired by their names without the words that each kind has in common")
            }
            Pairing::Number => write!(f, "images and depth are paired by the last number in their names"),
            Pairing::Time { within_s } => {
                write!(f, "images and depth are paired by nearest time, at most {:.3} ms apart", 1e3 * within_s)
            }
            Pairing::Table => write!(f, "a table says which image and depth are a frame"),
        }
    }
}

/// A file of a dataset, or a row of its table, that belongs to no frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Stray {
    /// The file relative to the dataset's folder, or the row.
    pub name: String,
    /// Why it belongs to no frame.
    pub reason: String,
}

impl Stray {
    /// A file below `root`.
    pub(crate) fn file(root: &Path, path: &Path, reason: impl Into<String>) -> Self {
        let name = path.strip_prefix(root).unwrap_or(path).display().to_string();
        Stray { name, reason: reason.into() }
    }
}

/// Name of a frame, and the positions of its image and its depth image.
pub(crate) type Pair = (String, usize, usize);

/// Pairs by the first of the rules equal stems, equal rests, equal numbers that pairs the most files. Names that occur twice
/// under a rule pair with nothing.
pub(crate) fn by_name(images: &[Candidate], depth: &[Candidate]) -> (Pairing, Vec<Pair>) {
    let stems = |files: &[Candidate]| files.iter().map(Candidate::stem).collect::<Vec<_>>();
    let (image_stems, depth_stems) = (stems(images), stems(depth));
    let rests = |stems: &[String]| rests(stems).into_iter().map(Some).collect::<Vec<_>>();
    let numbers = |stems: &[String]| stems.iter().map(|stem| last_number(stem).map(str::to_owned)).collect::<Vec<_>>();
    let whole = |stems: &[String]| stems.iter().cloned().map(Some).collect::<Vec<_>>();
    let rules = [
        (Pairing::Stem, equal(&whole(&image_stems), &whole(&depth_stems))),
        (Pairing::Rest, equal(&rests(&image_stems), &rests(&depth_stems))),
        (Pairing::Number, equal(&numbers(&image_stems), &numbers(&depth_stems))),
    ];
    // `max_by_key` takes the last of equals, the first rule is to win.
    rules.into_iter().rev().max_by_key(|(_, pairs)| pairs.len()).unwrap_or_default()
}

/// Pairs of equal keys that are unique on both sides. Leading zeros of numbers do not count.
fn equal(images: &[Option<String>], depth: &[Option<String>]) -> Vec<Pair> {
    let unique = |keys: &[Option<String>]| {
        let mut places: BTreeMap<String, Option<usize>> = BTreeMap::new();
        for (index, key) in keys.iter().enumerate() {
            if let Some(key) = key.as_ref().filter(|key| !key.is_empty()) {
                places.entry(without_zeros(key)).and_modify(|place| *place = None).or_insert(Some(index));
            }
        }
        places
    };
    let theirs = unique(depth);
    let pair = |(key, image): (String, Option<usize>)| {
        let (image, depth) = (image?, (*theirs.get(&key)?)?);
        Some((images[image].clone()?, image, depth))
    };
    unique(images).into_iter().filter_map(pair).collect()
}

/// The stems without the words that all of them begin and end with. Neither a number nor a word is cut.
fn rests(stems: &[String]) -> Vec<String> {
    let Some(first) = stems.first() else { return Vec::new() };
    let shared = |forward: bool| {
        let shared = |stem: &String| {
            let same = |(p, q): &(char, char)| p == q;
            let count =
                |pairs: &mut dyn Iterator<Item = (char, char)>| pairs.take_while(same).map(|(c, _)| c.len_utf8()).sum();
            let bytes: usize = if forward {
                count(&mut first.chars().zip(stem.chars()))
            } else {
                count(&mut first.chars().rev().zip(stem.chars().rev()))
            };
            bytes
        };
        stems.iter().map(shared).min().unwrap_or(0)
    };
    // Between a letter and a digit, or beside what is neither.
    let is_border = |within: Option<char>, beyond: Option<char>| match (within, beyond) {
        (Some(within), _) if !within.is_alphanumeric() => true,
        (Some(within), Some(beyond)) => within.is_alphabetic() && beyond.is_ascii_digit(),
        _ => false,
    };
    let front_fits = |front: usize| {
        let fits = |stem: &String| {
            let (front, middle) = stem.split_at_checked(front)?;
            is_border(front.chars().next_back(), middle.chars().next()).then_some(())
        };
        stems.iter().all(|stem| fits(stem).is_some())
    };
    let front = (1..=shared(true)).rev().find(|front| front_fits(*front)).unwrap_or(0);
    let shortest = stems.iter().map(String::len).min().unwrap_or(0);
    let back_fits = |back: usize| {
        let fits = |stem: &String| {
            let (middle, back) = stem.split_at_checked(stem.len() - back)?;
            is_border(back.chars().next(), middle.chars().next_back()).then_some(())
        };
        stems.iter().all(|stem| fits(stem).is_some())
    };
    let back = (1..=shared(false).min(shortest - front)).rev().find(|back| back_fits(*back)).unwrap_or(0);
    stems.iter().map(|stem| stem.get(front..stem.len() - back).unwrap_or_default().to_owned()).collect()
}

/// The digits of the last number.
fn last_number(stem: &str) -> Option<&str> {
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let start = stem[..end]
        .rfind(|c: char| !c.is_ascii_digit())
        .map_or(0, |i| i + stem[i..].chars().next().map_or(1, char::len_utf8));
    Some(&stem[start..end])
}

/// The name with its numbers without leading zeros: `f_007` and `f_7` are the same.
fn without_zeros(name: &str) -> String {
    let mut plain = String::with_capacity(name.len());
    let mut in_number = false;
    let mut characters = name.chars().peekable();
    while let Some(c) = characters.next() {
        let leading = c == '0' && !in_number && characters.peek().is_some_and(char::is_ascii_digit);
        in_number = c.is_ascii_digit() && !leading;
        if !leading {
            plain.push(c);
        }
    }
    plain
}

/// Pairs by nearest time: of all pairs at most `within_s` apart, the nearest first, each file once, as TUM's `associate.py` does.
/// `Err` is a file without a time.
pub(crate) fn by_time(images: &[Candidate], depth: &[Candidate], within_s: f64) -> Result<Vec<Pair>, PathBuf> {
    let times = |files: &[Candidate]| -> Result<Vec<(f64, usize)>, PathBuf> {
        let timed = files
            .iter()
            .enumerate()
            .map(|(i, file)| file.time_s().map(|time| (time, i)).ok_or_else(|| file.path.clone()));
        let mut times = timed.collect::<Result<Vec<_>, PathBuf>>()?;
        times.sort_by(|a, b| a.0.total_cmp(&b.0));
        Ok(times)
    };
    let (ours, theirs) = (times(images)?, times(depth)?);
    let mut near = Vec::new();
    for (time, image) in &ours {
        let first = theirs.partition_point(|(other, _)| *other < time - within_s);
        let close = theirs[first..].iter().take_while(|(other, _)| *other <= time + within_s);
        near.extend(close.map(|(other, depth)| ((time - other).abs(), *image, *depth)));
    }
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)).then(a.2.cmp(&b.2)));
    let (mut used_images, mut used_depth) = (vec![false; images.len()], vec![false; depth.len()]);
    let mut pairs = Vec::new();
    for (_, image, depth) in near {
        if !(used_images[image] || used_depth[depth]) {
            (used_images[image], used_depth[depth]) = (true, true);
            pairs.push((images[image].stem(), image, depth));
        }
    }
    Ok(pairs)
}

#[cfg(test)]
mod tests;
