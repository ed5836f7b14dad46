//! YAML as other tools write it. `OpenCV` 4's head `%YAML:1.0` is none of YAML's, and is left out; tags are not looked at, as what a
//! matrix is follows from its keys.

use super::document::DEEPEST;
use super::{Node, Problem, Value};
use saphyr_parser::{Event, Parser, ScalarStyle};

/// A list or a map that is still open.
enum Open {
    List(Vec<Node>),
    Map(Vec<(String, Node)>, Option<String>),
}

/// The only document of a file.
pub(super) fn tree(text: &str) -> Result<Node, Problem> {
    // Lines keep their numbers.
    let kept;
    let text = match text.strip_prefix("%YAML") {
        Some(rest) => {
            let head_len = rest.find('\n').unwrap_or(rest.len());
            kept = &rest[head_len..];
            kept
        }
        None => text,
    };
    let mut open: Vec<Open> = Vec::new();
    let mut root = None;
    for event in Parser::new_from_str(text) {
        let (event, span) = event.map_err(|error| Problem::Syntax {
            line: error.marker().line().max(1),
            message: error.info().to_owned(),
        })?;
        let refused = |message: &str| Problem::Syntax {
            line: span.start.line().max(1),
            message: message.to_owned(),
        };
        let node = match event {
            Event::Scalar(value, style, ..) => Node(match style {
                ScalarStyle::Plain => Value::Plain(value.into_owned()),
                _ => Value::Text(value.into_owned()),
            }),
            Event::SequenceStart(..) => {
                open.push(Open::List(Vec::new()));
                if open.len() > DEEPEST {
                    return Err(refused("it goes too deep"));
                }
                continue;
            }
            Event::MappingStart(..) => {
                open.push(Open::Map(Vec::new(), None));
                if open.len() > DEEPEST {
                    return Err(refused("it goes too deep"));
                }
                continue;
            }
            Event::SequenceEnd | Event::MappingEnd => match open.pop() {
                Some(Open::List(items)) => Node(Value::List(items)),
                Some(Open::Map(entries, _)) => Node::map(entries)?,
                None => return Err(refused("an end without a start")),
            },
            Event::Alias(_) => return Err(refused("references are not read")),
            _ => continue,
        };
        match open.last_mut() {
            Some(Open::List(items)) => items.push(node),
            Some(Open::Map(entries, key)) => match key.take() {
                Some(key) => entries.push((key, node)),
                None => match node.0 {
                    Value::Plain(text) | Value::Text(text) => *key = Some(text),
                    _ => return Err(refused("a key is no text")),
                },
            },
            None if root.is_none() => root = Some(node),
            None => return Err(refused("a second document")),
        }
    }
    root.ok_or(Problem::UnknownFormat)
}
