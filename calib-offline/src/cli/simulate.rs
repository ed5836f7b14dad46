//! `calib-offline simulate`: a dataset with known truth.

use calib_rays::geometry::SensorSize;
use calib_simulate::output::write_dataset;
use calib_simulate::{
    ImageDepth, ImageFiles, OpticsKind, OutputSettings, RenderSettings, Scene, SceneSettings,
};
pub use calib_simulate::{SimulateError, SimulateSummary};
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// Example: `calib-offline simulate -o port --optics port --seed 7`
///
/// Simulates a stereo rig before a chessboard on a rotation stage, and writes what a user would
/// have recorded (dataset.toml with corners.csv or images), pixels to measure (matches.csv,
/// holdout.csv) and the truth about all of it (`*_truth.csv`, truth.json). The same command writes
/// the same bytes.
#[derive(Debug, Clone, Args)]
#[expect(clippy::struct_excessive_bools, reason = "each is a flag")]
pub struct SimulateArgs {
    /// Folder to write; it appears whole or not at all
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Replace the folder, with everything in it, if it exists
    #[arg(long)]
    pub force: bool,
    /// Optics of the cameras
    #[arg(long, value_enum, default_value_t = OpticsKind::Brown)]
    pub optics: OpticsKind,
    /// Seed of everything random
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Corner noise per axis, standard deviation, px
    #[arg(long, default_value_t = 0.05, value_name = "PX")]
    pub noise_px: f64,
    /// Correlation of the noise of neighboring corners, 0 to 0.99
    #[arg(long, default_value_t = 0.0, value_name = "RHO")]
    pub noise_correlation: f64,
    /// Student-t noise with this many degrees of freedom [default: Gaussian]
    #[arg(long, value_name = "NU")]
    pub noise_tail: Option<f64>,
    /// Number the corners of a view from the wrong end: left:3 is pose 3 of the left camera
    #[arg(long, value_name = "CAMERA:POSE")]
    pub flip: Vec<String>,
    /// Let the right camera expose a pose late, after the board has moved on
    #[arg(long, value_name = "POSE")]
    pub late: Vec<usize>,
    /// Noise of the pixels to measure per axis, standard deviation, px
    #[arg(long, default_value_t = 0.05, value_name = "PX")]
    pub match_noise_px: f64,
    /// Share of corners that are not found, 0 to 1
    #[arg(long, default_value_t = 0.0, value_name = "SHARE")]
    pub missing: f64,
    /// Share of corners displaced by 3 to 10 px, 0 to 1
    #[arg(long, default_value_t = 0.0, value_name = "SHARE")]
    pub outliers: f64,
    /// How often the stage is put somewhere else [default: 2, fisheye 5]
    #[arg(long, value_name = "N")]
    pub placements: Option<usize>,
    /// How far apart the placements stand: 1 covers the image and cuts boards off at its edge;
    /// 0.3 with --square-mm 8 keeps them whole
    #[arg(long, default_value_t = 1.0, value_name = "SHARE")]
    pub spread: f64,
    /// Dial readings per placement, degrees: FROM:STEP:TO or a list A,B,C
    /// [default: -40:5:40, fisheye -40:10:40]
    #[arg(long, allow_hyphen_values = true, value_name = "ANGLES")]
    pub angles: Option<String>,
    /// Height of the board's outermost corners over its middle, mm
    #[arg(
        long,
        default_value_t = 0.0,
        allow_hyphen_values = true,
        value_name = "MM"
    )]
    pub bow_mm: f64,
    /// Run-out of the stage per axis, standard deviation, mm
    #[arg(long, default_value_t = 0.004, value_name = "MM")]
    pub runout_mm: f64,
    /// Wobble of the stage per axis, standard deviation, degrees
    #[arg(long, default_value_t = 0.001, value_name = "DEG")]
    pub wobble_deg: f64,
    /// Sensor, px; the optics scale with its width
    #[arg(long, default_value = "1280x1024", value_name = "WxH")]
    pub sensor: String,
    /// Rows of inner corners
    #[arg(long, default_value_t = 15)]
    pub rows: usize,
    /// Columns of inner corners
    #[arg(long, default_value_t = 13)]
    pub cols: usize,
    /// Pitch of the corners, mm
    #[arg(long, default_value_t = 10.0, value_name = "MM")]
    pub square_mm: f64,
    /// Pixels to measure inside the volume that the board swept
    #[arg(long, default_value_t = 500, value_name = "N")]
    pub points: usize,
    /// Pixels to measure on boards that were not recorded
    #[arg(long, default_value_t = 500, value_name = "N")]
    pub holdout: usize,
    /// Render images instead of writing corners.csv
    #[arg(long)]
    pub images: bool,
    /// With --images: write corners.csv as well
    #[arg(long, requires = "images")]
    pub corners: bool,
    /// With --images: draw every corner off by the noise of --noise-px, smoothly in between, as unsteady air or a
    /// shaking stand do
    #[arg(long, requires = "images")]
    pub displace: bool,
    /// Also render images of a measurement target
    #[arg(long, value_enum, value_name = "KIND")]
    pub target: Option<TargetKind>,
    /// Bits per pixel of images
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u8).range(8..=16), value_name = "8|16")]
    pub bits: u8,
    /// Lens blur of images, standard deviation, px
    #[arg(long, default_value_t = 0.7, value_name = "PX")]
    pub blur_px: f64,
    /// Sensor noise of images, standard deviation in levels of 8 bits
    #[arg(long, default_value_t = 1.0, value_name = "LEVELS")]
    pub image_noise: f64,
}

