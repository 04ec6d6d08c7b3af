//! The one error type of the library's surface.

use std::path::{Path, PathBuf};

/// Everything that can go wrong. [`Error::exit_code`] is what the command line returns for it.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file's contents are not what they should be. `what` names the field and what was expected.
    #[error("{}: {what}", path.display())]
    Input { path: PathBuf, what: String },
    /// A file could not be read or written.
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    /// An argument or a combination of arguments makes no sense.
    #[error("{0}")]
    Usage(String),
    /// The device, the driver or the memory on it failed, or lacks what glint needs.
    #[error("{0}")]
    Gpu(#[from] crate::gpu::GpuError),
}

pub type Result<T, E = Error> = std::result::Result<T, E>;

impl Error {
    pub fn input(path: impl AsRef<Path>, what: impl Into<String>) -> Self {
        Error::Input { path: path.as_ref().to_owned(), what: what.into() }
    }

    pub fn io(path: impl AsRef<Path>, source: std::io::Error) -> Self {
        Error::Io { path: path.as_ref().to_owned(), source }
    }

    /// 2 for what the caller gave, 1 for what the machine did.
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::Input { .. } | Error::Usage(_) => 2,
            Error::Io { source, .. } if source.kind() == std::io::ErrorKind::NotFound => 2,
            Error::Io { .. } | Error::Gpu(_) => 1,
        }
    }
}
