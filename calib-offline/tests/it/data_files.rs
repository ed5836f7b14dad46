//! The files in `data/` are those that `data/SHA256SUMS` lists: none damaged, none missing, none
//! that nobody has accounted for.

use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// Checksums of all files below a folder by their path in it. Descriptions and the list itself
/// are left out, and so is what begins with a dot.
fn checksums(folder: &Path, prefix: &str, found: &mut BTreeMap<String, String>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        let place = format!("{prefix}{name}");
        let describes = name == "SHA256SUMS" || path.extension().is_some_and(|e| e == "md");
        if path.is_dir() {
            checksums(&path, &format!("{place}/"), found);
        } else if !describes && !name.starts_with('.') {
            let digest = Sha256::digest(fs::read(&path).unwrap());
            let hex = digest.iter().fold(String::new(), |mut hex, byte| {
                // Writing to a String cannot fail.
                let _ = write!(hex, "{byte:02x}");
                hex
            });
            found.insert(place, hex);
        }
    }
}

#[test]
fn every_file_has_the_checksum_that_is_listed() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../data");
    let listed: BTreeMap<String, String> = fs::read_to_string(data.join("SHA256SUMS"))
        .unwrap()
        .lines()
        .map(|line| {
            let (sum, place) = line.split_once("  ").unwrap();
            (place.to_owned(), sum.to_owned())
        })
        .collect();
    let mut found = BTreeMap::new();
    checksums(&data, "", &mut found);
    for (place, sum) in &listed {
        assert_eq!(found.get(place), Some(sum), "data/{place}");
    }
    let unlisted: Vec<&String> = found.keys().filter(|p| !listed.contains_key(*p)).collect();
    assert!(
        unlisted.is_empty(),
        "not in data/SHA256SUMS: {unlisted:?}; data/README.md says how to write it"
    );
}
