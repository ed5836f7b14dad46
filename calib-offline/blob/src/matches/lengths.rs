//! `LENGTHS.csv`: known lengths between points that are measured.

use super::error::shortened;
use calib_rays::remedy::Remedy;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The header; the last column may be left out.
const HEADER: [&str; 4] = ["id_a", "id_b", "length_mm", "limit_mm"];

/// A known length.
#[derive(Debug, Clone, PartialEq)]
pub struct KnownLength {
    /// Line of the file, from 1.
    pub line: usize,
    /// Ids of its ends.
    pub ids: [String; 2],
    /// How long it is, mm.
    pub length_mm: f64,
    /// What its error may be at most, mm.
    pub limit_mm: Option<f64>,
}

/// Why a file of lengths was not accepted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LengthsError {
    /// The system refused to read it.
    #[error("{}: cannot be read", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Another header.
    #[error("{}:1: the header is \"{found}\", it must be \"id_a,id_b,length_mm\" or \"id_a,id_b,length_mm,limit_mm\"", file.display())]
    Header {
        /// The file.
        file: PathBuf,
        /// What stands there, shortened.
        found: String,
    },
    /// No line but the header.
    #[error("{}: has no length", file.display())]
    Empty {
        /// The file.
        file: PathBuf,
    },
    /// A line that is no length.
    #[error("{}:{line}: {problem}", file.display())]
    Row {
        /// The file.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// What is wrong with it.
        problem: LengthProblem,
    },
}

/// What is wrong with a line.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LengthProblem {
    /// Not UTF-8, or no row of CSV.
    #[error("is no row of comma-separated text")]
    NotText,
    /// Too few or too many fields.
    #[error("has {have} fields, the header has {need}")]
    FieldCount {
        /// Fields.
        have: usize,
        /// Columns.
        need: usize,
    },
    /// Both ends are the same point.
    #[error("both ends are \"{id}\"")]
    SameEnd {
        /// The id.
        id: String,
    },
    /// The same two ends again.
    #[error("the length from \"{}\" to \"{}\" stands in line {first_line} already", ids[0], ids[1])]
    Twice {
        /// The ends.
        ids: [String; 2],
        /// Where.
        first_line: usize,
    },
    /// No number above 0.
    #[error("{column} is \"{text}\", and must be a number of mm above 0")]
    NotALength {
        /// Which.
        column: &'static str,
        /// The field, shortened.
        text: String,
    },
    /// An end that no match has.
    #[error("no match has the id \"{id}\"")]
    UnknownId {
        /// The id.
        id: String,
    },
}

impl Remedy for LengthsError {
    fn remedy(&self) -> Option<String> {
        let text = match self {
            Self::Read { .. } => "check the path and the permissions",
            Self::Header { .. } => "write this header, with commas between the names",
            Self::Empty { .. } => "write one known length per line, or leave --lengths out",
            Self::Row { problem, .. } => match problem {
                LengthProblem::NotText => "save the file as UTF-8 text",
                LengthProblem::FieldCount { .. } => {
                    "each line has one length; decimal points are points, not commas"
                }
                LengthProblem::SameEnd { .. } => "name the ids of two matches",
                LengthProblem::Twice { .. } => {
                    "keep one of the two lines; give each measurement of a length matches of its own"
                }
                LengthProblem::NotALength { .. } => {
                    "give the length in mm, and a limit in mm or an empty field"
                }
                LengthProblem::UnknownId { .. } => {
                    "write the ids as they stand in the first column of the matches"
                }
            },
        };
        Some(text.to_owned())
    }
}

/// Reads a file of lengths.
///
/// # Errors
/// [`LengthsError`] with file and line.
pub fn read_lengths(file: &Path) -> Result<Vec<KnownLength>, LengthsError> {
    let bytes = std::fs::read(file).map_err(|source| LengthsError::Read {
        file: file.to_owned(),
        source,
    })?;
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes);
    let row_error = |line: usize, problem: LengthProblem| LengthsError::Row {
        file: file.to_owned(),
        line,
        problem,
    };
    // Line by line: no id has a line's end in it, and an empty line is none.
    let mut rows = bytes.split(|byte| *byte == b'\n').enumerate();
    let header = rows
        .next()
        .map_or(Ok(csv::StringRecord::new()), |(_, row)| fields(row));
    let header = header.map_err(|problem| row_error(1, problem))?;
    let columns = header.len();
    if !(columns >= 3 && header.iter().eq(HEADER.into_iter().take(columns))) {
        let header: Vec<&str> = header.iter().collect();
        return Err(LengthsError::Header {
            file: file.to_owned(),
            found: shortened(&header.join(",")),
        });
    }
    let mut lengths: Vec<KnownLength> = Vec::new();
    let mut seen: BTreeMap<[String; 2], usize> = BTreeMap::new();
    for (k, row) in rows.filter(|(_, row)| !row.trim_ascii().is_empty()) {
        let line = k + 1;
        let length = fields(row).and_then(|row| known_length(&row, line, columns));
        let length = length.map_err(|problem| row_error(line, problem))?;
        let mut ends = length.ids.clone();
        ends.sort();
        if let Some(first_line) = seen.insert(ends, line) {
            let ids = length.ids;
            return Err(row_error(line, LengthProblem::Twice { ids, first_line }));
        }
        lengths.push(length);
    }
    if lengths.is_empty() {
        return Err(LengthsError::Empty {
            file: file.to_owned(),
        });
    }
    Ok(lengths)
}

