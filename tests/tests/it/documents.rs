//! What the documents and the comments refer to is there: sections and equations of
//! `docs/METHOD.md`, files behind relative links, and source files named in `docs`.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Where the mathematics stands.
const METHOD: &str = "docs/METHOD.md";

#[test]
fn citations_of_the_method_name_what_is_there() {
    let root = root();
    let places = places(&read(&root.join(METHOD)));
    let mut cited = 0;
    let mut wrong = Vec::new();
    for path in files(&root, &["rs", "md"]) {
        let is_code = has_extension(&path, &["rs"]);
        let text = read(&path);
        let prose = if is_code { comments(&text) } else { text };
        for (line, place) in citations(&prose) {
            cited += 1;
            if !place.as_ref().is_some_and(|place| places.contains(place)) {
                let name = place.as_deref().unwrap_or("no section and no equation");
                wrong.push(format!("{}: it names {name}", at(&root, &path, line)));
            }
        }
    }
    assert!(cited > 20, "only {cited} citations were found");
    assert!(
        wrong.is_empty(),
        "citations of what {METHOD} does not have:\n{}",
        wrong.join("\n")
    );
}

#[test]
fn relative_links_lead_to_files() {
    let root = root();
    let mut wrong = Vec::new();
    for path in files(&root, &["md"]) {
        let folder = path.parent().unwrap_or(&root).to_path_buf();
        for (line, link) in links(&read(&path)) {
            let target = link.split(['#', '?']).next().unwrap_or_default();
            let is_foreign = target.contains(':') || target.starts_with("//");
            if !(target.is_empty() || is_foreign || folder.join(target).exists()) {
                wrong.push(format!("{}: {target}", at(&root, &path, line)));
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "links that lead nowhere:\n{}",
        wrong.join("\n")
    );
}

#[test]
fn source_files_named_in_docs_exist() {
    let root = root();
    let sources: Vec<String> = files(&root, &["rs"])
        .iter()
        .map(|path| format!("/{}", shown(&root, path)))
        .collect();
    let mut wrong = Vec::new();
    for path in files(&root.join("docs"), &["md"]) {
        for (number, text) in read(&path).lines().enumerate() {
            let spans = text.split('`').skip(1).step_by(2);
            for name in spans.filter(|span| has_extension(Path::new(span), &["rs"])) {
                let ending = format!("/{name}");
                if !sources.iter().any(|source| source.ends_with(&ending)) {
                    wrong.push(format!("{}: {name}", at(&root, &path, number + 1)));
                }
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "source files that are not there:\n{}",
        wrong.join("\n")
    );
}

#[test]
fn the_walks_lead_to_what_they_name() {
    let root = root();
    let text = read(&root.join("CONTRIBUTING.md"));
    let (_, walks) = text
        .split_once("## Where to change what")
        .expect("the walks");
    let walks = walks.split("\n## ").next().unwrap_or_default();
    let (mut paths, mut names, mut wrong) = (0, 0, Vec::new());
    for walk in walks.split("\n\n") {
        let spans: Vec<&str> = walk.split('`').skip(1).step_by(2).collect();
        let (places, words): (Vec<&str>, Vec<&str>) =
            spans.into_iter().partition(|span| span.contains('/'));
        let mut contents = String::new();
        for place in places {
            paths += 1;
            let path = root.join(place);
            if path.is_file() {
                contents += &read(&path);
            } else if !path.is_dir() {
                wrong.push(format!("no {place}"));
            }
        }
        for word in words {
            names += 1;
            let is_part = |c: char| c.is_alphanumeric() || c == '_';
            if !contents.split(|c| !is_part(c)).any(|part| part == word) {
                wrong.push(format!("no `{word}` in the files of its walk"));
            }
        }
    }
    assert!(paths >= 15 && names >= 8, "{paths} paths, {names} names");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn citations_are_read_in_all_their_forms() {
    let cited = |text: &str| {
        citations(text)
            .into_iter()
            .map(|(line, place)| format!("{line} {}", place.unwrap_or_default()))
            .collect::<Vec<_>>()
    };
    // Put together, so that this file cites nothing.
    let m = ["MET", "HOD"].concat();
    assert_eq!(cited(&format!("a ({m} 2.4, 9A). B")), ["1 2.4", "1 9A"]);
    assert_eq!(
        cited(&format!("{m} sections 2 and 9A,\n5 x")),
        ["1 2", "1 9A", "1 5"]
    );
    assert_eq!(cited(&format!("x\n{m}\n(4), (5)).")), ["2 (4)", "2 (5)"]);
    assert_eq!(cited(&format!("{m} 2.5: F = L")), ["1 2.5"]);
    assert_eq!(cited(&format!("see {m} for more")), ["1 "]);
    assert!(cited(&format!("[{m}](docs/{m}.md) {m}S {m}.md")).is_empty());
    let text = format!("let x = 1; // {m} 3\nlet y = \"{m} 4\";\n//! {m}\n//! 5");
    assert_eq!(cited(&comments(&text)), ["1 3", "3 5"]);
}

/// The root of the repository.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn shown(root: &Path, path: &Path) -> String {
    let path = path.strip_prefix(root).unwrap_or(path);
    path.display().to_string()
}

fn at(root: &Path, path: &Path, line: usize) -> String {
    format!("{}:{line}", shown(root, path))
}

/// All files below a folder with one of the extensions, in order; neither what is built nor what is
/// hidden.
fn files(folder: &Path, extensions: &[&str]) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let mut entries: Vec<_> = entries.map(|entry| entry.expect("an entry")).collect();
    entries.sort_by_key(fs::DirEntry::path);
    let mut found = Vec::new();
    for entry in entries {
        let (path, name) = (entry.path(), entry.file_name());
        let name = name.to_string_lossy();
        let kind = entry.file_type().expect("a file type");
        let is_built = name == "target" && path.join("CACHEDIR.TAG").exists();
        if kind.is_dir() && !name.starts_with('.') && !is_built {
            found.extend(files(&path, extensions));
        } else if kind.is_file() && has_extension(&path, extensions) {
            found.push(path);
        }
    }
    found
}

fn has_extension(path: &Path, extensions: &[&str]) -> bool {
    let extension = path.extension().and_then(|e| e.to_str());
    extension.is_some_and(|e| extensions.contains(&e))
}

/// Sections ("2.4", "9A") that have a heading, and equations ("(5)") in the first cell of a row.
fn places(method: &str) -> BTreeSet<String> {
    let mut places = BTreeSet::new();
    for line in method.lines() {
        if let Some(heading) = line.strip_prefix('#') {
            let number = heading.trim_start_matches('#').trim_start();
            places.extend(place_at(number).map(|(place, _)| place));
        } else if let Some(row) = line.strip_prefix("| (") {
            let cell = row.split('|').next().unwrap_or_default();
            let numbers = cell.split(|c: char| !c.is_ascii_digit());
            let numbers = numbers.filter(|number| !number.is_empty());
            places.extend(numbers.map(|number| format!("({number})")));
        }
    }
    places
}

/// The comments of Rust source, line by line; lines without one are empty.
fn comments(source: &str) -> String {
    let comment = |line: &str| {
        let (_, comment) = line.split_once("//")?;
        Some(comment.trim_start_matches(['/', '!']).to_owned())
    };
    let lines = source.lines().map(|line| comment(line).unwrap_or_default());
    lines.collect::<Vec<_>>().join("\n")
}

/// Line of each citation, and what it names, be it on the next line; `None` if it names nothing.
fn citations(prose: &str) -> Vec<(usize, Option<String>)> {
    let mut found = Vec::new();
    let mut from = 0;
    while let Some(offset) = prose[from..].find("METHOD") {
        let start = from + offset;
        from = start + "METHOD".len();
        let before = prose[..start].chars().next_back();
        let mut rest = &prose[from..];
        let is_part = |c: char| c.is_alphanumeric() || "_/".contains(c);
        let is_longer = before.is_some_and(is_part) || rest.starts_with(is_part);
        // A longer word, the file's name, or a link's text.
        if is_longer || rest.starts_with(".md") || rest.starts_with(']') {
            continue;
        }
        let line = prose[..start].matches('\n').count() + 1;
        rest = rest.trim_start();
        for word in ["sections", "section"] {
            rest = rest.strip_prefix(word).unwrap_or(rest).trim_start();
        }
        let mut named = false;
        while let Some((place, after)) = place_at(rest) {
            named = true;
            found.push((line, Some(place)));
            let after = after.trim_start();
            let next = after.strip_prefix(',').or(after.strip_prefix("and "));
            let Some(next) = next.or(after.strip_prefix("to ")) else {
                break;
            };
            let next = next.trim_start();
            rest = next.strip_prefix("and ").unwrap_or(next);
        }
        if !named {
            found.push((line, None));
        }
    }
    found
}

/// The section or equation that a text begins with, and what follows it.
fn place_at(text: &str) -> Option<(String, &str)> {
    if let Some((number, after)) = text.strip_prefix('(').and_then(|t| t.split_once(')')) {
        let is_number = !number.is_empty() && number.bytes().all(|b| b.is_ascii_digit());
        return is_number.then(|| (format!("({number})"), after));
    }
    let digits = |text: &str| text.bytes().take_while(u8::is_ascii_digit).count();
    let mut len = digits(text);
    if len == 0 {
        return None;
    }
    if text[len..].starts_with('.') && digits(&text[len + 1..]) > 0 {
        len += 1 + digits(&text[len + 1..]);
    }
    if text[len..].starts_with(|c: char| c.is_ascii_uppercase()) {
        len += 1;
    }
    Some((text[..len].to_owned(), &text[len..]))
}

/// Line and target of each Markdown link and picture outside of code.
fn links(text: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    let mut in_code = false;
    for (number, line) in text.lines().enumerate() {
        if line.trim_start().starts_with("```") {
            in_code = !in_code;
        }
        if in_code {
            continue;
        }
        let prose: String = line.split('`').step_by(2).collect();
        let targets = prose.split("](").skip(1);
        let targets = targets.filter_map(|rest| rest.split([')', ' ']).next());
        found.extend(targets.map(|target| (number + 1, target.to_owned())));
    }
    found
}
