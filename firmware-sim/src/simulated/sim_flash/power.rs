//! When power is lost, and what is left then.

/// What a cut of power leaves of the operation it hits. All bytes before the cut are done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cut {
    /// The rest as it was.
    Clean,
    /// In the rest, some of the bits changed.
    Torn,
    /// In the rest, the bits that were to change read differently each time.
    Weak,
}

/// When power is lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PowerCut {
    /// Number of the operation from now, from 0: each block erased and each unit programmed is one.
    pub operation: u64,
    /// How many of its bytes are done; all of them or more for a cut right behind it.
    pub byte: usize,
    /// What is left of the others.
    pub cut: Cut,
}
