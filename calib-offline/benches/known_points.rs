//! Points with known places: four cameras before a tank, calibrated from a plate of marks at five depths, in one
//! pose. `data/ptv-plates`, whose errors other tools have published, and a simulated tank beside it.
//!
//! `cargo bench -p calib-offline --bench known_points`. Every row is a `calibrate` and a `measure` of the program;
//! CPU seconds are those of the whole `calibrate`, packing included, over those of the estimate of `paper`.

use calib_estimate::adjust::Observations;
use calib_estimate::init::rig::start_rig;
use calib_estimate::joint::estimate_screened;
use calib_rays::geometry::{Ray, triangulate_rays};
use calib_simulate::tank::Tank;
use calib_simulate::{CameraOptics, OpticsKind, Scene, SceneSettings};
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, ExitCode, Stdio};

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Kernel ticks per second of the times in `/proc/self/stat`, on every Linux.
const TICKS_PER_SECOND: f64 = 100.0;

/// A mark: its place, mm, and where each camera sees it.
struct Mark {
    at_mm: Vector3<f64>,
    pixels: Vec<Option<[f64; 2]>>,
}

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
    let reference_s = paper_seconds()?;
    println!("start + estimate of paper: {reference_s:.1} CPU s\n");
    println!("RMS of the 3-D errors of all marks, mm; marks without a point; CPU over paper's\n");
    println!("marks             left out          RMS   along z  no point  oracle  CPU ratio");
    let public = public_marks(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/ptv-plates"))?;
    for (name, marks, rays) in [
        ("ptv-plates", public, None),
        (
            "simulated, water",
            simulated(&Tank::water()),
            Some(Tank::water()),
        ),
        (
            "simulated, empty",
            simulated(&Tank::new(1.0)),
            Some(Tank::new(1.0)),
        ),
    ] {
        let depths = depths(&marks);
        for left_out in [&[][..], &[1, 3], &[0, 4]] {
            let left_out: Vec<f64> = left_out.iter().map(|k| depths[*k]).collect();
            let found = score(&marks, &left_out)?;
            let oracle = rays.as_ref().map_or("-".to_owned(), |tank| {
                format!("{:.3}", oracle_mm(tank, &marks))
            });
            println!(
                "{name:17} {:16} {:5.3}   {:7.3}  {:4}      {oracle:>6}  {:9.1}",
                format!("{left_out:?}"),
                found.rms_mm,
                found.rms_z_mm,
                found.without,
                found.cpu_s / reference_s
            );
            if left_out.is_empty() {
                println!("    along z by depth, mean and scatter: {}", found.by_depth);
            }
        }
    }
    Ok(())
}

/// What was measured of all marks.
struct Score {
    rms_mm: f64,
    rms_z_mm: f64,
    without: usize,
    cpu_s: f64,
    /// Error along z of the marks of each depth, mm, in words.
    by_depth: String,
}

/// Calibrates from the marks of the other depths and measures all.
fn score(marks: &[Mark], left_out_mm: &[f64]) -> Result<Score> {
    let folder = tempfile::tempdir()?;
    let dataset = folder.path().join("dataset");
    std::fs::create_dir(&dataset)?;
    let cameras = marks.first().map_or(0, |mark| mark.pixels.len());
    let mut manifest = "[board]\nkind = \"points\"\n".to_owned();
    let mut corners = "camera,pose,u,v,x_mm,y_mm,z_mm\n".to_owned();
    let mut matches = "id".to_owned();
    for k in 0..cameras {
        write!(
            manifest,
            "[[camera]]\nname = \"cam{k}\"\nwidth = 2560\nheight = 2160\n"
        )?;
        write!(matches, ",u_cam{k},v_cam{k}")?;
    }
    matches.push('\n');
    for (id, mark) in marks.iter().enumerate() {
        write!(matches, "{id}")?;
        for (k, pixel) in mark.pixels.iter().enumerate() {
            match pixel {
                Some([u, v]) => {
                    write!(matches, ",{u},{v}")?;
                    if !left_out_mm.contains(&mark.at_mm.z) {
                        let at = &mark.at_mm;
                        writeln!(corners, "cam{k},0,{u},{v},{},{},{}", at.x, at.y, at.z)?;
                    }
                }
                None => matches.push_str(",,"),
            }
        }
        matches.push('\n');
    }
    std::fs::write(dataset.join("dataset.toml"), manifest)?;
    std::fs::write(dataset.join("corners.csv"), corners)?;
    std::fs::write(folder.path().join("matches.csv"), matches)?;

    let before = cpu_seconds(true)?;
    program(folder.path(), &["calibrate", "dataset", "-o", "out"])?;
    let cpu_s = cpu_seconds(true)? - before;
    program(
        folder.path(),
        &["measure", "out/rig.rays", "matches.csv", "-o", "points.csv"],
    )?;
    let text = std::fs::read_to_string(folder.path().join("points.csv"))?;
    let (mut sum, mut sum_z, mut count, mut without) = (0.0, 0.0, 0.0, 0);
    let mut by_depth: BTreeMap<i64, Vec<f64>> = BTreeMap::new();
    for (mark, line) in marks.iter().zip(text.lines().skip(1)) {
        let fields: Vec<&str> = line.split(',').collect();
        let [_, x, y, z, ..] = fields[..] else {
            return Err(line.into());
        };
        match (x.parse::<f64>(), y.parse::<f64>(), z.parse::<f64>()) {
            (Ok(x), Ok(y), Ok(z)) => {
                let error = Vector3::new(x, y, z) - mark.at_mm;
                sum += error.norm_squared();
                sum_z += error.z * error.z;
                let depth = by_depth.entry(mark.at_mm.z.round() as i64);
                depth.or_default().push(error.z);
                count += 1.0;
            }
            _ => without += 1,
        }
    }
    Ok(Score {
        rms_mm: (sum / f64::max(count, 1.0)).sqrt(),
        rms_z_mm: (sum_z / f64::max(count, 1.0)).sqrt(),
        without,
        cpu_s,
        by_depth: words(&by_depth),
    })
}

