//! How the equations of an adjustment are put together and solved quickly: only for whoever makes
//! that faster. What is adjusted, and by what it is judged, stands in [`super`].
//!
//! Views give sums (`assembly`, over `components` and `moments`), sums give blocks
//! ([`normal_equations`], `spline_block`), blocks are eliminated until a dense rest is left
//! ([`schur_complement`]), and that rest answers for steps, covariances ([`covariance`]) and for what it leaves of other columns
//! ([`elimination`]). METHOD 2.5 has a
//! picture of the matrix. The same equations formed densely, from differences of residuals, are the
//! reference that they are tested against: `dense` in `adjust/tests.rs`.

mod assembly;
mod components;
pub mod covariance;
pub mod elimination;
pub mod knots;
mod moments;
pub mod normal_equations;
pub mod schur_complement;
mod spline_block;
