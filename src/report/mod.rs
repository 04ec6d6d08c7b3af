//! Metrics, tables, pictures and HTML pages.

pub mod decompose;
pub mod evaluate;
#[cfg(feature = "cli")]
pub mod history;
#[cfg(feature = "cli")]
mod html;
#[cfg(feature = "cli")]
pub mod lpips;
pub mod metrics;
#[cfg(feature = "cli")]
pub mod page;
#[cfg(feature = "cli")]
pub mod parts;
#[cfg(feature = "cli")]
pub mod pictures;
pub mod plan;
#[cfg(feature = "cli")]
pub mod runs;
#[cfg(feature = "cli")]
pub mod spending;
pub mod summary;
pub mod table;
#[cfg(feature = "cli")]
pub mod viewer;
