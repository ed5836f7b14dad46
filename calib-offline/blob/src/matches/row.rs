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

/// The id of the row at the start of `text` and what follows the row's line, if the row is a plain one: an id without
/// quotes and the pixels of all cameras, digits alone. What any other row means, and what is wrong with it, [`parse`]
/// says; of a plain one it says the same.
#[inline]
pub(super) fn parse_plain<'a, N: Number>(
    text: &'a str,
    columns: &Columns,
    sightings: &mut Vec<Sighting<N>>,
) -> Option<(&'a str, &'a str)> {
    sightings.clear();
    let is_end = |b: &u8| matches!(b, b',' | b'\n' | b'"');
    let id_end = text.as_bytes().iter().position(is_end)?;
    let (id, mut rest) = text.split_at(id_end);
    for &camera_idx in &columns.camera_idx {
        let (u, behind) = leading(rest.strip_prefix(',')?)?;
        let (v, behind) = leading(behind.strip_prefix(',')?)?;
        sightings.push((camera_idx, [u, v]));
        rest = behind;
    }
    let behind = rest.strip_prefix('\r').unwrap_or(rest);
    match behind.strip_prefix('\n') {
        Some(behind) => Some((id, behind)),
        None => rest.is_empty().then_some((id, rest)),
    }
}

/// The number of digits alone, perhaps with a point and a sign, at the start of `text`, and what follows it.
#[inline]
fn leading<N: Number>(text: &str) -> Option<(N, &str)> {
    let is_plain = |b: &u8| matches!(b, b'0'..=b'9' | b'.' | b'-');
    let behind = text.as_bytes().iter().position(|b| !is_plain(b));
    let (number, rest) = text.split_at(behind.unwrap_or(text.len()));
    Some((number.parse().ok()?, rest))
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
            let mut numbers = Numbers::default();
            let [x, y, z] = found.point_mm;
            for value in [x, y, z, found.gap_mm] {
                numbers.add(value);
            }
            match found.sigma_mm {
                None => numbers.add_text(b",,,"),
                Some(sigma_mm) => sigma_mm.into_iter().for_each(|value| numbers.add(value)),
            }
            numbers.add_text(b",ok\n");
            out.extend_from_slice(numbers.text());
        }
        Err(status) => {
            out.extend_from_slice(b",,,,,,,,");
            out.extend_from_slice(status.word().as_bytes());
            out.push(b'\n');
        }
    }
}

/// Longest number of 64 bits, with its comma.
const LONGEST: usize = 25;

/// What follows the id of a row: seven numbers and a word.
struct Numbers {
    bytes: [u8; 8 * LONGEST],
    len: usize,
}

impl Default for Numbers {
    fn default() -> Self {
        Self {
            bytes: [0; 8 * LONGEST],
            len: 0,
        }
    }
}

impl Numbers {
    /// Appends a comma and the number with the fewest digits that read back to the same bits.
    #[inline]
    fn add<N: Number>(&mut self, value: N) {
        let mut buffer = zmij::Buffer::new();
        let text = buffer.format(value).as_bytes();
        let place = &mut self.bytes[self.len..][..LONGEST];
        place[0] = b',';
        // Two pieces of a fixed length, which may overlap, cost less than a call that copies any number of bytes.
        match (text.first_chunk::<8>(), text.last_chunk::<8>()) {
            (Some(first), Some(last)) if text.len() <= 16 => {
                place[1..9].copy_from_slice(first);
                place[text.len() - 7..][..8].copy_from_slice(last);
            }
            _ => place[1..=text.len()].copy_from_slice(text),
        }
        self.len += 1 + text.len();
    }

    #[inline]
    fn add_text<const LENGTH: usize>(&mut self, text: &[u8; LENGTH]) {
        self.bytes[self.len..][..LENGTH].copy_from_slice(text);
        self.len += LENGTH;
    }

    fn text(&self) -> &[u8] {
        &self.bytes[..self.len]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_numbers_have_room() {
        let longest = f64::from_bits(0x8000_0000_0000_0001 | 1 << 52);
        assert!(zmij::Buffer::new().format(longest).len() >= 23);
        for value in [longest, 0.0, -1.5, 123_456.789_012_345, 1e300] {
            let point = Point {
                point_mm: [value; 3],
                gap_mm: value,
                sigma_mm: Some([value; 3]),
            };
            let mut out = Vec::new();
            write("a", &Ok(point), &mut out);
            let number = zmij::Buffer::new().format(value).to_owned();
            let expected = format!("a{},ok\n", format!(",{number}").repeat(7));
            assert_eq!(String::from_utf8(out), Ok(expected));
        }
    }

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
    fn plain_rows_are_read_as_any_other() {
        let columns = Columns {
            camera_idx: vec![1, 0],
        };
        let plain = |text: &'static str| {
            let mut sightings = Vec::<Sighting<f64>>::new();
            let found = parse_plain(text, &columns, &mut sightings)?;
            Some((found.0, sightings, found.1))
        };
        for (text, rest) in [
            ("7,1.5,2,3,-4.25", ""),
            ("7,1.5,2,3,-4.25\n", ""),
            ("7,1.5,2,3,-4.25\r\n8", "8"),
            ("weld \u{3b1},906.43353,0,12345678,1.\n\nx", "\nx"),
        ] {
            let line = text.lines().next().unwrap();
            let (id, sightings) = parse_two(line).unwrap();
            assert_eq!(plain(text), Some((id, sightings, rest)), "{text}");
        }
        // Left to others, whether right or wrong.
        for text in [
            "",
            "\n",
            "7",
            "\"7\",1,2,3,4",
            "7, 1,2,3,4",
            "7,1,2,,",
            "7,1e2,2,3,4",
            "7,1,2,3",
            "7,1,2,3,4,5",
            "7,1,2,3,4 \n",
            "7,1,2,3,4\r",
            "a\n7,1,2,3,4",
            "7,+1,2,3,4",
            "7,nan,2,3,4",
        ] {
            assert_eq!(plain(text), None, "{text:?}");
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
