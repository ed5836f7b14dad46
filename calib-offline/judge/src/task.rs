//! The measurement that a user means to make: `length 100 mm at 800 mm`.

use calib_rays::remedy::Remedy;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::str::FromStr;

/// A length to be measured at a distance from the first camera.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Task {
    /// How long, mm.
    pub length_mm: f64,
    /// From the first camera to the middle of the length, mm.
    pub distance_mm: f64,
}

/// Why words are no task.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TaskWordsError {
    /// Other words.
    #[error("\"{text}\" is no measurement that can be asked for")]
    Form {
        /// The words, shortened.
        text: String,
    },
    /// A number without a unit.
    #[error("\"{number}\" has no unit")]
    NoUnit {
        /// The number as it stands there.
        number: String,
    },
    /// Another unit.
    #[error("\"{found}\" is not the unit of lengths here, which is mm")]
    Unit {
        /// What stands there, shortened.
        found: String,
    },
    /// No number above 0.
    #[error("\"{text}\" is no length above 0")]
    Number {
        /// What stands there, shortened.
        text: String,
    },
}

impl Remedy for TaskWordsError {
    fn remedy(&self) -> Option<String> {
        Some("write it as \"length 100 mm at 800 mm\": the length, and the distance of its middle from the first camera".to_owned())
    }
}

impl FromStr for Task {
    type Err = TaskWordsError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let form = || TaskWordsError::Form {
            text: shortened(text),
        };
        let mut words = text.split_whitespace().peekable();
        let mut length_after = |keyword: &str| {
            if words.next() != Some(keyword) {
                return Err(form());
            }
            let number = words.next().ok_or_else(form)?;
            let value = number.parse::<f64>();
            let value = value.ok().filter(|v| v.is_finite() && *v > 0.0);
            let value = value.ok_or_else(|| TaskWordsError::Number {
                text: shortened(number),
            })?;
            match words.peek() {
                None | Some(&"at") => Err(TaskWordsError::NoUnit {
                    number: shortened(number),
                }),
                Some(&"mm") => {
                    words.next();
                    Ok(value)
                }
                Some(found) => Err(TaskWordsError::Unit {
                    found: shortened(found),
                }),
            }
        };
        let task = Self {
            length_mm: length_after("length")?,
            distance_mm: length_after("at")?,
        };
        match words.next() {
            None => Ok(task),
            Some(_) => Err(form()),
        }
    }
}

fn shortened(text: &str) -> String {
    text.chars().take(60).flat_map(char::escape_debug).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_task_has_two_lengths_with_their_unit() {
        let task = "length 100 mm at 812.5 mm".parse();
        let expected = Task {
            length_mm: 100.0,
            distance_mm: 812.5,
        };
        assert_eq!(task, Ok(expected));
    }

    #[test]
    fn other_words_are_refused_for_what_is_wrong_with_them() {
        for (text, reason) in [
            ("", "no measurement"),
            ("height 100 mm at 800 mm", "no measurement"),
            ("length 100 mm", "no measurement"),
            ("length 100 mm at 800 mm or so", "no measurement"),
            ("length 100 at 800 mm", "\"100\" has no unit"),
            ("length 100 mm at 800", "\"800\" has no unit"),
            ("length 10 cm at 800 mm", "\"cm\" is not the unit"),
            ("length 100mm at 800 mm", "\"100mm\" is no length"),
            ("length -5 mm at 800 mm", "\"-5\" is no length"),
            ("length 0 mm at 800 mm", "\"0\" is no length"),
            ("length inf mm at 800 mm", "\"inf\" is no length"),
        ] {
            let error = text.parse::<Task>().unwrap_err();
            assert!(error.to_string().contains(reason), "{text}: {error}");
            assert!(error.remedy().is_some());
        }
    }
}
