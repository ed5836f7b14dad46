//! Values in braces: JSON, and the Python that mrcal writes. Both kinds of quotes, a comma behind the last value, `#` before a
//! comment, and words such as `None`, `true` or `.Nan` (which `OpenCV` writes into JSON) are taken.

use super::document::DEEPEST;
use super::{Node, Problem, Value};

pub(super) fn tree(text: &str) -> Result<Node, Problem> {
    let mut reader = Reader { text, at: 0 };
    let node = reader.value(0)?;
    reader.skip();
    match reader.peek() {
        None => Ok(node),
        Some(_) => Err(reader.refused("something stands behind the last brace")),
    }
}

struct Reader<'a> {
    text: &'a str,
    at: usize,
}

impl<'a> Reader<'a> {
    fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    fn peek(&self) -> Option<char> {
        self.rest().chars().next()
    }

    fn refused(&self, message: &str) -> Problem {
        Problem::Syntax {
            line: 1 + self.text[..self.at].matches('\n').count(),
            message: message.to_owned(),
        }
    }

    /// Over blanks and comments.
    fn skip(&mut self) {
        loop {
            let rest = self.rest();
            self.at += rest.len() - rest.trim_start().len();
            if self.peek() != Some('#') {
                return;
            }
            let rest = self.rest();
            self.at += rest.find('\n').unwrap_or(rest.len());
        }
    }

    /// Whether that is next; then it is passed.
    fn takes(&mut self, wanted: char) -> bool {
        self.skip();
        let is_next = self.peek() == Some(wanted);
        if is_next {
            self.at += wanted.len_utf8();
        }
        is_next
    }

    fn value(&mut self, depth: usize) -> Result<Node, Problem> {
        if depth > DEEPEST {
            return Err(self.refused("it goes too deep"));
        }
        if self.takes('{') {
            let mut entries = Vec::new();
            while !self.takes('}') {
                let key = self
                    .quoted()?
                    .ok_or_else(|| self.refused("a key in quotes is wanted"))?;
                if !self.takes(':') {
                    return Err(self.refused("a colon is wanted behind a key"));
                }
                entries.push((key, self.value(depth + 1)?));
                self.ends_or_goes_on('}')?;
            }
            return Node::map(entries);
        }
        for (first, last) in [('[', ']'), ('(', ')')] {
            if self.takes(first) {
                let mut items = Vec::new();
                while !self.takes(last) {
                    items.push(self.value(depth + 1)?);
                    self.ends_or_goes_on(last)?;
                }
                return Ok(Node(Value::List(items)));
            }
        }
        // Python's bytes, which nobody here reads.
        if self.rest().starts_with("b'") || self.rest().starts_with("b\"") {
            self.at += 1;
        }
        if let Some(text) = self.quoted()? {
            return Ok(Node(Value::Text(text)));
        }
        let rest = self.rest();
        let is_end = |c: char| c.is_whitespace() || ",:{}[]()#'\"".contains(c);
        let word = &rest[..rest.find(is_end).unwrap_or(rest.len())];
        if word.is_empty() {
            return Err(self.refused("a value is wanted"));
        }
        self.at += word.len();
        Ok(Node::plain(word))
    }

    fn ends_or_goes_on(&mut self, last: char) -> Result<(), Problem> {
        let goes_on = self.takes(',');
        self.skip();
        if goes_on || self.peek() == Some(last) {
            Ok(())
        } else {
            Err(self.refused(&format!("a comma or {last} is wanted")))
        }
    }

    /// A text in quotes, if one is next.
    fn quoted(&mut self) -> Result<Option<String>, Problem> {
        self.skip();
        let Some(quote) = self.peek().filter(|c| ['"', '\''].contains(c)) else {
            return Ok(None);
        };
        let mut text = String::new();
        let mut chars = self.rest().char_indices().skip(1);
        while let Some((at, c)) = chars.next() {
            match c {
                c if c == quote => {
                    self.at += at + 1;
                    return Ok(Some(text));
                }
                '\\' => match chars.next().map(|(_, c)| c) {
                    Some('n') => text.push('\n'),
                    Some('t') => text.push('\t'),
                    // Longer ones stand in no key and in no name that matters.
                    Some(c) => text.push(c),
                    None => break,
                },
                c => text.push(c),
            }
        }
        Err(self.refused("a text without an end"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::Document;

    #[test]
    fn python_and_json_are_read_and_broken_ones_refused() {
        let text = "# note\n{ 'a': [ 1, -2.5e3, ], # more\n \"b\": {'c': None}, 'd': b'x\\'y', 'e': .Nan }\n";
        let node = tree(text).unwrap();
        let document = Document::new(&node);
        assert_eq!(
            document.need("a").unwrap().numbers().unwrap(),
            [1.0, -2500.0]
        );
        assert!(document.need("b").unwrap().need("c").unwrap().is_nothing());
        assert_eq!(document.need("d").unwrap().text().unwrap(), "x'y");
        let not_finite = document.need("e").unwrap().number().unwrap_err();
        assert!(matches!(not_finite, Problem::NotFinite { .. }));
        for broken in [
            "{",
            "{'a' 1}",
            "{'a': 1} x",
            "{'a': [1 2]}",
            "{a: 1}",
            "{'a': '",
            "{'a': 1, 'a': 2}",
        ] {
            assert!(tree(broken).is_err(), "{broken}");
        }
        let deep = "[".repeat(100_000);
        assert!(matches!(tree(&deep), Err(Problem::Syntax { line: 1, .. })));
    }
}