/// Measurement targets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum TargetKind {
    /// 63 ring markers, five of them larger to tell the direction.
    Ring,
}

/// Simulates and writes the dataset.
///
/// # Errors
/// As [`write_dataset`], and [`SimulateError::Argument`] or [`SimulateError::Scene`] if an option
/// makes no sense.
pub fn run(args: &SimulateArgs) -> Result<SimulateSummary, SimulateError> {
    let scene = Scene::new(scene_settings(args)?)?;
    write_dataset(&scene, &output_settings(args)?, &args.output, args.force)
}

fn scene_settings(args: &SimulateArgs) -> Result<SceneSettings, SimulateError> {
    let mut settings = SceneSettings::standard(args.optics, args.seed);
    settings.sensor = parse_sensor(&args.sensor)?;
    settings.board.rows = args.rows;
    settings.board.cols = args.cols;
    settings.board.square_mm = args.square_mm;
    settings.placements = args.placements.unwrap_or(settings.placements);
    settings.spread = args.spread;
    if let Some(text) = &args.angles {
        settings.angles_deg = parse_angles(text)?;
    }
    settings.noise_px = args.noise_px;
    settings.noise_correlation = args.noise_correlation;
    settings.noise_tail = args.noise_tail;
    settings.flipped_views = args
        .flip
        .iter()
        .map(|text| parse_view(text))
        .collect::<Result<_, _>>()?;
    settings.unsynchronized_poses.clone_from(&args.late);
    settings.match_noise_px = args.match_noise_px;
    settings.missing_share = args.missing;
    settings.outlier_share = args.outliers;
    settings.bow_mm = args.bow_mm;
    settings.runout_mm = args.runout_mm;
    settings.wobble_deg = args.wobble_deg;
    Ok(settings)
}

fn output_settings(args: &SimulateArgs) -> Result<OutputSettings, SimulateError> {
    let in_range = |option, value: f64, high: f64, expected| {
        if (0.0..=high).contains(&value) {
            Ok(value)
        } else {
            Err(SimulateError::Argument {
                option,
                text: value.to_string(),
                expected,
            })
        }
    };
    let render = RenderSettings {
        blur_px: in_range("--blur-px", args.blur_px, 10.0, "0 to 10 px")?,
        noise_levels: in_range("--image-noise", args.image_noise, 100.0, "0 to 100 levels")?,
        is_displaced: args.displace,
        ..RenderSettings::default()
    };
    let image_depth = match args.bits {
        8 => ImageDepth::Eight,
        16 => ImageDepth::Sixteen,
        other => {
            return Err(SimulateError::Argument {
                option: "--bits",
                text: other.to_string(),
                expected: "8 or 16",
            });
        }
    };
    Ok(OutputSettings {
        corners: args.corners || !args.images,
        images: args.images,
        ring_target: args.target == Some(TargetKind::Ring),
        render,
        image_depth,
        image_files: ImageFiles::Small,
        point_count: args.points,
        holdout_count: args.holdout,
    })
}

fn parse_sensor(text: &str) -> Result<SensorSize, SimulateError> {
    text.split_once(['x', 'X'])
        .and_then(|(width, height)| {
            Some(SensorSize::new(width.parse().ok()?, height.parse().ok()?))
        })
        .ok_or_else(|| SimulateError::Argument {
            option: "--sensor",
            text: text.to_owned(),
            expected: "WIDTHxHEIGHT in pixels, such as 1280x1024",
        })
}

