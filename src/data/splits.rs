//! Lists of the photos for training and for testing.

use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};

use super::left_out::counted;
use super::listing::Listing;
use super::names;
use super::photo::Split;
use crate::{Error, Result};

/// Names of photos in a dataset's own lists.
pub(super) struct Lists {
    pub(super) train: Option<Vec<String>>,
    pub(super) test: Option<Vec<String>>,
    /// Description of the lists' origin, for notes.
    pub(super) from: String,
}

/// Reads lists with one name per line from one of `folders`: test.txt, as 3DGS has it, and train.txt.
pub(super) fn find(folders: &[&Path], sources: &mut Vec<PathBuf>) -> Result<Option<Lists>> {
    let mut read = |name: &str| -> Result<Option<(PathBuf, Vec<String>)>> {
        let Some(path) = folders.iter().map(|folder| folder.join(name)).find(|path| path.is_file()) else {
            return Ok(None);
        };
        let text = fs::read_to_string(&path).map_err(|source| Error::io(&path, source))?;
        let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
        let lines = text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#'));
        sources.push(path.clone());
        Ok(Some((path, lines.map(str::to_owned).collect())))
    };
    let (test, train) = (read("test.txt")?, read("train.txt")?);
    let names: Vec<String> =
        [&test, &train].into_iter().flatten().map(|(path, _)| path.display().to_string()).collect();
    let [test, train] = [test, train].map(|list| list.map(|(_, names)| names));
    Ok((!names.is_empty()).then(|| Lists { train, test, from: names.join(" and ") }))
}

impl Lists {
    /// Splits the photos. With one list, all other photos are in the other split. With two lists, photos in
    /// neither are left out, and photos in both are for testing.
    pub(super) fn apply(self, listed: &mut Listing) {
        let set = |names: Vec<String>| names.iter().map(|name| names::compared(name)).collect::<HashSet<String>>();
        let (train, test) = (self.train.map(set), self.test.map(set));
        let mut unknown: HashSet<&String> = train.iter().chain(&test).flatten().collect();
        let mut tests = 0;
        let before = listed.entries.len();
        listed.entries.retain_mut(|entry| {
            let key = names::compared(&entry.name);
            unknown.remove(&key);
            let [train, test] = [&train, &test].map(|list| list.as_ref().map(|names| names.contains(&key)));
            entry.split = match (train, test) {
                (_, Some(true)) | (Some(false), None) => Some(Split::Test),
                (Some(true), _) | (None, _) => Some(Split::Train),
                (Some(false), Some(false)) => return false,
            };
            tests += usize::from(entry.split == Some(Split::Test));
            true
        });
        listed.notes.push(format!("{} for testing, as {} say", counted(tests, "photo"), self.from));
        let left = before - listed.entries.len();
        if left > 0 {
            listed.notes.push(format!("{} left out, which the lists do not name", counted(left, "photo")));
        }
        if !unknown.is_empty() {
            let mut names: Vec<&&String> = unknown.iter().collect();
            names.sort();
            let n = counted(names.len(), "name");
            listed.notes.push(format!("{n} in the lists of which there is no photo, such as `{}`", names[0]));
        }
    }
}
