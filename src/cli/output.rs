//! Checks of output files before any work: never an input, existing files only with `--force`, a suitable
//! extension, and enough room on the disk.

use std::{
    collections::HashSet,
    fs,
    io::{Error as IoError, ErrorKind},
    path::{Path, PathBuf},
};

use super::progress::note;
use crate::{
    Error, Result,
    data::{Dataset, SceneFormat, sweep},
};

/// Why an input is not an output.
const READ: &str = "this command reads it and never overwrites its inputs; expected another name";

#[derive(Debug, Default, clap::Args)]
pub(super) struct OutputArgs {
    /// Overwrite existing files, except files that the command reads
    #[arg(long)]
    force: bool,
}

/// Identity of a file, independent of its name.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
enum Identity {
    #[cfg(unix)]
    Inode(u64, u64),
    #[cfg(not(unix))]
    Path(PathBuf),
}

impl Identity {
    /// `None` if there is no such file.
    #[cfg(unix)]
    fn of(path: &Path) -> Option<Identity> {
        use std::os::unix::fs::MetadataExt;
        fs::metadata(path).ok().map(|found| Identity::Inode(found.dev(), found.ino()))
    }

    #[cfg(not(unix))]
    fn of(path: &Path) -> Option<Identity> {
        fs::canonicalize(path).ok().map(Identity::Path)
    }
}

/// Files and folders that a command reads.
#[derive(Debug, Default)]
pub(super) struct Inputs {
    files: HashSet<Identity>,
    /// Folders with photos. A new file there may become part of the dataset.
    folders: HashSet<Identity>,
}

impl Inputs {
    pub(super) fn scene(mut self, path: &Path) -> Inputs {
        self.files.extend(Identity::of(path));
        self
    }

    pub(super) fn dataset(mut self, dataset: &Dataset) -> Inputs {
        let photos = dataset.photo_files();
        self.folders.extend(photos.iter().filter_map(|path| Identity::of(path.parent()?)));
        let files = photos.into_iter().chain(dataset.sources.iter().map(PathBuf::as_path));
        self.files.extend(files.filter_map(Identity::of));
        self
    }
}

impl OutputArgs {
    /// Fails early if a file at `path` cannot or must not be written. Leaves no file behind. `extension`
    /// and `what` describe the expected kind of file.
    pub(super) fn check_file(&self, path: &Path, extension: &str, what: &str, inputs: &Inputs) -> Result<()> {
        if fs::metadata(path).is_ok_and(|found| !found.is_file()) {
            return Err(Error::input(path, "exists and is not a file, expected the name of a file to write"));
        }
        if !path.extension().is_some_and(|found| found.eq_ignore_ascii_case(extension)) {
            let name = path.with_extension(extension);
            let name = name.file_name().unwrap_or_default().to_string_lossy();
            return Err(Error::input(path, format!("the output is {what}, expected a name such as {name}")));
        }
        let folder = folder_of(path);
        writable(folder)
            .map_err(|error| Error::input(path, format!("cannot be written: {}: {error}", folder.display())))?;
        self.check_replaced(path, inputs)?;
        clear(folder);
        Ok(())
    }

    /// Checks the description of a scene that is a folder: the folder around it is written, and is the scene's own.
    pub(super) fn check_folder_of(&self, path: &Path, inputs: &Inputs) -> Result<()> {
        let Some(folder) = path.parent().filter(|folder| folder.file_name().is_some()) else {
            let what = format!("the scene is a folder, expected a name such as web/{}", path.display());
            return Err(Error::input(path, what));
        };
        let beside = folder.parent().filter(|beside| !beside.as_os_str().is_empty()).unwrap_or(Path::new("."));
        writable(beside)
            .map_err(|error| Error::input(path, format!("cannot be written: {}: {error}", beside.display())))?;
        // The input may be the folder, or one of the scenes in it.
        let within = |path: PathBuf| fs::read_dir(path).into_iter().flatten().flatten().map(|entry| entry.path());
        let files = within(folder.into()).chain(within(folder.into()).flat_map(within)).chain([folder.into()]);
        match files.filter_map(|file| Identity::of(&file)).find(|file| inputs.files.contains(file)) {
            Some(_) => return Err(Error::input(folder, READ)),
            None => self.check_replaced(path, inputs)?,
        }
        clear(beside);
        Ok(())
    }

    /// Checks a PLY scene. For other endings, the error suggests `glint convert`.
    pub(super) fn check_ply(&self, path: &Path, inputs: &Inputs) -> Result<()> {
        if SceneFormat::of(path).is_some_and(|format| format.ending != "ply") {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let stem = name.split_once('.').map_or(&name[..], |(stem, _)| stem);
            let what = format!(
                "the output is a PLY scene, expected a name such as {stem}.ply; then `glint convert {stem}.ply {name}` \
                 makes the other file"
            );
            return Err(Error::input(path, what));
        }
        self.check_file(path, "ply", "a PLY scene", inputs)
    }

