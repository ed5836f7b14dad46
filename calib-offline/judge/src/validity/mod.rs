//! Does an old calibration still hold? A few new boards say it: what changed by the evidence, what that
//! costs in measured points, and what would have gone unnoticed.

pub mod amounts;
pub mod boards;
pub mod cost;
pub mod judged;
mod residuals;
pub mod verdict;

pub use amounts::Amount;
pub use boards::MeasuredBoards;
pub use judged::validity;
pub use verdict::{Found, Seen, Validity};
