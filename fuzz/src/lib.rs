//! What every target does with the bytes it gets.

use std::path::Path;

use glint::data::FileKind;

/// Reads `bytes` as a file of `kind`; an error must be one line that names the file.
pub fn judge(kind: FileKind, bytes: &[u8]) {
    if let Err(error) = kind.check(bytes, Path::new("input")) {
        let message = error.to_string();
        assert!(message.starts_with("input: ") && !message.contains(char::is_control), "{message:?}");
    }
}
