//! Writes files whole or not at all.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use tempfile::NamedTempFile;

use crate::{Error, Result};

/// Prefix of the names of unfinished files.
const PREFIX: &str = ".glint-";
/// File of an unfinished folder that tells [`sweep`] that it is in use.
const LOCK: &str = "lock";
/// Age from which an unlocked temporary file counts as left by a dead process: a live one locks its file a
/// moment after making it.
const STALE: Duration = Duration::from_secs(60);

/// Lets `fill` write a temporary file next to `path`, then renames it to `path`. If anything fails, nothing
/// is left, and an older file at `path` is untouched. Links are followed. A path that is not a plain file is
/// refused, because the rename would replace the device or folder itself. The contents reach the disk before
/// the name does, so that a power cut leaves either the old file or the new one.
pub(super) fn write_whole(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<NamedTempFile>) -> io::Result<()>,
) -> Result<()> {
    let at = |source| Error::io(path, source);
    let target = match fs::metadata(path) {
        // guard: no folder is written over
        Ok(found) if !found.is_file() => {
            return Err(Error::input(path, "exists and is not a file, so it cannot be written to"));
        }
        // guard: links to outputs
        Ok(_) => fs::canonicalize(path).map_err(at)?,
        Err(_) => path.to_owned(),
    };
    let folder = parent(&target);
    let mut builder = tempfile::Builder::new();
    builder.prefix(PREFIX);
    // Temporary files are private by default; an output gets the permissions that the umask allows.
    #[cfg(unix)]
    // guard: rights of outputs
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let file = builder.tempfile_in(folder).map_err(at)?;
    // Tells `sweep` that the file is in use. Some file systems have no locks; ignore that.
    let _ = file.as_file().try_lock();
    let mut writer = BufWriter::with_capacity(1 << 20, file);
    // guard: outputs whole or not at all
    fill(&mut writer).map_err(at)?;
    writer.flush().map_err(at)?;
    let file = writer.into_inner().map_err(|failed| at(failed.into_error()))?;
    file.as_file().sync_all().map_err(at)?;
    file.persist(&target).map_err(|failed| at(failed.error))?;
    // Only Unix can open and synchronise folders, and not on every file system. The file is whole either way.
    if let (true, Ok(folder)) = (cfg!(unix), File::open(folder)) {
        let _ = folder.sync_all();
    }
    Ok(())
}

/// Lets `fill` write a temporary folder next to `folder`, then renames it to `folder`. If anything fails, nothing is left, and an older
/// folder is untouched. It is replaced only if it holds nothing but names that are `own`. Links are followed.
#[cfg(feature = "formats")]
pub(super) fn replace_folder(
    folder: &Path,
    own: impl Fn(&str) -> bool,
    fill: impl FnOnce(&Path) -> io::Result<()>,
) -> Result<()> {
    let at = |source| Error::io(folder, source);
    let target = fs::canonicalize(folder).unwrap_or_else(|_| folder.to_owned());
    let entries = match fs::read_dir(folder) {
        Ok(entries) => Some(entries.collect::<io::Result<Vec<_>>>().map_err(at)?),
        Err(error) if error.kind() == io::ErrorKind::NotFound => None,
        Err(error) => return Err(at(error)),
    };
    let foreign = |entry: &&fs::DirEntry| entry.file_name().to_str().is_none_or(|name| !own(name));
    // guard: folders with other files
    if let Some(other) = entries.iter().flatten().find(foreign) {
        let other = other.file_name();
        let what = format!("has `{}`, which is not of such a scene; expected a folder of its own", other.display());
        return Err(Error::input(folder, what));
    }
    let beside = || tempfile::Builder::new().prefix(PREFIX).tempdir_in(parent(&target)).map_err(at);
    let new = beside()?;
    let lock = File::create(new.path().join(LOCK)).map_err(at)?;
    let _ = lock.try_lock();
    let scene = new.path().join("scene");
    fs::create_dir(&scene).map_err(at)?;
    fill(&scene).map_err(at)?;
    let old = beside()?;
    if entries.is_some() {
        fs::rename(&target, old.path().join("old")).map_err(at)?;
    }
    fs::rename(&scene, &target).map_err(at)
}

