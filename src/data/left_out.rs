//! Counts what a reader leaves out, and names it in a note.

/// Number of names that a note lists after the first.
const NAMED: usize = 3;

/// Entries of a file that are not used: their count, and the first few names.
#[derive(Default)]
pub(super) struct LeftOut {
    pub(super) count: usize,
    /// The name of the first and the reason.
    first: String,
    more: Vec<String>,
}

impl LeftOut {
    /// Counts one more. `why` names it and gives the reason.
    pub(super) fn add(&mut self, name: impl FnOnce() -> String, why: impl FnOnce() -> String) {
        match self.count {
            0 => self.first = why(),
            1..=NAMED => self.more.push(name()),
            _ => {}
        }
        self.count += 1;
    }

    /// The first with its reason, and the names of the next.
    pub(super) fn text(&self) -> String {
        let Some(others) = self.count.checked_sub(1).filter(|&n| n > 0) else { return self.first.clone() };
        let and_on = if others > self.more.len() { ", …" } else { "" };
        format!("{} (and {others} more: {}{and_on})", self.first, self.more.join(", "))
    }

    /// "2 photos of 9 left out: …".
    pub(super) fn note(&self, all: usize, one: &str) -> Option<String> {
        (self.count > 0).then(|| format!("{} of {all} left out: {}", counted(self.count, one), self.text()))
    }
}

/// "1 photo", "2 photos".
pub(crate) fn counted(n: usize, one: &str) -> String {
    format!("{n} {one}{}", if n == 1 { "" } else { "s" })
}
