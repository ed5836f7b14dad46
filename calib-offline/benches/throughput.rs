//! Points per second of CPU: a million matches by the runtime, by `calib-offline measure` with its
//! files, and by `OpenCV`'s `undistortPoints` and `triangulatePoints`, in one run.
//!
//! `cargo bench -p calib-offline --bench throughput`; `OpenCV` is measured if `python3` has `cv2` and numpy
//! (`pip install opencv-python-headless numpy`).

use calib_blob::pack::read_aligned;
use ray_runtime::{PixelPoint, RayBlob};
use std::fmt::Write as _;
use std::hint::black_box;
use std::path::Path;
use std::process::{Command, ExitCode};

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

const MATCHES: usize = 1_000_000;
/// How often the runtime's own rows are repeated.
const REPEATS: u32 = 10;
/// The calibration that the blobs come from.
const DATASET: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../data/stage");
const OPENCV: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/opencv_points.py");
const TOOL: &str = env!("CARGO_BIN_EXE_calib-offline");

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<()> {
    let folder = tempfile::tempdir()?;
    let folder = folder.path();
    let results = folder.join("stage");
    tool(&["calibrate", DATASET, "-o", path(&results)?])?;
    let calibration = results.join("calibration.json");
    println!("{MATCHES} matches, seconds of CPU\n");
    let opencv_s = opencv();
    match &opencv_s {
        Ok(seconds) => println!(
            "{:<46} {seconds:>8.3}",
            "OpenCV: undistortPoints, triangulatePoints"
        ),
        Err(error) => println!("OpenCV was not measured: {error}"),
    }
    let row = |name: &str, seconds: f64| {
        let ratio = opencv_s.as_ref().map_or(String::new(), |opencv_s| {
            format!("{:.1} times faster", opencv_s / seconds)
        });
        println!("{name:<46} {seconds:>8.3}   {ratio}");
    };
    for prefer in ["speed", "size"] {
        let blob_path = folder.join(format!("{prefer}.rays"));
        let pack = ["pack", path(&calibration)?, "-o", path(&blob_path)?];
        tool(&[&pack[..], &["--prefer", prefer]].concat())?;
        let bytes = read_aligned(&blob_path)?;
        let blob = RayBlob::open(&bytes)?;
        let matches = matches(&blob);

        let mut points = 0;
        let seconds = repeated(|| {
            points = 0;
            for [a, b] in &matches {
                points += usize::from(black_box(blob.triangulate((0, *a), (1, *b))).is_ok());
            }
        })?;
        row(&format!("runtime, --prefer {prefer}"), seconds);
        assert!(points > MATCHES * 9 / 10, "{points} points");

        let seconds = repeated(|| {
            for [a, b] in &matches {
                let _ = black_box(blob.triangulate_with_covariance((0, *a), (1, *b)));
            }
        })?;
        let name = format!("runtime with covariance, --prefer {prefer}");
        row(&name, seconds);

        let (input, output) = (folder.join("matches.csv"), folder.join("points.csv"));
        std::fs::write(&input, csv(&matches)?)?;
        let start = cpu_seconds(CHILDREN)?;
        tool(&[
            "measure",
            path(&blob_path)?,
            path(&input)?,
            "-o",
            path(&output)?,
            "--force",
        ])?;
        let name = format!("measure, CSV to CSV, --prefer {prefer}");
        row(&name, cpu_seconds(CHILDREN)? - start);
    }
    Ok(())
}

/// CPU seconds of work, the mean of [`REPEATS`]: the system's clock has steps of 10 ms.
fn repeated(mut work: impl FnMut()) -> Result<f64> {
    let start = cpu_seconds(OWN)?;
    for _ in 0..REPEATS {
        work();
    }
    Ok((cpu_seconds(OWN)? - start) / f64::from(REPEATS))
}

/// Pixels that see points of a box before the cameras.
fn matches(blob: &RayBlob<'_>) -> Vec<[PixelPoint; 2]> {
    let spread = |k: usize, step: f64, extent: f64| ((k as f64 * step).fract() - 0.5) * extent;
    let seen: Vec<[PixelPoint; 2]> = (0..20_000)
        .filter_map(|k| {
            let point_mm = [
                (60.0 + spread(k, 0.618, 80.0)) as f32,
                (70.0 + spread(k, 0.414, 80.0)) as f32,
                spread(k, 0.732, 40.0) as f32,
            ];
            let pixels = [0, 1].map(|camera| blob.project(camera, point_mm).ok());
            Some([pixels[0]?, pixels[1]?])
        })
        .collect();
    seen.iter().cycle().take(MATCHES).copied().collect()
}

fn csv(matches: &[[PixelPoint; 2]]) -> Result<String> {
    let mut text = String::from("id,u_left,v_left,u_right,v_right\n");
    for (id, [a, b]) in matches.iter().enumerate() {
        writeln!(text, "{id},{},{},{},{}", a.u, a.v, b.u, b.v)?;
    }
    Ok(text)
}

fn path(path: &Path) -> Result<&str> {
    path.to_str().ok_or_else(|| "a path is not Unicode".into())
}

fn tool(arguments: &[&str]) -> Result<()> {
    let output = Command::new(TOOL).args(arguments).output()?;
    if output.status.success() {
        Ok(())
    } else {
        Err(String::from_utf8_lossy(&output.stderr).into())
    }
}

fn opencv() -> Result<f64> {
    let output = Command::new("python3")
        .args([OPENCV, &MATCHES.to_string()])
        .output()?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into());
    }
    Ok(String::from_utf8(output.stdout)?.trim().parse()?)
}

/// Where `/proc/self/stat` has user time, from 0; system time follows.
const OWN: usize = 13;
const CHILDREN: usize = 15;
/// Linux counts them in hundredths of a second.
const TICKS_PER_S: f64 = 100.0;

fn cpu_seconds(first: usize) -> Result<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat")?;
    // The name, in parentheses, may hold spaces; behind it comes field 2.
    let (_, fields) = stat
        .rsplit_once(") ")
        .ok_or("/proc/self/stat is unreadable")?;
    let mut fields = fields.split(' ').skip(first - 2);
    let mut next = || -> Result<f64> { Ok(fields.next().ok_or("too few fields")?.parse()?) };
    Ok((next()? + next()?) / TICKS_PER_S)
}
