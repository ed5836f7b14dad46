//! Corners in `.vnl`, as mrgingham and mrcal write them: a line a corner, `filename x y level`, row by row of the board.
//!
//! Quirks. The legend is not read by mrcal, and not here: the first three columns count, and the fourth as its level of detection, which is not a
//! standard deviation and is left out. `- -` in place of x and y is a corner that was not found; an image with one such line has no board.
//! Any other number of lines than the board's corners is an error. mrcal takes x or y below 0 for missing though the sensor begins at -0.5;
//! here they are kept. The board's size is nowhere, nor which image is of which camera and pose: both are asked. A pose is what the patterns' stars stand for.
//! The center of the top-left pixel is (0, 0).

use super::CornerRow;
use crate::read::Problem;
use calib_rays::geometry::PixelPoint;

/// A camera's images.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Images {
    /// The camera's name.
    pub camera: String,
    /// A pattern with one star.
    pub pattern: String,
}

impl Images {
    /// From `left=left-*.jpg`.
    ///
    /// # Errors
    /// In words.
    pub fn parse(text: &str) -> Result<Self, String> {
        let parts = text.split_once('=').filter(|(name, _)| !name.is_empty());
        let (camera, pattern) = parts.ok_or("give NAME=PATTERN, such as left=left-*.png")?;
        if pattern.matches('*').count() != 1 {
            return Err(format!("\"{pattern}\" has not one *"));
        }
        Ok(Self {
            camera: camera.to_owned(),
            pattern: pattern.to_owned(),
        })
    }

    /// What the star stands for.
    fn star<'a>(&self, file: &'a str) -> Option<&'a str> {
        let name = file.rsplit('/').next().unwrap_or(file);
        let (before, behind) = self.pattern.split_once('*')?;
        [file, name]
            .into_iter()
            .find_map(|name| name.strip_prefix(before)?.strip_suffix(behind))
    }
}

/// The corners, poses numbered from 0 in the order of what the stars stand for (numbers by value). `grid` are the board's rows and columns.
///
/// # Errors
/// [`Problem`] with the line.
pub fn corners(
    text: &str,
    grid: Option<[usize; 2]>,
    images: &[Images],
) -> Result<Vec<CornerRow>, Problem> {
    let [rows, cols] = grid.ok_or(Problem::NeedsGrid)?;
    if images.is_empty() {
        return Err(Problem::NeedsImages);
    }
    let mut groups: Vec<Group> = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let line_number = number + 1;
        let words: Vec<&str> = line.split_whitespace().collect();
        if words.is_empty() || words[0].starts_with('#') {
            continue;
        }
        let refused = |message: String| Problem::Syntax {
            line: line_number,
            message,
        };
        let [file, x, y, ..] = words[..] else {
            return Err(refused("a corner is filename, x, y".to_owned()));
        };
        let seen = if x == "-" || y == "-" {
            None
        } else {
            let number = |word: &str| {
                let value = word.parse::<f64>().ok().filter(|value| value.is_finite());
                value.ok_or_else(|| refused(format!("\"{word}\" is no finite number")))
            };
            Some(PixelPoint::new(number(x)?, number(y)?))
        };
        match groups.iter_mut().find(|group| group.file == file) {
            Some(group) => group.corners.push(seen),
            None => groups.push(Group {
                file,
                line: line_number,
                corners: vec![seen],
            }),
        }
    }
    let mut found: Vec<(&str, &str, Vec<Option<PixelPoint>>)> = Vec::new();
    for group in groups {
        if let [None] = group.corners[..] {
            continue;
        }
        let refused = |message: String| Problem::Syntax {
            line: group.line,
            message,
        };
        if group.corners.len() != rows * cols {
            return Err(refused(format!(
                "\"{}\" has {} corners, a board of {rows} x {cols} has {}",
                group.file,
                group.corners.len(),
                rows * cols
            )));
        }
        let star = images
            .iter()
            .find_map(|of| Some((of, of.star(group.file)?)));
        let (of, star) = star.ok_or_else(|| {
            refused(format!(
                "\"{}\" is an image of no camera of --images",
                group.file
            ))
        })?;
        found.push((&of.camera, star, group.corners));
    }
    let mut stars: Vec<&str> = found.iter().map(|(_, star, _)| *star).collect();
    stars.sort_by_key(|star| (star.parse::<u64>().unwrap_or(u64::MAX), *star));
    stars.dedup();
    let mut all = Vec::new();
    for (camera, star, seen) in found {
        let pose = stars.iter().position(|other| *other == star).unwrap_or(0);
        for (index, pixel) in seen.into_iter().enumerate() {
            let Some(pixel) = pixel else { continue };
            all.push(CornerRow {
                camera: camera.to_owned(),
                pose,
                row: index / cols,
                col: index % cols,
                pixel,
                sigma_px: None,
            });
        }
    }
    if all.is_empty() {
        return Err(Problem::NoCorners);
    }
    Ok(all)
}

/// The lines of one image.
struct Group<'a> {
    file: &'a str,
    line: usize,
    corners: Vec<Option<PixelPoint>>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_without_a_board_and_corners_not_found_are_left_out() {
        let images = ["left=left-*.jpg", "right=r*.jpg"].map(|text| Images::parse(text).unwrap());
        let text = "# filename x y level\na/left-10.jpg 1 2 0\na/left-10.jpg - - -\nleft-9.jpg -0.25 3 0\nleft-9.jpg 5 6 1\nr9.jpg - - -\n";
        let rows = corners(text, Some([1, 2]), &images).unwrap();
        let seen: Vec<_> = rows
            .iter()
            .map(|row| (row.pose, row.col, row.pixel.u))
            .collect();
        assert_eq!(seen, [(1, 0, 1.0), (0, 0, -0.25), (0, 1, 5.0)]);
        assert!(matches!(
            corners(text, Some([2, 2]), &images),
            Err(Problem::Syntax { line: 2, .. })
        ));
        assert_eq!(corners(text, None, &images), Err(Problem::NeedsGrid));
        assert_eq!(corners(text, Some([1, 2]), &[]), Err(Problem::NeedsImages));
        let other = corners("x.jpg 1 2\nx.jpg 1 2\n", Some([1, 2]), &images).unwrap_err();
        assert!(other.to_string().contains("no camera"), "{other}");
        assert!(Images::parse("left").is_err() && Images::parse("left=a").is_err());
    }
}
