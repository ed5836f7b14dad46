//! Changes planted between a recording and three new boards, and what is found of them.

use calib_estimate::adjust::Observations;
use calib_estimate::init::rig::start_rig;
use calib_estimate::joint::{Estimate, estimate_screened};
use calib_judge::cause::Code;
use calib_judge::grade::Grade;
use calib_judge::validity::{Validity, validity};
use calib_rays::geometry::{RigidTransform, so3};
use calib_simulate::faults::{Motion, Poses, Rig, Session, Take, scene};
use nalgebra::Vector3;

/// So many new boards.
const BOARDS: usize = 3;
/// The boards of simulated rigs go round by the seed.
const KINDS_OF_BOARDS: u64 = 3;

fn observed(session: &Session, poses: usize) -> Observations {
    let mut views = session.views();
    views.retain(|view| view.pose < poses);
    let sensors = session
        .scene
        .cameras
        .iter()
        .map(calib_simulate::CameraOptics::sensor)
        .collect();
    Observations::new(session.scene.settings.board.clone(), sensors, &views)
}

/// A recording's estimate, its rig, and three more boards seen by a rig that `change` has changed.
fn old_and_new(
    rig: Rig,
    seed: u64,
    change: impl Fn(usize, &mut Take),
) -> (Estimate, calib_rays::field::Rig, Observations) {
    let usual = |seed| scene(rig, Poses::HandHeld, &Motion::USUAL, seed).unwrap();
    let old = observed(&Session::faultless(usual(seed)), usize::MAX);
    let start = start_rig(&old).unwrap();
    let (estimate, _) = estimate_screened(&old, start).unwrap();
    let names = ["left", "right"].map(str::to_owned);
    let calibrated = estimate.rig(&names);
    let mut later = Session::faultless(usual(seed + 100 * KINDS_OF_BOARDS));
    for (camera_idx, takes) in later.takes.iter_mut().enumerate() {
        for take in takes {
            change(camera_idx, take);
        }
    }
    (estimate, calibrated, observed(&later, BOARDS))
}

fn checked(rig: Rig, seed: u64, change: impl Fn(usize, &mut Take)) -> Validity {
    let (estimate, calibrated, new) = old_and_new(rig, seed, change);
    let started = std::time::Instant::now();
    let found = validity(&estimate, &calibrated, &new).unwrap();
    println!(
        "{rig:?} {seed} {:?}: cost {:.4} limit {:.4} unnoticed {:.4?} in {:.1?}, rms {:.4} {:.4}, {:?} {:?}",
        found.verdict,
        found.cost_mm,
        found.limit_mm,
        found.unnoticed_mm,
        started.elapsed(),
        found.rms_px,
        found.old_rms_px,
        found.boards,
        found.old_boards,
    );
    for camera in &found.cameras {
        println!("  {camera:?}");
    }
    for cause in &found.causes {
        println!(
            "  {:.0} {:?} {}",
            cause.evidence, cause.cause.code, cause.cause.text
        );
    }
    for reason in &found.reasons {
        println!("  . {reason}");
    }
    found
}

/// The right camera's own turn, degrees about its x and y axis.
fn turned(x_deg: f64, y_deg: f64) -> impl Fn(usize, &mut Take) {
    let turn = so3::exp(&Vector3::new(x_deg.to_radians(), y_deg.to_radians(), 0.0));
    let before_from_after = RigidTransform::new(turn, Vector3::zeros());
    move |camera_idx, take| {
        if camera_idx == 1 {
            take.left_from_camera = take.left_from_camera * before_from_after;
        }
    }
}

fn refocused(camera: Option<usize>, factor: f64) -> impl Fn(usize, &mut Take) {
    move |camera_idx, take| {
        if camera.is_none_or(|camera| camera == camera_idx) {
            take.camera = take.camera.refocused(factor);
        }
    }
}

fn baseline(factor: f64) -> impl Fn(usize, &mut Take) {
    move |_, take| take.left_from_camera.translation_mm *= factor
}

#[track_caller]
fn assert_found(found: &Validity, code: Code, what: &str, unit: &str, truth: f64) {
    let first = found.causes.first().expect("something is found");
    assert_eq!(first.cause.code, code, "{}", first.cause.text);
    assert_eq!(found.verdict, Grade::Fail, "{:?}", found.reasons);
    assert_eq!(found.cause, Some(code));
    let mut amounts = first.amounts.iter();
    let amount = amounts
        .find(|amount| amount.what == what && amount.unit == unit)
        .unwrap();
    assert!(
        (amount.value - truth).abs() < 4.0 * amount.sd,
        "{} and not {truth}",
        amount.words()
    );
    assert!(amount.sd < truth.abs() / 4.0, "{}", amount.words());
}

