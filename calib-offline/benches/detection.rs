//! What the search for a chessboard costs: CPU and memory of `detect`, beside an older build and beside `OpenCV`.
//!
//! `cargo bench -p calib-offline --bench detection -- [--base PROGRAM] [--opencv PYTHON] [--time PROGRAM]`. Scenes are
//! rendered and thrown away: 40 of 1.3 megapixels and one of 24 with a board, one of 24 and one of 50 without. Every
//! program runs on one thread under GNU `time` (`/usr/bin/time`), which tells its CPU (user and system) and the most memory
//! it had; of `OpenCV` the loop over the images
//! alone is timed, without the start of Python, and only where there is a board. All read the same PGM files.

use rayon::prelude::*;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

const ROWS: usize = 6;
const COLS: usize = 9;

/// Images of one kind.
struct Set {
    name: &'static str,
    width: usize,
    height: usize,
    images: u64,
    has_board: bool,
}

const SETS: [Set; 4] = [
    Set {
        name: "board, 1.3 MP",
        width: 1280,
        height: 1024,
        images: 40,
        has_board: true,
    },
    Set {
        name: "board, 24 MP",
        width: 6000,
        height: 4000,
        images: 1,
        has_board: true,
    },
    Set {
        name: "no board, 24 MP",
        width: 6000,
        height: 4000,
        images: 1,
        has_board: false,
    },
    Set {
        name: "no board, 50 MP",
        width: 8640,
        height: 5760,
        images: 1,
        has_board: false,
    },
];

