//! Tests across the crates, in one program: images to points, the same bytes, the plan of the house and its documents.

mod documents;
mod house;
mod images_to_points;
mod real_pairs;
mod same_bytes;