fn words(by_depth: &BTreeMap<i64, Vec<f64>>) -> String {
    let of = |(depth, errors): (&i64, &Vec<f64>)| {
        let count = errors.len() as f64;
        let mean = errors.iter().sum::<f64>() / count;
        let scatter = errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / count;
        format!("{depth}: {mean:.2} +- {:.2}", scatter.sqrt())
    };
    by_depth.iter().map(of).collect::<Vec<_>>().join(", ")
}

/// Runs the program; a verdict "fail" is an answer too.
fn program(folder: &Path, arguments: &[&str]) -> Result<()> {
    let output = Command::new(env!("CARGO_BIN_EXE_calib-offline"))
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::null())
        .output()?;
    if matches!(output.status.code(), Some(0 | 1)) {
        return Ok(());
    }
    Err(String::from_utf8_lossy(&output.stderr).into_owned().into())
}

/// The marks of a recording of points, by place.
fn public_marks(folder: &Path) -> Result<Vec<Mark>> {
    let text = std::fs::read_to_string(folder.join("corners.csv"))?;
    let mut marks: BTreeMap<[i64; 3], Mark> = BTreeMap::new();
    for line in text.lines().skip(1) {
        let fields: Vec<&str> = line.split(',').collect();
        let [camera, _, u, v, x, y, z] = fields[..] else {
            return Err(line.into());
        };
        let camera_idx: usize = camera.trim_start_matches("cam").parse()?;
        let at_mm = Vector3::new(x.parse()?, y.parse()?, z.parse()?);
        let key = [at_mm.z, at_mm.y, at_mm.x].map(|x: f64| (1000.0 * x).round() as i64);
        let mark = marks.entry(key).or_insert_with(|| Mark {
            at_mm,
            pixels: vec![None; 4],
        });
        mark.pixels[camera_idx] = Some([u.parse()?, v.parse()?]);
    }
    Ok(marks.into_values().collect())
}

/// The marks of a simulated tank, located to whole pixels too.
fn simulated(tank: &Tank) -> Vec<Mark> {
    let mut marks: Vec<Mark> = tank
        .marks_mm
        .iter()
        .map(|at_mm| Mark {
            at_mm: *at_mm,
            pixels: vec![None; tank.cameras.len()],
        })
        .collect();
    for seen in tank.seen() {
        let pixel = [seen.pixel.u.round(), seen.pixel.v.round()];
        marks[seen.mark_idx].pixels[seen.camera_idx] = Some(pixel);
    }
    marks
}

fn depths(marks: &[Mark]) -> Vec<f64> {
    let mut depths: Vec<f64> = marks.iter().map(|mark| mark.at_mm.z).collect();
    depths.sort_by(f64::total_cmp);
    depths.dedup();
    depths
}

/// RMS error of all marks through the true rays of the same pixels, mm.
fn oracle_mm(tank: &Tank, marks: &[Mark]) -> f64 {
    let errors = marks.iter().filter_map(|mark| {
        let rays: Vec<Ray> = mark
            .pixels
            .iter()
            .zip(&tank.cameras)
            .filter_map(|(pixel, camera)| {
                let [u, v] = (*pixel)?;
                let ray = camera
                    .optics
                    .ray(calib_rays::geometry::PixelPoint::new(u, v))?;
                Some(ray.transformed(&camera.tank_from_camera))
            })
            .collect();
        let point = triangulate_rays(&rays).ok()?.point_mm;
        Some((point - mark.at_mm).norm_squared())
    });
    let squared: Vec<f64> = errors.collect();
    (squared.iter().sum::<f64>() / squared.len().max(1) as f64).sqrt()
}

/// CPU seconds of what `--bench estimate -- paper` measures.
fn paper_seconds() -> Result<f64> {
    let scene = Scene::new(SceneSettings::standard_noisy(OpticsKind::Paper, 1))?;
    let views = scene.observe_corners();
    let sensors = scene.cameras.iter().map(CameraOptics::sensor).collect();
    let before = cpu_seconds(false)?;
    let observations = Observations::new(scene.settings.board.clone(), sensors, &views);
    let start = start_rig(&observations)?;
    estimate_screened(&observations, start)?;
    Ok(cpu_seconds(false)? - before)
}

/// CPU seconds in user code so far: of this process, or of those that it waited for.
fn cpu_seconds(of_children: bool) -> Result<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat")?;
    // The name, in parentheses, may hold blanks.
    let fields = stat.rsplit(')').next().unwrap_or_default();
    let at = if of_children { 13 } else { 11 };
    let ticks = fields.split_whitespace().nth(at).ok_or("no such field")?;
    Ok(ticks.parse::<f64>()? / TICKS_PER_SECOND)
}
