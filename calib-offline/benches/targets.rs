//! How near the points of each printed target come to the truth, how many are found, and whether any is
//! taken for another: beside `OpenCV` on the same images.
//!
//! `cargo bench -p calib-offline --bench targets -- [KIND...] [--images N] [--from K] [--threads N] [--ids]
//! [--opencv PYTHON]`. Images are
//! rendered (blur 0.5 to 2 px, noise 1 to 10 levels, tilts of 0 to 60 degrees, wide lenses with
//! barrel distortion, a fifth of them covered in part, a tenth without a target) and thrown away.
//! `--ids` takes smaller images (640 x 480), many of them in the time of one, to look for points taken for others
//! and for targets where there are none. `true/said` is the points' RMS against the standard deviations given with them.
//! With `--opencv`, `opencv_targets.py` looks at the same images. Both figures are over the points that
//! lie in view and are not covered; `both` is the RMS over the points that both found.

use calib_rays::board::BoardSpec;
use calib_rays::geometry::{PixelPoint, SensorSize};
use calib_rays::observed::Corner;
use calib_rays::print::{AprilGrid, Artwork, Charuco, Circles, Codes, TagBorder, TagOrder};
use calib_recording::dataset::BoardKind;
use calib_recording::dataset::image::GrayImage;
use calib_recording::detect::{DetectSettings, printed};
use calib_simulate::shots::{Shot, ShotSettings};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Points farther from the truth than this, px, are taken for another.
const WRONG_PX: f64 = 3.0;
/// Points this near to what covers them are not counted as missed, px.
const NEAR_COVER_PX: f64 = 30.0;
/// Images that are on disk at one time for `OpenCV`.
const CHUNK: u64 = 50;

struct Target {
    name: &'static str,
    kind: BoardKind,
    board: BoardSpec,
    art: Arc<Artwork>,
    points: Vec<((usize, usize), [f64; 2])>,
    /// What `OpenCV` is told.
    opencv: String,
    /// (rows, cols) of a grid that looks the same after a half turn: either numbering is right.
    half_turns: Option<(usize, usize)>,
}

fn grid(
    rows: usize,
    cols: usize,
    at: impl Fn(usize, usize) -> [f64; 2],
) -> Vec<((usize, usize), [f64; 2])> {
    let labels = (0..rows).flat_map(|row| (0..cols).map(move |col| (row, col)));
    labels
        .map(|(row, col)| ((row, col), at(row, col)))
        .collect()
}

fn charuco(name: &'static str, rows: usize, dictionary: &str, legacy: bool) -> Target {
    let codes = Codes::named(dictionary).expect("a dictionary");
    let board = Charuco {
        rows,
        cols: 10,
        square_mm: 20.0,
        marker_mm: 15.0,
        codes,
        legacy,
        first_id: 0,
    };
    Target {
        name,
        art: Arc::new(board.artwork()),
        points: grid(rows, 10, |row, col| [20.0 * col as f64, 20.0 * row as f64]),
        half_turns: None,
        board: BoardSpec::chessboard(rows, 10, 20.0),
        opencv: format!("charuco {rows} 10 20 15 {dictionary} {}", u8::from(legacy)),
        kind: BoardKind::Charuco(board),
    }
}

fn april_grid(name: &'static str, order: TagOrder) -> Target {
    let grid_of = AprilGrid {
        rows: 5,
        cols: 6,
        tag_mm: 30.0,
        spacing: 0.3,
        codes: Codes::named("DICT_APRILTAG_36h11").expect("a dictionary"),
        first_id: 0,
        border: TagBorder::One,
    };
    Target {
        name,
        art: Arc::new(grid_of.artwork(order)),
        points: grid(10, 12, |row, col| grid_of.corner_mm(row, col)),
        half_turns: None,
        board: BoardSpec::face(10, 12, |row, col| grid_of.corner_mm(row, col)),
        opencv: format!("aprilgrid 5 6 {}", u8::from(order == TagOrder::Upwards)),
        kind: BoardKind::AprilGrid(grid_of),
    }
}

