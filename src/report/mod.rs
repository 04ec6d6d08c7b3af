//! Metrics, tables and pictures for people.

#[cfg(feature = "cli")]
pub mod compare;
pub mod decompose;
pub mod evaluate;
#[cfg(feature = "cli")]
pub mod history;
#[cfg(feature = "cli")]
pub mod lpips;
pub mod metrics;
#[cfg(feature = "cli")]
pub mod page;
pub mod plan;
#[cfg(feature = "cli")]
pub mod runs;
pub mod sidebyside;
#[cfg(feature = "cli")]
pub mod spending;
pub mod summary;
pub mod table;
#[cfg(feature = "cli")]
pub mod viewer;
