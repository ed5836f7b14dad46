//! Progress of long work, told to whoever wants to show it. Libraries never print.

/// Told how far a stage of the work is. Called from several threads at once.
pub trait Progress: Sync {
    /// A stage of `total` steps begins.
    fn begin(&self, stage: &str, total: usize);
    /// One more step of the stage is done.
    fn advance(&self);
    /// The stage is over, whether or not every step was made.
    fn end(&self);
}

/// Shows nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _stage: &str, _total: usize) {}
    fn advance(&self) {}
    fn end(&self) {}
}
