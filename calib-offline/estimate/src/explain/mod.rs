//! What may be wrong with a recording, as competing explanations of the same residuals: a board whose
//! squares are not square, a camera that was refocused half way, pictures that were not taken at one
//! instant. Each is a few numbers more in the model; the evidence says which of them the data want
//! (METHOD 2.8).
//!
//! [`effects`] are what a unit of each such number does to the corners of one view; a
//! [`suspicion`] joins effects of many views under common numbers; `scores` judges all suspicions
//! from one linearization; [`search`](mod@search) fits those ahead in full and takes the best.
//! [`change`] looks between an old recording and a few new poses, starting from the old rig as it is (`held`).

mod bayes;
pub mod change;
mod detrended;
pub mod effects;
pub mod explained;
mod held;
mod scores;
pub mod search;
pub mod suspicion;

pub use change::{Change, Changes, explain_change};
pub use explained::Explanation;
pub use search::explain;
pub use suspicion::{Since, Suspect, Suspicion};
