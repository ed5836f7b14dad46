//! A table, shown on a terminal, in Markdown, or as CSV.

use csv::WriterBuilder;
use std::fmt::Display;

/// A header and rows of as many cells.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Table {
    /// The header is the first.
    rows: Vec<Vec<String>>,
    /// Columns after the first hold numbers, and stand to the right.
    of_numbers: bool,
}

impl Table {
    /// Only a header yet: a column that names its row, and columns of numbers.
    pub fn new(header: impl IntoIterator<Item = impl ToString>) -> Self {
        Self {
            rows: vec![header.into_iter().map(|name| name.to_string()).collect()],
            of_numbers: true,
        }
    }

    /// With all columns to the left.
    pub fn left_aligned(self) -> Self {
        Self {
            of_numbers: false,
            ..self
        }
    }

    /// One more row.
    pub fn push(&mut self, cells: Vec<String>) {
        self.rows.push(cells);
    }

    /// One more row, of what can be written.
    pub fn row(&mut self, values: &[&dyn Display]) {
        self.push(values.iter().map(ToString::to_string).collect());
    }

    /// For a terminal: columns as wide as their widest cell, two spaces apart.
    pub fn text(&self) -> String {
        let width = |column: usize| {
            let cells = self.rows.iter().filter_map(|row| row.get(column));
            cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
        };
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let widths: Vec<usize> = (0..columns).map(width).collect();
        self.rows.iter().fold(String::new(), |text, row| {
            let cells = row.iter().zip(&widths).enumerate();
            let cells: Vec<String> = cells
                .map(|(column, (cell, &width))| {
                    if self.of_numbers && column > 0 {
                        format!("{cell:>width$}")
                    } else {
                        format!("{cell:<width$}")
                    }
                })
                .collect();
            text + cells.join("  ").trim_end() + "\n"
        })
    }

    /// As Markdown.
    pub fn markdown(&self) -> String {
        let mut lines: Vec<String> = self.rows.iter().map(|row| markdown_line(row)).collect();
        let columns = self.rows.first().map_or(0, Vec::len);
        let rule = |column| match column {
            0 => " --- |",
            _ if self.of_numbers => " ---: |",
            _ => " --- |",
        };
        let rules: String = (0..columns).map(rule).collect();
        lines.insert(1, format!("|{rules}"));
        lines.join("\n") + "\n"
    }

    /// As CSV.
    pub fn csv(&self) -> String {
        let mut writer = WriterBuilder::new().flexible(true).from_writer(Vec::new());
        for row in &self.rows {
            // Writing to memory cannot fail.
            let _ = writer.write_record(row);
        }
        String::from_utf8(writer.into_inner().unwrap_or_default()).unwrap_or_default()
    }
}

fn markdown_line(row: &[String]) -> String {
    row.iter().fold("|".to_owned(), |line, cell| {
        let cell = cell.replace('|', "\\|");
        let space = if cell.is_empty() { "" } else { " " };
        line + space + &cell + " |"
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let mut table = Table::new(["method", "error, mm", ""]);
        table.row(&[&"a|b", &0.25, &"-"]);
        table.push(vec![
            "a \"long\" name".to_owned(),
            "12".to_owned(),
            String::new(),
        ]);
        table
    }

    #[test]
    fn columns_of_a_terminal_are_aligned_and_no_line_ends_in_spaces() {
        assert_eq!(
            table().text(),
            "method         error, mm\n\
             a|b                 0.25  -\n\
             a \"long\" name         12\n"
        );
        assert_eq!(
            table().left_aligned().text(),
            "method         error, mm\n\
             a|b            0.25       -\n\
             a \"long\" name  12\n"
        );
    }

    #[test]
    fn no_cell_is_taken_for_several() {
        assert_eq!(
            table().markdown(),
            "| method | error, mm | |\n\
             | --- | ---: | ---: |\n\
             | a\\|b | 0.25 | - |\n\
             | a \"long\" name | 12 | |\n"
        );
        assert!(
            table()
                .left_aligned()
                .markdown()
                .contains("\n| --- | --- | --- |\n")
        );
        assert_eq!(
            table().csv(),
            "method,\"error, mm\",\na|b,0.25,-\n\"a \"\"long\"\" name\",12,\n"
        );
    }
}
