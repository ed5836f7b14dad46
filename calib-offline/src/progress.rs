//! How long steps tell their caller where they are. Libraries never print.

/// Told about the start, the steps and the end of each stage; may be called from several threads.
pub trait Progress: Sync {
    /// A stage begins. `total` is the number of steps; 0 if it is not known.
    fn begin(&self, stage: &str, total: usize);
    /// One step is done.
    fn advance(&self);
    /// The stage is done.
    fn end(&self);
}

/// Tells nobody.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _stage: &str, _total: usize) {}
    fn advance(&self) {}
    fn end(&self) {}
}