/// The fields of a line, without the quotes that may protect them.
fn fields(line: &[u8]) -> Result<csv::StringRecord, LengthProblem> {
    let rows = csv::ReaderBuilder::new()
        .has_headers(false)
        .trim(csv::Trim::All)
        .from_reader(line)
        .into_records()
        .next();
    rows.unwrap_or_else(|| Ok(csv::StringRecord::new()))
        .map_err(|_| LengthProblem::NotText)
}

fn known_length(
    row: &csv::StringRecord,
    line: usize,
    columns: usize,
) -> Result<KnownLength, LengthProblem> {
    if row.len() != columns {
        return Err(LengthProblem::FieldCount {
            have: row.len(),
            need: columns,
        });
    }
    let field = |k: usize| row.get(k).unwrap_or("");
    let millimeters = |k: usize| {
        let value = field(k).parse::<f64>().ok();
        value
            .filter(|value| value.is_finite() && *value > 0.0)
            .ok_or_else(|| LengthProblem::NotALength {
                column: HEADER[k],
                text: shortened(field(k)),
            })
    };
    let ids = [field(0), field(1)].map(str::to_owned);
    if ids[0] == ids[1] {
        return Err(LengthProblem::SameEnd {
            id: shortened(&ids[0]),
        });
    }
    Ok(KnownLength {
        line,
        ids,
        length_mm: millimeters(2)?,
        limit_mm: (!field(3).is_empty()).then(|| millimeters(3)).transpose()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<KnownLength>, LengthsError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("l.csv");
        std::fs::write(&path, text).unwrap();
        read_lengths(&path)
    }

    #[test]
    fn lengths_have_two_ends_and_perhaps_a_limit() {
        let text = "\u{feff}id_a,id_b,length_mm,limit_mm\n1,\"a,b\",100.5,0.02\n\n2,1,50,\n";
        let lengths = read(text).unwrap();
        let length = |line, ids: [&str; 2], length_mm, limit_mm| KnownLength {
            line,
            ids: ids.map(str::to_owned),
            length_mm,
            limit_mm,
        };
        let expected = [
            length(2, ["1", "a,b"], 100.5, Some(0.02)),
            length(4, ["2", "1"], 50.0, None),
        ];
        assert_eq!(lengths, expected);
        assert_eq!(
            read("id_a,id_b,length_mm\n1,2,3\n").unwrap()[0].limit_mm,
            None
        );
    }

    #[test]
    fn what_is_no_length_is_named_with_its_line() {
        let rows = |rows: &str| format!("id_a,id_b,length_mm,limit_mm\n1,2,10,\n{rows}\n");
        for (text, reason) in [
            (String::new(), "l.csv:1: the header is \"\""),
            ("a,b,length\n".to_owned(), "l.csv:1: the header"),
            ("id_a,id_b,length_mm\n".to_owned(), "l.csv: has no length"),
            (rows("1,3,10"), "l.csv:3: has 3 fields, the header has 4"),
            (rows("3,3,10,"), "l.csv:3: both ends are \"3\""),
            (
                rows("2,1,10,"),
                "l.csv:3: the length from \"2\" to \"1\" stands in line 2",
            ),
            (rows("1,3,-10,"), "l.csv:3: length_mm is \"-10\""),
            (rows("1,3,0,"), "l.csv:3: length_mm is \"0\""),
            (rows("1,3,nan,"), "l.csv:3: length_mm is \"nan\""),
            (rows("1,3,10,x"), "l.csv:3: limit_mm is \"x\""),
            (
                rows("\n1,3,10,\n3,1,9,"),
                "l.csv:5: the length from \"3\" to \"1\" stands in line 4",
            ),
            (rows("1,3,10,-1"), "l.csv:3: limit_mm is \"-1\""),
        ] {
            let error = read(&text).unwrap_err();
            assert!(error.to_string().contains(reason), "{text}: {error}");
            assert!(error.remedy().is_some());
        }
    }
}
