//! The runtime from outside: golden blobs, blobs made by hand and damaged ones, and its C interface.

mod c_build;
mod c_interface;
mod c_packages;
mod cpp_interface;
mod damage;
mod document;
mod golden;
#[cfg(feature = "integer")]
mod integer;
mod project;
mod questions;
mod rows;
mod sections;
mod test_blob;
mod uncertainty;
mod varints;
