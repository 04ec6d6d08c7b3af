//! The work of all targets on their bytes.

use std::path::Path;

/// Reads `bytes` as a file of `kind`, one of `glint::data::file_kinds`; an error must be one line that names the file.
pub fn judge(kind: &str, bytes: &[u8]) {
    if let Err(error) = glint::data::check_file(kind, bytes, Path::new("input")) {
        let message = error.to_string();
        assert!(message.starts_with("input: ") && !message.contains(char::is_control), "{message:?}");
    }
}
