//! The tables for people, plain or as Markdown.

use std::collections::BTreeMap;
use std::fmt::Write;

use crate::across::{AcrossCores, means};
use crate::count::TIME_SHIFT;
use crate::image::STARTUP;
use crate::report::{BlobCost, Cost, ImageCost, StackBound};

/// How tables are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Style {
    /// For a terminal.
    Plain,
    /// For a document.
    Markdown,
}

/// Rows of cells; all but the first column are numbers.
struct Table {
    head: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    fn new(head: &[&str]) -> Self {
        Self {
            head: head.iter().map(|cell| (*cell).to_owned()).collect(),
            rows: Vec::new(),
        }
    }

    fn drawn(&self, style: Style) -> String {
        let lines = || std::iter::once(&self.head).chain(&self.rows);
        let width = |column: usize| {
            let cells = lines().filter_map(|line| line.get(column));
            cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..self.head.len()).map(width).collect();
        let mut text = String::new();
        for (number, line) in lines().enumerate() {
            let cells: Vec<String> = line
                .iter()
                .zip(&widths)
                .enumerate()
                .map(|(column, (cell, width))| match column {
                    0 => format!("{cell:<width$}"),
                    _ => format!("{cell:>width$}"),
                })
                .collect();
            let _ = match style {
                Style::Plain => writeln!(text, "  {}", cells.join("  ").trim_end()),
                Style::Markdown => writeln!(text, "| {} |", cells.join(" | ")),
            };
            if number == 0 && style == Style::Markdown {
                let rules = widths.iter().enumerate().map(|(column, width)| {
                    let rule = "-".repeat((*width).max(3) - 1);
                    if column == 0 {
                        format!("-{rule}")
                    } else {
                        format!("{rule}:")
                    }
                });
                let _ = writeln!(text, "| {} |", rules.collect::<Vec<_>>().join(" | "));
            }
        }
        text
    }
}

impl Cost {
    /// Everything but the single functions, for a terminal.
    pub fn to_text(&self) -> String {
        let conditions = &self.conditions;
        let mut text = format!(
            "{}, {}\n{}, {}\n{}\n\n",
            conditions.machine,
            conditions.qemu,
            conditions.target,
            conditions.compiler,
            conditions.profile
        );
        self.tables(&mut text, Style::Plain);
        let _ = writeln!(
            text,
            "Instructions are counted exactly; they are not cycles, and QEMU says nothing of time on silicon."
        );
        text
    }

    /// `ray-runtime/COST.md`, with other cores in it.
    pub fn to_markdown(&self, across: &AcrossCores) -> String {
        let conditions = &self.conditions;
        let mut text = String::from(include_str!("method.md"));
        let _ = write!(
            text,
            "\n## Measured with\n\n\
             - {}, board {}, `-icount shift={}`\n\
             - {}, {}, {}\n\
             - a block of {} instructions counted {}; {} for the two looks at the timer and an empty call are taken off\n\n",
            conditions.qemu,
            conditions.machine,
            TIME_SHIFT,
            conditions.compiler,
            conditions.target,
            conditions.profile,
            conditions.known_block,
            conditions.known_block_counted,
            conditions.overhead,
        );
        self.tables(&mut text, Style::Markdown);
        text.push_str(include_str!("choose.md"));
        text.push('\n');
        across.tables(&mut text, Style::Markdown);
        while text.ends_with("\n\n") {
            text.pop();
        }
        text
    }

    fn tables(&self, text: &mut String, style: Style) {
        for blob in &self.blobs {
            heading(text, style, &heading_of(blob));
            let _ = writeln!(text, "{}", instructions(blob).drawn(style));
        }
        heading(text, style, "Code and memory of the images, bytes");
        let _ = writeln!(text, "{}", sizes(&self.images).drawn(style));
        let _ = writeln!(
            text,
            "Code of the runtime in the first with other features than all three: {}.\n",
            self.forms
                .iter()
                .map(|form| format!("`{}` {} bytes", form.features, form.code_bytes))
                .collect::<Vec<_>>()
                .join(", ")
        );
        heading(text, style, "Code by the crate it comes from, bytes");
        let _ = writeln!(text, "{}", origins(&self.images).drawn(style));
        heading(
            text,
            style,
            "Functions of the runtime and what it needs, 100 bytes and more",
        );
        let _ = writeln!(text, "{}", functions(&self.images).drawn(style));
        heading(
            text,
            style,
            "Stack by function and all it calls, upper bound, bytes",
        );
        let _ = writeln!(text, "{}", bounds(&self.images).drawn(style));
    }
}

