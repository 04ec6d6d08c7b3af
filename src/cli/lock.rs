//! Lock on an output: a second run that writes to it is refused, because both would overwrite each other's
//! checkpoints.

use std::{
    fs::{self, File, TryLockError},
    path::{Path, PathBuf},
};

use crate::{Error, Result};

/// Prefix of unfinished files, so that the sweep also removes locks of killed runs.
const PREFIX: &str = ".glint-";

/// Lock held by this process until it is dropped.
pub(super) struct Lock {
    path: PathBuf,
    /// `None` if the file system has no locks.
    held: Option<File>,
}

impl Lock {
    /// Locks the output `of`: a file, or an existing folder.
    ///
    /// # Errors
    /// [`Error::Input`] if another process holds the lock; [`Error::Io`] if the lock file cannot be
    /// written.
    pub(super) fn take(of: &Path) -> Result<Lock> {
        let name = of.file_name().unwrap_or_default().to_string_lossy();
        let path = if of.is_dir() {
            of.join(format!("{PREFIX}lock"))
        } else {
            of.with_file_name(format!("{PREFIX}{name}.lock"))
        };
        loop {
            let file = File::options().create(true).truncate(false).write(true).open(&path);
            let file = file.map_err(|error| Error::io(&path, error))?;
            match file.try_lock() {
                Ok(()) if is_at(&file, &path) => return Ok(Lock { path, held: Some(file) }),
                // The previous holder has removed the file meanwhile.
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    let what = "another glint process is writing here; wait for it, or choose another output";
                    return Err(Error::input(of, what));
                }
                Err(TryLockError::Error(error)) => {
                    tracing::debug!("{}: {error}: no lock, so another run may write here too", path.display());
                    return Ok(Lock { path, held: None });
                }
            }
        }
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        // Removed while it is held, so that no other process's lock is removed.
        if self.held.is_some() {
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Whether the path still names this file.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let of = |found: &fs::Metadata| (found.dev(), found.ino());
    matches!((file.metadata(), fs::metadata(path)), (Ok(ref a), Ok(ref b)) if of(a) == of(b))
}

#[cfg(not(unix))]
fn is_at(_: &File, path: &Path) -> bool {
    path.exists()
}

#[cfg(test)]
mod tests {
    use std::{sync::atomic::AtomicU32, sync::atomic::Ordering, thread};

    use super::*;

    #[test]
    fn a_place_is_one_run_s_until_its_end() {
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("base.ply");
        let refused = |of: &Path| Lock::take(of).err().unwrap().to_string();
        let (first, other) = (Lock::take(&output).unwrap(), Lock::take(&folder.path().join("other.ply")).unwrap());
        let inside = Lock::take(folder.path()).unwrap();
        assert!(refused(&output).contains("another glint process is writing here"));
        assert!(refused(folder.path()).contains("another glint process"));
        drop((first, other, inside));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        // The lock file of a killed run does not block.
        fs::write(folder.path().join(".glint-base.ply.lock"), "").unwrap();
        drop(Lock::take(&output).unwrap());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    /// The file is removed while other threads open it.
    #[test]
    fn never_two_have_one_place() {
        let folder = tempfile::tempdir().unwrap();
        let (output, inside) = (folder.path().join("base.ply"), AtomicU32::new(0));
        let work = || {
            for _ in 0..500 {
                let Ok(lock) = Lock::take(&output) else { continue };
                assert_eq!(inside.fetch_add(1, Ordering::SeqCst), 0);
                inside.fetch_sub(1, Ordering::SeqCst);
                drop(lock);
            }
        };
        thread::scope(|scope| (0..4).for_each(|_| drop(scope.spawn(work))));
    }
}
