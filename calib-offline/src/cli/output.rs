//! The only place that prints. Results go to standard output, all else to standard error; a
//! reader that has gone away is no error.

use super::progress::Bars;
use super::settings::{Narration, Settings, Words};
use calib_rays::progress::Progress;
use serde::Serialize;
use std::cell::RefCell;
use std::io::{ErrorKind, Write};

/// Where a command shows what it does and finds.
#[derive(Debug)]
pub struct Console {
    settings: Settings,
    bars: Bars,
    /// What happened to a result that could not be written.
    lost: RefCell<Option<std::io::Error>>,
}

impl Console {
    /// A console with these settings.
    pub fn new(settings: Settings) -> Self {
        Self {
            settings,
            bars: Bars::new(settings),
            lost: RefCell::new(None),
        }
    }

    /// How it was set.
    pub fn settings(&self) -> Settings {
        self.settings
    }

    /// For long work to tell where it is.
    pub fn progress(&self) -> &dyn Progress {
        &self.bars
    }

    /// Tells what is being done.
    pub fn narrate(&self, text: &str) {
        if self.settings.narration >= Narration::Usual {
            self.error_line(text);
        }
    }

    /// Tells what only some want to know.
    pub fn detail(&self, text: &str) {
        if self.settings.narration >= Narration::Details {
            self.error_line(text);
        }
    }

    /// Tells what the user should look at.
    pub fn warn(&self, text: &str) {
        if self.settings.narration >= Narration::Usual {
            let word = self.painted("warning:", Paint::Yellow);
            self.error_line(&format!("{word} {text}"));
        }
    }

    /// A line on standard error, whatever the settings.
    pub fn error_line(&self, text: &str) {
        self.bars.above(|| {
            let _ = writeln!(std::io::stderr().lock(), "{text}");
        });
    }

    /// The result: `words` for people, or `object` with `--json`. Where the command's file itself goes to standard
    /// output, the words are narration.
    pub fn result(&self, words: &str, object: &impl Serialize) {
        let text = if self.settings.json {
            match serde_json::to_string_pretty(object) {
                Ok(text) => text,
                // The objects are our own structs; what JSON cannot say is a name that is not UTF-8.
                Err(error) => {
                    *self.lost.borrow_mut() = Some(error.into());
                    return;
                }
            }
        } else {
            words.to_owned()
        };
        let text = text.trim_end_matches('\n');
        if self.settings.words == Words::BesideFile {
            return self.narrate(text);
        }
        let mut stdout = std::io::stdout().lock();
        let written = writeln!(stdout, "{text}").and_then(|()| stdout.flush());
        if let Err(error) = written
            && error.kind() != ErrorKind::BrokenPipe
        {
            *self.lost.borrow_mut() = Some(error);
        }
    }

    /// Why a result did not reach standard output, if one did not.
    pub fn take_lost(&self) -> Option<std::io::Error> {
        self.lost.take()
    }

    /// The word in a color, if colors are shown.
    pub fn painted(&self, word: &str, paint: Paint) -> String {
        if self.settings.color {
            format!("\u{1b}[1;{}m{word}\u{1b}[0m", paint as u8)
        } else {
            word.to_owned()
        }
    }
}

/// Colors that are readable on light and dark terminals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Paint {
    /// Errors.
    Red = 31,
    /// Warnings.
    Yellow = 33,
}