impl AcrossCores {
    /// A table for each blob, for a terminal.
    pub fn to_text(&self) -> String {
        let mut text = String::new();
        self.tables(&mut text, Style::Plain);
        text.push_str("Instructions, the mean of all pixels; they are not cycles.\n");
        text
    }

    fn tables(&self, text: &mut String, style: Style) {
        let mut conditions = Table::new(&["core", "compiled for", "run by QEMU as"]);
        for core in &self.cores {
            let flags = core.flags.trim_start_matches("-C ");
            conditions.rows.push(vec![
                core.core.to_owned(),
                format!("{} {flags}", core.conditions.target)
                    .trim_end()
                    .to_owned(),
                core.conditions.machine.clone(),
            ]);
        }
        heading(text, style, "The cores");
        let _ = writeln!(text, "{}", conditions.drawn(style));
        let Some(first) = self.cores.first() else {
            return;
        };
        for (number, blob) in first.blobs.iter().enumerate() {
            heading(text, style, &heading_of(blob));
            for columns in [&ACROSS, &ACROSS_INTEGERS] {
                let table = self.table(number, columns);
                let _ = writeln!(text, "{}", table.drawn(style));
            }
        }
    }

    /// A row for each core, of the blob of this number.
    fn table(&self, number: usize, columns: &[(&str, &str)]) -> Table {
        let heads: Vec<&str> = columns.iter().map(|(_, head)| *head).collect();
        let mut table = Table::new(&heads);
        for core in &self.cores {
            let Some(blob) = core.blobs.get(number) else {
                continue;
            };
            let means = means(blob);
            let cell = |(work, _): &(&str, &str)| match *work {
                "" => core.core.to_owned(),
                work => means
                    .get(work)
                    .map_or("-".to_owned(), |mean| format!("{mean:.0}")),
            };
            table.rows.push(columns.iter().map(cell).collect());
        }
        table
    }
}

/// The columns of the tables across cores: the work, and what stands above it.
const ACROSS: [(&str, &str); 7] = [
    ("", "instructions"),
    ("lookup", "lookup"),
    ("a ray in a row of 64", "a ray in a row of 64"),
    ("triangulate", "triangulate"),
    ("triangulate_with_covariance", "with covariance"),
    ("open", "open"),
    ("bilinear_triangulate", "yardstick: bilinear triangulate"),
];

/// The same of points in integers, beside those in f32.
const ACROSS_INTEGERS: [(&str, &str); 7] = [
    ("", "in integers"),
    ("triangulate", "triangulate in f32"),
    ("integer_triangulate", "triangulate from f32 to f32"),
    ("integer_triangulate_fixed", "in fixed point"),
    ("integer_lookup", "lookup from f32 to f32"),
    ("integer_lookup_fixed", "in fixed point"),
    ("integer_prepare", "prepare, once"),
];

fn heading(text: &mut String, style: Style, heading: &str) {
    let _ = match style {
        Style::Plain => writeln!(text, "{heading}"),
        Style::Markdown => writeln!(text, "## {heading}\n"),
    };
}

fn heading_of(blob: &BlobCost) -> String {
    let cameras: Vec<String> = blob
        .cameras
        .iter()
        .map(|camera| format!("{} ({})", camera.name, camera.kind))
        .collect();
    format!(
        "{}: {} bytes, {} matches of {}",
        blob.blob,
        blob.bytes,
        blob.matches,
        cameras.join(" and ")
    )
}

