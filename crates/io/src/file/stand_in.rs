//! Files that stand for another one that was not fetched.

use std::fmt;

/// A file that stands for another one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum StandIn {
    /// A pointer of Git LFS.
    GitLfs,
    /// A page of the web instead of the file that was asked for.
    WebPage,
}

impl StandIn {
    /// The kind of stand-in that a file with these contents is; `None` of other files.
    pub fn of(bytes: &[u8]) -> Option<Self> {
        let text = bytes.trim_ascii_start();
        let starts_with =
            |start: &str| text.get(..start.len()).is_some_and(|s| s.eq_ignore_ascii_case(start.as_bytes()));
        if starts_with("version https://git-lfs") {
            Some(Self::GitLfs)
        } else if starts_with("<!doctype html") || starts_with("<html") {
            Some(Self::WebPage)
        } else {
            None
        }
    }
}

impl fmt::Display for StandIn {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::GitLfs => "this is a pointer of Git LFS, not the file itself: fetch it with `git lfs pull`",
            Self::WebPage => "this is a web page, not the file itself: download the file behind the page's link",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_not_fetched_is_recognised() {
        assert_eq!(StandIn::of(b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n"), Some(StandIn::GitLfs));
        assert_eq!(StandIn::of(b"\n<!DOCTYPE HTML>\n<html>"), Some(StandIn::WebPage));
        assert_eq!(StandIn::of(b"<opencv_storage>"), None);
        assert_eq!(StandIn::of(b""), None);
    }
}
