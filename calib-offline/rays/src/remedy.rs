//! What to do about an error: told apart from what is wrong, by the room that knows both.

/// An error that knows what to do about it.
pub trait Remedy {
    /// What to do about it, in words; `None` where there is nothing to advise.
    fn remedy(&self) -> Option<String>;
}
