//! Finds real data that is not part of the repository.

use std::path::PathBuf;

/// A file or folder of `../shared/data`. If it is missing, the test skips with a message; with
/// `GLINT_REQUIRE_DATA`, set by CI, it fails.
pub fn shared(name: &str) -> Option<PathBuf> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/data").join(name);
    if path.exists() {
        return Some(path);
    }
    assert!(std::env::var_os("GLINT_REQUIRE_DATA").is_none(), "{} is not there", path.display());
    eprintln!("skipped: {} is not there", path.display());
    None
}
