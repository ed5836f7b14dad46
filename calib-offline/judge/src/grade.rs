//! The three grades.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Pass, doubtful or fail.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum Grade {
    /// Nothing speaks against it.
    Pass,
    /// Usable with care: see the reasons.
    Doubtful,
    /// Not usable: see the reasons.
    Fail,
}

impl Grade {
    /// The grade as a word.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Doubtful => "doubtful",
            Self::Fail => "fail",
        }
    }
}

impl std::fmt::Display for Grade {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.word())
    }
}
