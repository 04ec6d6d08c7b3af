//! Outputs that appear whole or not at all.

use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use tempfile::NamedTempFile;

use crate::{Error, Result};

/// Lets `fill` write a temporary file beside `path`, then renames it to `path`. When anything fails nothing is left and
/// what stood at `path` before is untouched. A link is followed; something that is no plain file is refused, because a
/// rename would replace the device or folder itself.
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
    let folder = match target.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".glint-");
    // A temporary file is private by default; an output has the rights that the umask leaves.
    #[cfg(unix)]
    // guard: rights of outputs
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut writer = BufWriter::with_capacity(1 << 20, builder.tempfile_in(folder).map_err(at)?);
    // guard: outputs whole or not at all
    fill(&mut writer).map_err(at)?;
    writer.flush().map_err(at)?;
    let file = writer.into_inner().map_err(|failed| at(failed.into_error()))?;
    file.persist(&target).map_err(|failed| at(failed.error))?;
    Ok(())
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
