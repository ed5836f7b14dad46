//! Whether a JSON value is what a JSON Schema says: the keywords that ours uses, and a panic at any other, so that none
//! passes unread.

use serde_json::{Map, Value};

/// Keywords that say nothing about a value.
const REMARKS: [&str; 6] = [
    "$schema",
    "$defs",
    "title",
    "description",
    "default",
    "format",
];

/// What contradicts a schema, each with where it stands; empty if nothing does.
pub fn contradictions(schema: &Value, value: &Value) -> Vec<String> {
    let mut found = Vec::new();
    check(schema, schema, value, "", &mut found);
    found
}

fn check(root: &Value, schema: &Value, value: &Value, place: &str, found: &mut Vec<String>) {
    let keywords = match schema {
        Value::Bool(true) => return,
        Value::Object(keywords) => keywords,
        _ => panic!("{schema} is no schema"),
    };
    for (keyword, argument) in keywords {
        let holds = match keyword.as_str() {
            "$ref" => {
                let target = argument.as_str().and_then(|path| path.strip_prefix('#'));
                let target = target.and_then(|path| root.pointer(path));
                check(root, target.expect("a definition"), value, place, found);
                true
            }
            "anyOf" | "oneOf" => {
                let fits = |one: &&Value| {
                    let mut inner = Vec::new();
                    check(root, one, value, place, &mut inner);
                    inner.is_empty()
                };
                let fitting = list(argument).iter().filter(fits).count();
                fitting == 1 || (keyword == "anyOf" && fitting > 1)
            }
            "type" => match argument {
                Value::Array(names) => names.iter().any(|name| is_a(name, value)),
                name => is_a(name, value),
            },
            "const" => value == argument,
            "enum" => list(argument).contains(value),
            "minimum" => value
                .as_f64()
                .is_none_or(|x| x >= argument.as_f64().unwrap()),
            "maximum" => value
                .as_f64()
                .is_none_or(|x| x <= argument.as_f64().unwrap()),
            "minItems" => value.as_array().is_none_or(|v| v.len() >= count(argument)),
            "maxItems" => value.as_array().is_none_or(|v| v.len() <= count(argument)),
            "required" => value.as_object().is_none_or(|object| {
                list(argument)
                    .iter()
                    .all(|key| object.contains_key(key.as_str().unwrap()))
            }),
            "properties" => {
                for (key, schema) in object(argument) {
                    if let Some(inner) = value.get(key) {
                        check(root, schema, inner, &format!("{place}/{key}"), found);
                    }
                }
                true
            }
            "additionalProperties" => {
                let known = keywords.get("properties").map(object);
                let is_new = |key: &String| known.is_none_or(|known| !known.contains_key(key));
                assert_eq!(argument, &Value::Bool(false), "{place}");
                value
                    .as_object()
                    .is_none_or(|object| !object.keys().any(is_new))
            }
            "prefixItems" => {
                let items = value.as_array().into_iter().flatten();
                for (k, (schema, inner)) in list(argument).iter().zip(items).enumerate() {
                    check(root, schema, inner, &format!("{place}/{k}"), found);
                }
                true
            }
            "items" => {
                for (k, inner) in value.as_array().into_iter().flatten().enumerate() {
                    check(root, argument, inner, &format!("{place}/{k}"), found);
                }
                true
            }
            remark if REMARKS.contains(&remark) => true,
            other => panic!("{place}: the keyword {other} is not known here"),
        };
        if !holds {
            found.push(format!("{place}: {keyword} {argument}"));
        }
    }
}

fn is_a(name: &Value, value: &Value) -> bool {
    match name.as_str().expect("the name of a type") {
        "null" => value.is_null(),
        "boolean" => value.is_boolean(),
        "integer" => value.is_i64() || value.is_u64(),
        "number" => value.is_number(),
        "string" => value.is_string(),
        "array" => value.is_array(),
        "object" => value.is_object(),
        other => panic!("{other} is no type"),
    }
}

fn list(value: &Value) -> &[Value] {
    value.as_array().expect("a list")
}

fn object(value: &Value) -> &Map<String, Value> {
    value.as_object().expect("an object")
}

fn count(value: &Value) -> usize {
    value.as_u64().expect("a count") as usize
}
