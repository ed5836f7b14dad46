//! What a user records: a folder with `dataset.toml` and images or corners, the corners found in
//! images, what a recording covers, and files written whole or not at all.

pub mod atomic_file;
pub mod capture;
pub mod dataset;
pub mod detect;
