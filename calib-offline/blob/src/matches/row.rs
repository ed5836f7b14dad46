//! One line of `MATCHES.csv` to one line of `POINTS.csv`, without allocating.

use super::error::{RowProblem, shortened};
use super::header::Columns;
use calib_rays::measure::{Number, Point, Sighting, Status};

/// The header of `POINTS.csv`.
pub const POINTS_HEADER: &str = "id,x,y,z,gap,sigma_x,sigma_y,sigma_z,status";

/// Reads a row into `sightings` (cleared first) and returns its id as it stands there.
pub(super) fn parse<'a, N: Number>(
    line: &'a str,
    columns: &Columns,
    sightings: &mut Vec<Sighting<N>>,
) -> Result<&'a str, RowProblem> {
    let (id, rest) = split_id(line)?;
    sightings.clear();
    let mut fields = rest.map(|rest| rest.split(',')).into_iter().flatten();
    for &camera_idx in &columns.camera_idx {
        let (Some(u), Some(v)) = (fields.next(), fields.next()) else {
            return Err(field_count(rest, columns));
        };
        let (u, v) = (u.trim(), v.trim());
        match (u.is_empty(), v.is_empty()) {
            (true, true) => {}
            (false, false) => sightings.push((camera_idx, [coordinate(u)?, coordinate(v)?])),
            _ => return Err(RowProblem::HalfPixel),
        }
    }
    if fields.next().is_some() {
        return Err(field_count(rest, columns));
    }
    match (sightings.len(), columns.camera_idx.len()) {
        (0, 1) => Err(RowProblem::NoPixel),
        (have @ (0 | 1), 2..) => Err(RowProblem::TooFewPixels { have }),
        _ => Ok(id),
    }
}

/// The id of a row, without the quotes that may protect it.
pub(super) fn id(line: &str) -> Result<String, RowProblem> {
    let (id, _) = split_id(line)?;
    let inner = id.strip_prefix('"').and_then(|id| id.strip_suffix('"'));
    Ok(inner.map_or_else(|| id.trim().to_owned(), |id| id.replace("\"\"", "\"")))
}

fn field_count(rest: Option<&str>, columns: &Columns) -> RowProblem {
    RowProblem::FieldCount {
        have: 1 + rest.map_or(0, |rest| rest.split(',').count()),
        need: columns.field_count(),
    }
}

/// The id, quotes included, and what follows its comma.
fn split_id(line: &str) -> Result<(&str, Option<&str>), RowProblem> {
    let end = if line.starts_with('"') {
        let bytes = line.as_bytes();
        let mut at = 1;
        loop {
            match bytes.get(at) {
                None => return Err(RowProblem::OpenQuote),
                // A doubled quote stands for one.
                Some(b'"') if bytes.get(at + 1) == Some(&b'"') => at += 2,
                Some(b'"') => break at + 1,
                Some(_) => at += 1,
            }
        }
    } else {
        line.find(',').unwrap_or(line.len())
    };
    let (id, rest) = line.split_at(end);
    match rest.strip_prefix(',') {
        Some(rest) => Ok((id, Some(rest))),
        None if rest.is_empty() => Ok((id, None)),
        None => Err(RowProblem::OpenQuote),
    }
}

fn coordinate<N: Number>(text: &str) -> Result<N, RowProblem> {
    match text.parse::<N>() {
        Ok(value) if value.is_finite() => Ok(value),
        Ok(_) => Err(RowProblem::NotFinite {
            text: shortened(text),
        }),
        Err(_) => Err(RowProblem::NotANumber {
            text: shortened(text),
        }),
    }
}

/// Appends the row of a match to `out`.
pub(super) fn write<N: Number>(id: &str, result: &Result<Point<N>, Status>, out: &mut Vec<u8>) {
    out.extend_from_slice(id.as_bytes());
    match result {
        Ok(found) => {
            let mut buffer = zmij::Buffer::new();
            let [x, y, z] = found.point_mm;
            for value in [x, y, z, found.gap_mm] {
                out.push(b',');
                out.extend_from_slice(buffer.format(value).as_bytes());
            }
            match found.sigma_mm {
                None => out.extend_from_slice(b",,,"),
                Some(sigma_mm) => {
                    for value in sigma_mm {
                        out.push(b',');
                        out.extend_from_slice(buffer.format(value).as_bytes());
                    }
                }
            }
            out.extend_from_slice(b",ok\n");
        }
        Err(status) => {
            out.extend_from_slice(b",,,,,,,,");
            out.extend_from_slice(status.word().as_bytes());
            out.push(b'\n');
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse_two(line: &str) -> Result<(&str, Vec<Sighting<f64>>), RowProblem> {
        let columns = Columns {
            camera_idx: vec![1, 0],
        };
        let mut sightings = vec![(9, [9.0, 9.0])];
        parse(line, &columns, &mut sightings).map(|id| (id, sightings))
    }

    #[test]
    fn ids_are_text_and_quotes_protect_commas() {
        let pixels = vec![(1, [1.5, 2.0]), (0, [3.0, -4.25])];
        for id in [
            "7",
            "",
            "00012",
            "weld \u{3b1}",
            "\"a,b\"",
            "\"say \"\"x\"\", y\"",
        ] {
            let line = format!("{id},1.5,2, 3.0 ,-4.25");
            assert_eq!(parse_two(&line), Ok((id, pixels.clone())), "{line}");
        }
    }

    #[test]
    fn malformed_rows_say_what_is_wrong() {
        let count = |have| Err(RowProblem::FieldCount { have, need: 5 });
        assert_eq!(parse_two("1"), count(1));
        assert_eq!(parse_two("1,2,3,4"), count(4));
        assert_eq!(parse_two("1,2,3,4,5,6"), count(6));
        assert_eq!(parse_two("\"1,2,3,4,5"), Err(RowProblem::OpenQuote));
        assert_eq!(parse_two("\"1\"x,2,3,4,5"), Err(RowProblem::OpenQuote));
        assert_eq!(parse_two("1,2,,4,5"), Err(RowProblem::HalfPixel));
        assert_eq!(
            parse_two("1,,,4,5"),
            Err(RowProblem::TooFewPixels { have: 1 })
        );
        for text in ["x", "1.2.3", "0x10"] {
            let problem = RowProblem::NotANumber {
                text: text.to_owned(),
            };
            assert_eq!(parse_two(&format!("1,2,{text},4,5")), Err(problem));
        }
        for text in ["nan", "inf", "-inf", "1e999"] {
            let problem = RowProblem::NotFinite {
                text: text.to_owned(),
            };
            assert_eq!(parse_two(&format!("1,2,3,4,{text}")), Err(problem));
        }
    }

    #[test]
    fn a_camera_that_did_not_see_the_point_is_left_out() {
        let columns = Columns {
            camera_idx: vec![0, 1, 2],
        };
        let mut sightings: Vec<Sighting<f32>> = Vec::new();
        assert_eq!(parse("a,1,2,,,5,6", &columns, &mut sightings), Ok("a"));
        assert_eq!(sightings, [(0, [1.0, 2.0]), (2, [5.0, 6.0])]);
    }
}
