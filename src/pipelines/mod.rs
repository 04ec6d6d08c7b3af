//! Order of recording: which stages run, on what, and when the host looks.

pub mod checkpoint;
pub mod density;
pub mod enhance;
pub mod frames;
pub mod join;
pub mod layers;
pub mod learn;
pub mod lift;
pub mod loss;
pub mod model;
pub mod plan;
pub mod pursuit;
pub mod raster;
pub mod render;
pub mod screen;
pub mod session;
pub mod sort;
pub mod start;
pub mod steps;
pub mod train;
pub mod views;
pub mod work;
