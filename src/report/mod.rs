//! Metrics, tables and pictures for people.

pub mod metrics;
pub mod sidebyside;
pub mod table;
