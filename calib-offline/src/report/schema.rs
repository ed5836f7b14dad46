//! The JSON Schema of `calibration.json`, made from the types that are written: names, shapes, and what each number
//! means. `calibration.schema.json` is its text.

use super::Calibration;
use super::record::SCHEMA;
use schemars::Schema;
use schemars::generate::SchemaSettings;
use schemars::transform::{Transform, transform_subschemas};
use serde_json::Value;

/// The schema (draft 2020-12) of the version that is written. Further keys are allowed anywhere: programs that read
/// this version go on reading what is added to it.
pub fn calibration_schema() -> Value {
    let settings = SchemaSettings::draft2020_12()
        .for_serialize()
        .with_transform(PlainWords);
    let mut schema = settings
        .into_generator()
        .into_root_schema_for::<Calibration>();
    schema.insert("title".to_owned(), SCHEMA.into());
    let mut value = schema.to_value();
    if let Some(version) = value.pointer_mut("/properties/schema") {
        version["const"] = SCHEMA.into();
    }
    value
}

/// Takes the links out of descriptions that were written for the code: what they lead to is not in the schema.
#[derive(Debug, Clone)]
struct PlainWords;

impl Transform for PlainWords {
    fn transform(&mut self, schema: &mut Schema) {
        let words = schema.get("description").and_then(Value::as_str);
        if let Some(words) = words.map(plain) {
            schema.insert("description".to_owned(), words.into());
        }
        transform_subschemas(self, schema);
    }
}

/// `[name](target)` and `[name]` become the name, lines of a paragraph one line.
fn plain(words: &str) -> String {
    let mut text = String::new();
    let mut rest = words;
    while let Some((before, (name, after))) = rest
        .split_once("[`")
        .and_then(|(before, link)| Some((before, link.split_once("`]")?)))
    {
        text += before;
        text += name;
        let target = after.strip_prefix('(').and_then(|t| t.split_once(')'));
        rest = target.map_or(after, |(_, after)| after);
    }
    text += rest;
    let paragraphs: Vec<String> = text
        .split("\n\n")
        .map(|paragraph| paragraph.replace('\n', " "))
        .collect();
    paragraphs.join("\n\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn descriptions_are_words_and_not_links() {
        let words = "As [`Rig::x`](super::Rig::x) and\n[`y`] say,\n[0, 1].\n\nMore.";
        assert_eq!(plain(words), "As Rig::x and y say, [0, 1].\n\nMore.");
    }
}
