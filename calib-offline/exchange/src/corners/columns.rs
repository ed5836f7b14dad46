//! Any table of values, by names of its columns.
//!
//! Quirks. What a table counts pixels from is nowhere in it, and is asked: the coordinates of the center of the top-left pixel. A corner is named by
//! row and column, or by one number that counts row by row, for which the board's columns are needed. A camera's or pose's
//! column may be left out where a value is said for all rows.

use super::CornerRow;
use crate::read::Problem;
use calib_rays::geometry::PixelPoint;

/// Where a value comes from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum From {
    /// A column by its name.
    Column(String),
    /// The same for all rows.
    Value(String),
}

/// Which column is what.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Columns {
    camera: From,
    pose: From,
    label: Label,
    u: String,
    v: String,
    sigma_px: Option<String>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
enum Label {
    RowCol(String, String),
    /// A number that counts row by row.
    Index(String),
}

impl Columns {
    /// From `camera=cam,pose=frame,row=r,col=c,u=x,v=y`; `index=id` instead of row and column; `camera:left` for a value that all rows have.
    ///
    /// # Errors
    /// What is missing, in words.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut given: Vec<(&str, From)> = Vec::new();
        for part in text.split(',').map(str::trim) {
            let (key, from) = if let Some((key, column)) = part.split_once('=') {
                (key, From::Column(column.to_owned()))
            } else if let Some((key, value)) = part.split_once(':') {
                (key, From::Value(value.to_owned()))
            } else {
                return Err(format!("\"{part}\" is neither KEY=COLUMN nor KEY:VALUE"));
            };
            let keys = [
                "camera", "pose", "row", "col", "index", "u", "v", "sigma_px",
            ];
            if !keys.contains(&key) {
                return Err(format!("\"{key}\" is none of {}", keys.join(", ")));
            }
            if given.iter().any(|(other, _)| *other == key) {
                return Err(format!("\"{key}\" is given twice"));
            }
            given.push((key, from));
        }
        let find = |key: &str| {
            let found = given.iter().find(|(other, _)| *other == key);
            found.map(|(_, from)| from.clone())
        };
        let need = |key: &str| find(key).ok_or_else(|| format!("\"{key}\" is missing"));
        let column = |key: &str| match need(key)? {
            From::Column(name) => Ok(name),
            From::Value(_) => Err(format!("\"{key}\" cannot be the same for all rows")),
        };
        let label = match find("index") {
            Some(_) if find("row").is_some() || find("col").is_some() => {
                return Err("give row and col, or index".to_owned());
            }
            Some(_) => Label::Index(column("index")?),
            None => Label::RowCol(column("row")?, column("col")?),
        };
        Ok(Self {
            camera: need("camera")?,
            pose: need("pose")?,
            label,
            u: column("u")?,
            v: column("v")?,
            sigma_px: find("sigma_px").map(|_| column("sigma_px")).transpose()?,
        })
    }
}

