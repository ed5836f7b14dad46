//! What was asked for, as the record says it: what bears on the result, in the words of a command line.

use std::fmt::Write as _;
use std::path::Path;

/// A command on a dataset with those flags that have a value. What has none, and what changes no number (the place of the
/// results, the number of threads), is not in it. The dataset has the name of its folder: the same recording gives the
/// same bytes wherever it lies.
pub(super) fn asked_for(verb: &str, dataset: &Path, flags: &[(&str, Option<String>)]) -> String {
    let name = dataset.file_name().unwrap_or(dataset.as_os_str());
    let mut words = format!("calib-offline {verb} {}", quoted(&name.to_string_lossy()));
    for (flag, value) in flags {
        if let Some(value) = value {
            // Writing to a String cannot fail.
            let _ = write!(words, " {flag} {}", quoted(value));
        }
    }
    words
}

/// The word as a shell takes it.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "._-,=+/".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_quoted_where_a_shell_would_take_them_apart() {
        let words = ["monday", "3,17", "length 100 mm", "it's", ""];
        let found = words.map(quoted);
        let expected = ["monday", "3,17", "'length 100 mm'", r"'it'\''s'", "''"];
        assert_eq!(found, expected);
        let flags = [("--exclude", Some("3,17".to_owned())), ("--task", None)];
        let words = asked_for("calibrate", Path::new("../line 3/"), &flags);
        assert_eq!(words, "calib-offline calibrate 'line 3' --exclude 3,17");
    }
}
