//! What a command tells the shell.

/// How a command that ran to its end came out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Done: exit code 0.
    Done,
    /// Done, but the verdict is "fail": exit code 1.
    VerdictFail,
    /// Done, but there is nothing that could give a verdict: exit code 3.
    Undetermined,
}
