//! Two calibrations of one rig from two recordings.

use calib_estimate::adjust::Observations;
use calib_estimate::init::rig::start_rig;
use calib_estimate::joint::{Estimate, estimate_screened};
use calib_judge::difference::{Judgement, difference};
use calib_judge::half_data::Halves;
use calib_judge::working_volume::span;
use calib_rays::field::Rig as Calibrated;
use calib_simulate::faults::{Motion, Poses, Rig, Session, scene};

/// A rig calibrated by a recording of its own, its focal lengths so many times as long, and the
/// distances of its boards.
fn calibrated(seed: u64, focal: f64) -> (Estimate, Calibrated, Vec<f64>) {
    let usual = scene(Rig::Plain, Poses::HandHeld, &Motion::USUAL, seed).unwrap();
    let mut session = Session::faultless(usual);
    for take in session.takes.iter_mut().flatten() {
        take.camera = take.camera.refocused(focal);
    }
    let sensors = session
        .scene
        .cameras
        .iter()
        .map(calib_simulate::CameraOptics::sensor)
        .collect();
    let observations = Observations::new(
        session.scene.settings.board.clone(),
        sensors,
        &session.views(),
    );
    let start = start_rig(&observations).unwrap();
    let (estimate, _) = estimate_screened(&observations, start).unwrap();
    let rig = estimate.rig(&["left".to_owned(), "right".to_owned()]);
    let distances = span(&estimate.board_distances_mm(&rig));
    (estimate, rig, distances)
}

fn both(
    first: &(Estimate, Calibrated, Vec<f64>),
    second: &(Estimate, Calibrated, Vec<f64>),
) -> Halves {
    Halves {
        estimates: [first.0.clone(), second.0.clone()],
        rigs: [first.1.clone(), second.1.clone()],
    }
}

#[test]
fn recordings_of_one_rig_differ_as_predicted_and_of_a_changed_one_more() {
    let first = calibrated(1, 1.0);
    let compared = |second: &(Estimate, Calibrated, Vec<f64>)| {
        let found = difference(&first.1, &second.1, &first.2, Some(both(&first, second)));
        found.unwrap()
    };
    let mut ratios = Vec::new();
    for seed in 2..=6 {
        let found = compared(&calibrated(seed, 1.0));
        assert_eq!(found.judgement, Judgement::AsPredicted, "{:?}", found.ratio);
        ratios.push(found.ratio.unwrap());
    }
    println!("{ratios:.2?}");

    let found = compared(&calibrated(2, 1.002));
    assert_eq!(found.judgement, Judgement::More, "{:?}", found.ratio);
    let camera = &found.cameras[0];
    assert!(camera.map.iter().all(|place| place.px <= camera.max_px));
    assert!(found.rms_mm > 3.0 * found.predicted_rms_mm.unwrap());
}

#[test]
fn a_rig_does_not_differ_from_itself() {
    let own = calibrated(3, 1.0);
    let (_, rig, distances) = &own;
    let found = difference(rig, rig, distances, Some(both(&own, &own))).unwrap();
    assert!(found.max_mm < 1e-9 && found.cameras.iter().all(|c| c.max_px < 1e-6));
    assert_ne!(found.judgement, Judgement::More);
    assert!(found.predicted_rms_mm.unwrap() > 0.0);
    let mut alone = rig.clone();
    alone.cameras.truncate(1);
    let found = difference(&alone, &alone, distances, None).unwrap();
    assert_eq!(found.judgement, Judgement::NotPredicted);
    assert!(found.rms_mm < 1e-9 && found.points == 0);
}
