//! What a file of keys and values holds, whatever it is written in, and what may be asked of it.

use super::Problem;

/// A value as it stands in a file.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Value {
    Map(Vec<(String, Node)>),
    List(Vec<Node>),
    /// In quotes.
    Text(String),
    /// Without: a number, a word or nothing.
    Plain(String),
}

/// A value of a tree.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Node(pub Value);

/// A deeper file is somebody's joke.
pub(crate) const DEEPEST: usize = 64;

/// A value and the key under which it stands.
#[derive(Debug, Clone)]
pub(crate) struct Document<'a> {
    node: &'a Node,
    key: String,
}

/// A matrix, row by row.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Matrix {
    pub rows: usize,
    pub cols: usize,
    pub data: Vec<f64>,
}

impl Node {
    pub fn plain(text: impl Into<String>) -> Self {
        Self(Value::Plain(text.into()))
    }

    /// A map, unless it has a key twice.
    pub fn map(entries: Vec<(String, Self)>) -> Result<Self, Problem> {
        for (k, (key, _)) in entries.iter().enumerate() {
            if entries[..k].iter().any(|(other, _)| other == key) {
                return Err(Problem::Twice { key: key.clone() });
            }
        }
        Ok(Self(Value::Map(entries)))
    }
}

impl<'a> Document<'a> {
    pub fn new(node: &'a Node) -> Self {
        Self {
            node,
            key: String::new(),
        }
    }

    fn below(&self, key: &str, node: &'a Node) -> Self {
        let key = match self.key.as_str() {
            "" => key.to_owned(),
            above => format!("{above}.{key}"),
        };
        Self { node, key }
    }

    /// The keys that led here.
    pub fn key(&self) -> &str {
        &self.key
    }

    pub fn get(&self, key: &str) -> Option<Self> {
        let Value::Map(entries) = &self.node.0 else {
            return None;
        };
        let entry = entries.iter().find(|(name, _)| name == key)?;
        Some(self.below(key, &entry.1))
    }

    pub fn need(&self, key: &str) -> Result<Self, Problem> {
        self.get(key).ok_or_else(|| Problem::Missing {
            key: match self.key.as_str() {
                "" => key.to_owned(),
                above => format!("{above}.{key}"),
            },
        })
    }

    /// The first of several keys that is there.
    pub fn any(&self, keys: &[&str]) -> Option<Self> {
        keys.iter().find_map(|key| self.get(key))
    }

    pub fn keys(&self) -> Vec<&'a str> {
        match &self.node.0 {
            Value::Map(entries) => entries.iter().map(|(key, _)| key.as_str()).collect(),
            _ => Vec::new(),
        }
    }

    fn is(&self) -> String {
        match &self.node.0 {
            Value::Map(_) => "a group of keys".to_owned(),
            Value::List(items) => format!("a list of {}", items.len()),
            Value::Text(text) => format!("the text \"{}\"", shortened(text)),
            Value::Plain(text) if text.is_empty() => "empty".to_owned(),
            Value::Plain(text) => format!("\"{}\"", shortened(text)),
        }
    }

    pub fn wrong(&self, wanted: impl Into<String>) -> Problem {
        Problem::Wrong {
            key: self.key.clone(),
            found: self.is(),
            wanted: wanted.into(),
        }
    }

    pub fn disagrees(&self, other: impl Into<String>) -> Problem {
        Problem::Disagrees {
            key: self.key.clone(),
            other: other.into(),
        }
    }

    pub fn items(&self) -> Result<Vec<Self>, Problem> {
        match &self.node.0 {
            Value::List(items) => Ok(items
                .iter()
                .enumerate()
                .map(|(k, node)| Self {
                    node,
                    key: format!("{}[{k}]", self.key),
                })
                .collect()),
            _ => Err(self.wrong("a list")),
        }
    }

    pub fn is_nothing(&self) -> bool {
        matches!(&self.node.0, Value::Plain(text) if matches!(text.as_str(), "" | "~" | "null" | "None"))
    }

    pub fn is_group(&self) -> bool {
        matches!(self.node.0, Value::Map(_))
    }

    pub fn text(&self) -> Result<&'a str, Problem> {
        match &self.node.0 {
            Value::Text(text) | Value::Plain(text) if !text.is_empty() => Ok(text),
            _ => Err(self.wrong("text")),
        }
    }

    pub fn number(&self) -> Result<f64, Problem> {
        let Value::Plain(text) = &self.node.0 else {
            return Err(self.wrong("a number"));
        };
        let bare = text
            .trim_start_matches(['-', '+', '.'])
            .to_ascii_lowercase();
        if ["nan", "inf", "infinity"].contains(&bare.as_str()) {
            return Err(self.not_finite());
        }
        let value: f64 = text.parse().map_err(|_| self.wrong("a number"))?;
        if value.is_finite() {
            Ok(value)
        } else {
            Err(self.not_finite())
        }
    }

    pub fn not_finite(&self) -> Problem {
        Problem::NotFinite {
            key: self.key.clone(),
        }
    }

    /// A whole number from 1 on, as a sensor's side.
    pub fn side(&self) -> Result<u32, Problem> {
        let value = self.number()?;
        if value >= 1.0 && value <= f64::from(u16::MAX) && value.fract() == 0.0 {
            Ok(value as u32)
        } else {
            Err(self.wrong("a whole number from 1 to 65535"))
        }
    }

    pub fn numbers(&self) -> Result<Vec<f64>, Problem> {
        self.items()?.iter().map(Self::number).collect()
    }

    pub fn exactly<const N: usize>(&self) -> Result<[f64; N], Problem> {
        let numbers = self.numbers()?;
        <[f64; N]>::try_from(numbers).map_err(|_| self.wrong(format!("a list of {N} numbers")))
    }

    /// Rows of numbers, all of one length.
    pub fn rows(&self) -> Result<Matrix, Problem> {
        let rows = self.items()?;
        let read: Vec<Vec<f64>> = rows.iter().map(Self::numbers).collect::<Result<_, _>>()?;
        let cols = read.first().map_or(0, Vec::len);
        if read.iter().any(|row| row.len() != cols) {
            return Err(self.wrong("rows of one length"));
        }
        Ok(Matrix {
            rows: read.len(),
            cols,
            data: read.concat(),
        })
    }
}

/// A text that may be anything, so that a message stays a line.
fn shortened(text: &str) -> String {
    let clean: String = text.chars().filter(|c| !c.is_control()).take(40).collect();
    if clean.len() < text.len() {
        format!("{clean}...")
    } else {
        clean
    }
}
