//! Every target described as every other one, and with each key wrong: no image may be used, and the right
//! line must be said. The images are rendered.

use calib_rays::geometry::PixelPoint;
use calib_rays::print::{
    AprilGrid, Artwork, Charuco, Circles, Codes, TagBorder, TagOrder, chessboard, rings,
};
use calib_rays::progress::Silent;
use calib_recording::dataset::{BoardKind, Dataset};
use calib_recording::detect::verdict::Outcome;
use calib_recording::detect::{DetectSettings, detect_dataset};
use calib_simulate::shots::{Shot, ShotSettings};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::Arc;

const CAMERA: &str =
    "\n[[camera]]\nname = \"cam\"\nwidth = 640\nheight = 480\nimages = \"*.pgm\"\n";
const DIRECTION: [(usize, usize); 4] = [(1, 2), (2, 4), (2, 5), (4, 1)];

/// A target as it is printed.
struct Printed {
    name: &'static str,
    /// Its `[board]`.
    board: &'static str,
    /// What must be said wherever it is described otherwise.
    line: &'static [&'static str],
    art: Artwork,
    /// Places of the points, mm.
    place_mm: Box<dyn Fn(usize, usize) -> [f64; 2]>,
    /// `[board]`s that are wrong in one key.
    wrong: &'static [&'static str],
}

fn square(row: usize, col: usize) -> [f64; 2] {
    [20.0 * col as f64, 20.0 * row as f64]
}

fn charuco(legacy: bool, first_id: usize) -> Artwork {
    let codes = Codes::named("DICT_4X4_100").unwrap();
    Charuco {
        rows: 5,
        cols: 7,
        square_mm: 20.0,
        marker_mm: 15.0,
        codes,
        legacy,
        first_id,
    }
    .artwork()
}

fn circles(rows: usize, cols: usize, asymmetric: bool, direction: &[(usize, usize)]) -> Circles {
    Circles {
        rows,
        cols,
        pitch_mm: if asymmetric { 14.0 } else { 20.0 },
        diameter_mm: 12.0,
        asymmetric,
        direction: direction.to_vec(),
    }
}

/// With and without dots.
fn chessboards() -> Vec<Printed> {
    vec![
        Printed {
            name: "chessboard",
            board: "kind = \"chessboard\"\nrows = 5\ncols = 8\nsquare_mm = 20",
            line: &["rows = 5, cols = 8"],
            art: chessboard::artwork((5, 8), [20.0; 2], &[]),
            place_mm: Box::new(square),
            wrong: &[
                "kind = \"chessboard\"\nrows = 6\ncols = 9\nsquare_mm = 20",
                "kind = \"chessboard\"\nrows = 4\ncols = 8\nsquare_mm = 20",
                "kind = \"chessboard\"\nrows = 5\ncols = 8\nsquare_mm = 20\nmarked = [[1, 2], [3, 3]]",
            ],
        },
        Printed {
            name: "marked chessboard",
            board: "kind = \"chessboard\"\nrows = 5\ncols = 7\nsquare_mm = 20\nmarked = [[0, 0], [2, 3], [3, 3]]",
            line: &["kind = \"chessboard\"", "rows = 5, cols = 7", "marked = "],
            art: chessboard::artwork((5, 7), [20.0; 2], &[(0, 0), (2, 3), (3, 3)]),
            place_mm: Box::new(square),
            wrong: &[],
        },
    ]
}

