//! Properties of models, renders and gradients that no single kernel shows.

#[path = "../common/mod.rs"]
mod common;
mod gradients;
mod metamorphic;
mod model;
mod parts;
#[path = "../common/probe.rs"]
mod probe;
mod reduction;
mod scene_properties;
mod twin;
