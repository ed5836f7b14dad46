//! Points as PLY, from the table that `measure` writes.
//!
//! Quirks. Binary, little-endian, doubles: text would lose digits in some readers. `x y z` are mm in the table's frame; `gap` and `sigma_x sigma_y
//! sigma_z` are further properties, which readers that do not know them pass over. A table in which any point has no sigma gives none. Rows whose status is not
//! `ok` have no point and are left out. Lost: the ids, and the rows that are left out.

use calib_rays::remedy::Remedy;
use std::path::{Path, PathBuf};

/// How a file begins.
pub const START: &[u8] = b"ply\n";
const HEADER: [&str; 9] = [
    "id", "x", "y", "z", "gap", "sigma_x", "sigma_y", "sigma_z", "status",
];
/// Of the columns: x, y, z and gap; sigma.
const POINT: [usize; 4] = [1, 2, 3, 4];
const SIGMA: [usize; 3] = [5, 6, 7];
const STATUS: usize = 8;

/// Why a table of points was not accepted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PointsError {
    /// The system refused to read it.
    #[error("{}: cannot be read", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Not such a table.
    #[error("{}: the header is \"{found}\", it must be \"{}\"", file.display(), HEADER.join(","))]
    Header {
        /// The file.
        file: PathBuf,
        /// Its header.
        found: String,
    },
    /// A row that is none.
    #[error("{}:{line}: {what}", file.display())]
    Row {
        /// The file.
        file: PathBuf,
        /// From 1.
        line: u64,
        /// What is wrong.
        what: String,
    },
    /// A table without points.
    #[error("{}: has no point whose status is ok", file.display())]
    Empty {
        /// The file.
        file: PathBuf,
    },
}

impl Remedy for PointsError {
    fn remedy(&self) -> Option<String> {
        let text = match self {
            Self::Read { .. } => "check the path",
            Self::Header { .. } => {
                "--format ply takes the points.csv that calib-offline measure writes"
            }
            Self::Row { .. } => "correct the row, or measure again",
            Self::Empty { .. } => "look at the column status: it says what each match lacks",
        };
        Some(text.to_owned())
    }
}

/// Points as PLY.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cloud {
    /// The file.
    pub bytes: Vec<u8>,
    /// Its points.
    pub count: usize,
    /// Rows that have none.
    pub left_out: usize,
    /// Whether it says how uncertain they are.
    pub has_sigma: bool,
}

/// Makes a cloud of a table.
///
/// # Errors
/// [`PointsError`].
pub fn read(file: &Path) -> Result<Cloud, PointsError> {
    let table = std::fs::read(file).map_err(|source| PointsError::Read {
        file: file.to_owned(),
        source,
    })?;
    cloud(file, &table)
}

/// Of a table's bytes; `file` is for messages.
fn cloud(file: &Path, table: &[u8]) -> Result<Cloud, PointsError> {
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .from_reader(table);
    let broken = |line: u64, what: String| PointsError::Row {
        file: file.to_owned(),
        line,
        what,
    };
    let mut record = csv::StringRecord::new();
    let mut next = |record: &mut csv::StringRecord| {
        reader.read_record(record).map_err(|error| {
            let line = error.position().map_or(1, csv::Position::line);
            broken(line, "is no row of text".to_owned())
        })
    };
    next(&mut record)?;
    if record.iter().ne(HEADER) {
        let found = record.iter().collect::<Vec<_>>().join(",");
        return Err(PointsError::Header {
            file: file.to_owned(),
            found: found.chars().take(80).collect(),
        });
    }
    let (mut points, mut sigmas, mut left_out): (Vec<[f64; 4]>, Vec<[f64; 3]>, _) =
        (Vec::new(), Vec::new(), 0);
    while next(&mut record)? {
        let line = record.position().map_or(0, csv::Position::line);
        if record.len() != HEADER.len() {
            let what = format!("has {} fields, {} are needed", record.len(), HEADER.len());
            return Err(broken(line, what));
        }
        if &record[STATUS] != "ok" {
            left_out += 1;
            continue;
        }
        let number = |column: usize| {
            let value = record[column]
                .trim()
                .parse::<f64>()
                .ok()
                .filter(|value| value.is_finite());
            value.ok_or_else(|| {
                let text: String = record[column].chars().take(40).collect();
                broken(
                    line,
                    format!("{} is \"{text}\", and no number", HEADER[column]),
                )
            })
        };
        let [x, y, z, gap] = POINT.map(number);
        points.push([x?, y?, z?, gap?]);
        if SIGMA.iter().all(|column| !record[*column].is_empty()) {
            let [x, y, z] = SIGMA.map(number);
            sigmas.push([x?, y?, z?]);
        }
    }
    if points.is_empty() {
        return Err(PointsError::Empty {
            file: file.to_owned(),
        });
    }
    let has_sigma = sigmas.len() == points.len();
    Ok(Cloud {
        bytes: bytes(&points, has_sigma.then_some(&sigmas[..])),
        count: points.len(),
        left_out,
        has_sigma,
    })
}

