//! The arguments that hold for every verb, and what they and the environment come to.

use clap::{Args, ValueEnum};
use std::io::IsTerminal;
use std::num::NonZeroUsize;

/// What holds for every verb.
#[derive(Debug, Clone, Args)]
pub struct CommonArgs {
    /// Print one JSON object to standard output and nothing else
    #[arg(long, global = true)]
    pub json: bool,
    /// Say nothing but errors on standard error
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Say more; twice says most
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub verbose: u8,
    /// When to color the words that matter.
    #[arg(
        long,
        global = true,
        value_name = "WHEN",
        default_value = "auto",
        hide_possible_values = true,
        help = "Color the words that matter: auto (on a terminal, unless NO_COLOR is set), always, never"
    )]
    pub color: ColorChoice,
    /// Use so many threads [default: all]; results do not depend on it
    #[arg(long, global = true, value_name = "COUNT")]
    pub threads: Option<NonZeroUsize>,
}

/// When to color.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ColorChoice {
    /// On a terminal.
    Auto,
    /// Everywhere.
    Always,
    /// Nowhere.
    Never,
}

/// How a command shows itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settings {
    /// One JSON object on standard output, instead of words.
    pub json: bool,
    /// How much is said on standard error.
    pub narration: Narration,
    /// Whether words on standard error are colored.
    pub color: bool,
    /// Whether standard error is a terminal that can show moving bars.
    pub bars: bool,
    /// Where the words of a result go.
    pub words: Words,
}

/// Where the words of a result go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Words {
    /// To standard output.
    StandardOutput,
    /// To standard error: the command's file itself goes to standard output.
    BesideFile,
}

/// How much is said on standard error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Narration {
    /// Errors.
    Errors,
    /// What is being done, and warnings.
    Usual,
    /// Details.
    Details,
}

impl Settings {
    /// The settings of this process; where the words of its result go.
    pub fn resolve(common: &CommonArgs, words: Words) -> Self {
        let terminal = std::io::stderr().is_terminal();
        let set = |name| std::env::var_os(name).is_some_and(|value| !value.is_empty());
        let dumb = std::env::var_os("TERM").is_some_and(|term| term == "dumb");
        Self {
            words,
            ..Self::from_facts(common, terminal && !dumb, set("NO_COLOR"))
        }
    }

    fn from_facts(common: &CommonArgs, terminal: bool, no_color: bool) -> Self {
        let narration = match (common.quiet, common.verbose) {
            (true, _) => Narration::Errors,
            (false, 0) => Narration::Usual,
            (false, _) => Narration::Details,
        };
        Self {
            json: common.json,
            narration,
            color: match common.color {
                ColorChoice::Always => true,
                ColorChoice::Never => false,
                ColorChoice::Auto => terminal && !no_color,
            },
            bars: terminal && narration > Narration::Errors,
            words: Words::StandardOutput,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn color_is_for_terminals_unless_asked_for_or_refused() {
        let color = |color, terminal, no_color| {
            let common = CommonArgs {
                json: false,
                quiet: false,
                verbose: 0,
                color,
                threads: None,
            };
            Settings::from_facts(&common, terminal, no_color).color
        };
        assert!(color(ColorChoice::Auto, true, false));
        assert!(!color(ColorChoice::Auto, false, false));
        assert!(!color(ColorChoice::Auto, true, true));
        assert!(color(ColorChoice::Always, false, true));
        assert!(!color(ColorChoice::Never, true, false));
    }
}
