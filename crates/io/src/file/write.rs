//! Atomic writing: an output file is either complete or absent.

use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use super::error::FileError;
use super::temporary::{temporary_file, without_name};

/// Writes the file `path` with the bytes that `fill` writes: under a temporary name in the same folder, synchronised to
/// the disk, then renamed.
///
/// Where `path` is a symbolic link, the link is replaced by the file, and what it points to stays as it is: no output reaches a
/// file that was not named. A link among the folders of `path` is followed, since results go to the folder that the user chose.
///
/// Missing parent folders are created. When anything fails, or the program is interrupted, `path` keeps its former
/// contents. The temporary name, `.NAME.RANDOM.depthcal.tmp`, starts with a dot, so that globs such as `*.png` do not match it;
/// the next run that writes into the folder removes what a killed one left.
///
/// # Errors
/// [`FileError::Write`] with `path`: the folder or the file cannot be created, or `fill` failed.
pub fn write_atomically<F>(path: impl AsRef<Path>, fill: F) -> Result<(), FileError>
where
    F: FnOnce(&mut dyn Write) -> io::Result<()>,
{
    let (path, mut fill) = (path.as_ref(), Some(fill));
    let written = write(path, &mut |writer| fill.take().map_or(Ok(()), |fill| fill(writer)));
    written.map_err(|error| FileError::Write { path: path.to_owned(), error: without_name(error) })
}

/// For all types of path and contents alike, so that callers do not compile it again.
fn write(path: &Path, fill: &mut dyn FnMut(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let name = path.file_name().ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "this is no file name"))?;
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    fs::create_dir_all(folder)?;

    let file = temporary_file(folder, name)?;
    let mut writer = BufWriter::new(file);
    fill(&mut writer)?;
    let file = writer.into_inner().map_err(io::IntoInnerError::into_error)?;
    file.as_file().sync_all()?;
    file.persist(path).map_err(|failure| failure.error)?;
    // The rename survives a crash only once the folder is synchronised, which not every file system supports.
    synchronise(folder);
    Ok(())
}

/// Makes renames in a folder survive a crash of the machine, where the system supports it.
pub(super) fn synchronise(folder: &Path) {
    #[cfg(unix)]
    if let Ok(folder) = fs::File::open(folder) {
        let _ = folder.sync_all();
    }
    #[cfg(not(unix))]
    let _ = folder;
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Names of all that is in a folder, hidden files too.
    pub(in crate::file) fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn makes_folders_and_replaces() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a/b/result.txt");
        write_atomically(&path, |w| w.write_all(b"one")).unwrap();
        write_atomically(&path, |w| w.write_all(b"two")).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"two");
        assert_eq!(names(path.parent().unwrap()), ["result.txt"]);
    }

    #[test]
    fn a_failure_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("result.txt");
        write_atomically(&path, |w| w.write_all(b"old")).unwrap();
        let error = write_atomically(&path, |w| {
            w.write_all(b"half")?;
            Err(io::Error::other("the disk is full"))
        })
        .unwrap_err();
        assert!(error.to_string().contains("result.txt") && error.to_string().contains("the disk is full"));
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(names(folder.path()), ["result.txt"]);
    }

    #[test]
    fn a_panic_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("result.txt");
        let target = path.clone();
        let run = std::panic::catch_unwind(move || write_atomically(target, |_| panic!("interrupted")));
        assert!(run.is_err() && names(folder.path()).is_empty());
    }

    #[cfg(unix)]
    #[test]
    fn others_may_read_the_result() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (ours, plain) = (folder.path().join("ours"), folder.path().join("plain"));
        write_atomically(&ours, |w| w.write_all(b"x")).unwrap();
        fs::write(&plain, b"x").unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&plain));
    }

    #[cfg(unix)]
    #[test]
    fn a_link_is_replaced_and_its_target_is_not_touched() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let (elsewhere, link) = (folder.path().join("elsewhere"), folder.path().join("result.txt"));
        fs::write(&elsewhere, "precious").unwrap();
        // A link to a file, a link to nothing, and a link to itself.
        for target in [elsewhere.as_path(), Path::new("nowhere"), &link] {
            let _ = fs::remove_file(&link);
            symlink(target, &link).unwrap();
            write_atomically(&link, |w| w.write_all(b"new")).unwrap();
            assert!(fs::symlink_metadata(&link).unwrap().is_file());
            assert_eq!(
                (fs::read(&link).unwrap(), fs::read(&elsewhere).unwrap()),
                (b"new".to_vec(), b"precious".to_vec())
            );
        }
        assert_eq!(names(folder.path()), ["elsewhere", "result.txt"]);
    }

    #[cfg(unix)]
    #[test]
    fn a_folder_may_be_a_link() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let (real, link) = (folder.path().join("real"), folder.path().join("out"));
        fs::create_dir(&real).unwrap();
        symlink(&real, &link).unwrap();
        write_atomically(link.join("a/result.txt"), |w| w.write_all(b"new")).unwrap();
        assert_eq!(fs::read(real.join("a/result.txt")).unwrap(), b"new");
        // A folder that is not there is not made through a link.
        symlink(folder.path().join("nowhere"), folder.path().join("dangling")).unwrap();
        let error = write_atomically(folder.path().join("dangling/result.txt"), |_| Ok(())).unwrap_err();
        assert!(error.to_string().contains("dangling/result.txt") && !folder.path().join("nowhere").exists());
    }

    #[test]
    fn a_folder_in_the_way_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        assert!(write_atomically(folder.path(), |_| Ok(())).is_err());
        assert!(write_atomically("/", |_| Ok(())).is_err());
    }
}
