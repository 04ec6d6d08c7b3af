//! Error against time, one point for each row.