/// A number from 0 to 1 that belongs to a place, a scale and a seed.
fn hash(x: i64, y: i64, scale: u64, seed: u64) -> f64 {
    let mut h = seed
        .wrapping_mul(0x9E37_79B9_7F4A_7C15)
        .wrapping_add(scale << 48)
        .wrapping_add((x as u64).wrapping_mul(0xBF58_476D_1CE4_E5B9))
        .wrapping_add((y as u64).wrapping_mul(0x94D0_49BB_1331_11EB));
    h = (h ^ (h >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    h = (h ^ (h >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((h ^ (h >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

/// A scene: gravel of all sizes, blocks of even brightness, and a board in the middle that is turned and tilted.
struct Scene {
    width: f64,
    height: f64,
    seed: u64,
    board: Option<Board>,
}

struct Board {
    center: [f64; 2],
    px_per_square: f64,
    turn: (f64, f64),
    tilt: [f64; 2],
}

impl Scene {
    fn new(set: &Set, seed: u64) -> Self {
        let (width, height) = (set.width as f64, set.height as f64);
        let draw = |k: i64, low: f64, high: f64| low + (high - low) * hash(k, 7, 0, seed);
        Self {
            width,
            height,
            seed,
            board: set.has_board.then(|| Board {
                center: [width * draw(0, 0.45, 0.55), height * draw(1, 0.45, 0.55)],
                px_per_square: 0.5 * width / 12.0,
                turn: draw(2, -0.4, 0.4).sin_cos(),
                tilt: [draw(3, -0.03, 0.03), draw(4, -0.03, 0.03)],
            }),
        }
    }

    fn backdrop(&self, u: f64, v: f64) -> f64 {
        let mut value = 125.0;
        for (k, (scale, strength)) in [(1.5, 18.0), (4.0, 24.0), (16.0, 30.0), (200.0, 80.0)]
            .into_iter()
            .enumerate()
        {
            let (x, y) = (u / scale, v / scale);
            let (i, j) = (x.floor(), y.floor());
            let at = |di: i64, dj: i64| hash(i as i64 + di, j as i64 + dj, k as u64, self.seed);
            let (s, t) = (x - i, y - j);
            let upper = at(0, 0) * (1.0 - s) + at(1, 0) * s;
            let lower = at(0, 1) * (1.0 - s) + at(1, 1) * s;
            value += strength * (upper * (1.0 - t) + lower * t - 0.5);
        }
        // A tenth of all places is covered by even blocks.
        let block = self.width / 40.0;
        let (i, j) = ((u / block).floor() as i64, (v / block).floor() as i64);
        if hash(i, j, 9, self.seed) < 0.1 {
            value = 255.0 * hash(i, j, 10, self.seed);
        }
        value
    }

    /// Brightness of the board, if it is there.
    fn print(&self, u: f64, v: f64) -> Option<f64> {
        let board = self.board.as_ref()?;
        let (du, dv) = (u - board.center[0], v - board.center[1]);
        let (sin, cos) = board.turn;
        let (x, y) = (
            (cos * du + sin * dv) / board.px_per_square,
            (cos * dv - sin * du) / board.px_per_square,
        );
        // Straight lines stay straight.
        let depth = 1.0 - board.tilt[0] * x - board.tilt[1] * y;
        let (x, y) = (
            x / depth + (COLS + 1) as f64 / 2.0,
            y / depth + (ROWS + 1) as f64 / 2.0,
        );
        let on_board =
            |x: f64, count: usize, margin: f64| (-margin..count as f64 + 1.0 + margin).contains(&x);
        if !(on_board(x, COLS, 0.7) && on_board(y, ROWS, 0.7)) {
            return None;
        }
        let is_dark = on_board(x, COLS, 0.0)
            && on_board(y, ROWS, 0.0)
            && (x.floor() + y.floor()).rem_euclid(2.0) == 0.0;
        Some(if is_dark { 30.0 } else { 225.0 })
    }

    /// Mean over a little more than the pixel, and noise of two levels.
    fn pixel(&self, u: usize, v: usize) -> u8 {
        let (x, y) = (u as f64, v as f64);
        let around = [(-0.9, -0.9), (0.9, -0.9), (-0.9, 0.9), (0.9, 0.9)]
            .map(|(du, dv)| self.print(x + du, y + dv));
        let light = if around.iter().all(|light| *light == around[0]) {
            around[0].unwrap_or_else(|| self.backdrop(x, y))
        } else {
            let mut sum = 0.0;
            for k in 0..49 {
                let (du, dv) = (f64::from(k % 7 - 3) * 0.26, f64::from(k / 7 - 3) * 0.26);
                let at = self.print(x + du, y + dv);
                sum += at.unwrap_or_else(|| self.backdrop(x + du, y + dv));
            }
            sum / 49.0
        };
        let noise: f64 = (0..6)
            .map(|k| hash(u as i64, v as i64, 20 + k, self.seed) - 0.5)
            .sum();
        (light + 2.8 * noise).round().clamp(0.0, 255.0) as u8
    }

    fn write(&self, path: &Path) {
        let (width, height) = (self.width as usize, self.height as usize);
        let pixels: Vec<u8> = (0..width * height)
            .into_par_iter()
            .map(|k| self.pixel(k % width, k / width))
            .collect();
        let mut file = std::fs::File::create(path).expect("a file");
        file.write_all(format!("P5\n{width} {height}\n255\n").as_bytes())
            .and_then(|()| file.write_all(&pixels))
            .expect("written");
    }
}

/// CPU, s, and memory, MB, of a program.
struct Cost {
    cpu_s: f64,
    peak_mb: f64,
}

fn cost(time: &str, program: &Path, folder: &Path) -> Cost {
    let output = Command::new(time)
        .args(["-f", "%U %S %M"])
        .arg(program)
        .args(["detect", "--force", "--quiet", "--threads", "1"])
        .arg(folder)
        .output()
        .expect("GNU time runs");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let numbers: Vec<f64> = said
        .lines()
        .last()
        .unwrap_or("")
        .split(' ')
        .filter_map(|n| n.parse().ok())
        .collect();
    let [user, system, peak_kib] = numbers[..] else {
        panic!("GNU time said no numbers: {said}");
    };
    Cost {
        cpu_s: user + system,
        peak_mb: peak_kib * 1024.0 / 1e6,
    }
}

/// Corners that `detect` wrote.
fn corners(folder: &Path) -> usize {
    let text = std::fs::read_to_string(folder.join("corners.csv")).unwrap_or_default();
    text.lines().count().saturating_sub(1)
}

/// CPU of `OpenCV`'s finder, s, and the boards it found.
fn opencv(python: &str, folder: &Path) -> (f64, usize) {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/opencv_chessboards.py");
    let output = Command::new(python)
        .arg(script)
        .arg(folder.join("images"))
        .args([ROWS.to_string(), COLS.to_string()])
        .output()
        .expect("python runs");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let mut fields = text.split_whitespace();
    let said = || String::from_utf8_lossy(&output.stderr).into_owned();
    match (fields.next(), fields.next()) {
        (Some(seconds), Some(boards)) => (
            seconds.parse().expect("seconds"),
            boards.parse().expect("a number"),
        ),
        _ => panic!("OpenCV said nothing: {}", said()),
    }
}

fn render(set: &Set, folder: &Path) {
    let images = folder.join("images");
    std::fs::create_dir_all(&images).expect("a folder");
    for k in 0..set.images {
        Scene::new(set, 11 + k).write(&images.join(format!("{k:03}.pgm")));
    }
    let manifest = format!(
        "[board]\nkind = \"chessboard\"\nrows = {ROWS}\ncols = {COLS}\nsquare_mm = 30.0\n\n[[camera]]\nname = \"camera\"\n\
         width = {}\nheight = {}\nimages = \"images/*.pgm\"\n",
        set.width, set.height
    );
    std::fs::write(folder.join("dataset.toml"), manifest).expect("written");
}

fn main() {
    let mut base = None;
    let mut python = None;
    let mut time = "/usr/bin/time".to_owned();
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let mut value = || words.next().expect("a value");
        match word.as_str() {
            "--base" => base = Some(PathBuf::from(value())),
            "--opencv" => python = Some(value()),
            "--time" => time = value(),
            "--bench" => {}
            other => panic!("unknown argument {other}"),
        }
    }
    let this = Path::new(env!("CARGO_BIN_EXE_calib-offline"));
    println!(
        "{:18} {:>8} {:>8} {:>8} {:>8} {:>9} {:>9} {:>8} {:>8}",
        "", "corners", "CPU, s", "MB", "base, s", "of base", "base, MB", "cv, s", "of cv"
    );
    for set in &SETS {
        let folder = tempfile::tempdir().expect("a folder");
        render(set, folder.path());
        let ours = cost(&time, this, folder.path());
        let found = corners(folder.path());
        let older = base.as_ref().map(|base| cost(&time, base, folder.path()));
        // Without a board its search goes on for minutes.
        let python = python.as_ref().filter(|_| set.has_board);
        let theirs = python.map(|python| opencv(python, folder.path()));
        let or_dash = |text: Option<String>| text.unwrap_or_else(|| "-".to_owned());
        println!(
            "{:18} {:>8} {:>8.2} {:>8.0} {:>8} {:>9} {:>9} {:>8} {:>8}",
            set.name,
            found,
            ours.cpu_s,
            ours.peak_mb,
            or_dash(older.as_ref().map(|o| format!("{:.2}", o.cpu_s))),
            or_dash(
                older
                    .as_ref()
                    .map(|o| format!("{:.2}", ours.cpu_s / o.cpu_s))
            ),
            or_dash(older.as_ref().map(|o| format!("{:.0}", o.peak_mb))),
            or_dash(theirs.map(|(s, _)| format!("{s:.2}"))),
            or_dash(theirs.map(|(s, _)| format!("{:.2}", ours.cpu_s / s))),
        );
        if let Some((_, boards)) = theirs {
            println!("{:18} OpenCV: {boards} of {} boards", "", set.images);
        }
    }
}
