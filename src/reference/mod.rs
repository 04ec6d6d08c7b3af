pub mod lift_append;
pub mod lift_cluster;
pub mod lift_count;
pub mod lift_pca;
pub mod lift_points;