fn circles(
    name: &'static str,
    rows: usize,
    cols: usize,
    asymmetric: bool,
    direction: &[(usize, usize)],
) -> Target {
    let circles = Circles {
        rows,
        cols,
        pitch_mm: if asymmetric { 14.0 } else { 20.0 },
        diameter_mm: 12.0,
        asymmetric,
        direction: direction.to_vec(),
    };
    Target {
        name,
        art: Arc::new(circles.artwork()),
        points: grid(rows, cols, |row, col| circles.center_mm(row, col)),
        half_turns: (!asymmetric && direction.is_empty()).then_some((rows, cols)),
        board: BoardSpec::face(rows, cols, |row, col| circles.center_mm(row, col)),
        opencv: format!("circles {rows} {cols} {}", u8::from(asymmetric)),
        kind: BoardKind::Circles(circles),
    }
}

fn targets() -> Vec<Target> {
    vec![
        charuco("charuco", 7, "DICT_4X4_100", false),
        charuco("charuco-legacy", 7, "DICT_5X5_100", true),
        april_grid("aprilgrid", TagOrder::Upwards),
        april_grid("aprilgrid-down", TagOrder::Downwards),
        circles("circles", 7, 10, false, &[]),
        circles("circles-asymmetric", 11, 4, true, &[]),
        circles(
            "circles-marked",
            7,
            10,
            false,
            &[(3, 4), (3, 5), (3, 6), (4, 4), (1, 2)],
        ),
    ]
}

/// The points by the label of the nearest truth: for a detector that numbers a grid in any of its ways.
fn by_nearest(shot: &Shot, target: &Target, found: Found) -> Found {
    if target.half_turns.is_none() {
        return found;
    }
    let truth: Vec<_> = target
        .points
        .iter()
        .filter_map(|(label, at_mm)| Some((*label, shot.pixel(*at_mm)?)))
        .collect();
    found
        .into_values()
        .filter_map(|pixel| {
            let away = |truth: &&((usize, usize), PixelPoint)| truth.1.distance_px(pixel.0);
            let nearest = truth.iter().min_by(|a, b| away(a).total_cmp(&away(b)))?;
            Some((nearest.0, pixel))
        })
        .collect()
}

/// The points numbered from the end that the truth is numbered from.
fn as_truth(shot: &Shot, target: &Target, found: Found) -> Found {
    let Some((rows, cols)) = target.half_turns else {
        return found;
    };
    let near = target.points.iter().filter(|(label, at_mm)| {
        let pixel = shot.pixel(*at_mm).zip(found.get(label));
        pixel.is_some_and(|(truth, pixel)| truth.distance_px(pixel.0) < WRONG_PX)
    });
    if 2 * near.count() >= found.len() {
        return found;
    }
    let turned = |((row, col), pixel)| ((rows - 1 - row, cols - 1 - col), pixel);
    found.into_iter().map(turned).collect()
}

/// Points by label, with the standard deviation that comes with them.
type Found = BTreeMap<(usize, usize), (PixelPoint, Option<f64>)>;

#[derive(Default)]
struct Score {
    images: usize,
    found: usize,
    missed: usize,
    wrong: usize,
    false_targets: usize,
    squared: f64,
    worst_px: f64,
    /// Over the points with a standard deviation: squared errors, and squared deviations.
    said: [f64; 2],
}

impl Score {
    fn add(&mut self, shot: &Shot, target: &Target, found: &Found) {
        if !shot.has_target() {
            self.false_targets += usize::from(!found.is_empty());
            return;
        }
        self.images += usize::from(!found.is_empty());
        for (label, at_mm) in &target.points {
            let truth = shot.pixel(*at_mm);
            match (truth, found.get(label)) {
                (Some(truth), Some(pixel)) => {
                    let error = truth.distance_px(pixel.0);
                    if error > 0.15 && std::env::var_os("VERBOSE").is_some() {
                        let (blur, noise) = (shot.render.blur_px, shot.render.noise_levels);
                        let covered = shot.is_covered(truth, NEAR_COVER_PX);
                        eprintln!(
                            "{label:?}: {error:.3} px at {:.0} {:.0}, covered {covered}, blur {blur:.2}, noise {noise:.1}",
                            truth.u, truth.v
                        );
                    }
                    if error > WRONG_PX {
                        self.wrong += 1;
                    } else {
                        self.found += 1;
                        self.squared += error * error / 2.0;
                        self.worst_px = self.worst_px.max(error);
                        if let Some(sigma_px) = pixel.1 {
                            self.said[0] += error * error / 2.0;
                            self.said[1] += sigma_px * sigma_px;
                        }
                    }
                }
                (None, Some(_)) => self.wrong += 1,
                (Some(truth), None) => {
                    self.missed += usize::from(!shot.is_covered(truth, NEAR_COVER_PX));
                }
                (None, None) => {}
            }
        }
    }