/// The folder that `path` is in.
pub(super) fn parent(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Removes unfinished files and folders that killed runs left in `folder`, and returns their paths. Those of running
/// processes are locked or young, and stay.
pub fn sweep(folder: impl AsRef<Path>) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let ours = |name: &std::ffi::OsStr| name.to_str().is_some_and(|name| name.starts_with(PREFIX));
    let gone = |path: &PathBuf| match path.is_dir() {
        true => is_stale(&path.join(LOCK)) && fs::remove_dir_all(path).is_ok(),
        false => is_stale(path) && fs::remove_file(path).is_ok(),
    };
    entries.filter(|entry| ours(&entry.file_name())).map(|entry| entry.path()).filter(gone).collect()
}

fn is_stale(path: &Path) -> bool {
    let Ok(file) = File::options().write(true).open(path) else { return false };
    let age = file.metadata().and_then(|found| found.modified()).map(|at| SystemTime::now().duration_since(at));
    matches!(age, Ok(Ok(age)) if age >= STALE) && file.try_lock().is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.txt");
        write_whole(&path, |file| file.write_all(b"first")).unwrap();
        let failed = write_whole(&path, |file| {
            file.write_all(b"second")?;
            Err(io::Error::other("disk on fire"))
        });
        assert!(failed.unwrap_err().to_string().contains("disk on fire"));
        assert_eq!(fs::read(&path).unwrap(), b"first");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_folder_is_not_written_over_and_a_missing_one_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let refused = write_whole(folder.path(), |_| Ok(())).unwrap_err();
        assert!(refused.to_string().contains("not a file"), "{refused}");
        let missing = folder.path().join("nowhere").join("out.txt");
        let refused = write_whole(&missing, |_| Ok(())).unwrap_err();
        assert!(refused.to_string().contains("nowhere"), "{refused}");
    }

    #[test]
    fn what_a_killed_run_left_is_swept_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let make = |name: &str, age: Duration| {
            let file = File::create(folder.path().join(name)).unwrap();
            file.set_modified(SystemTime::now() - age).unwrap();
            file
        };
        make(".glint-dead", 2 * STALE);
        make(".glint-young", Duration::ZERO);
        make(".other", 2 * STALE);
        make("scene.ply", 2 * STALE);
        fs::create_dir(folder.path().join(".glint-folder")).unwrap();
        for (name, age) in [(".glint-web/lock", 2 * STALE), (".glint-new/lock", Duration::ZERO)] {
            fs::create_dir(folder.path().join(name).parent().unwrap()).unwrap();
            make(name, age);
        }
        let busy = make(".glint-busy", 2 * STALE);
        busy.lock().unwrap();
        let mut swept = sweep(folder.path());
        swept.sort();
        assert_eq!(swept, [".glint-dead", ".glint-web"].map(|name| folder.path().join(name)));
        drop(busy);
        assert_eq!(sweep(folder.path()), [folder.path().join(".glint-busy")]);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 5);
        assert!(sweep(folder.path().join("nowhere")).is_empty());
    }

    #[test]
    fn a_file_that_is_being_written_is_locked() {
        let folder = tempfile::tempdir().unwrap();
        write_whole(&folder.path().join("a"), |writer| {
            let path = writer.get_ref().path().to_owned();
            writer.get_ref().as_file().set_modified(SystemTime::now() - 2 * STALE)?;
            assert!(sweep(folder.path()).is_empty() && path.is_file());
            Ok(())
        })
        .unwrap();
    }

    #[test]
    fn a_name_alone_is_in_the_folder_that_one_is_in() {
        assert_eq!(["a", "b/a", "/a"].map(|path| parent(Path::new(path))), [".", "b", "/"].map(Path::new));
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_and_its_file_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("file"), folder.path().join("link"));
        fs::write(&file, b"first").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        write_whole(&link, |out| out.write_all(b"second")).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&file).unwrap(), b"second");
    }

    #[cfg(unix)]
    #[test]
    fn outputs_can_be_read_by_others_as_the_umask_allows() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (ours, plain) = (folder.path().join("ours"), folder.path().join("plain"));
        write_whole(&ours, |_| Ok(())).unwrap();
        fs::write(&plain, b"").unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&plain));
    }
}
