//! Planted faults are found by the evidence, with the numbers they were planted with.

use calib_estimate::adjust::Observations;
use calib_estimate::explain::{Explanation, Since, Suspect, explain};
use calib_estimate::init::rig::start_rig;
use calib_estimate::joint::estimate_screened;
use calib_simulate::faults::{Poses, Rig, named, plant};

/// What explains the recording with a fault.
fn found(fault: &str, rig: Rig, poses: Poses, seed: u64) -> Vec<Explanation> {
    let recording = plant(named(fault).unwrap(), rig, poses, seed).unwrap();
    let observations = Observations::new(recording.board, recording.sensors, &recording.views);
    let start = start_rig(&observations).unwrap();
    let (estimate, _) = estimate_screened(&observations, start).unwrap();
    let found = explain(&estimate).into_iter();
    found.map(|(explanation, _)| explanation).collect()
}

/// The first explanation is the fault's own, and its numbers are as planted: within four of their
/// standard deviations, and half a percent for what is linear in it.
fn assert_first(
    fault: &str,
    rig: Rig,
    poses: Poses,
    suspect: Suspect,
    since: &Since,
    values: &[f64],
) {
    let found = found(fault, rig, poses, 1);
    let first = found.first().unwrap_or_else(|| panic!("{fault}: nothing"));
    assert_eq!(
        (first.suspect, &first.since),
        (suspect, since),
        "{fault}: {first:?}"
    );
    for ((value, sd), planted) in first.values.iter().zip(&first.sd).zip(values) {
        let allowed = 4.0 * sd + 5e-3 * planted.abs();
        assert!((value - planted).abs() < allowed, "{fault}: {first:?}");
    }
}

#[test]
fn a_faultless_recording_is_left_alone() {
    for seed in 1..=4 {
        for poses in Poses::ALL {
            let found = found("none", Rig::Plain, poses, seed);
            assert!(found.is_empty(), "seed {seed}, {poses:?}: {found:?}");
        }
    }
}

#[test]
fn squares_longer_one_way_are_told_from_lenses() {
    let (rig, hand) = (Rig::Plain, Poses::HandHeld);
    // Half of it along x and half taken off y: the size of the whole is not in the data.
    assert_first(
        "square-x-long",
        rig,
        hand,
        Suspect::BoardScale,
        &Since::Always,
        &[5e-3],
    );
}

#[test]
fn what_changed_half_way_is_named_and_dated() {
    let hand = Poses::HandHeld;
    let since = Since::Before(6);
    let both = Suspect::Focus { camera_idx: None };
    assert_first("focus-both", Rig::Plain, hand, both, &since, &[1e-3]);
    let left = Suspect::Focus {
        camera_idx: Some(0),
    };
    assert_first("focus-left", Rig::Plain, hand, left, &since, &[1e-3]);
    let origin = Suspect::Shift {
        camera_idx: Some(1),
    };
    assert_first(
        "origin-right-half",
        Rig::Wide,
        hand,
        origin,
        &since,
        &[-0.5, -0.5],
    );
    let turned = Suspect::Turned { camera_idx: 1 };
    let angle = 0.02_f64.to_radians();
    assert_first(
        "right-turned",
        Rig::Wide,
        hand,
        turned,
        &since,
        &[0.0, -angle, 0.0],
    );
}

#[test]
fn what_differs_in_every_pose_is_named() {
    for (fault, suspect) in [
        ("late-all-random", Suspect::Late { camera_idx: 1 }),
        ("flexing", Suspect::BoardFlexes),
    ] {
        let found = found(fault, Rig::Plain, Poses::Stage, 1);
        assert_eq!(
            found.first().map(|found| found.suspect),
            Some(suspect),
            "{fault}"
        );
    }
}