    fn row(&self, name: &str) {
        println!(
            "{name:28} {:7} {:8} {:7} {:6} {:6}   {:8.4} {:8.3} {}",
            self.images,
            self.found,
            self.missed,
            self.wrong,
            self.false_targets,
            (self.squared / self.found.max(1) as f64).sqrt(),
            self.worst_px,
            if self.said[1] > 0.0 {
                format!("{:9.2}", (self.said[0] / self.said[1]).sqrt())
            } else {
                String::new()
            }
        );
    }
}

struct Looked {
    shot: Shot,
    ours: Found,
    time: Duration,
    path: Option<PathBuf>,
}

fn look(target: &Target, settings: &ShotSettings, seed: u64, folder: Option<&Path>) -> Looked {
    let shot = Shot::draw(settings, &target.art, seed);
    let rendered = shot.image();
    let bytes = rendered.to_u8();
    let path = folder.map(|folder| {
        let path = folder.join(format!("{seed}.pgm"));
        let mut file = std::fs::File::create(&path).expect("a file");
        let head = format!(
            "P5\n{} {}\n255\n",
            rendered.sensor.width, rendered.sensor.height
        );
        file.write_all(head.as_bytes())
            .and_then(|()| file.write_all(&bytes))
            .expect("written");
        path
    });
    let values = bytes.into_iter().map(f32::from).collect();
    let image = GrayImage::from_values(rendered.sensor, values, 255.0).expect("an image");
    let begin = Instant::now();
    let detector = printed::of_kind(&target.kind).expect("a printed target");
    let result = detector.find(&image, &DetectSettings::default());
    let time = begin.elapsed();
    if std::env::var_os("VERBOSE").is_some() {
        match &result {
            Ok(found) => eprintln!(
                "{seed}: {} points, blur {:.2}, noise {:.1}",
                found.corners.len(),
                shot.render.blur_px,
                shot.render.noise_levels
            ),
            Err(refusal) if shot.has_target() => eprintln!(
                "{seed}: {refusal}, blur {:.2}, noise {:.1}",
                shot.render.blur_px, shot.render.noise_levels
            ),
            Err(_) => {}
        }
    }
    let ours = result.map_or_else(
        |_| Found::new(),
        |found| {
            let beyond_px = found.model_error_px(&target.board).unwrap_or(0.0);
            let sigma_px = |c: &Corner| c.sigma_px.map(|sigma| sigma.hypot(beyond_px));
            let corners = found.corners.iter();
            corners
                .map(|c| ((c.row, c.col), (c.pixel, sigma_px(c))))
                .collect()
        },
    );
    Looked {
        ours: as_truth(&shot, target, ours),
        shot,
        time,
        path,
    }
}

/// Where `OpenCV` has the points of images: one line per point, image, row, column, u, v.
fn opencv(python: &str, target: &Target, folder: &Path) -> (BTreeMap<u64, Found>, f64) {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/opencv_targets.py");
    let output = Command::new(python)
        .arg(script)
        .arg(folder)
        .args(target.opencv.split(' '))
        .output()
        .expect("python runs");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let mut found: BTreeMap<u64, Found> = BTreeMap::new();
    let mut seconds = 0.0;
    for line in text.lines() {
        let mut fields = line.split(',');
        let mut next = || fields.next().unwrap_or("");
        let first = next();
        if first == "seconds" {
            seconds = next().parse().expect("a number");
            continue;
        }
        let seed: u64 = first.parse().expect("a number");
        let label = (
            next().parse().expect("a row"),
            next().parse().expect("a column"),
        );
        let pixel = PixelPoint::new(next().parse().expect("u"), next().parse().expect("v"));
        found.entry(seed).or_default().insert(label, (pixel, None));
    }
    (found, seconds)
}

