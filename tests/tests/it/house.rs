//! The plan of the house: who may import whom among the rooms of the program, no circles of files, and
//! how many rooms there are. Between crates the compiler sees to it.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// The rooms of the program from the bottom up; a room may import those of its own floor and of floors before it.
/// ARCHITECTURE.md draws them.
const FLOORS: [&[&str]; 5] = [
    &["present"],
    &["device", "report"],
    &["methods"],
    &["pipeline", "compare", "audit", "demo"],
    &["cli"],
];

/// Files that are one thing cut into pieces: the arrows between them may point both ways.
const FINE: [&[&str]; 2] = [
    // One hot path, so cut that each form of a table can be left out of an image.
    &[
        "ray-runtime/src/lookup.rs",
        "ray-runtime/src/quantized.rs",
        "ray-runtime/src/spline.rs",
    ],
    // A blob runs its self-tests, which look up in the blob.
    &["ray-runtime/src/blob.rs", "ray-runtime/src/self_test.rs"],
];

/// Packages with code of the product, at the top and one folder below it.
// The formats of other tools, the Python wheel and the image that counts on riscv32 (another start-up) were the last three.
const MOST_PACKAGES: usize = 17;

/// What only tests the product.
const TESTS: [&str; 2] = ["ray-runtime/fuzz", "tests"];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The crates whose files are held against each other, as paths from the root.
fn packages() -> Vec<PathBuf> {
    let folders = |of: &Path| -> Vec<PathBuf> {
        let entries = fs::read_dir(of).unwrap().map(|entry| entry.unwrap());
        let mut found: Vec<_> = entries
            .filter(|entry| entry.file_type().unwrap().is_dir() && entry.file_name() != "target")
            .map(|entry| entry.path())
            .collect();
        found.sort();
        found
    };
    let upper = folders(&root());
    let lower: Vec<_> = upper.iter().flat_map(|folder| folders(folder)).collect();
    let both = upper.into_iter().chain(lower);
    both.filter(|folder| folder.join("Cargo.toml").exists())
        .map(|folder| folder.strip_prefix(root()).unwrap().to_owned())
        .collect()
}

/// The product's files of a crate by the path of their module, tests left out.
fn modules(source: &Path) -> BTreeMap<Vec<String>, PathBuf> {
    let mut found = BTreeMap::new();
    let mut waiting = vec![source.to_owned()];
    while let Some(folder) = waiting.pop() {
        let Ok(entries) = fs::read_dir(&folder) else {
            continue;
        };
        for path in entries.map(|entry| entry.unwrap().path()) {
            let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
            if name == "tests" || name.ends_with("_tests") || name == "bin" {
                continue;
            }
            if path.is_dir() {
                waiting.push(path);
            } else if path.extension().is_some_and(|ending| ending == "rs") {
                let inside = path.strip_prefix(source).unwrap().with_extension("");
                let mut module: Vec<String> = inside
                    .iter()
                    .map(|part| part.to_str().unwrap().to_owned())
                    .collect();
                if matches!(
                    module.last().map(String::as_str),
                    Some("mod" | "lib" | "main")
                ) {
                    module.pop();
                }
                // A program's main file says no more than that there is a library.
                if name != "main" {
                    found.insert(module, path);
                }
            }
        }
    }
    found
}

/// What a file imports, as written, with the names under which it passes things on (`pub use`).
struct Imports {
    /// Paths, each from `crate`, `super`, `self` or a child module on.
    paths: BTreeSet<Vec<String>>,
    /// Name passed on, and the path behind it.
    passed_on: BTreeMap<String, Vec<String>>,
}

fn is_name(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}

/// The code of a file: neither comments nor what follows its tests.
fn code(text: &str) -> String {
    text.lines()
        .take_while(|line| *line != "#[cfg(test)]" || !text.contains("mod tests {"))
        .map(|line| line.split("//").next().unwrap_or(""))
        .collect::<Vec<_>>()
        .join("\n")
}

