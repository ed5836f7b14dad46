//! `FORMAT.md` is enough to read a blob: a reader in Python that was written from it alone gives the bits
//! that the golden blobs state, and refuses damage.

use crate::test_blob::repair_checksum;
use ray_runtime::format::Header;
use std::path::{Path, PathBuf};
use std::process::Command;

pub fn golden() -> Vec<PathBuf> {
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

/// What a reader made of a blob.
pub struct Read {
    pub code: i32,
    pub printed: String,
    pub said: String,
}

/// Runs a reader on each of these.
pub fn read(reader: &str, blobs: &[PathBuf]) -> Vec<Read> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it");
    let output = Command::new("python3")
        // Without the folder of compiled modules that Python would leave here.
        .arg("-B")
        .args([folder.join("read_each.py"), folder.join(reader)])
        .args(blobs)
        .output()
        .expect("python3 is missing: install Python 3, which checks that FORMAT.md is right");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}: {said}", output.status);
    let answers = String::from_utf8(output.stdout).unwrap();
    let answers: Vec<&str> = answers.split_terminator('\0').collect();
    let (answers, rest) = answers.as_chunks::<3>();
    assert!(answers.len() == blobs.len() && rest.is_empty(), "{said}");
    let read = |[code, printed, said]: &[&str; 3]| Read {
        code: code.parse().unwrap(),
        printed: (*printed).to_owned(),
        said: (*said).to_owned(),
    };
    answers.iter().map(read).collect()
}

#[test]
fn a_reader_written_from_the_document_gives_the_bits_of_every_golden_blob() {
    let mut versions = Vec::new();
    let golden = golden();
    for (path, found) in golden.iter().zip(read("read_blob.py", &golden)) {
        let (_, header) = Header::read(&std::fs::read(path).unwrap()).unwrap();
        versions.push(header.version);
        let (name, printed) = (path.display(), &found.printed);
        assert_eq!(found.code, 0, "{name}: {printed}{}", found.said);
        assert!(
            printed.ends_with("4 rays and 4 matches, 0 with other bits\n"),
            "{name}: {printed}"
        );
    }
    versions.sort_unstable();
    versions.dedup();
    assert_eq!(versions, [1, 2, 3, 4]);
}

#[test]
fn the_documents_covariance_gives_the_bits_of_every_golden_blob() {
    let golden = golden();
    for (path, found) in golden.iter().zip(read("read_uncertainty.py", &golden)) {
        let (_, header) = Header::read(&std::fs::read(path).unwrap()).unwrap();
        let count = if header.version == 1 { 0 } else { 2 };
        let (name, said) = (path.display(), &found.said);
        assert_eq!(
            found.printed,
            format!("{count} uncertainties, 0 with other bits\n"),
            "{name}: {said}"
        );
        assert_eq!(found.code, 0, "{name}: {said}");
    }
}

#[test]
fn the_reader_is_short() {
    let lines = include_str!("read_blob.py").lines();
    assert!(lines.clone().all(|line| line.len() <= 120));
    assert!(lines.count() <= 120);
}

/// Writes a damaged copy of a blob for the reader.
fn damaged(path: &Path, name: &str, damage: impl Fn(&mut Vec<u8>)) -> PathBuf {
    let mut bytes = std::fs::read(path).unwrap();
    damage(&mut bytes);
    let blob = path.file_name().unwrap().to_str().unwrap();
    let copy = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}-{blob}"));
    std::fs::write(&copy, bytes).unwrap();
    copy
}

#[test]
fn the_reader_refuses_damage() {
    let mut copies = Vec::new();
    let mut cut_short = Vec::new();
    for path in golden() {
        let length = std::fs::metadata(&path).unwrap().len() as usize;
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
            copies.push(damaged(&path, &format!("byte-{at}"), |bytes| {
                bytes[at] ^= 1 << (at % 8);
            }));
        }
        for length in [length - 8, 20] {
            let name = format!("cut-{length}");
            cut_short.push(damaged(&path, &name, |bytes| bytes.truncate(length)));
        }
    }
    for (path, found) in copies.iter().zip(read("read_blob.py", &copies)) {
        let (name, said) = (path.display(), &found.said);
        assert_eq!(found.code, 1, "{name}: {said}");
        assert!(said.starts_with("refused: "), "{name}: {said}");
    }
    for (path, found) in cut_short.iter().zip(read("read_blob.py", &cut_short)) {
        assert_eq!(found.code, 1, "{}: {}", path.display(), found.said);
    }
}

/// Were the reader to pass everything, the first test would say nothing.
#[test]
fn the_reader_sees_a_changed_table() {
    let change = |bytes: &mut Vec<u8>| {
        let header = Header::read(bytes).unwrap().1;
        let records = (24 + header.meta_len as usize).next_multiple_of(8);
        // The first camera's translation along x.
        bytes[records + 4 * 29] ^= 1;
        repair_checksum(bytes);
    };
    let copies: Vec<PathBuf> = golden()
        .iter()
        .map(|path| damaged(path, "changed", change))
        .collect();
    for (path, found) in copies.iter().zip(read("read_blob.py", &copies)) {
        let (name, printed) = (path.display(), &found.printed);
        assert_eq!(found.code, 1, "{name}");
        assert!(printed.contains("4 rays and 4 matches, "), "{printed}");
        assert!(!printed.contains(", 0 with other bits"), "{printed}");
    }
}