#[test]
fn what_three_boards_show_is_named_with_its_size() {
    for (rig, seed) in [(Rig::Plain, 1), (Rig::Plain, 5), (Rig::Wide, 3)] {
        let found = checked(rig, seed, turned(0.0, 0.02));
        assert_found(
            &found,
            Code::CameraMoved,
            "turned right by",
            "degrees",
            0.02,
        );
        let found = checked(rig, seed, refocused(Some(0), 1.001));
        assert_found(
            &found,
            Code::FocusChanged,
            "focal length longer by",
            "%",
            0.1,
        );
        let found = checked(rig, seed, baseline(1.001));
        assert_found(&found, Code::BaselineChanged, "longer by", "%", 0.1);
    }
}

#[test]
fn nothing_is_found_where_nothing_changed() {
    let rigs = [Rig::Plain, Rig::Plain, Rig::Wide, Rig::Window];
    for (seed, rig) in (1..=8).zip(rigs.into_iter().cycle()) {
        let found = checked(rig, seed, |_, _| {});
        assert_eq!(found.verdict, Grade::Pass, "{:?}", found.reasons);
        assert!(found.causes.is_empty() && found.cause.is_none());
    }
}

#[test]
fn a_knock_of_many_pixels_is_found_as_well() {
    // 30 px to the left. Turns about several axes add up in another order: linear to a percent.
    let found = checked(Rig::Plain, 2, turned(0.4, -1.0));
    assert_eq!(found.cause, Some(Code::CameraMoved), "{:?}", found.reasons);
    assert_eq!(found.verdict, Grade::Fail);
    let amounts = &found.causes[0].amounts;
    for (amount, truth) in amounts.iter().zip([-1.0, 0.4]) {
        assert!(
            (amount.value / truth - 1.0).abs() < 0.01,
            "{}",
            amount.words()
        );
    }
    let found = checked(Rig::Plain, 2, refocused(None, 0.98));
    assert_eq!(found.cause, Some(Code::FocusChanged), "{:?}", found.reasons);
    // The image spreads about the principal point; what is known is the lens's center of symmetry, and
    // these lenses are decentered.
    let amount = &found.causes[0].amounts[0];
    assert!(
        (amount.value / -2.0 - 1.0).abs() < 0.05,
        "{}",
        amount.words()
    );
    assert_eq!(amount.camera, None);
}

#[test]
fn one_camera_alone_shows_its_focus_and_not_its_place() {
    let alone = |change: &dyn Fn(usize, &mut Take)| {
        let (_, _, new) = old_and_new(Rig::Plain, 1, change);
        let usual = scene(Rig::Plain, Poses::HandHeld, &Motion::USUAL, 1).unwrap();
        let old = observed(&Session::faultless(usual), usize::MAX).of_camera(1);
        let start = start_rig(&old).unwrap();
        let (estimate, _) = estimate_screened(&old, start).unwrap();
        let rig = estimate.rig(&["right".to_owned()]);
        validity(&estimate, &rig, &new.of_camera(1)).unwrap()
    };
    let found = alone(&turned(0.0, 1.0));
    assert_ne!(found.verdict, Grade::Fail, "{:?}", found.reasons);
    assert!(found.cannot_tell[0].contains("none of where it stands"));
    assert!(found.boards.is_none());
    let found = alone(&refocused(Some(1), 1.01));
    assert_found(
        &found,
        Code::FocusChanged,
        "focal length longer by",
        "%",
        1.0,
    );
}

#[test]
fn one_board_in_a_corner_of_the_image_is_too_little() {
    let (estimate, rig, mut new) = old_and_new(Rig::Plain, 2, |_, _| {});
    for view in &mut new.views {
        view.corners
            .retain(|corner| corner.row < 3 && corner.col < 4);
    }
    let found = validity(&estimate, &rig, &new.with_pose_indices(|pose| pose == 0)).unwrap();
    assert_eq!(found.verdict, Grade::Doubtful, "{:?}", found.reasons);
    assert_eq!(found.cause, None);
    assert!(
        found.reasons[0].contains("more boards, tilted"),
        "{:?}",
        found.reasons
    );
}

#[test]
fn a_board_that_became_longer_one_way_is_not_the_rig() {
    let found = checked(Rig::Plain, 2, |_, take| {
        take.stretch_and_shear = [1.002, 0.0];
    });
    assert_eq!(found.verdict, Grade::Doubtful, "{:?}", found.reasons);
    assert_eq!(found.cause, Some(Code::SquareScaleAxis));
}