/// The paths of a tree as it stands behind `use`.
fn spread(tree: &str, before: &[String], found: &mut Vec<Vec<String>>) {
    let tree = tree.trim();
    if let Some(open) = tree.find('{') {
        let mut path = before.to_vec();
        path.extend(
            tree[..open]
                .split("::")
                .map(str::trim)
                .filter(|part| !part.is_empty())
                .map(str::to_owned),
        );
        let inner = &tree[open + 1..tree.rfind('}').unwrap_or(tree.len())];
        let (mut depth, mut start) = (0, 0);
        for (at, c) in inner.char_indices().chain([(inner.len(), ',')]) {
            match c {
                '{' => depth += 1,
                '}' => depth -= 1,
                ',' if depth == 0 => {
                    if !inner[start..at].trim().is_empty() {
                        spread(&inner[start..at], &path, found);
                    }
                    start = at + 1;
                }
                _ => {}
            }
        }
        return;
    }
    let path = tree.split(" as ").next().unwrap_or(tree);
    let parts = path
        .split("::")
        .map(|part| part.trim().to_owned())
        .filter(|part| part != "self");
    found.push(before.iter().cloned().chain(parts).collect());
}

fn imports(text: &str) -> Imports {
    let code = code(text);
    let mut paths = BTreeSet::new();
    let mut passed_on = BTreeMap::new();
    for (at, _) in code.match_indices("use ") {
        let line_start = code[..at].rfind('\n').map_or(0, |k| k + 1);
        let before = code[line_start..at].trim();
        // The end of a longer word, as in `pub enum Cause {`, imports nothing.
        let is_public = before == "pub" || before.starts_with("pub(") && before.ends_with(')');
        if !(before.is_empty() || is_public) {
            continue;
        }
        let end = code[at..].find(';').map_or(code.len(), |k| at + k);
        let mut found = Vec::new();
        spread(&code[at + 4..end], &[], &mut found);
        for path in found {
            // What a folder lists of its files it does not use.
            if !before.starts_with("pub") {
                paths.insert(path);
            } else if let Some(name) = path.last() {
                passed_on.insert(name.clone(), path.clone());
            }
        }
    }
    // Paths in the code itself: from above, or into a child.
    let children = code.lines().filter_map(|line| {
        let declared = line
            .trim()
            .trim_start_matches("pub ")
            .trim_start_matches("pub(crate) ");
        let name = declared.strip_prefix("mod ")?.strip_suffix(';')?;
        Some(format!("{name}::"))
    });
    let heads = ["crate::", "super::"].map(str::to_owned);
    for head in heads.into_iter().chain(children) {
        for (at, _) in code.match_indices(&head) {
            let line_start = code[..at].rfind('\n').map_or(0, |k| k + 1);
            let line = code[line_start..].trim_start();
            if code[..at].ends_with(|c: char| is_name(c) || c == ':')
                || line.starts_with("use ")
                || line.starts_with("pub use ")
            {
                continue;
            }
            let path = code[at..].split(|c| !(is_name(c) || c == ':')).next();
            let parts = path
                .unwrap_or("")
                .split("::")
                .filter(|part| !part.is_empty());
            paths.insert(parts.map(str::to_owned).collect());
        }
    }
    Imports { paths, passed_on }
}

/// The module in which what a path names is defined; `None` for another crate's.
fn defined_in(
    path: &[String],
    here: &[String],
    files: &BTreeMap<Vec<String>, PathBuf>,
    all: &BTreeMap<Vec<String>, Imports>,
) -> Option<Vec<String>> {
    let mut module = here.to_vec();
    let mut rest = path;
    match rest.first().map(String::as_str) {
        Some("crate") => {
            module.clear();
            rest = &rest[1..];
        }
        Some("super") => {
            while rest.first().is_some_and(|part| part == "super") {
                module.pop();
                rest = &rest[1..];
            }
        }
        Some(child) => {
            module.push(child.to_owned());
            if !files.contains_key(&module) {
                return None;
            }
            rest = &rest[1..];
        }
        None => return None,
    }
    while let Some(name) = rest.first() {
        module.push(name.clone());
        if !files.contains_key(&module) {
            module.pop();
            break;
        }
        rest = &rest[1..];
    }
    // Whoever passes a thing on is not where it is.
    if let Some(name) = rest.first()
        && let Some(behind) = all.get(&module).and_then(|file| file.passed_on.get(name))
        && let Some(place) = defined_in(behind, &module, files, all)
    {
        return Some(place);
    }
    Some(module)
}

fn are_one_thing(a: &str, b: &str) -> bool {
    a == b
        || FINE
            .iter()
            .any(|fine| fine.contains(&a) && fine.contains(&b))
}

