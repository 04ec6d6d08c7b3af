//! The order in which stages are recorded.

pub mod sort;
