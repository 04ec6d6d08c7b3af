//! The library's only error type.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use crate::gpu::GpuError;

/// Maximum characters of a message about a file. Messages quote files, whose words can be megabytes long.
const MAX_WHAT: usize = 800;

/// Any failure of the library. [`Error::exit_code`] is the command line's exit status for it.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "fields are what the messages say of them")]
pub enum Error {
    /// Invalid contents of a file. `what` names the field and the expected value.
    #[error("{}: {}", one_line(&path.to_string_lossy(), usize::MAX), one_line(what, MAX_WHAT))]
    Input { path: PathBuf, what: String },
    /// A file could not be read or written.
    #[error("{}: {source}", one_line(&path.to_string_lossy(), usize::MAX))]
    Io { path: PathBuf, source: std::io::Error },
    /// An argument or a combination of arguments makes no sense.
    #[error("{0}")]
    Usage(String),
    /// The device, the driver or the memory on it failed, or lacks what glint needs.
    #[error("{0}")]
    Gpu(#[from] GpuError),
}

/// A result whose error is [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

impl Error {
    /// Bad input in a file: `what` states the value found and the expected one.
    pub fn input(path: impl AsRef<Path>, what: impl Into<String>) -> Self {
        Error::Input { path: path.as_ref().to_owned(), what: what.into() }
    }

    /// A failed read or write of a file.
    pub fn io(path: impl AsRef<Path>, source: std::io::Error) -> Self {
        Error::Io { path: path.as_ref().to_owned(), source }
    }

    /// 2 for errors in the caller's input, 1 for failures of the machine.
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::Input { .. } | Error::Usage(_) | Error::Gpu(GpuError::Null(_)) => 2,
            Error::Io { source, .. } if source.kind() == std::io::ErrorKind::NotFound => 2,
            Error::Io { .. } | Error::Gpu(_) => 1,
        }
    }
}

/// Escapes control characters of `text`, which could break the line or move a terminal's cursor. Removes the
/// middle if it is longer than `limit` characters.
fn one_line(text: &str, limit: usize) -> String {
    let escape = |c: char| {
        let (plain, escaped) = if c.is_control() { (None, Some(c.escape_default())) } else { (Some(c), None) };
        plain.into_iter().chain(escaped.into_iter().flatten())
    };
    let escaped: String = without_middle(text, limit).chars().flat_map(escape).collect();
    without_middle(&escaped, limit).into_owned()
}

/// Keeps the end as well as the beginning: messages end with the expected value.
fn without_middle(text: &str, limit: usize) -> Cow<'_, str> {
    if text.chars().nth(limit).is_none() {
        return Cow::Borrowed(text);
    }
    let head = text.chars().take(limit / 2);
    let tail: Vec<char> = text.chars().rev().take(limit / 2).collect();
    Cow::Owned(head.chain(" … ".chars()).chain(tail.into_iter().rev()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_one_line_whatever_they_quote() {
        let error = Error::input("a\nb.ply", "the word `\u{1b}[2J\r\n` is not a number");
        assert_eq!(error.to_string(), "a\\nb.ply: the word `\\u{1b}[2J\\r\\n` is not a number");
        let long = Error::input("a.ply", format!("`{}` is not a number", "ä\n".repeat(100_000))).to_string();
        assert!(long.starts_with("a.ply: `ä\\nä") && long.ends_with("` is not a number") && long.contains(" … "));
        assert_eq!(long.chars().count(), "a.ply: ".len() + MAX_WHAT + " … ".chars().count());
    }
}