fn instructions(blob: &BlobCost) -> Table {
    let mut table = Table::new(&[
        "instructions",
        "min",
        "mean",
        "max",
        "stack",
        "at most",
        "runs",
    ]);
    for row in &blob.rows {
        let mut work = row.work.replace('_', " ");
        if let Some(camera) = &row.camera {
            let _ = write!(work, ", {camera}");
        }
        if row.is_yardstick {
            work.insert_str(0, "yardstick: ");
        }
        if row.work == "checksum" {
            let _ = write!(work, " ({:.2} a byte)", blob.checksum_instructions_per_byte);
        }
        table.rows.push(vec![
            work,
            row.instructions.min.to_string(),
            format!("{:.1}", row.instructions.mean),
            row.instructions.max.to_string(),
            row.stack_bytes.to_string(),
            bound_in_words(&row.stack_bound),
            row.runs.to_string(),
        ]);
    }
    table
}

fn sizes(images: &[ImageCost]) -> Table {
    let mut table = Table::new(&[
        "image",
        "code of the runtime",
        "text",
        "rodata",
        "vectors",
        "data",
        "bss",
        "RAM besides the stack",
        "panics",
    ]);
    for image in images {
        let section = |name: &str| image.sections.get(name).copied().unwrap_or(0).to_string();
        let code = image
            .runtime_code_bytes
            .map_or("-".to_owned(), |bytes| bytes.to_string());
        table.rows.push(vec![
            image.does.to_owned(),
            code,
            section(".text"),
            section(".rodata"),
            section(".vector_table"),
            section(".data"),
            section(".bss"),
            image.ram_besides_stack.to_string(),
            image.panics.len().to_string(),
        ]);
    }
    table
}

fn origins(images: &[ImageCost]) -> Table {
    let mut head = vec!["crate"];
    head.extend(images.iter().map(|image| image.image));
    let mut table = Table::new(&head);
    let mut origins: Vec<(&String, Vec<u64>)> = Vec::new();
    for origin in images.iter().flat_map(|image| image.code_by_origin.keys()) {
        if origins.iter().all(|(known, _)| *known != origin) {
            let of = |image: &ImageCost| image.code_by_origin.get(origin).copied().unwrap_or(0);
            origins.push((origin, images.iter().map(of).collect()));
        }
    }
    origins.sort_by(|(a, x), (b, y)| (y, a).cmp(&(x, b)));
    for (origin, bytes) in origins {
        let mut row = vec![origin.clone()];
        row.extend(bytes.iter().map(u64::to_string));
        table.rows.push(row);
    }
    table
}

/// Functions of one name, such as those of one generic, are taken together.
fn functions(images: &[ImageCost]) -> Table {
    let images = images
        .iter()
        .filter(|image| image.runtime_code_bytes.is_some());
    let images: Vec<&ImageCost> = images.collect();
    let mut head = vec!["function"];
    head.extend(images.iter().map(|image| image.image));
    let mut table = Table::new(&head);
    let mut sizes: BTreeMap<&str, Vec<u64>> = BTreeMap::new();
    for (column, image) in images.iter().enumerate() {
        for function in image
            .functions
            .iter()
            .filter(|function| function.origin != STARTUP)
        {
            let own = format!("{}::", image.image);
            let name = function.name.strip_prefix(&own).unwrap_or(&function.name);
            let row = sizes.entry(name).or_insert_with(|| vec![0; images.len()]);
            if let Some(bytes) = row.get_mut(column) {
                *bytes += function.bytes;
            }
        }
    }
    let mut sizes: Vec<_> = sizes.into_iter().collect();
    sizes.sort_by(|(a, x), (b, y)| (y.iter().max(), a).cmp(&(x.iter().max(), b)));
    for (name, bytes) in sizes {
        if bytes.iter().any(|bytes| *bytes >= 100) {
            let cells = bytes.iter().map(u64::to_string);
            table
                .rows
                .push(std::iter::once(name.to_owned()).chain(cells).collect());
        }
    }
    table
}

fn bounds(images: &[ImageCost]) -> Table {
    let mut table = Table::new(&["image, function", "bytes"]);
    for image in images {
        for (function, bound) in &image.stack_bounds {
            let name = format!("{}, {}", image.image, function.replace('_', " "));
            table.rows.push(vec![name, bound_in_words(bound)]);
        }
    }
    table
}

fn bound_in_words(bound: &StackBound) -> String {
    match bound {
        StackBound::Bytes(bytes) => bytes.to_string(),
        StackBound::Unknown(reason) => format!("none: {reason}"),
    }
}
