//! What comes in and goes out: scene files, photographs, the built-in scene.

pub mod builtin;
