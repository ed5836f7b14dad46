use super::*;
use crate::cli::settings::{Narration, Settings, Words};
use crate::cli::usage_error::UsageError;
use crate::report::example;
use calib_recording::dataset::{CornersError, SufficiencyError};
use std::fs;

fn console() -> Console {
    Console::new(Settings {
        json: true,
        narration: Narration::Errors,
        color: false,
        bars: false,
        words: Words::StandardOutput,
    })
}

/// A dataset with one corner: enough for a stand-in that does not look at it.
fn dataset(folder: &Path) {
    fs::write(
        folder.join("dataset.toml"),
        "[board]\nrows = 5\ncols = 4\nsquare_mm = 10\n[[camera]]\nname = \"left\"\nwidth = 640\nheight = 480\n",
    )
    .unwrap();
    fs::write(
        folder.join("corners.csv"),
        "camera,pose,row,col,u,v\nleft,0,0,0,1,1\n",
    )
    .unwrap();
}

fn args(folder: &Path) -> CalibrateArgs {
    CalibrateArgs {
        dataset: folder.to_owned(),
        output: folder.join("deep/results"),
        method: MethodArg::Joint,
        exclude: vec![3, 17],
        task: None,
        ray_tables: false,
        match_noise_px: None,
        force: false,
    }
}

#[test]
fn all_three_files_are_written_and_belong_together() {
    let folder = tempfile::tempdir().unwrap();
    dataset(folder.path());
    let args = args(folder.path());
    let excluded = std::cell::RefCell::new(Vec::<usize>::new());
    let estimate = |dataset: &Dataset, _: &CalibrateSettings, _: &dyn Progress| {
        excluded.borrow_mut().extend(&dataset.excluded_poses);
        Ok(example::calibration().into())
    };
    assert_eq!(run(&args, &console(), &estimate).unwrap(), Outcome::Done);
    assert_eq!(excluded.into_inner(), [3, 17]);
    let mut names: Vec<_> = fs::read_dir(&args.output)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(names, ["calibration.json", "report.html", "rig.rays"]);

    let calibration = Calibration::load(&args.output.join("calibration.json")).unwrap();
    assert_eq!(calibration, example::calibration());
    let bytes = calib_blob::pack::read_aligned(&args.output.join("rig.rays")).unwrap();
    let blob = ray_runtime::RayBlob::open(&bytes).unwrap();
    assert_eq!(blob.identity(), &calibration.identity());
    let page = fs::read_to_string(args.output.join("report.html")).unwrap();
    assert!(page.contains(&format!("{} bytes", bytes.len())));

    // Not twice into one place, unless forced; and then the same bytes.
    let before = fs::read(args.output.join("report.html")).unwrap();
    let error = run(&args, &console(), &estimate_never).unwrap_err();
    assert!(matches!(error, Error::Usage(UsageError::Exists { .. })));
    let forced = CalibrateArgs {
        force: true,
        ..args
    };
    run(&forced, &console(), &|_, _, _| {
        Ok(example::calibration().into())
    })
    .unwrap();
    assert_eq!(fs::read(forced.output.join("report.html")).unwrap(), before);
}

fn estimate_never(
    _: &Dataset,
    _: &CalibrateSettings,
    _: &dyn Progress,
) -> Result<Calibrated, CalibrateError> {
    panic!("refused too late")
}

#[test]
fn a_failed_verdict_is_written_and_told() {
    let folder = tempfile::tempdir().unwrap();
    dataset(folder.path());
    let args = args(folder.path());
    let mut calibration = example::calibration();
    calibration.verdict.grade = Grade::Fail;
    let outcome = run(&args, &console(), &|_, _, _| Ok(calibration.clone().into())).unwrap();
    assert_eq!(outcome, Outcome::VerdictFail);
    assert!(args.output.join("report.html").is_file());
}

#[test]
fn an_estimate_that_fails_leaves_no_folder() {
    let folder = tempfile::tempdir().unwrap();
    dataset(folder.path());
    let args = args(folder.path());
    let error = run(&args, &console(), &|_, _, _| {
        Err(SufficiencyError::NoCorners.into())
    })
    .unwrap_err();
    assert_eq!(error.exit_code(), 3);
    assert!(!folder.path().join("deep").exists());

    // A result that cannot be packed leaves none either.
    let mut empty = example::calibration();
    empty.rig.cameras[0].coverage.covered.fill(false);
    let error = run(&args, &console(), &|_, _, _| Ok(empty.clone().into())).unwrap_err();
    assert_eq!(error.exit_code(), 3);
    assert!(!folder.path().join("deep").exists());
}

#[test]
fn an_output_that_is_a_file_is_refused_before_any_work() {
    let folder = tempfile::tempdir().unwrap();
    dataset(folder.path());
    let mut args = args(folder.path());
    args.output = folder.path().join("corners.csv");
    let error = run(&args, &console(), &estimate_never).unwrap_err();
    assert!(matches!(error, Error::Write(_)));
    assert_eq!(error.exit_code(), 2);
}

#[test]
fn the_method_and_the_ray_tables_asked_for_are_made_and_written() {
    use calib_rays::field::RayTable;
    let folder = tempfile::tempdir().unwrap();
    dataset(folder.path());
    let args = CalibrateArgs {
        method: MethodArg::Alternating,
        ray_tables: true,
        ..args(folder.path())
    };
    let estimate = |_: &Dataset, settings: &CalibrateSettings, _: &dyn Progress| {
        assert!(settings.method.name() == "alternating" && settings.ray_tables);
        let calibration = example::calibration();
        let cameras = calibration.rig.cameras.iter();
        Ok(Calibrated {
            ray_tables: cameras.map(RayTable::of_camera).collect(),
            calibration,
        })
    };
    run(&args, &console(), &estimate).unwrap();
    let sensor = example::calibration().rig.cameras[0].field.sensor;
    let bytes = fs::metadata(args.output.join("rays_left.npy"))
        .unwrap()
        .len();
    let numbers = 6 * 8 * u64::from(sensor.width) * u64::from(sensor.height);
    assert!((numbers + 64..numbers + 256).contains(&bytes), "{bytes}");
    assert!(args.output.join("rays_right.npy").exists());
    // They are not replaced unasked either.
    let error = run(&args, &console(), &estimate_never).unwrap_err();
    assert!(matches!(error, Error::Usage(UsageError::Exists { .. })));
}

#[test]
fn a_dataset_with_broken_corners_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    dataset(folder.path());
    fs::write(folder.path().join("corners.csv"), "").unwrap();
    let error = run(
        &args(folder.path()),
        &console(),
        &crate::pipeline::calibrate,
    )
    .unwrap_err();
    let Error::Calibrate(CalibrateError::Corners(error)) = error else {
        panic!("{error}");
    };
    assert!(matches!(error, CornersError::Empty { .. }));
}
