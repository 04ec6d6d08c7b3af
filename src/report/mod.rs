//! Metrics, tables and pictures for people.

pub mod decompose;
pub mod evaluate;
pub mod metrics;
#[cfg(feature = "cli")]
pub mod page;
pub mod sidebyside;
pub mod summary;
pub mod table;