/// Of both patterns.
fn charucos() -> Vec<Printed> {
    vec![
        Printed {
            name: "charuco",
            board: "kind = \"charuco\"\nrows = 5\ncols = 7\nsquare_mm = 20\nmarker_mm = 15\ndictionary = \"DICT_4X4_100\"",
            line: &[
                "kind = \"charuco\", rows = 5, cols = 7, dictionary = \"DICT_4X4_50\", legacy = false",
            ],
            art: charuco(false, 0),
            place_mm: Box::new(square),
            wrong: &[
                "kind = \"charuco\"\nrows = 5\ncols = 7\nsquare_mm = 20\nmarker_mm = 15\ndictionary = \"DICT_4X4_100\"\nlegacy = true",
                "kind = \"charuco\"\nrows = 5\ncols = 7\nsquare_mm = 20\nmarker_mm = 15\ndictionary = \"DICT_4X4_100\"\nfirst_id = 1",
                "kind = \"charuco\"\nrows = 5\ncols = 7\nsquare_mm = 20\nmarker_mm = 15\ndictionary = \"DICT_4X4_100\"\nfirst_id = 8",
                "kind = \"charuco\"\nrows = 5\ncols = 7\nsquare_mm = 20\nmarker_mm = 15\ndictionary = \"DICT_5X5_100\"",
                "kind = \"charuco\"\nrows = 7\ncols = 7\nsquare_mm = 20\nmarker_mm = 15\ndictionary = \"DICT_4X4_100\"",
                "kind = \"charuco\"\nrows = 4\ncols = 7\nsquare_mm = 20\nmarker_mm = 15\ndictionary = \"DICT_4X4_100\"",
                "kind = \"charuco\"\nrows = 5\ncols = 9\nsquare_mm = 20\nmarker_mm = 15\ndictionary = \"DICT_4X4_100\"",
                "kind = \"charuco\"\nrows = 5\ncols = 6\nsquare_mm = 20\nmarker_mm = 15\ndictionary = \"DICT_4X4_100\"",
                "kind = \"chessboard\"\nrows = 5\ncols = 7\nsquare_mm = 20",
            ],
        },
        Printed {
            name: "charuco of the old pattern",
            board: "kind = \"charuco\"\nrows = 5\ncols = 7\nsquare_mm = 20\nmarker_mm = 15\ndictionary = \"DICT_4X4_100\"\nlegacy = true\nfirst_id = 3",
            line: &[
                "kind = \"charuco\", rows = 5, cols = 7, dictionary = \"DICT_4X4_50\", legacy = true, first_id = 3",
            ],
            art: charuco(true, 3),
            place_mm: Box::new(square),
            wrong: &[
                "kind = \"charuco\"\nrows = 5\ncols = 7\nsquare_mm = 20\nmarker_mm = 15\ndictionary = \"DICT_4X4_100\"\nfirst_id = 3",
                "kind = \"charuco\"\nrows = 5\ncols = 7\nsquare_mm = 20\nmarker_mm = 15\ndictionary = \"DICT_4X4_100\"\nlegacy = true",
            ],
        },
    ]
}

/// As `OpenCV` prints the tags.
fn tags() -> Vec<Printed> {
    let grid = AprilGrid {
        rows: 4,
        cols: 5,
        tag_mm: 24.0,
        spacing: 0.3,
        codes: Codes::named("DICT_APRILTAG_36h11").unwrap(),
        first_id: 0,
        border: TagBorder::One,
    };
    vec![Printed {
        name: "grid of tags",
        board: "kind = \"aprilgrid\"\nrows = 4\ncols = 5\ntag_mm = 24\nspacing = 0.3",
        line: &[
            "kind = \"aprilgrid\", rows = 4, cols = 5, family = \"36h11\", first_id = 0, spacing = 0.",
        ],
        art: grid.artwork(TagOrder::Upwards),
        place_mm: Box::new(move |row, col| grid.corner_mm(row, col)),
        wrong: &[
            "kind = \"aprilgrid\"\nrows = 4\ncols = 5\ntag_mm = 24\nspacing = 0.25",
            "kind = \"aprilgrid\"\nrows = 4\ncols = 5\ntag_mm = 24\nspacing = 0.32",
            "kind = \"aprilgrid\"\nrows = 4\ncols = 5\ntag_mm = 24\nspacing = 0.6",
            "kind = \"aprilgrid\"\nrows = 4\ncols = 5\ntag_mm = 24\nspacing = 0.3\nfirst_id = 1",
            "kind = \"aprilgrid\"\nrows = 4\ncols = 5\ntag_mm = 24\nspacing = 0.3\nfirst_id = 5",
            "kind = \"aprilgrid\"\nrows = 4\ncols = 5\ntag_mm = 24\nspacing = 0.3\nfamily = \"36h10\"",
            "kind = \"aprilgrid\"\nrows = 5\ncols = 5\ntag_mm = 24\nspacing = 0.3",
            "kind = \"aprilgrid\"\nrows = 3\ncols = 5\ntag_mm = 24\nspacing = 0.3",
            "kind = \"aprilgrid\"\nrows = 4\ncols = 6\ntag_mm = 24\nspacing = 0.3",
            "kind = \"aprilgrid\"\nrows = 5\ncols = 4\ntag_mm = 24\nspacing = 0.3",
            "kind = \"chessboard\"\nrows = 8\ncols = 10\nsquare_mm = 20",
            "kind = \"chessboard\"\nrows = 10\ncols = 12\nsquare_mm = 20",
        ],
    }]
}

