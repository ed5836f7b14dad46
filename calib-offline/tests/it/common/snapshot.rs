//! Texts that a person has read and accepted. `ACCEPT=1 cargo test` writes what is said today; the
//! difference is then read in the version control's diff.

use std::path::{Path, PathBuf};

/// Fails with a diff unless a text is that of `NAME.snap` beside the calling file.
#[track_caller]
pub fn assert_snapshot(name: &str, text: &str) {
    let caller = std::panic::Location::caller().file();
    let file = beside(caller, name);
    let text = format!("{}\n", text.trim_end());
    if std::env::var_os("ACCEPT").is_some_and(|value| value == "1") {
        std::fs::write(&file, &text).unwrap();
    }
    let accepted = std::fs::read_to_string(&file).unwrap_or_default();
    assert!(
        text == accepted,
        "not what {} says (-, expected; +, found); ACCEPT=1 accepts it:\n{}",
        file.display(),
        difference(&accepted, &text)
    );
}

/// The compiler names source files from the workspace's folder.
fn beside(source: &str, name: &str) -> PathBuf {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    let source = package
        .ancestors()
        .map(|folder| folder.join(source))
        .find(|file| file.is_file());
    source.unwrap().with_file_name(format!("{name}.snap"))
}

/// The lines that differ, each run of them with the line before it.
fn difference(old: &str, new: &str) -> String {
    let (old, new): (Vec<&str>, Vec<&str>) = (old.lines().collect(), new.lines().collect());
    // Lengths of the longest common subsequences of what follows.
    let mut common = vec![vec![0; new.len() + 1]; old.len() + 1];
    for i in (0..old.len()).rev() {
        for j in (0..new.len()).rev() {
            common[i][j] = if old[i] == new[j] {
                common[i + 1][j + 1] + 1
            } else {
                common[i + 1][j].max(common[i][j + 1])
            };
        }
    }
    let (mut i, mut j, mut equal, mut lines) = (0, 0, None, Vec::new());
    while i < old.len() || j < new.len() {
        if i < old.len() && j < new.len() && old[i] == new[j] {
            equal = Some(format!("{:>4}   {}", i + 1, old[i]));
            (i, j) = (i + 1, j + 1);
            continue;
        }
        lines.extend(equal.take());
        if j == new.len() || (i < old.len() && common[i + 1][j] >= common[i][j + 1]) {
            lines.push(format!("{:>4} - {}", i + 1, old[i]));
            i += 1;
        } else {
            lines.push(format!("{:>4} + {}", j + 1, new[j]));
            j += 1;
        }
    }
    lines.join("\n")
}

/// What a reader sees of an HTML page: its text, a line per block, figures as their labels.
pub fn visible_text(page: &str) -> String {
    const BLOCKS: [&str; 15] = [
        "p",
        "div",
        "tr",
        "h1",
        "h2",
        "h3",
        "li",
        "dt",
        "dd",
        "section",
        "figcaption",
        "header",
        "summary",
        "title",
        "pre",
    ];
    let (mut text, mut rest) = (String::new(), page);
    while let Some((before, tag)) = rest.split_once('<') {
        text += before;
        let (tag, after) = tag.split_once('>').unwrap();
        let name = tag
            .split([' ', '/'])
            .find(|part| !part.is_empty())
            .unwrap_or_default();
        rest = match name {
            "style" => after.split_once("</style>").unwrap().1,
            "svg" => {
                text += "\n[figure]\n";
                after.split_once("</svg>").unwrap().1
            }
            _ => after,
        };
        match name {
            "td" | "th" if tag.starts_with('/') => text += " | ",
            _ if BLOCKS.contains(&name) => text += "\n",
            _ => {}
        }
    }
    text += rest;
    let lines = text
        .lines()
        .map(|line| line.trim().trim_end_matches(" |").trim());
    lines
        .filter(|line| !line.is_empty())
        .collect::<Vec<_>>()
        .join("\n")
}

#[test]
fn a_difference_shows_the_lines_that_changed() {
    let shown = difference("a\nb\nc\nd", "a\nB\nc\nd\ne");
    assert_eq!(shown, "   1   a\n   2 - b\n   2 + B\n   4   d\n   5 + e");
}

#[test]
fn of_a_page_the_text_remains() {
    let page = "<title>T</title><style>p { }</style><p>one <b>two</b></p><svg x=\"1\"><text>3</text></svg>\
                <table><tr><td>a</td><td>b</td></tr></table>";
    assert_eq!(visible_text(page), "T\none two\n[figure]\na | b");
}
