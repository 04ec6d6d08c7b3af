//! Metrics, tables and pictures for people.

pub mod decompose;
pub mod evaluate;
pub mod metrics;
pub mod sidebyside;
pub mod summary;
pub mod table;