/// Symmetric, asymmetric and marked.
fn grids_of_circles() -> Vec<Printed> {
    let (symmetric, asymmetric, marked) = (
        circles(6, 8, false, &[]),
        circles(9, 4, true, &[]),
        circles(6, 8, false, &DIRECTION),
    );
    vec![
        Printed {
            name: "circles",
            board: "kind = \"circles\"\nrows = 6\ncols = 8\npitch_mm = 20\ndiameter_mm = 12",
            line: &["kind = \"circles\", rows = 6, cols = 8, asymmetric = false"],
            art: symmetric.artwork(),
            place_mm: Box::new(move |row, col| symmetric.center_mm(row, col)),
            wrong: &[
                "kind = \"circles\"\nrows = 7\ncols = 8\npitch_mm = 20\ndiameter_mm = 12",
                "kind = \"circles\"\nrows = 5\ncols = 8\npitch_mm = 20\ndiameter_mm = 12",
                "kind = \"circles\"\nrows = 6\ncols = 7\npitch_mm = 20\ndiameter_mm = 12",
                "kind = \"circles\"\nrows = 6\ncols = 8\npitch_mm = 20\ndiameter_mm = 12\nasymmetric = true",
                "kind = \"circles\"\nrows = 6\ncols = 8\npitch_mm = 20\ndiameter_mm = 9",
                "kind = \"circles\"\nrows = 6\ncols = 8\npitch_mm = 20\ndiameter_mm = 6",
                "kind = \"circles\"\nrows = 6\ncols = 8\npitch_mm = 20\ndiameter_mm = 12\ndirection = [[1, 2], [2, 4]]",
            ],
        },
        Printed {
            name: "asymmetric circles",
            board: "kind = \"circles\"\nrows = 9\ncols = 4\npitch_mm = 14\ndiameter_mm = 12\nasymmetric = true",
            line: &["kind = \"circles\", rows = 9, cols = 4, asymmetric = true"],
            art: asymmetric.artwork(),
            place_mm: Box::new(move |row, col| asymmetric.center_mm(row, col)),
            wrong: &[
                "kind = \"circles\"\nrows = 11\ncols = 4\npitch_mm = 14\ndiameter_mm = 12\nasymmetric = true",
                "kind = \"circles\"\nrows = 9\ncols = 5\npitch_mm = 14\ndiameter_mm = 12\nasymmetric = true",
                "kind = \"circles\"\nrows = 9\ncols = 3\npitch_mm = 14\ndiameter_mm = 12\nasymmetric = true",
                "kind = \"circles\"\nrows = 9\ncols = 4\npitch_mm = 19.8\ndiameter_mm = 12",
                "kind = \"circles\"\nrows = 9\ncols = 4\npitch_mm = 14\ndiameter_mm = 12\nasymmetric = true\ndirection = [[1, 1], [3, 2]]",
            ],
        },
        Printed {
            name: "marked circles",
            board: "kind = \"circles\"\nrows = 6\ncols = 8\npitch_mm = 20\ndiameter_mm = 12\ndirection = [[1, 2], [2, 4], [2, 5], [4, 1]]",
            line: &["kind = \"circles\", rows = 6, cols = 8, asymmetric = false, direction = "],
            art: marked.artwork(),
            place_mm: Box::new(move |row, col| marked.center_mm(row, col)),
            wrong: &[
                "kind = \"circles\"\nrows = 6\ncols = 8\npitch_mm = 20\ndiameter_mm = 12",
                "kind = \"circles\"\nrows = 6\ncols = 8\npitch_mm = 20\ndiameter_mm = 12\ndirection = [[1, 2], [2, 4], [2, 5], [3, 1]]",
                "kind = \"circles\"\nrows = 6\ncols = 8\npitch_mm = 20\ndiameter_mm = 12\ndirection = [[1, 2], [2, 4]]",
                "kind = \"circles\"\nrows = 7\ncols = 8\npitch_mm = 20\ndiameter_mm = 12\ndirection = [[1, 2], [2, 4], [2, 5], [4, 1]]",
                "kind = \"circles\"\nrows = 5\ncols = 8\npitch_mm = 20\ndiameter_mm = 12\ndirection = [[1, 2], [2, 4], [2, 5], [4, 1]]",
            ],
        },
    ]
}

