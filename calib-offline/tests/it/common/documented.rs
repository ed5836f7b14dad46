//! The keys of a verb's `--json` objects beside those that its help lists.

use super::run;
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;

/// Paths such as `cameras.name`.
type Keys = BTreeSet<String>;

/// The files of `calibrate` and what it was asked for, which are not facts of the calibration.
const FILES_OF_CALIBRATE: [&str; 5] = ["blob", "calibration", "rig", "report", "task"];

/// Fails unless the objects together have the keys that `VERB --help` lists for the schema, and no
/// other. `never` are listed keys that none of these objects has, each with the reason.
#[track_caller]
pub fn assert_documented(verb: &str, schema: &str, objects: &[Value], never: &[(&str, &str)]) {
    let (listed, found) = assert_listed(verb, schema, objects);
    let is_excused = |key: &str| never.iter().any(|(excused, _)| *excused == key);
    let absent: Vec<&String> = listed
        .difference(&found)
        .filter(|key| !is_excused(key))
        .collect();
    assert!(
        absent.is_empty(),
        "{schema} has no {absent:?}, which {verb} --help lists"
    );
    for (key, reason) in never {
        assert!(
            listed.contains(*key) && !found.contains(*key),
            "{key} is excused in vain: {reason}"
        );
    }
}

/// Fails if one of the objects has a key that the help does not list; the keys of both.
#[track_caller]
pub fn assert_listed(verb: &str, schema: &str, objects: &[Value]) -> (Keys, Keys) {
    let listed = keys_in_help(verb, schema);
    let mut found = Keys::new();
    for object in objects {
        collect(object, "", &mut found);
    }
    found.remove("schema");
    let unlisted: Vec<&String> = found.difference(&listed).collect();
    assert!(
        unlisted.is_empty(),
        "{verb} --help does not list {unlisted:?} of {schema}"
    );
    (listed, found)
}

fn collect(value: &Value, path: &str, keys: &mut Keys) {
    match value {
        Value::Object(map) => {
            for (key, value) in map {
                let path = format!("{path}{key}");
                collect(value, &format!("{path}."), keys);
                keys.insert(path);
            }
        }
        Value::Array(values) => values.iter().for_each(|value| collect(value, path, keys)),
        _ => {}
    }
}

/// A help lists keys in the indented lines after the one that names the schema: separated by commas,
/// those of an object in parentheses after its own (`a/b (...)` for two alike), with a remark after two
/// spaces or on a line indented further. `the facts of calibrate` and `as of calibrate` stand for
/// what the help of `calibrate` lists.
fn keys_in_help(verb: &str, schema: &str) -> Keys {
    let help = run(Path::new("."), &[verb, "--help"]).stdout;
    let mut lines = help.lines().skip_while(|line| !line.contains(schema));
    let header = lines.next();
    assert!(
        header.is_some_and(|line| line.ends_with(':')),
        "{verb} --help: {schema}"
    );
    let (mut list, mut depth) = (String::new(), 0);
    for line in lines.take_while(|line| line.starts_with("  ")) {
        if depth == 0 && line.starts_with("   ") {
            continue;
        }
        let line = line.trim();
        let line = line.split_once("  ").map_or(line, |(keys, _)| keys);
        list += line;
        depth += line.matches('(').count();
        depth -= line.matches(')').count();
        list += if depth == 0 { ", " } else { " " };
    }
    let mut keys = Keys::new();
    parse(&list, "", &mut keys);
    keys
}

fn parse(list: &str, path: &str, keys: &mut Keys) {
    for item in items(list) {
        let (names, inner) = match item.split_once('(') {
            Some((names, inner)) => (names.trim(), inner.strip_suffix(')').unwrap()),
            None => (item, ""),
        };
        if names == "the facts of calibrate" {
            let of_calibrate = keys_in_help("calibrate", "calib-offline/calibrate/1");
            let is_fact = |key: &&String| {
                let top = key.split('.').next().unwrap_or_default();
                !FILES_OF_CALIBRATE.contains(&top)
            };
            keys.extend(
                of_calibrate
                    .iter()
                    .filter(is_fact)
                    .map(|key| format!("{path}{key}")),
            );
            continue;
        }
        for name in names.split('/') {
            assert!(
                name.chars()
                    .all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_'),
                "{name:?} is no key"
            );
            keys.insert(format!("{path}{name}"));
            if inner == "as of calibrate" {
                let of_calibrate = keys_in_help("calibrate", "calib-offline/calibrate/1");
                let below = format!("{name}.");
                let own = of_calibrate.iter().filter(|key| key.starts_with(&below));
                keys.extend(own.map(|key| format!("{path}{key}")));
            } else {
                parse(inner, &format!("{path}{name}."), keys);
            }
        }
    }
}

/// What stands between the commas outside parentheses.
fn items(list: &str) -> impl Iterator<Item = &str> {
    let mut depth = 0;
    let at_comma = move |c: char| {
        match c {
            '(' => depth += 1,
            ')' => depth -= 1,
            _ => {}
        }
        c == ',' && depth == 0
    };
    list.split(at_comma)
        .map(str::trim)
        .filter(|item| !item.is_empty())
}