/// Squared errors per axis over points that both have right.
fn common(looked: &Looked, target: &Target, theirs: &Found) -> (usize, [f64; 2]) {
    let mut sum = (0, [0.0; 2]);
    for (label, at_mm) in &target.points {
        if let (Some(truth), Some(ours), Some(theirs)) = (
            looked.shot.pixel(*at_mm),
            looked.ours.get(label),
            theirs.get(label),
        ) {
            let (a, b) = (truth.distance_px(ours.0), truth.distance_px(theirs.0));
            if a <= WRONG_PX && b <= WRONG_PX {
                sum.0 += 1;
                sum.1[0] += a * a / 2.0;
                sum.1[1] += b * b / 2.0;
            }
        }
    }
    sum
}

fn main() {
    let mut kinds: Vec<String> = Vec::new();
    let (mut images, mut from, mut python) = (200_u64, 0_u64, None);
    let mut settings = ShotSettings::default();
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        match arg.as_str() {
            "--images" => {
                images = args
                    .next()
                    .and_then(|n| n.parse().ok())
                    .expect("--images N");
            }
            "--from" => {
                from = args.next().and_then(|n| n.parse().ok()).expect("--from K");
            }
            "--ids" => settings.sensor = SensorSize::new(640, 480),
            "--threads" => {
                let threads = args.next().and_then(|n| n.parse().ok());
                rayon::ThreadPoolBuilder::new()
                    .num_threads(threads.expect("--threads N"))
                    .build_global()
                    .expect("a pool");
            }
            "--opencv" => python = Some(args.next().expect("--opencv PYTHON")),
            "--bench" => {}
            _ => kinds.push(arg),
        }
    }
    println!(
        "{:28} {:>7} {:>8} {:>7} {:>6} {:>6}   {:>8} {:>8} {:>9}",
        "px per axis", "images", "points", "missed", "wrong", "false", "RMS", "worst", "true/said"
    );
    for target in targets() {
        if !kinds.is_empty() && !kinds.iter().any(|kind| kind == target.name) {
            continue;
        }
        let (mut ours, mut theirs) = (Score::default(), Score::default());
        let (mut time, mut their_time) = (Duration::ZERO, 0.0);
        let mut both = (0, [0.0; 2]);
        let mut first = from;
        while first < from + images {
            let seeds: Vec<u64> = (first..(first + CHUNK).min(from + images)).collect();
            first += CHUNK;
            let folder = python
                .as_ref()
                .map(|_| tempfile::tempdir().expect("a folder"));
            let looked: Vec<Looked> = seeds
                .par_iter()
                .map(|&seed| {
                    look(
                        &target,
                        &settings,
                        seed,
                        folder.as_ref().map(tempfile::TempDir::path),
                    )
                })
                .collect();
            let opencv_found = match (&python, &folder) {
                (Some(python), Some(folder)) => {
                    let (found, seconds) = opencv(python, &target, folder.path());
                    their_time += seconds;
                    found
                }
                _ => BTreeMap::new(),
            };
            for (seed, looked) in seeds.iter().zip(&looked) {
                time += looked.time;
                ours.add(&looked.shot, &target, &looked.ours);
                if looked.path.is_some() {
                    let found = opencv_found.get(seed).cloned().unwrap_or_default();
                    let found = by_nearest(&looked.shot, &target, found);
                    theirs.add(&looked.shot, &target, &found);
                    let (count, [a, b]) = common(looked, &target, &found);
                    both = (both.0 + count, [both.1[0] + a, both.1[1] + b]);
                }
            }
        }
        ours.row(target.name);
        if python.is_none() {
            println!(
                "  {images} images, CPU {:.0} ms an image",
                1e3 * time.as_secs_f64() / images as f64
            );
        } else {
            theirs.row("  OpenCV");
            let rms = both
                .1
                .map(|sum| (sum / f64::from(both.0.max(1) as u32)).sqrt());
            println!(
                "  both: {} points, {:.4} and {:.4} px, ratio {:.2}; CPU {:.0} and {:.0} ms an image",
                both.0,
                rms[0],
                rms[1],
                rms[0] / rms[1],
                1e3 * time.as_secs_f64() / images as f64,
                1e3 * their_time / images as f64
            );
        }
    }
}
