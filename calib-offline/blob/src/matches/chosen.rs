//! Some matches of a file, by their ids.

use super::error::MatchesError;
use super::row;
use super::stream::parse_header;
use calib_rays::measure::{Number, Sighting};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The matches with some ids (without the quotes that may protect them), each with its sightings. The rows of
/// others are not looked at beyond their id.
///
/// # Errors
/// [`MatchesError`] with file and line; [`MatchesError::IdTwice`] if two matches have one of these ids.
pub fn read_chosen<N: Number>(
    file: &Path,
    cameras: &[String],
    ids: &BTreeSet<&str>,
) -> Result<BTreeMap<String, Vec<Sighting<N>>>, MatchesError> {
    let bytes = std::fs::read(file).map_err(|source| MatchesError::Read {
        file: file.to_owned(),
        source,
    })?;
    let text = String::from_utf8_lossy(&bytes);
    let mut lines = text.lines();
    let columns = parse_header(file, lines.next().unwrap_or("").as_bytes(), cameras)?;
    let mut chosen: BTreeMap<String, (usize, Vec<Sighting<N>>)> = BTreeMap::new();
    for (k, content) in lines.enumerate().filter(|(_, content)| !content.is_empty()) {
        let line = k + 2;
        let row_error = |problem| MatchesError::Row {
            file: file.to_owned(),
            line,
            problem,
        };
        let id = row::id(content).map_err(row_error)?;
        if !ids.contains(id.as_str()) {
            continue;
        }
        let mut sightings = Vec::new();
        row::parse(content, &columns, &mut sightings).map_err(row_error)?;
        if let Some((first_line, _)) = chosen.get(&id) {
            return Err(MatchesError::IdTwice {
                file: file.to_owned(),
                line,
                first_line: *first_line,
                id,
            });
        }
        chosen.insert(id, (line, sightings));
    }
    Ok(chosen
        .into_iter()
        .map(|(id, (_, sightings))| (id, sightings))
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matches_are_found_by_id_and_an_id_twice_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.csv");
        let cameras = ["a".to_owned(), "b".to_owned()];
        let rows = "id,u_a,v_a,u_b,v_b\n\"x,\"\"1\"\"\",1,2,3,4\n7,5,6,7,8\n9,1,1,1,1\n9,1,1,1,1\n";
        std::fs::write(&path, rows).unwrap();
        let chosen =
            |ids: &[&str]| read_chosen::<f64>(&path, &cameras, &ids.iter().copied().collect());
        let found = chosen(&["x,\"1\"", "7", "none"]).unwrap();
        assert_eq!(found.len(), 2);
        assert_eq!(found["x,\"1\""], [(0, [1.0, 2.0]), (1, [3.0, 4.0])]);
        let error = chosen(&["9"]).unwrap_err().to_string();
        assert!(
            error.contains("m.csv:5: the id \"9\" stands in line 4"),
            "{error}"
        );
    }
}