/// Some of them larger.
fn grids_of_rings() -> Vec<Printed> {
    vec![Printed {
        name: "rings",
        board: "kind = \"rings\"\nrows = 6\ncols = 8\npitch_mm = 20\nouter_radius_mm = 6.5\ndirection_outer_radius_mm = 8\ndirection = [[1, 2], [2, 4], [2, 5], [4, 1]]",
        line: &["kind = \"rings\", rows = 6, cols = 8, direction = "],
        art: rings::artwork((6, 8), 20.0, |row, col| {
            if DIRECTION.contains(&(row, col)) {
                8.0
            } else {
                6.5
            }
        }),
        place_mm: Box::new(square),
        wrong: &[
            "kind = \"rings\"\nrows = 7\ncols = 8\npitch_mm = 20\nouter_radius_mm = 6.5\ndirection_outer_radius_mm = 8\ndirection = [[1, 2], [2, 4], [2, 5], [4, 1]]",
            "kind = \"rings\"\nrows = 5\ncols = 8\npitch_mm = 20\nouter_radius_mm = 6.5\ndirection_outer_radius_mm = 8\ndirection = [[1, 2], [2, 4], [2, 5], [4, 1]]",
            "kind = \"rings\"\nrows = 6\ncols = 8\npitch_mm = 20\nouter_radius_mm = 6.5\ndirection_outer_radius_mm = 8\ndirection = [[1, 2], [2, 4], [3, 1]]",
        ],
    }]
}

fn printed() -> Vec<Printed> {
    let kinds = [
        chessboards(),
        charucos(),
        tags(),
        grids_of_circles(),
        grids_of_rings(),
    ];
    kinds.into_iter().flatten().collect()
}

