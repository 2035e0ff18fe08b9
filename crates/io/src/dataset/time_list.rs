//! Lists of files with their times, as the RGB-D benchmark of the TU Munich has them.

use std::fs;
use std::path::Path;

use super::candidate::Candidate;
use super::error::DatasetError;
use super::inside::within;

/// Whether a pattern of `[frames]` names a list instead of images.
pub(crate) fn is_list(pattern: &str) -> bool {
    Path::new(pattern).extension().is_some_and(|extension| extension.eq_ignore_ascii_case("txt"))
}

/// Reads a list with lines `time file`, such as TUM's `rgb.txt`; `#` begins a comment. Files are relative to the list's folder,
/// and in the folder `root`.
pub(crate) fn read_list(root: &Path, path: &Path) -> Result<Vec<Candidate>, DatasetError> {
    let rows = lines(path, 2, "a time in s and a file, such as 1305031102.1753 rgb/1305031102.175304.png")?;
    rows.iter().map(|row| candidate(root, path, row, 0)).collect()
}

/// Reads TUM's associations, lines `time file time file` as `associate.py rgb.txt depth.txt` writes them: image and depth of
/// every frame. Where the first file of every line has `depth` in its path and the second has not, the order is the other one.
pub(crate) fn read_associations(root: &Path, path: &Path) -> Result<Vec<(Candidate, Candidate)>, DatasetError> {
    let rows = lines(path, 4, "a time in s and a file, twice: the image's and the depth image's")?;
    let pairs = rows.iter().map(|row| Ok((candidate(root, path, row, 0)?, candidate(root, path, row, 2)?)));
    let pairs: Vec<(Candidate, Candidate)> = pairs.collect::<Result<_, DatasetError>>()?;
    let is_depth = |row: &Row, column: usize| row.cells[column].to_lowercase().contains("depth");
    let swapped = rows.iter().all(|row| is_depth(row, 1) && !is_depth(row, 3));
    Ok(if swapped { pairs.into_iter().map(|(depth, image)| (image, depth)).collect() } else { pairs })
}

struct Row {
    line: u64,
    cells: Vec<String>,
}

fn lines(path: &Path, cells: usize, expected: &str) -> Result<Vec<Row>, DatasetError> {
    let text = fs::read_to_string(path).map_err(|error| DatasetError::Read { path: path.to_owned(), error })?;
    let mut rows = Vec::new();
    for (number, text) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        let text = text.trim();
        if text.is_empty() || text.starts_with('#') {
            continue;
        }
        let entries: Vec<String> =
            text.split([' ', '\t', ',']).filter(|cell| !cell.is_empty()).map(str::to_owned).collect();
        let line = number as u64 + 1;
        if entries.len() != cells {
            let problem = format!("this line has {} entries: write {expected}", entries.len());
            return Err(DatasetError::Table { path: path.to_owned(), line, problem });
        }
        rows.push(Row { line, cells: entries });
    }
    if rows.is_empty() {
        let problem = format!("the list is empty: write lines of {expected}");
        return Err(DatasetError::Table { path: path.to_owned(), line: 1, problem });
    }
    Ok(rows)
}

fn candidate(root: &Path, list: &Path, row: &Row, column: usize) -> Result<Candidate, DatasetError> {
    let time = row.cells[column].parse().ok().filter(|time: &f64| time.is_finite());
    let time_s = Some(time.ok_or_else(|| DatasetError::Cell {
        path: list.to_owned(),
        line: row.line,
        column: format!("{}", column + 1),
        value: row.cells[column].clone(),
    })?);
    let given = &row.cells[column + 1];
    let inside = within(root, list.parent().unwrap_or(root), Path::new(given));
    let outside = || DatasetError::Outside { path: list.to_owned(), line: row.line, given: given.clone() };
    Ok(Candidate { path: root.join(inside.ok_or_else(outside)?), time_s })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_and_associations() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        let write = |text: &str| fs::write(&path, text).unwrap();
        write("# color images\n1.5 rgb/1.5.png\n\n2.5\trgb/2.5.png\n");
        let list = read_list(folder.path(), &path).unwrap();
        assert_eq!(list[1], Candidate { path: folder.path().join("rgb/2.5.png"), time_s: Some(2.5) });
        write("1 rgb/1.png 1.01 depth/1.png\n");
        assert!(read_associations(folder.path(), &path).unwrap()[0].1.path.ends_with("depth/1.png"));
        write("1 depth/1.png 1.01 rgb/1.png\n");
        assert!(read_associations(folder.path(), &path).unwrap()[0].1.path.ends_with("depth/1.png"));
        write("1 rgb/1.png 1.01 depth/1.png\nx rgb/2.png 2 depth/2.png\n");
        assert!(
            read_associations(folder.path(), &path).unwrap_err().to_string().contains(":2: column `1` holds \"x\"")
        );
        write("1 rgb/1.png\n");
        assert!(read_associations(folder.path(), &path).unwrap_err().to_string().contains("2 entries"));
        write("# nothing\n");
        assert!(read_list(folder.path(), &path).unwrap_err().to_string().contains("empty"));
    }
}
