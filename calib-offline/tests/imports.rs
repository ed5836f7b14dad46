//! Who may import whom inside the crate, as ARCHITECTURE.md states it: no arrow points back.

use std::fs;
use std::path::{Path, PathBuf};

/// From the bottom up; a module may import those of its own layer and of layers before it.
const LAYERS: [&[&str]; 5] = [
    &["device", "evaluate", "report"],
    &["error"],
    &["pipeline"],
    &["demo", "compare", "experiments"],
    &["cli"],
]; 12] = [
    &[
        "numerics",
        "geometry",
        "progress",
        "atomic_file",
        "in_order",
    ],
    &["board", "observed"],
    &["dataset", "field"],
    &["detect", "simulate", "measure"],
    &["capture"],
    &["adjust"],
    &["init"],
    &["joint", "pinhole", "alternating"],
    &["device", "evaluate", "export", "matches", "pack", "report"],
    &["error"],
    &["pipeline", "demo", "compare", "experiments"],
    &["cli"],
];

/// The error that wraps all others may know all others.
const KNOWS_ALL: &str = "error";

fn layer(module: &str) -> Option<usize> {
    LAYERS.iter().position(|layer| layer.contains(&module))
}

fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        let is_test = name == "tests" || name.ends_with("_tests");
        if path.is_dir() && !is_test {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|e| e == "rs") && !is_test {
            found.push(path);
        }
    }
    found
}

/// The modules of this crate that the code of a file names, with the line; tests are left out.
fn imports(text: &str) -> Vec<(usize, String)> {
    let code = text.lines().take_while(|line| *line != "#[cfg(test)]");
    let mut found = Vec::new();
    for (index, line) in code.enumerate() {
        if line.trim_start().starts_with("//") {
            continue;
        }
        for rest in line.split("crate::").skip(1) {
            let is_name = |c: char| c.is_ascii_alphanumeric() || c == '_';
            let name = rest.split(|c| !is_name(c)).next().unwrap_or("");
            found.push((index + 1, name.to_owned()));
        }
    }
    found
}

#[test]
fn no_module_imports_what_stands_above_it() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut wrong = Vec::new();
    let mut checked = 0;
    for path in sources(&root) {
        let place = path.strip_prefix(&root).unwrap();
        let first = place.components().next().unwrap().as_os_str();
        let module = first.to_str().unwrap().trim_end_matches(".rs");
        if matches!(module, "lib" | "main" | KNOWS_ALL) {
            continue;
        }
        let own = layer(module)
            .unwrap_or_else(|| panic!("{module} has no place: add it here and to ARCHITECTURE.md"));
        for (line, imported) in imports(&fs::read_to_string(&path).unwrap()) {
            let Some(other) = layer(&imported) else {
                continue;
            };
            checked += 1;
            if other > own {
                wrong.push(format!(
                    "{}:{line}: {module} -> {imported}",
                    place.display()
                ));
            }
        }
    }
    assert!(checked > 100, "only {checked} imports were found");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
