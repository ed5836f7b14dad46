//! What somebody else's project takes of this one: the two crates that stand alone, and the packages of the C library. What they
//! say twice is said alike.

use std::fs;
use std::path::{Path, PathBuf};

use toml::{Table, Value};

/// The crates that are copied and published alone, and what their tests need.
const ALONE: [&str; 3] = [
    "ray-runtime",
    "firmware-sim/ray-device",
    "ray-runtime/split-mix",
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn text(path: &str) -> String {
    let path = root().join(path);
    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn manifest(folder: &str) -> Table {
    text(&format!("{folder}/Cargo.toml")).parse().unwrap()
}

fn workspace() -> Table {
    manifest(".")["workspace"].as_table().unwrap().clone()
}

/// Every package of the repository that inherits nothing: the crates that stand alone, those outside of the workspace, the examples.
fn that_inherit_nothing() -> Vec<String> {
    let examples = root().join("firmware-sim/ray-device/examples");
    let examples = fs::read_dir(examples).unwrap().map(|entry| {
        let name = entry.unwrap().file_name().into_string().unwrap();
        format!("firmware-sim/ray-device/examples/{name}")
    });
    let outside = [
        "firmware-sim/cortex-m",
        "ray-runtime/c",
        "ray-runtime/fuzz",
        "ray-runtime/python",
    ];
    let found: Vec<_> = ALONE
        .iter()
        .chain(&outside)
        .map(|name| (*name).to_owned())
        .chain(examples.filter(|folder| root().join(folder).join("Cargo.toml").exists()))
        .collect();
    assert!(found.len() >= 9, "{found:?}");
    found
}

/// What is asked for of a dependency: its version.
fn version(dependency: &Value) -> Option<&str> {
    match dependency {
        Value::String(version) => Some(version),
        other => other.get("version")?.as_str(),
    }
}

fn dependencies(manifest: &Table) -> Vec<(&String, &Value)> {
    ["dependencies", "dev-dependencies", "build-dependencies"]
        .iter()
        .filter_map(|kind| manifest.get(*kind)?.as_table())
        .flatten()
        .collect()
}

#[test]
fn a_crate_that_stands_alone_inherits_nothing_and_says_the_same() {
    let workspace = workspace();
    let shared = workspace["package"].as_table().unwrap();
    for folder in ALONE {
        let manifest = manifest(folder);
        let inherits = |value: &Value| value.get("workspace").is_some();
        assert!(manifest.get("workspace").is_none(), "{folder}");
        let package = manifest["package"].as_table().unwrap();
        let mut inherited: Vec<_> = package
            .iter()
            .chain(dependencies(&manifest))
            .filter(|(_, value)| inherits(value))
            .map(|(name, _)| name.as_str())
            .collect();
        inherited.extend(inherits(&manifest["lints"]).then_some("lints"));
        assert!(inherited.is_empty(), "{folder} inherits {inherited:?}");
        for key in ["version", "edition", "license"] {
            assert_eq!(package[key], shared[key], "{folder}: {key}");
        }
        assert_eq!(manifest["lints"], workspace["lints"], "{folder}: lints");
    }
}

#[test]
fn every_dependency_has_one_version() {
    let workspace = workspace();
    let shared = workspace["dependencies"].as_table().unwrap();
    let mut compared = 0;
    let mut wrong = Vec::new();
    for folder in that_inherit_nothing() {
        for (name, dependency) in dependencies(&manifest(&folder)) {
            let (Some(found), Some(expected)) =
                (version(dependency), shared.get(name).and_then(version))
            else {
                continue;
            };
            compared += 1;
            if found != expected {
                wrong.push(format!(
                    "{folder}: {name} {found}, the workspace has {expected}"
                ));
            }
        }
    }
    assert!(compared > 15, "only {compared}");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn what_a_registry_and_its_readers_want_is_there() {
    for folder in ["ray-runtime", "firmware-sim/ray-device"] {
        let manifest = manifest(folder);
        let package = manifest["package"].as_table().unwrap();
        for key in [
            "description",
            "documentation",
            "readme",
            "rust-version",
            "include",
        ] {
            assert!(package.contains_key(key), "{folder}: {key}");
        }
        assert!(
            !package.contains_key("publish"),
            "{folder} can be published"
        );
        for (key, most) in [("keywords", 5), ("categories", 5)] {
            let count = package[key].as_array().unwrap().len();
            assert!((1..=most).contains(&count), "{folder}: {count} {key}");
        }
        let docs = &package["metadata"]["docs"]["rs"];
        assert_eq!(docs["all-features"].as_bool(), Some(true), "{folder}");
        for name in ["LICENSE-MIT", "LICENSE-APACHE"] {
            assert_eq!(
                text(&format!("{folder}/{name}")),
                text(name),
                "{folder}: {name}"
            );
        }
    }
    // ray-device asks a registry for the ray-runtime that stands beside it.
    let device = manifest("firmware-sim/ray-device");
    assert_eq!(
        version(&device["dependencies"]["ray-runtime"]),
        manifest("ray-runtime")["package"]["version"].as_str()
    );
    let example = fs::read(root().join("ray-runtime/example.rays")).unwrap();
    let golden = fs::read(root().join("data/golden/stereo-v3-small.rays")).unwrap();
    assert!(
        example == golden,
        "ray-runtime/example.rays is a copy of the golden blob"
    );
}

/// The value behind `key` and what parts the two.
fn value<'a>(text: &'a str, key: &str, parted_by: char) -> &'a str {
    let mut lines = text.lines().filter_map(|line| line.split_once(parted_by));
    let found = lines.find(|(name, _)| name.trim() == key);
    found.unwrap_or_else(|| panic!("no {key}")).1.trim()
}

#[test]
fn the_packages_of_the_c_library_name_files_and_versions_that_are_there() {
    let version = manifest("ray-runtime/c")["package"]["version"].clone();
    let version = version.as_str().unwrap();
    // Arduino: keys that its library specification asks for.
    let arduino = text("ray-runtime/c/arduino/library.properties");
    for key in [
        "name",
        "author",
        "maintainer",
        "sentence",
        "paragraph",
        "category",
        "url",
    ] {
        let _ = value(&arduino, key, '=');
    }
    assert_eq!(value(&arduino, "version", '='), version);
    assert_eq!(value(&arduino, "category", '='), "Data Processing");
    assert_eq!(value(&arduino, "precompiled", '='), "full");
    for header in value(&arduino, "includes", '=').split(',') {
        assert!(
            root().join("ray-runtime/c").join(header.trim()).exists(),
            "{header}"
        );
    }
    let package = text("ray-runtime/c/arduino/package.sh");
    let flags = value(&arduino, "ldflags", '=');
    assert_eq!(flags, "-lrays");
    for file in ["rays.h", "rays.hpp", "rays_device.h", "librays.a"] {
        assert!(package.contains(file), "package.sh puts {file} in place");
    }
    // Zephyr: module.yml stands where west looks for it, and names a folder with CMakeLists.txt and Kconfig.
    let module = text("ray-runtime/c/zephyr/module.yml");
    assert_eq!(value(&module, "name", ':'), "rays");
    for (key, file) in [("cmake", "CMakeLists.txt"), ("kconfig", "Kconfig")] {
        let place = value(&module, key, ':').trim_end_matches(file);
        let path = root().join("ray-runtime/c").join(place).join(file);
        assert!(path.exists(), "{key}: {}", path.display());
    }
    let kconfig = text("ray-runtime/c/zephyr/Kconfig");
    let cmake = text("ray-runtime/c/zephyr/CMakeLists.txt");
    assert!(kconfig.contains("config RAYS\n"), "{kconfig}");
    assert!(cmake.contains("CONFIG_RAYS"), "{cmake}");
    // CMake and pkg-config are tried for real: see tests/it/c_packages.rs of ray-runtime.
    let project = text("ray-runtime/c/CMakeLists.txt");
    assert!(project.contains(&format!("VERSION {version}")), "{version}");
}