fn bytes(points: &[[f64; 4]], sigmas: Option<&[[f64; 3]]>) -> Vec<u8> {
    let own = if sigmas.is_some() { 8 } else { 5 };
    let mut header = format!(
        "ply\nformat binary_little_endian 1.0\ncomment mm, in the frame of the table\nelement vertex {}\n",
        points.len()
    );
    for name in &HEADER[1..own] {
        for part in ["property double ", name, "\n"] {
            header += part;
        }
    }
    header += "end_header\n";
    let mut bytes = header.into_bytes();
    for (k, point) in points.iter().enumerate() {
        let sigma = sigmas.map_or(&[][..], |sigmas| &sigmas[k]);
        bytes.extend(
            point
                .iter()
                .chain(sigma)
                .flat_map(|value| value.to_le_bytes()),
        );
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(rows: &str) -> Result<Cloud, PointsError> {
        cloud(
            Path::new("points.csv"),
            format!("{}\n{rows}", HEADER.join(",")).as_bytes(),
        )
    }

    #[test]
    fn a_cloud_has_the_bits_of_the_table() {
        let found =
            of("a,0.1,2,-3e-7,0.5,0.01,0.02,0.03,ok\nb,,,,,,,,outside\n\"c,d\",1,1,1,0,1,1,1,ok\n")
                .unwrap();
        assert_eq!((found.count, found.left_out, found.has_sigma), (2, 1, true));
        let text = "ply\nformat binary_little_endian 1.0\ncomment mm, in the frame of the table\nelement vertex 2\n\
            property double x\nproperty double y\nproperty double z\nproperty double gap\nproperty double sigma_x\n\
            property double sigma_y\nproperty double sigma_z\nend_header\n";
        let (head, body) = found.bytes.split_at(text.len());
        assert_eq!(head, text.as_bytes());
        let numbers: Vec<f64> = body
            .chunks_exact(8)
            .map(|b| f64::from_le_bytes(b.try_into().unwrap()))
            .collect();
        assert_eq!(numbers[..7], [0.1, 2.0, -3e-7, 0.5, 0.01, 0.02, 0.03]);
        assert_eq!(numbers.len(), 14);
    }

    #[test]
    fn one_point_without_sigma_leaves_it_out_of_all() {
        let found = of("a,1,2,3,0,,,,ok\nb,1,2,3,0,1,1,1,ok\n").unwrap();
        assert!(!found.has_sigma);
        let end = b"end_header\n";
        let head = found
            .bytes
            .windows(end.len())
            .position(|window| window == end)
            .unwrap();
        assert_eq!(found.bytes.len() - head - end.len(), 2 * 4 * 8);
    }

    #[test]
    fn what_is_no_table_of_points_is_refused() {
        for (rows, says) in [
            ("a,1,2,3,0,,,ok\n", ":2: has 8 fields"),
            ("a,1,x,3,0,,,,ok\n", ":2: y is \"x\""),
            ("a,1,2,NaN,0,,,,ok\n", "z is \"NaN\""),
            ("a,1,2,3,0,1,inf,1,ok\n", "sigma_y is \"inf\""),
            ("a,,,,,,,,parallel\n", "no point"),
            ("", "no point"),
        ] {
            let error = of(rows).unwrap_err();
            assert!(error.to_string().contains(says), "{error}");
            assert!(error.remedy().is_some());
        }
        for table in [&b""[..], b"id,u,v\n", b"\xff\xfe,x\n"] {
            assert!(cloud(Path::new("points.csv"), table).is_err());
        }
    }
}