    /// Creates the output folder; fails if it cannot or must not be written to.
    pub(super) fn make_folder(&self, path: &Path, inputs: &Inputs) -> Result<()> {
        if fs::metadata(path).is_ok_and(|found| !found.is_dir()) {
            return Err(Error::input(path, "exists and is not a folder, expected a folder to write to"));
        }
        if Identity::of(path).is_some_and(|folder| inputs.folders.contains(&folder)) {
            return Err(Error::input(path, "is a folder of the dataset's photos, expected another output folder"));
        }
        fs::create_dir_all(path)
            .map_err(|error| Error::input(path, format!("the folder cannot be created: {error}")))?;
        writable(path).map_err(|error| Error::input(path, format!("cannot be written to: {error}")))?;
        clear(path);
        Ok(())
    }

    /// Fails if one of `names` exists in `folder` and may not be replaced.
    pub(super) fn check_files<'a>(
        &self,
        folder: &Path,
        names: impl IntoIterator<Item = &'a str>,
        inputs: &Inputs,
    ) -> Result<()> {
        names.into_iter().try_for_each(|name| self.check_replaced(&folder.join(name), inputs))
    }

    /// Allows replacement if `own`: the existing output belongs to this run.
    pub(super) fn or(&self, own: bool) -> OutputArgs {
        OutputArgs { force: self.force || own }
    }

    fn check_replaced(&self, path: &Path, inputs: &Inputs) -> Result<()> {
        match Identity::of(path) {
            Some(file) if inputs.files.contains(&file) => Err(Error::input(path, READ)),
            Some(_) if !self.force => Err(Error::input(path, "already exists; --force overwrites it")),
            _ => Ok(()),
        }
    }
}

/// The folder that `path` is in.
pub(super) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

pub(super) fn writable(folder: &Path) -> std::io::Result<()> {
    tempfile::tempfile_in(folder).map(drop)
}

/// Removes unfinished files of killed runs.
fn clear(folder: &Path) {
    let gone = sweep(folder);
    if !gone.is_empty() {
        note(format!("{}: unfinished files of killed runs removed: {}", folder.display(), gone.len()));
    }
}

/// Fails if `bytes` do not fit on the disk of `path`. Prints a note if they fit, but not together with the
/// `beside` bytes written meanwhile. If the free space is unknown, nothing is checked.
pub(super) fn check_room(path: &Path, bytes: u64, beside: u64) -> Result<()> {
    match fs4::available_space(folder_of(path)) {
        Ok(free) => judge_room(path, free, [bytes, beside]).map(|said| said.into_iter().for_each(note)),
        Err(_) => Ok(()),
    }
}

/// Error or note for a disk with `free` bytes.
fn judge_room(path: &Path, free: u64, [bytes, beside]: [u64; 2]) -> Result<Option<String>> {
    let megabytes = |bytes: u64| bytes as f64 / 1e6;
    let (need, more, have) = (megabytes(bytes), megabytes(beside), megabytes(free));
    if free < bytes {
        let what = format!("needs {need:.1} MB, but its disk has {have:.1} MB left");
        return Err(Error::io(path, IoError::new(ErrorKind::StorageFull, what)));
    }
    Ok((free < bytes.saturating_add(beside)).then(|| {
        format!(
            "{}: its disk has {have:.1} MB left, enough for the output ({need:.1} MB), but not for {more:.1} MB of \
             checkpoints and pictures; the run continues, but may not be able to save checkpoints",
            path.display()
        )
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_known_by_any_of_its_names() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("base.ply"), "base").unwrap();
        fs::create_dir(at("sub")).unwrap();
        let inputs = Inputs::default().scene(&at("base.ply"));
        let mut names = vec![at("base.ply"), at("sub/../base.ply")];
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(at("base.ply"), at("link.ply")).unwrap();
            fs::hard_link(at("base.ply"), at("hard.ply")).unwrap();
            names.extend([at("link.ply"), at("hard.ply")]);
        }
        for name in names {
            for force in [false, true] {
                let refused = OutputArgs { force }.check_file(&name, "ply", "a scene", &inputs).unwrap_err();
                assert!(refused.to_string().contains("this command reads"), "{refused}");
            }
        }
    }

    #[test]
    fn what_does_not_fit_the_disk_is_said_before_it_is_made() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.ply");
        check_room(&path, 1, 1).unwrap();
        let full = check_room(&path, u64::MAX, 0).unwrap_err();
        assert!(full.to_string().contains("out.ply") && full.to_string().contains("MB left"), "{full}");
        assert_eq!(full.exit_code(), 1);
        check_room(Path::new("nowhere/out.ply"), u64::MAX, 0).unwrap();
        let judge = |free| judge_room(&path, free, [2_000_000, 6_000_000]).map_err(|error| error.to_string());
        let said = judge(7_900_000).unwrap().unwrap();
        assert!(
            said.contains("7.9 MB left") && said.contains("2.0") && said.contains("6.0 MB of checkpoints"),
            "{said}"
        );
        assert_eq!(judge(8_000_000), Ok(None));
        assert!(judge(1_900_000).unwrap_err().contains("needs 2.0 MB"));
    }
}
