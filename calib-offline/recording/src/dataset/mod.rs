//! What a user records: a folder with `dataset.toml` and images or corners, or both.

pub mod corners;
mod description;
pub mod identity;
pub mod image;
pub mod image_files;
pub mod known_poses;
pub mod manifest;
mod markers;
pub mod split;
pub mod stage;
pub mod sufficiency;
pub mod target;

pub use corners::{CornersError, load_corners, write_corners};
pub use description::{
    BoardKind, CameraSpec, Certificate, Dataset, ExpectedOptics, RecordingSpec, StageSpec,
};
pub use identity::input_sha256;
pub use manifest::ManifestError;
pub use markers::load_markers;
pub use sufficiency::{SufficiencyError, check_sufficiency};
pub use target::TargetSpec;