fn parse_view(text: &str) -> Result<(usize, usize), SimulateError> {
    text.split_once(':')
        .and_then(|(camera, pose)| {
            let camera_idx = match camera {
                "left" => 0,
                "right" => 1,
                _ => return None,
            };
            Some((camera_idx, pose.parse().ok()?))
        })
        .ok_or_else(|| SimulateError::Argument {
            option: "--flip",
            text: text.to_owned(),
            expected: "left:POSE or right:POSE",
        })
}

fn parse_angles(text: &str) -> Result<Vec<f64>, SimulateError> {
    let wrong = || SimulateError::Argument {
        option: "--angles",
        text: text.to_owned(),
        expected: "FROM:STEP:TO or a list A,B,C, in degrees, at most 1000 of them",
    };
    let number = |part: &str| {
        part.trim()
            .parse::<f64>()
            .ok()
            .filter(|value| value.is_finite())
            .ok_or_else(wrong)
    };
    let parts: Vec<&str> = text.split(':').collect();
    match parts[..] {
        [list] => list.split(',').map(number).collect(),
        [from, step, to] => {
            let (from, step, to) = (number(from)?, number(step)?, number(to)?);
            let steps = (to - from) / step;
            // NaN and steps that lead away are wrong too; a hair of round-off is not.
            if !(0.0..1000.0).contains(&steps) {
                return Err(wrong());
            }
            let last = (steps + 1e-9).floor() as u32;
            Ok((0..=last).map(|k| from + f64::from(k) * step).collect())
        }
        _ => Err(wrong()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        args: SimulateArgs,
    }

    fn parse(line: &str) -> SimulateArgs {
        let words = std::iter::once("simulate").chain(line.split_whitespace());
        Command::try_parse_from(words).unwrap().args
    }

    fn refused(line: &str) -> String {
        let home = tempfile::tempdir().unwrap();
        let mut args = parse(&format!("-o out {line}"));
        args.output = home.path().join("out");
        let message = run(&args).unwrap_err().to_string();
        assert!(!args.output.exists(), "{line} left something behind");
        message
    }

    #[test]
    fn defaults_are_the_standard_dataset_with_noise() {
        let settings = scene_settings(&parse("-o x --optics port --seed 7")).unwrap();
        assert_eq!(settings, SceneSettings::standard_noisy(OpticsKind::Port, 7));
        let fisheye = scene_settings(&parse("-o x --optics fisheye")).unwrap();
        assert_eq!((fisheye.placements, fisheye.angles_deg.len()), (5, 9));
    }

    #[test]
    fn angles_are_a_range_or_a_list() {
        assert_eq!(
            parse_angles("-40:20:40").unwrap(),
            [-40., -20., 0., 20., 40.]
        );
        assert_eq!(parse_angles("10:-4:1").unwrap(), [10.0, 6.0, 2.0]);
        assert_eq!(parse_angles("0:0.1:0.3").unwrap().len(), 4);
        assert_eq!(parse_angles("3, -7.5").unwrap(), [3.0, -7.5]);
        for wrong in [
            "", "a", "1:2", "0:1:nan", "0:0:5", "0:-1:5", "0:1e-9:1", "1,,2",
        ] {
            assert!(parse_angles(wrong).is_err(), "{wrong}");
        }
        let settings = scene_settings(&parse("-o x --angles -6:3:6")).unwrap();
        assert_eq!(settings.angles_deg.len(), 5);
    }

    #[test]
    fn senseless_options_are_named_and_leave_nothing_behind() {
        for (line, named) in [
            ("--sensor 1280", "--sensor"),
            ("--sensor 12x-3", "--sensor"),
            ("--angles 1:2", "--angles"),
            ("--noise-px nan", "noise_px"),
            ("--missing 1.2", "missing share"),
            ("--outliers inf", "outlier share"),
            ("--placements 0", "placements"),
            ("--square-mm 0", "square_mm"),
            ("--bits 12", "--bits"),
            ("--flip top:1", "--flip"),
            ("--flip left:99", "flipped view"),
            ("--late 34", "unsynchronized pose"),
            ("--noise-tail 2", "noise tail"),
            ("--image-noise nan", "--image-noise"),
            ("--missing 0 --angles 180", "matches found"),
        ] {
            let message = refused(line);
            assert!(message.contains(named), "{line}: {message}");
        }
    }

    #[test]
    fn images_replace_corners_unless_both_are_wanted() {
        let corners_of = |line: &str| output_settings(&parse(line)).unwrap().corners;
        assert!(corners_of("-o x"));
        assert!(!corners_of("-o x --images"));
        assert!(corners_of("-o x --images --corners"));
    }
}
