//! Which image files a camera's pattern means, in which order.

use std::cmp::Ordering;
use std::io;
use std::path::{Path, PathBuf};

/// Files in the folder that `pattern` names whose names match, in natural order.
///
/// `pattern` is `folder/name` relative to `base`; `*` (any characters) and `?` (one character) may
/// stand in the name only. Hidden files match only a pattern that starts with a dot.
///
/// # Errors
/// What the system says of the folder.
pub fn matching_files(base: &Path, pattern: &str) -> io::Result<Vec<PathBuf>> {
    let (folder, name_pattern) = split_pattern(pattern);
    let folder = base.join(folder);
    let mut names = Vec::new();
    for entry in std::fs::read_dir(&folder)? {
        let entry = entry?;
        let name = entry.file_name();
        let Some(name) = name.to_str() else { continue };
        let hidden = name.starts_with('.') && !name_pattern.starts_with('.');
        if !hidden && name_matches(name_pattern, name) && entry.path().is_file() {
            names.push(name.to_owned());
        }
    }
    names.sort_by(|a, b| natural_order(a, b));
    Ok(names.into_iter().map(|name| folder.join(name)).collect())
}

/// Folder and name of a pattern; the folder is empty for a bare name.
pub fn split_pattern(pattern: &str) -> (&str, &str) {
    pattern.rsplit_once('/').unwrap_or(("", pattern))
}

/// Whether `name` matches `pattern` with `*` and `?`.
pub fn name_matches(pattern: &str, name: &str) -> bool {
    let pattern: Vec<char> = pattern.chars().collect();
    let name: Vec<char> = name.chars().collect();
    let (mut p, mut n) = (0, 0);
    // Where to go on when the rest does not fit: the last star, and how much of the name it took.
    let mut retry: Option<(usize, usize)> = None;
    while n < name.len() {
        match pattern.get(p) {
            Some('*') => {
                retry = Some((p, n));
                p += 1;
            }
            Some(&c) if c == '?' || c == name[n] => {
                p += 1;
                n += 1;
            }
            _ => match retry {
                Some((star, taken)) => {
                    retry = Some((star, taken + 1));
                    p = star + 1;
                    n = taken + 1;
                }
                None => return false,
            },
        }
    }
    pattern[p..].iter().all(|c| *c == '*')
}

/// Order in which people count: `img2` before `img10`. Equal numbers written with more zeros come
/// after those with fewer.
pub fn natural_order(a: &str, b: &str) -> Ordering {
    let (mut rest_a, mut rest_b) = (a, b);
    while !rest_a.is_empty() && !rest_b.is_empty() {
        let (digits_a, digits_b) = (leading_digits(rest_a), leading_digits(rest_b));
        if digits_a > 0 && digits_b > 0 {
            let (number_a, number_b) = (
                rest_a[..digits_a].trim_start_matches('0'),
                rest_b[..digits_b].trim_start_matches('0'),
            );
            let order = number_a
                .len()
                .cmp(&number_b.len())
                .then_with(|| number_a.cmp(number_b));
            if order != Ordering::Equal {
                return order;
            }
            rest_a = &rest_a[digits_a..];
            rest_b = &rest_b[digits_b..];
        } else {
            let (char_a, char_b) = (rest_a.chars().next(), rest_b.chars().next());
            if char_a != char_b {
                return char_a.cmp(&char_b);
            }
            let len = char_a.map_or(1, char::len_utf8);
            rest_a = &rest_a[len..];
            rest_b = &rest_b[len..];
        }
    }
    rest_a
        .len()
        .cmp(&rest_b.len())
        .then_with(|| a.len().cmp(&b.len()))
        .then_with(|| a.cmp(b))
}

fn leading_digits(text: &str) -> usize {
    text.bytes().take_while(u8::is_ascii_digit).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_comes_before_ten() {
        let mut names = [
            "l10.png", "l2.png", "l1.png", "l02.png", "k3.png", "l2b.png",
        ];
        names.sort_by(|a, b| natural_order(a, b));
        assert_eq!(
            names,
            [
                "k3.png", "l1.png", "l2.png", "l02.png", "l2b.png", "l10.png"
            ]
        );
    }

    #[test]
    fn numbers_longer_than_any_integer_are_ordered() {
        let small = format!("{}1", "9".repeat(40));
        let large = format!("{}2", "9".repeat(40));
        assert_eq!(natural_order(&small, &large), Ordering::Less);
    }

    #[test]
    fn star_and_question_mark() {
        assert!(name_matches("left*.jpg", "left01.jpg"));
        assert!(name_matches("*", "anything"));
        assert!(name_matches("a*b*c", "aXbYbZc"));
        assert!(name_matches("im?.png", "im1.png"));
        assert!(!name_matches("im?.png", "im10.png"));
        assert!(!name_matches("left*.jpg", "left01.png"));
        assert!(!name_matches("", "a"));
        assert!(name_matches("é?", "éa"));
    }

    #[test]
    fn files_come_in_natural_order_without_folders_and_hidden_ones() {
        let base = tempfile::tempdir().unwrap();
        let folder = base.path().join("left");
        std::fs::create_dir_all(folder.join("5.png")).unwrap();
        for name in ["10.png", "2.png", ".3.png", "2.txt"] {
            std::fs::write(folder.join(name), "").unwrap();
        }
        let files = matching_files(base.path(), "left/*.png").unwrap();
        assert_eq!(files, [folder.join("2.png"), folder.join("10.png")]);
    }
}
