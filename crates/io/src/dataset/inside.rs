//! Paths that a dataset names, and the folder that they may not leave.

use std::path::{Component, Path, PathBuf};

/// The path `given`, which is relative to `folder` or absolute, as one relative to `root`, without `.` and `..`; `None` where it
/// leads out of `root`.
///
/// Only the text counts, not what is on the disk: a symbolic link in the folder is followed, as its owner has put it there, while
/// the text of a file that came with a dataset reaches nothing else. `..` is taken out before a link could give it another
/// meaning.
pub(crate) fn within(root: &Path, folder: &Path, given: &Path) -> Option<PathBuf> {
    let (root, path) = (plain(root)?, plain(&folder.join(given))?);
    path.strip_prefix(root).ok().map(Path::to_owned)
}

/// The path of the file `name` in the folder `root`. Names that lead out of it are refused where they are declared.
pub(crate) fn file_in(root: &Path, name: &str) -> PathBuf {
    root.join(within(root, root, Path::new(name)).unwrap_or_else(|| name.into()))
}

/// The absolute path without `.` and `..`; `None` where it leads above the root of the file system.
fn plain(path: &Path) -> Option<PathBuf> {
    let path = if path.as_os_str().is_empty() { Path::new(".") } else { path };
    let mut plain = PathBuf::new();
    for component in std::path::absolute(path).ok()?.components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir => plain.pop().then_some(())?,
            other => plain.push(other),
        }
    }
    Some(plain)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_paths_below_the_root_are_within() {
        for root in ["captures", "./captures/.", "../captures", "/data/captures", ""] {
            let within = |given: &str| within(Path::new(root), &Path::new(root).join("tables"), Path::new(given));
            assert_eq!(within("../image/1.png"), Some("image/1.png".into()), "{root}");
            assert_eq!(within("./a/../1.png"), Some("tables/1.png".into()), "{root}");
            assert_eq!(within("../../other/1.png"), None, "{root}");
            assert_eq!(within("a/../../../1.png"), None, "{root}");
            assert_eq!(within("/etc/passwd"), None, "{root}");
            let absolute = std::path::absolute(if root.is_empty() { "." } else { root }).unwrap().join("1.png");
            assert_eq!(within(absolute.to_str().unwrap()), Some("1.png".into()), "{root}");
        }
    }
}