/// Images of a target as a whole, and the pixels of its points.
fn photograph(
    folder: &Path,
    target: &Printed,
    from: u64,
    count: u64,
) -> Vec<BTreeMap<(usize, usize), PixelPoint>> {
    let settings = ShotSettings {
        sensor: calib_rays::geometry::SensorSize::new(640, 480),
        tilt_deg: (5.0, 30.0),
        blur_px: (0.6, 0.9),
        noise_levels: (1.0, 3.0),
        size: (0.65, 0.75),
        covered: 0.0,
        without: 0.0,
        ..ShotSettings::default()
    };
    let art = Arc::new(target.art.clone());
    let shots = (from..from + count).map(|seed| {
        let shot = Shot::draw(&settings, &art, seed);
        let mut bytes = b"P5\n640 480\n255\n".to_vec();
        bytes.extend(shot.image().to_u8());
        fs::write(folder.join(format!("{seed:02}.pgm")), bytes).unwrap();
        let labels = (0..20).flat_map(|row| (0..20).map(move |col| (row, col)));
        labels
            .filter_map(|(row, col)| {
                let pixel = shot.pixel((target.place_mm)(row, col))?;
                Some(((row, col), pixel))
            })
            .collect()
    });
    shots.collect()
}

#[test]
fn whatever_is_described_wrongly_is_refused_and_named() {
    let all = printed();
    let mut failed = Vec::new();
    for shown in &all {
        let home = tempfile::tempdir().unwrap();
        photograph(home.path(), shown, 100, 1);
        let of_others = all.iter().filter(|other| other.name != shown.name);
        let described = of_others
            .map(|other| other.board)
            .chain(shown.wrong.iter().copied());
        for board in described {
            let text = format!("[board]\n{board}\n{CAMERA}");
            fs::write(home.path().join("dataset.toml"), text).unwrap();
            let dataset = Dataset::load(home.path()).unwrap();
            let detected = match detect_dataset(&dataset, &DetectSettings::default(), &Silent) {
                Ok(detected) => detected,
                // A whole recording of another size.
                Err(error) => {
                    let said = format!("{error} {:?}", calib_rays::remedy::Remedy::remedy(&error));
                    if !shown.line.iter().all(|part| said.contains(part)) {
                        failed.push(format!("{} as {board}: {said}", shown.name));
                    }
                    continue;
                }
            };
            for image in &detected.images {
                let said = match &image.outcome {
                    Outcome::Refused(refusal) => refusal.to_string(),
                    Outcome::Used { corner_count, .. } => format!("USED, {corner_count} points"),
                };
                if !shown.line.iter().all(|part| said.contains(part)) {
                    let board = board.replace('\n', ", ");
                    failed.push(format!("{} as {board}:\n    {said}", shown.name));
                }
            }
        }
    }
    assert!(
        failed.is_empty(),
        "{}:\n{}",
        failed.len(),
        failed.join("\n")
    );
}

#[test]
fn what_is_described_rightly_is_found() {
    for shown in printed() {
        let home = tempfile::tempdir().unwrap();
        let truth = photograph(home.path(), &shown, 200, 2);
        let text = format!("[board]\n{}\n{CAMERA}", shown.board);
        fs::write(home.path().join("dataset.toml"), text).unwrap();
        let dataset = Dataset::load(home.path()).unwrap();
        let detected = detect_dataset(&dataset, &DetectSettings::default(), &Silent).unwrap();
        for image in &detected.images {
            if let Outcome::Refused(refusal) = &image.outcome {
                panic!("{}: {refusal}", shown.name);
            }
        }
        let (rows, cols) = (dataset.board.rows, dataset.board.cols);
        let turns = match &dataset.kind {
            // Either end may be counted from.
            BoardKind::Circles(circles) => circles.direction.is_empty() && !circles.asymmetric,
            _ => false,
        };
        for view in &detected.views {
            let truth = &truth[view.pose];
            let off = |turned: bool| {
                let worst = view.corners.iter().map(|c| {
                    let label = if turned {
                        (rows - 1 - c.row, cols - 1 - c.col)
                    } else {
                        (c.row, c.col)
                    };
                    truth[&label].distance_px(c.pixel)
                });
                worst.fold(0.0, f64::max)
            };
            let off = if turns {
                off(false).min(off(true))
            } else {
                off(false)
            };
            assert!(off < 0.5, "{}: {off} px", shown.name);
            assert!(10 * view.corners.len() >= 9 * rows * cols, "{}", shown.name);
        }
    }
}
