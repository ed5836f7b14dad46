//! Ways from views of a board to a rig. Each is a file of its own: it implements [`Method`], gives a
//! [`Solution`] and stands in [`METHODS`]. Whoever calibrates, checks or compares knows no more of it.

pub mod alternating;
pub mod error;
pub mod joint;
pub mod method;
pub mod pinhole;
pub mod screened;
pub mod solution;

pub use alternating::Alternating;
pub use error::MethodError;
pub use joint::Joint;
pub use method::{Given, Method, fit_folds};
pub use pinhole::Pinhole;
pub use screened::Screened;
pub use solution::{Own, Solution};

/// All methods, in the order of tables. The first is what the others are measured against; the last is
/// the program's own.
pub const METHODS: [&dyn Method; 3] = [&Pinhole, &Alternating, &Joint];