/// The corners of a table. `first_pixel` are the coordinates that it gives the center of the top-left pixel, both the same; `cols` are those of the
/// board, needed for an index.
///
/// # Errors
/// [`Problem`] with the line or the column.
pub fn corners(
    text: &str,
    columns: &Columns,
    first_pixel: Option<f64>,
    cols: Option<usize>,
) -> Result<Vec<CornerRow>, Problem> {
    let first_pixel = first_pixel.ok_or(Problem::NeedsPixelOrigin)?;
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_reader(text.trim_start_matches('\u{feff}').as_bytes());
    let refused = |error: &csv::Error| Problem::Syntax {
        line: error.position().map_or(1, |place| place.line() as usize),
        message: error.to_string(),
    };
    let header = reader.headers().map_err(|error| refused(&error))?.clone();
    let place = |name: &String| {
        let found = header.iter().position(|other| other == name);
        found.ok_or_else(|| Problem::Missing { key: name.clone() })
    };
    let source = |from: &From| match from {
        From::Column(name) => Ok(Source::Place(place(name)?)),
        From::Value(value) => Ok(Source::Value(value.clone())),
    };
    let (camera, pose) = (source(&columns.camera)?, source(&columns.pose)?);
    let label = match &columns.label {
        Label::RowCol(row, col) => Places::RowCol(place(row)?, place(col)?),
        Label::Index(index) => Places::Index(
            place(index)?,
            cols.filter(|cols| *cols > 0).ok_or(Problem::NeedsGrid)?,
        ),
    };
    let (u, v) = (place(&columns.u)?, place(&columns.v)?);
    let sigma_px = columns.sigma_px.as_ref().map(place).transpose()?;
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|error| refused(&error))?;
        let line = record.position().map_or(1, |place| place.line() as usize);
        let cell = |place: usize| record.get(place).unwrap_or_default();
        let wrong = |place: usize, wanted: &str| Problem::Syntax {
            line,
            message: format!(
                "column \"{}\" is \"{}\", not {wanted}",
                &header[place],
                cell(place)
            ),
        };
        let whole = |place: usize| {
            let text = cell(place);
            // Some tables write 3.0 for a count.
            let text = text.strip_suffix(".0").unwrap_or(text);
            text.parse::<usize>()
                .map_err(|_| wrong(place, "a whole number from 0 on"))
        };
        let number = |place: usize| {
            let value = cell(place)
                .parse::<f64>()
                .ok()
                .filter(|value| value.is_finite());
            value.ok_or_else(|| wrong(place, "a finite number"))
        };
        let (row, col) = match label {
            Places::RowCol(row, col) => (whole(row)?, whole(col)?),
            Places::Index(place, cols) => {
                let index = whole(place)?;
                (index / cols, index % cols)
            }
        };
        rows.push(CornerRow {
            camera: match &camera {
                Source::Place(place) => cell(*place).to_owned(),
                Source::Value(value) => value.clone(),
            },
            pose: match &pose {
                Source::Place(place) => whole(*place)?,
                Source::Value(value) => value.parse().map_err(|_| Problem::Syntax {
                    line: 1,
                    message: format!("the pose \"{value}\" is no whole number"),
                })?,
            },
            row,
            col,
            pixel: PixelPoint::new(number(u)? - first_pixel, number(v)? - first_pixel),
            sigma_px: sigma_px.map(number).transpose()?,
        });
    }
    if rows.is_empty() {
        return Err(Problem::NoCorners);
    }
    Ok(rows)
}

enum Source {
    Place(usize),
    Value(String),
}

#[derive(Clone, Copy)]
enum Places {
    RowCol(usize, usize),
    Index(usize, usize),
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::corners::to_csv;

    #[test]
    fn columns_are_found_by_name_and_pixels_moved() {
        let columns = Columns::parse("camera=cam,pose=frame,index=id,u=x,v=y").unwrap();
        let text = "frame,cam,id,x,y\n3,left,13,101.5,20.25\n";
        let rows = corners(text, &columns, Some(0.5), Some(9)).unwrap();
        assert_eq!(
            to_csv(&rows),
            "camera,pose,row,col,u,v\nleft,3,1,4,101,19.75\n"
        );
        assert_eq!(
            corners(text, &columns, None, Some(9)),
            Err(Problem::NeedsPixelOrigin)
        );
        assert_eq!(
            corners(text, &columns, Some(0.0), None),
            Err(Problem::NeedsGrid)
        );
        let missing = Columns::parse("camera:left,pose=frame,row=r,col=id,u=x,v=y").unwrap();
        let key = "r".to_owned();
        assert_eq!(
            corners(text, &missing, Some(0.0), None),
            Err(Problem::Missing { key })
        );
        let nan = corners(
            "frame,cam,id,x,y\n3,left,13,nan,20\n",
            &columns,
            Some(0.0),
            Some(9),
        );
        assert!(
            matches!(nan, Err(Problem::Syntax { line: 2, .. })),
            "{nan:?}"
        );
        for bad in [
            "",
            "camera=c",
            "camera=c,pose=p,row=r,col=c,u=x,v=y,w=1",
            "camera=c,camera=d",
            "u:3",
        ] {
            assert!(Columns::parse(bad).is_err(), "{bad}");
        }
    }
}
