//! What the estimate costs: CPU seconds and peak memory per kind of optics, against the number of
//! poses and of spline cells, and against mrcal's splined solve of the same corners.
//!
//! `cargo bench -p calib-offline --bench estimate`; arguments after `--` choose kinds of optics.
//! Figures are CPU seconds of the whole process (user time), so that a busy machine disturbs them
//! less than wall time. Everything measured runs in a process of its own.

use calib_estimate::adjust::Observations;
use calib_estimate::init::rig::start_rig;
use calib_estimate::joint::evidence::Smoothness;
use calib_estimate::joint::fit::Fit;
use calib_estimate::joint::{Estimate, estimate_screened};
use calib_rays::geometry::PixelPoint;
use calib_rays::observed::View;
use calib_simulate::{CameraOptics, OpticsKind, Scene, SceneSettings};
use clap::ValueEnum;
use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, ExitCode};

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Kernel ticks per second of the times in `/proc/self/stat`, on every Linux.
const TICKS_PER_SECOND: f64 = 100.0;
/// Rounds over which the cost of one is averaged.
const ROUNDS: usize = 5;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args()
        .skip(1)
        .filter(|argument| argument != "--bench")
        .collect();
    let done = match arguments.first().map(String::as_str) {
        Some("one") => one(&arguments[1..]),
        Some("cells") => cells(),
        _ => everything(&arguments),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn everything(optics: &[String]) -> Result<()> {
    let all = ["brown", "paper", "bumps", "window", "port", "fisheye"].map(String::from);
    let optics = if optics.is_empty() { &all } else { optics };
    println!("Standard datasets, corner noise 0.05 px; CPU seconds of start + estimate:");
    println!("optics    poses corners  cpu s  peak MB  mrcal cpu s  share");
    for name in optics {
        child(&["one", name, "standard", "mrcal"])?;
    }
    println!("\nAgainst the number of poses:");
    for name in ["port", "bumps"] {
        for placements in ["1", "2", "4"] {
            child(&["one", name, placements])?;
        }
    }
    println!("\nOne round (equations, factors, traces) against the cells of the spline, bumps:");
    child(&["cells"])
}

fn child(arguments: &[&str]) -> Result<()> {
    let status = Command::new(std::env::current_exe()?)
        .args(arguments)
        .status()?;
    status
        .success()
        .then_some(())
        .ok_or_else(|| format!("{arguments:?} failed").into())
}

/// `one OPTICS standard|PLACEMENTS [mrcal]`: a row of the table.
fn one(arguments: &[String]) -> Result<()> {
    let optics = OpticsKind::from_str(&arguments[0], true)?;
    let mut settings = SceneSettings::standard_noisy(optics, 1);
    if let Ok(placements) = arguments[1].parse() {
        settings.placements = placements;
    }
    let scene = Scene::new(settings)?;
    let views = scene.observe_corners();
    let before = cpu_seconds()?;
    let estimate = estimate(&scene, &views)?;
    let own = cpu_seconds()? - before;
    print!(
        "{:<9} {:>5} {:>7} {own:>6.2} {:>8.0}",
        arguments[0],
        scene.true_poses.len(),
        views.iter().map(|view| view.corners.len()).sum::<usize>(),
        peak_mb()?
    );
    if arguments.get(2).is_some() {
        match mrcal_seconds(&scene, &views, &estimate)? {
            Mrcal::Took(theirs) => print!("  {theirs:>11.2}  {:>5.3}", own / theirs),
            Mrcal::Failed(theirs, says) => print!("  {theirs:>11.2}  (failed: {says})"),
            Mrcal::Missing => print!("  (mrcal is not installed)"),
        }
    }
    println!();
    Ok(())
}

fn estimate(scene: &Scene, views: &[View]) -> Result<Estimate> {
    let observations = observations(scene, views);
    let start = start_rig(&observations)?;
    Ok(estimate_screened(&observations, start)?.0)
}

fn observations(scene: &Scene, views: &[View]) -> Observations {
    let sensors = scene.cameras.iter().map(CameraOptics::sensor).collect();
    Observations::new(scene.settings.board.clone(), sensors, views)
}

/// The cost of a round with splines of different grids.
fn cells() -> Result<()> {
    let scene = Scene::new(SceneSettings::standard_noisy(OpticsKind::Bumps, 1))?;
    let views = scene.observe_corners();
    let found = estimate(&scene, &views)?;
    println!("cells  spline unknowns  cpu s per round");
    for cells in [12.0, 23.0, 32.0, 46.0, 64.0] {
        let mut model = found.model.clone();
        for camera in &mut model.cameras {
            let Some(spline) = &camera.field.direction.spline else {
                return Err("bumps without a spline".into());
            };
            let sensor = camera.field.sensor;
            let spacing_px = f64::from(sensor.width.max(sensor.height)) / cells;
            let grid = calib_rays::field::spline::SplineGrid::with_spacing(sensor, spacing_px);
            camera.field.direction.spline = Some(spline.resampled(grid));
        }
        let unknowns: usize = model.cameras.iter().map(|c| c.spline_amounts().len()).sum();
        let smoothness = Smoothness::new(&model);
        let mut fit = Fit::new(model, smoothness, &found.observations);
        let before = cpu_seconds()?;
        for _ in 0..ROUNDS {
            fit.round(&found.observations)?;
        }
        let each = (cpu_seconds()? - before) / ROUNDS as f64;
        println!("{cells:>5} {unknowns:>16} {each:>16.3}");
    }
    Ok(())
}

/// User time of mrcal's splined solve.
enum Mrcal {
    /// It ended well.
    Took(f64),
    /// It gave up, with its last words.
    Failed(f64, String),
    /// It is not installed.
    Missing,
}

/// mrcal's splined solve of the same corners, its own checks of the result included.
fn mrcal_seconds(scene: &Scene, views: &[View], estimate: &Estimate) -> Result<Mrcal> {
    const TOOL: &str = "mrcal-calibrate-cameras";
    if Command::new(TOOL).arg("--help").output().is_err() {
        return Ok(Mrcal::Missing);
    }
    let folder = tempfile::tempdir()?;
    let corners = folder.path().join("corners.vnl");
    write_vnl(scene, views, &corners)?;
    let sensor = scene.settings.sensor;
    let half_angle_rad = half_angle_rad(estimate);
    // The focal length that shows the image's edge at that angle in the model's projection.
    let half_px = f64::from(sensor.width) / 2.0;
    let focal_px = half_px / (2.0 * (half_angle_rad / 2.0).tan());
    let fov_deg = (2.0 * half_angle_rad).to_degrees() * 1.1;
    let before = children_cpu_seconds()?;
    let output = Command::new(TOOL)
        .arg("--corners-cache")
        .arg(&corners)
        .arg("--lensmodel")
        .arg(format!(
            "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=30_Ny=24_fov_x_deg={fov_deg:.0}"
        ))
        .args(["--focal", &format!("{focal_px:.0}")])
        .args([
            "--imagersize",
            &sensor.width.to_string(),
            &sensor.height.to_string(),
        ])
        .args(["--object-spacing", "0.01"])
        .args(["--object-width-n", &scene.settings.board.cols.to_string()])
        .args(["--object-height-n", &scene.settings.board.rows.to_string()])
        .arg("--outdir")
        .arg(folder.path())
        .args((0..scene.cameras.len()).map(|camera| format!("camera{camera}-*.png")))
        .output()?;
    let seconds = children_cpu_seconds()? - before;
    if !output.status.success() {
        let says = String::from_utf8_lossy(&output.stderr);
        let last = says.lines().last().unwrap_or_default().to_string();
        return Ok(Mrcal::Failed(seconds, last));
    }
    Ok(Mrcal::Took(seconds))
}

/// Largest angle from the axis at the middles of the image's left and right edges.
fn half_angle_rad(estimate: &Estimate) -> f64 {
    let angles = estimate.model.cameras.iter().flat_map(|camera| {
        let sensor = camera.field.sensor;
        let v = f64::from(sensor.height) / 2.0;
        [0.0, f64::from(sensor.width) - 1.0].map(|u| {
            let ray = camera.field.ray(PixelPoint::new(u, v));
            ray.direction
                .x
                .hypot(ray.direction.y)
                .atan2(ray.direction.z)
        })
    });
    angles.fold(0.0, f64::max)
}

/// All corners of each view row by row; a corner that was not seen has no level.
fn write_vnl(scene: &Scene, views: &[View], path: &Path) -> Result<()> {
    let board = scene.settings.board.clone();
    let mut text = String::from("# filename x y level\n");
    for view in views {
        for row in 0..board.rows {
            for col in 0..board.cols {
                write!(text, "camera{}-{:03}.png ", view.camera_idx, view.pose)?;
                let seen = view.corners.iter().find(|c| c.row == row && c.col == col);
                match seen {
                    Some(corner) => writeln!(text, "{} {} 0", corner.pixel.u, corner.pixel.v)?,
                    None => writeln!(text, "- - -")?,
                }
            }
        }
    }
    Ok(std::fs::write(path, text)?)
}

/// User time of this process.
fn cpu_seconds() -> Result<f64> {
    stat_seconds(11)
}

/// User time of the children that have ended.
fn children_cpu_seconds() -> Result<f64> {
    stat_seconds(13)
}

/// A time of `/proc/self/stat`, counted behind the process's name.
fn stat_seconds(field: usize) -> Result<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat")?;
    let behind_name = stat.rsplit(") ").next().unwrap_or_default();
    let ticks = behind_name.split(' ').nth(field).ok_or("a short stat")?;
    Ok(ticks.parse::<f64>()? / TICKS_PER_SECOND)
}

/// The most memory that this process has used.
fn peak_mb() -> Result<f64> {
    let status = std::fs::read_to_string("/proc/self/status")?;
    let line = status.lines().find(|line| line.starts_with("VmHWM"));
    let kb = line.and_then(|line| line.split_whitespace().nth(1));
    Ok(kb.ok_or("no VmHWM")?.parse::<f64>()? / 1024.0)
}
