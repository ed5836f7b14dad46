//! A file of matches that is short enough to be held in memory.

use super::error::MatchesError;
use super::row;
use super::stream::parse_header;
use calib_rays::measure::{Number, Sighting};
use std::path::Path;

/// Reads all matches, one list of sightings each, in the file's order.
///
/// # Errors
/// [`MatchesError`] with file and line.
pub fn read_matches<N: Number>(
    file: &Path,
    cameras: &[String],
) -> Result<Vec<Vec<Sighting<N>>>, MatchesError> {
    let bytes = std::fs::read(file).map_err(|source| MatchesError::Read {
        file: file.to_owned(),
        source,
    })?;
    let text = String::from_utf8_lossy(&bytes);
    let mut lines = text.lines();
    let columns = parse_header(file, lines.next().unwrap_or("").as_bytes(), cameras)?;
    let mut matches = Vec::new();
    for (line, content) in lines.enumerate().filter(|(_, content)| !content.is_empty()) {
        let mut sightings = Vec::new();
        row::parse(content, &columns, &mut sightings).map_err(|problem| MatchesError::Row {
            file: file.to_owned(),
            line: line + 2,
            problem,
        })?;
        matches.push(sightings);
    }
    Ok(matches)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matches_are_read_in_order_and_a_bad_line_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.csv");
        let cameras = ["a".to_owned(), "b".to_owned()];
        std::fs::write(&path, "id,u_b,v_b,u_a,v_a\n7,1,2,3,4\n\n9,0.1,6,7,8\n").unwrap();
        let read = read_matches::<f32>(&path, &cameras).unwrap();
        assert_eq!(
            read,
            [
                vec![(1, [1.0, 2.0]), (0, [3.0, 4.0])],
                vec![(1, [0.1, 6.0]), (0, [7.0, 8.0])]
            ]
        );
        std::fs::write(&path, "id,u_b,v_b,u_a,v_a\n7,1,2,3,4\n9,x,6,7,8\n").unwrap();
        let error = read_matches::<f64>(&path, &cameras).unwrap_err();
        assert!(error.to_string().contains("m.csv:3: \"x\""), "{error}");
    }
}
