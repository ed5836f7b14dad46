//! XML: `OpenCV`'s, whose elements are keys, and `DICe`'s, whose elements are `Parameter` with a name and a value.

use super::document::DEEPEST;
use super::{Node, Problem, Value};
use roxmltree::{Document, Error, ParsingOptions};

pub(super) fn tree(text: &str) -> Result<Node, Problem> {
    let options = ParsingOptions {
        allow_dtd: false,
        nodes_limit: 1_000_000,
        ..ParsingOptions::default()
    };
    let document =
        Document::parse_with_options(text, options).map_err(|error: Error| Problem::Syntax {
            line: error.pos().row as usize,
            message: error.to_string(),
        })?;
    node(document.root_element(), 0)
}

fn node(element: roxmltree::Node<'_, '_>, depth: usize) -> Result<Node, Problem> {
    if depth > DEEPEST {
        return Err(Problem::Syntax {
            line: 1,
            message: "it goes too deep".to_owned(),
        });
    }
    if let (Some(_), Some(value)) = (element.attribute("name"), element.attribute("value")) {
        return Ok(Node::plain(value));
    }
    let inner: Vec<_> = element
        .children()
        .filter(roxmltree::Node::is_element)
        .collect();
    if inner.is_empty() {
        let text = element.text().unwrap_or_default();
        let words: Vec<&str> = text.split_whitespace().collect();
        let tag = element.tag_name().name();
        // A list of one looks like a value; these are lists however many there are.
        return Ok(if words.len() > 1 || ["data", "sizes"].contains(&tag) {
            Node(Value::List(words.into_iter().map(Node::plain).collect()))
        } else {
            Node::plain(text.trim())
        });
    }
    let is_list = inner.iter().all(|element| element.tag_name().name() == "_");
    if is_list {
        let items = inner.into_iter().map(|element| node(element, depth + 1));
        return Ok(Node(Value::List(items.collect::<Result<_, _>>()?)));
    }
    let entries = inner.into_iter().map(|element| {
        let name = element
            .attribute("name")
            .unwrap_or(element.tag_name().name());
        Ok((name.to_owned(), node(element, depth + 1)?))
    });
    Node::map(entries.collect::<Result<_, Problem>>()?)
}
