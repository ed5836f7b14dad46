//! What readers of formats share: trees of keys and values, whatever they are written in, what may be asked of them, and what is said
//! where the answer is wrong.

mod document;
mod error;
mod literal;
mod numbers;
mod options;
mod xml;
mod yaml;

pub(crate) use document::{Document, Matrix, Node, Value};
pub use error::{ImportError, Problem};
pub use options::{Hint, ReadOptions, RotationForm, Unit};

/// The tree of a file in XML, in YAML, or in braces.
pub(crate) fn tree(text: &str) -> Result<Node, Problem> {
    let start = text
        .lines()
        .map(str::trim_start)
        .find(|line| !line.is_empty() && !line.starts_with('#'))
        .unwrap_or_default();
    if start.starts_with('<') {
        xml::tree(text)
    } else if start.starts_with('{') {
        literal::tree(text)
    } else {
        yaml::tree(text)
    }
}