/// Which files of a crate import which, each by its path from the root.
fn arrows(package: &Path) -> BTreeMap<String, BTreeSet<String>> {
    let files = modules(&root().join(package).join("src"));
    let all: BTreeMap<_, _> = files
        .iter()
        .map(|(module, path)| (module.clone(), imports(&fs::read_to_string(path).unwrap())))
        .collect();
    let name = |path: &PathBuf| {
        let path = path.strip_prefix(root()).unwrap();
        path.to_str().unwrap().to_owned()
    };
    files
        .iter()
        .map(|(module, path)| {
            let targets = all[module].paths.iter();
            let targets = targets
                .filter_map(|path| defined_in(path, module, &files, &all))
                .filter_map(|place| files.get(&place))
                .map(name)
                .filter(|target| !are_one_thing(target, &name(path)))
                .collect();
            (name(path), targets)
        })
        .collect()
}

/// Groups of two files or more from each of which every other can be reached.
fn circles(arrows: &BTreeMap<String, BTreeSet<String>>) -> Vec<Vec<String>> {
    let reach = |from: &String| {
        let mut seen = BTreeSet::new();
        let mut waiting = vec![from.clone()];
        while let Some(file) = waiting.pop() {
            for next in arrows.get(&file).into_iter().flatten() {
                if seen.insert(next.clone()) {
                    waiting.push(next.clone());
                }
            }
        }
        seen
    };
    let reached: BTreeMap<_, _> = arrows.keys().map(|file| (file, reach(file))).collect();
    let mut found: BTreeSet<Vec<String>> = BTreeSet::new();
    for (file, seen) in &reached {
        if seen.contains(*file) {
            let group = seen.iter().filter(|other| reached[other].contains(*file));
            found.insert(group.cloned().collect());
        }
    }
    found.into_iter().collect()
}

#[test]
fn no_circle_of_files_but_those_that_are_one_thing() {
    let mut wrong = Vec::new();
    let mut count = 0;
    for package in packages() {
        let arrows = arrows(&package);
        count += arrows.values().map(BTreeSet::len).sum::<usize>();
        for circle in circles(&arrows) {
            let inside = circle.iter().flat_map(|file| {
                let targets = arrows[file].iter().filter(|file| circle.contains(file));
                targets.map(move |target| format!("  {file} -> {target}"))
            });
            wrong.push(inside.collect::<Vec<_>>().join("\n"));
        }
    }
    println!("{count} arrows between files");
    assert!(count > 800, "only {count} arrows: were the files read?");
    assert!(
        wrong.is_empty(),
        "{} circle(s):\n{}",
        wrong.len(),
        wrong.join("\n\n")
    );
}

#[test]
fn no_room_imports_what_stands_above_it() {
    let floor = |room: &str| FLOORS.iter().position(|floor| floor.contains(&room));
    let room = |file: &str| {
        let inside = file.strip_prefix("calib-offline/src/").unwrap();
        let first = inside.split('/').next().unwrap();
        first.trim_end_matches(".rs").to_owned()
    };
    let mut wrong = Vec::new();
    for (file, targets) in arrows(Path::new("calib-offline")) {
        let own = room(&file);
        if own == "lib" {
            continue;
        }
        let place = floor(&own)
            .unwrap_or_else(|| panic!("{own} has no floor: add it here and to ARCHITECTURE.md"));
        for target in targets {
            if floor(&room(&target)).is_some_and(|other| other > place) {
                wrong.push(format!("{file} -> {target}"));
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "imports that point up:\n{}",
        wrong.join("\n")
    );
}

#[test]
fn the_house_has_few_rooms() {
    let packages: Vec<_> = packages()
        .into_iter()
        .filter(|package| !TESTS.iter().any(|tests| package == Path::new(tests)))
        .collect();
    println!(
        "{} packages on the two upper levels of folders:",
        packages.len()
    );
    for package in &packages {
        println!("  {}", package.display());
    }
    assert!(packages.len() <= MOST_PACKAGES, "{packages:?}");
}

#[test]
fn paths_of_a_tree_are_spread_and_followed() {
    let text = "use crate::a::{b::C, d::{E, f}};\npub use super::g::H; // crate::no\nlet x = crate::i::j();\n";
    let found = imports(text);
    let joined: Vec<_> = found.paths.iter().map(|path| path.join("::")).collect();
    assert_eq!(
        joined,
        [
            "crate::a::b::C",
            "crate::a::d::E",
            "crate::a::d::f",
            "crate::i::j"
        ]
    );
    assert_eq!(found.passed_on["H"].join("::"), "super::g::H");
    let arrow = |from: &str, to: &[&str]| {
        let to = to.iter().map(|name| (*name).to_owned()).collect();
        (from.to_owned(), to)
    };
    let ring = BTreeMap::from([arrow("a", &["b"]), arrow("b", &["c"]), arrow("c", &["b"])]);
    assert_eq!(circles(&ring), [["b", "c"]]);
}
