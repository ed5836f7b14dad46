use super::*;
use calib_rays::measure::{Point, Sighting};
use std::fmt::Write as _;

/// x and y are the sums of the pixels, z the number of cameras. Pixels below zero are outside.
struct Sums;

impl PointSource for Sums {
    type Number = f64;

    fn cameras(&self) -> Vec<String> {
        ["left", "right"].map(str::to_owned).into()
    }

    fn point(&self, sightings: &[Sighting<f64>]) -> Result<Point<f64>, Status> {
        let [u, v] = [0, 1].map(|k| sightings.iter().map(|(_, p)| p[k]).sum::<f64>());
        if u < 0.0 {
            return Err(Status::Outside);
        }
        Ok(Point {
            point_mm: [u, v, sightings.len() as f64],
            gap_mm: 0.5,
            sigma_mm: None,
        })
    }
}

fn measure(text: &[u8]) -> Result<(String, MeasureSummary), MatchesError> {
    let mut out = Vec::new();
    match measure_stream(&Sums, Path::new("m.csv"), &mut &*text, &mut out) {
        Ok(summary) => Ok((String::from_utf8(out).unwrap(), summary)),
        Err(StreamError::Matches(error)) => Err(error),
        Err(StreamError::Write(error)) => panic!("{error}"),
    }
}

const HEADER: &str = "id,u_left,v_left,u_right,v_right\n";

#[test]
fn every_row_has_one_row_in_its_place() {
    let text = format!("{HEADER}b,1,2,3,4\na,-9,2,3,4\n\r\na,0.1,0,0.2,0");
    let (out, summary) = measure(text.as_bytes()).unwrap();
    assert_eq!(
        out,
        format!(
            "{POINTS_HEADER}\nb,4.0,6.0,2.0,0.5,,,,ok\na,,,,,,,,outside\na,0.30000000000000004,0.0,2.0,0.5,,,,ok\n"
        )
    );
    assert_eq!(summary.matches, 3);
    assert_eq!((summary.ok, summary.outside), (2, 1));
    assert_eq!(summary.gap_rms_mm, Some(0.5));
}

#[test]
fn files_longer_than_a_block_keep_their_order() {
    // About 9 MB: more than two blocks, many pieces.
    let count = 400_000;
    let mut text = String::from(HEADER);
    for k in 0..count {
        let _ = writeln!(text, "row{k},{k},1,0.25,7");
    }
    assert!(text.len() > 2 * BLOCK_LEN);
    let (out, summary) = measure(text.as_bytes()).unwrap();
    assert_eq!(summary.matches, count);
    let mut lines = out.lines().skip(1);
    for k in 0..count {
        let expected = format!("row{k},{:?},8.0,2.0,0.5,,,,ok", k as f64 + 0.25);
        assert_eq!(lines.next(), Some(expected.as_str()));
    }
    assert_eq!(lines.next(), None);
}

#[test]
fn a_wrong_row_is_named_by_its_line_wherever_it_stands() {
    for wrong in [2, 3, 200_000, 399_999] {
        let mut text = String::from(HEADER);
        for line in 2..400_001 {
            let v = if line == wrong { "x" } else { "1" };
            let _ = writeln!(text, "{line},{line}.5,{v},0.25,7");
        }
        let error = measure(text.as_bytes()).unwrap_err();
        assert!(
            error.to_string().starts_with(&format!("m.csv:{wrong}: ")),
            "{error}"
        );
    }
}

#[test]
fn bytes_that_are_no_text_are_named_by_their_line() {
    let mut text = format!("{HEADER}1,1,1,1,1\n").into_bytes();
    text.extend_from_slice(b"\xff,1,1,1,1\n2,x,1,1,1\n");
    let error = measure(&text).unwrap_err();
    assert_eq!(error.to_string(), "m.csv:3: is not text (no UTF-8)");
    // A wrong row before them comes first.
    let mut text = format!("{HEADER}1,x,1,1,1\n").into_bytes();
    text.push(0xff);
    assert!(
        measure(&text)
            .unwrap_err()
            .to_string()
            .starts_with("m.csv:2: \"x\"")
    );
}

#[test]
fn a_header_alone_is_no_error_and_nothing_at_all_is() {
    let (out, summary) = measure(HEADER.as_bytes()).unwrap();
    assert_eq!(out, format!("{POINTS_HEADER}\n"));
    assert_eq!(summary, MeasureSummary::default());
    for text in ["", "\n", "\u{feff}"] {
        let error = measure(text.as_bytes()).unwrap_err();
        assert!(matches!(error, MatchesError::Empty { .. }), "{text:?}");
        assert!(error.to_string().contains(HEADER.trim()));
    }
}

#[test]
fn a_wrong_header_shows_the_right_one() {
    let error = measure(b"id;u_left;v_left\n").unwrap_err();
    assert!(error.to_string().contains(HEADER.trim()));
    assert!(error.remedy().unwrap().contains("commas"));
}
