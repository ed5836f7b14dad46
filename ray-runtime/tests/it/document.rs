//! `FORMAT.md` is enough to read a blob: a reader in Python that was written from it alone gives the bits
//! that the golden blobs state, and refuses damage.

use crate::test_blob::repair_checksum;
use ray_runtime::format::Header;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn golden() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/golden");
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| {
            path.extension()
                .is_some_and(|extension| extension == "rays")
        })
        .collect();
    files.sort();
    files
}

fn read(blob: &Path) -> Output {
    read_with("read_blob.py", blob)
}

fn read_with(reader: &str, blob: &Path) -> Output {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it");
    Command::new("python3")
        // Without the folder of compiled modules that Python would leave here.
        .arg("-B")
        .arg(folder.join(reader))
        .arg(blob)
        .output()
        .expect("python3 is missing: install Python 3, which checks that FORMAT.md is right")
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

#[test]
fn a_reader_written_from_the_document_gives_the_bits_of_every_golden_blob() {
    let mut versions = Vec::new();
    for path in golden() {
        let (_, header) = Header::read(&std::fs::read(&path).unwrap()).unwrap();
        versions.push(header.version);
        let output = read(&path);
        let (printed, said) = (text(&output.stdout), text(&output.stderr));
        assert!(
            output.status.success(),
            "{}: {}\n{printed}{said}",
            path.display(),
            output.status
        );
        assert!(
            printed.ends_with("4 rays and 4 matches, 0 with other bits\n"),
            "{}: {printed}",
            path.display()
        );
    }
    versions.sort_unstable();
    versions.dedup();
    assert_eq!(versions, [1, 2, 3]);
}

#[test]
fn the_documents_covariance_gives_the_bits_of_every_golden_blob() {
    for path in golden() {
        let (_, header) = Header::read(&std::fs::read(&path).unwrap()).unwrap();
        let output = read_with("read_uncertainty.py", &path);
        let (printed, said) = (text(&output.stdout), text(&output.stderr));
        let count = if header.version == 1 { 0 } else { 2 };
        assert_eq!(
            printed,
            format!("{count} uncertainties, 0 with other bits\n"),
            "{}: {said}",
            path.display()
        );
        assert!(output.status.success());
    }
}

#[test]
fn the_reader_has_at_most_a_hundred_lines() {
    let lines = include_str!("read_blob.py").lines();
    assert!(lines.clone().all(|line| line.len() <= 120));
    assert!(lines.count() <= 100);
}

/// Writes a damaged copy of a blob for the reader, and what it makes of it.
fn read_damaged(path: &Path, name: &str, damage: impl Fn(&mut Vec<u8>)) -> Output {
    let mut bytes = std::fs::read(path).unwrap();
    damage(&mut bytes);
    let copy = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::write(&copy, bytes).unwrap();
    read(&copy)
}

#[test]
fn the_reader_refuses_damage() {
    for path in golden() {
        let length = std::fs::metadata(&path).unwrap().len() as usize;
        let name = path.file_name().unwrap().to_str().unwrap();
        // Magic, version, lengths, checksum, metadata, and bits all over the rest.
        for at in [
            0,
            5,
            6,
            9,
            13,
            17,
            21,
            30,
            length / 3,
            length / 2,
            length - 1,
        ] {
            let output = read_damaged(&path, name, |bytes| bytes[at] ^= 1 << (at % 8));
            assert_eq!(output.status.code(), Some(1), "{name}: byte {at}");
            let said = text(&output.stderr);
            assert!(said.starts_with("refused: "), "{name}: byte {at}: {said}");
        }
        let output = read_damaged(&path, name, |bytes| bytes.truncate(length - 8));
        assert_eq!(output.status.code(), Some(1), "{name}");
        let output = read_damaged(&path, name, |bytes| bytes.truncate(20));
        assert_eq!(output.status.code(), Some(1), "{name}");
    }
}

/// Were the reader to pass everything, the first test would say nothing.
#[test]
fn the_reader_sees_a_changed_table() {
    for path in golden() {
        let name = format!("changed-{}", path.file_name().unwrap().to_str().unwrap());
        let output = read_damaged(&path, &name, |bytes| {
            let header = Header::read(bytes).unwrap().1;
            let records = (24 + header.meta_len as usize).next_multiple_of(8);
            // The first camera's translation along x.
            bytes[records + 4 * 29] ^= 1;
            repair_checksum(bytes);
        });
        assert_eq!(output.status.code(), Some(1), "{name}");
        let printed = text(&output.stdout);
        assert!(printed.contains("4 rays and 4 matches, "), "{printed}");
        assert!(!printed.contains(", 0 with other bits"), "{printed}");
    }
}
