//! The faults by name.

use super::labels::{
    exchange_cameras, half_turn, mirror, repeat_positions, right_one_late, shift_rows,
};
use super::pixels::{count_from_the_edge, count_upwards, exchange_axes};
use super::recording::Recording;
use super::rigs::{Motion, Poses};
use super::session::{Session, Take};
use crate::random;
use crate::settings::SceneSettings;
use calib_rays::geometry::{RigidTransform, so3};
use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;

/// What is wrong, by where it happens.
#[derive(Debug, Clone, Copy)]
pub enum Step {
    /// Nothing is.
    Nothing,
    /// The board is shown too little of the time, or of the space.
    Motion(fn(&mut Motion)),
    /// Of the board or the noise throughout.
    Scene(fn(&mut SceneSettings)),
    /// Of single takes.
    Session(fn(&mut Session, &mut ChaCha8Rng)),
    /// Of what was written down.
    Written(fn(&mut Recording, &mut ChaCha8Rng)),
}

/// A fault.
#[derive(Debug, Clone, Copy)]
pub struct Fault {
    /// For tables and arguments.
    pub name: &'static str,
    /// By which a program may name it first; none if there is nothing to name.
    pub codes: &'static [&'static str],
    /// Whether the recording differs from every faultless one of some other rig and board.
    pub is_visible: bool,
    /// The only way of showing the board that has it, if not both have.
    pub only: Option<Poses>,
    /// How it is planted.
    pub step: Step,
}

const fn fault(name: &'static str, codes: &'static [&'static str], step: Step) -> Fault {
    Fault {
        name,
        codes,
        is_visible: true,
        only: None,
        step,
    }
}

/// Faults that leave a recording as some other rig or board would have made it.
const fn unseen(name: &'static str, codes: &'static [&'static str], step: Step) -> Fault {
    Fault {
        is_visible: false,
        ..fault(name, codes, step)
    }
}

const fn on_stage(fault: Fault) -> Fault {
    Fault {
        only: Some(Poses::Stage),
        ..fault
    }
}

const LEFT: &[usize] = &[0];
const RIGHT: &[usize] = &[1];
const BOTH: &[usize] = &[0, 1];

/// Every fault; the first is none.
pub const FAULTS: &[Fault] = &[
    fault("none", &[], Step::Nothing),
    // The board.
    fault(
        "square-x-long",
        &["square-scale-axis"],
        Step::Session(|s, _| board(s, [1.005, 0.0])),
    ),
    fault(
        "board-sheared",
        &["square-scale-axis"],
        Step::Session(|s, _| board(s, [1.0, 0.005])),
    ),
    fault(
        "square-in-m",
        &["square-unit"],
        Step::Written(|r, _| r.board.square_mm *= 1e-3),
    ),
    fault(
        "square-in-cm",
        &["square-unit"],
        Step::Written(|r, _| r.board.square_mm *= 0.1),
    ),
    fault(
        "square-in-inches",
        &["square-unit"],
        Step::Written(|r, _| r.board.square_mm /= 25.4),
    ),
    unseen(
        "square-small",
        &["square-unit"],
        Step::Written(|r, _| r.board.square_mm *= 0.995),
    ),
    fault(
        "rows-cols-swapped",
        &["rows-cols-swapped"],
        Step::Written(|r, _| std::mem::swap(&mut r.board.rows, &mut r.board.cols)),
    ),
    fault(
        "bowed-0.2mm",
        &["board-bowed"],
        Step::Scene(|s| s.bow_mm = 0.2),
    ),
    fault(
        "bowed-2mm",
        &["board-bowed"],
        Step::Scene(|s| s.bow_mm = 2.0),
    ),
    fault("flexing", &["board-flexes"], Step::Session(flexing)),
    // Labels and numbers.
    fault(
        "half-turn-some",
        &["labels-turned"],
        Step::Written(|r, rng| {
            let some = some_poses(r, rng);
            half_turn(r, |view| view.camera_idx == 1 && some.contains(&view.pose));
        }),
    ),
    fault(
        "mirrored-some",
        &["labels-mirrored"],
        Step::Written(|r, rng| {
            let some = some_poses(r, rng);
            mirror(r, |view| view.camera_idx == 1 && some.contains(&view.pose));
        }),
    ),
    fault(
        "mirrored-all",
        &["labels-mirrored", "v-upwards"],
        Step::Written(|r, _| mirror(r, |_| true)),
    ),
    fault(
        "row-shift-right-one",
        &["labels-shifted"],
        Step::Written(|r, rng| {
            let one = some_poses(r, rng)[0];
            shift_rows(r, |view| view.camera_idx == 1 && view.pose == one);
        }),
    ),
    unseen(
        "row-shift-both-one",
        &["labels-shifted"],
        Step::Written(|r, rng| {
            let one = some_poses(r, rng)[0];
            shift_rows(r, |view| view.pose == one);
        }),
    ),
    fault(
        "row-shift-right-all",
        &["labels-shifted"],
        Step::Written(|r, _| {
            shift_rows(r, |view| view.camera_idx == 1);
        }),
    ),
    fault(
        "exchanged-all",
        &["cameras-exchanged"],
        Step::Written(|r, _| {
            exchange_cameras(r, |_| true);
        }),
    ),
    fault(
        "exchanged-some",
        &["cameras-exchanged"],
        Step::Written(|r, rng| {
            let some = some_poses(r, rng);
            exchange_cameras(r, |pose| some.contains(&pose));
        }),
    ),
    fault(
        "poses-from-1",
        &["pose-numbering"],
        Step::Written(|r, _| {
            r.views.iter_mut().for_each(|view| view.pose += 1);
        }),
    ),
    fault(
        "right-one-late",
        &["pose-numbering"],
        Step::Written(|r, _| right_one_late(r)),
    ),
    // Where the board was shown.
    fault(
        "few-tilts",
        &["few-tilts"],
        Step::Motion(|m| m.tilt_deg = 3.0),
    ),
    fault(
        "frontal-one-depth",
        &["one-depth", "few-tilts"],
        Step::Motion(|m| {
            m.tilt_deg = 2.0;
            m.depth = 0.0;
        }),
    ),
    fault("one-depth", &["one-depth"], Step::Motion(|m| m.depth = 0.0)),
    fault(
        "middle-only",
        &["coverage"],
        Step::Motion(|m| {
            m.distance = 1.7;
            m.across = 0.1;
        }),
    ),
    fault(
        "poses-2",
        &["few-poses"],
        Step::Written(|r, _| few_poses(r, 2)),
    ),
    fault(
        "poses-3",
        &["few-poses"],
        Step::Written(|r, _| few_poses(r, 3)),
    ),
    fault(
        "poses-4",
        &["few-poses"],
        Step::Written(|r, _| few_poses(r, 4)),
    ),
    fault(
        "poses-5",
        &["few-poses"],
        Step::Written(|r, _| few_poses(r, 5)),
    ),
    fault(
        "copies",
        &["duplicates"],
        Step::Written(|r, _| {
            let poses = pose_count(r);
            repeat_positions(r, 4, poses);
        }),
    ),
    fault("standing-some", &["duplicates"], Step::Session(standing)),
    // When it was exposed.
    fault(
        "late-some",
        &["not-simultaneous"],
        Step::Session(|s, rng| {
            for pose in draw_poses(s.pose_count(), rng) {
                late(&mut s.takes[1][pose], &(direction(rng) * LATE_MM));
            }
        }),
    ),
    fault(
        "late-all-random",
        &["not-simultaneous"],
        Step::Session(|s, rng| {
            for (_, take) in s.of(RIGHT) {
                late(take, &(direction(rng) * LATE_MM));
            }
        }),
    ),
    unseen(
        "late-all-same",
        &["not-simultaneous"],
        Step::Session(|s, rng| {
            let shift = direction(rng) * LATE_MM;
            s.of(RIGHT).for_each(|(_, take)| late(take, &shift));
        }),
    ),
    fault(
        "skew-per-pose",
        &["rolling-shutter"],
        Step::Session(|s, rng| {
            s.of(BOTH)
                .for_each(|(_, take)| take.skew_px = random::between(rng, -1.0, 1.0));
        }),
    ),
    unseen(
        "skew-same",
        &["rolling-shutter"],
        Step::Session(|s, _| {
            s.of(BOTH).for_each(|(_, take)| take.skew_px = 1.0);
        }),
    ),
    // What changed half way.
    fault(
        "focus-both",
        &["focus-changed"],
        Step::Session(|s, _| {
            s.second_half(BOTH)
                .for_each(|take| take.camera = take.camera.refocused(1.001));
        }),
    ),
    fault(
        "focus-left",
        &["focus-changed"],
        Step::Session(|s, _| {
            s.second_half(LEFT)
                .for_each(|take| take.camera = take.camera.refocused(1.001));
        }),
    ),
    fault(
        "half-size-half",
        &["image-size"],
        Step::Session(|s, _| {
            s.second_half(BOTH)
                .for_each(|take| take.camera = take.camera.half_size());
        }),
    ),
    fault(
        "window-40-24",
        &["window-shifted"],
        Step::Session(|s, _| {
            let by_px = [40.0, 24.0];
            s.second_half(BOTH)
                .for_each(|take| take.camera = take.camera.window_moved(by_px));
        }),
    ),
    fault(
        "window-right-4",
        &["window-shifted"],
        Step::Session(|s, _| {
            let by_px = [4.0, 0.0];
            s.second_half(RIGHT)
                .for_each(|take| take.camera = take.camera.window_moved(by_px));
        }),
    ),
    fault(
        "right-turned",
        &["camera-moved"],
        Step::Session(|s, _| {
            let turn = so3::exp(&Vector3::new(0.0, 0.02_f64.to_radians(), 0.0));
            let turn = RigidTransform::new(turn, Vector3::zeros());
            s.second_half(RIGHT)
                .for_each(|take| take.left_from_camera = take.left_from_camera * turn);
        }),
    ),
    fault(
        "baseline-longer",
        &["baseline-changed", "camera-moved"],
        Step::Session(|s, _| {
            s.second_half(RIGHT)
                .for_each(|take| take.left_from_camera.translation_mm *= 1.001);
        }),
    ),
    // Pixels.
    unseen(
        "origin-right-all",
        &["pixel-origin"],
        Step::Written(|r, _| {
            count_from_the_edge(r, |view| view.camera_idx == 1);
        }),
    ),
    fault(
        "origin-right-half",
        &["pixel-origin"],
        Step::Written(|r, _| {
            let half = pose_count(r) / 2;
            count_from_the_edge(r, |view| view.camera_idx == 1 && view.pose < half);
        }),
    ),
    fault(
        "v-upwards-both",
        &["v-upwards"],
        Step::Written(|r, _| count_upwards(r, |_| true)),
    ),
    fault(
        "v-upwards-right",
        &["v-upwards"],
        Step::Written(|r, _| {
            count_upwards(r, |view| view.camera_idx == 1);
        }),
    ),
    fault(
        "uv-exchanged",
        &["uv-exchanged"],
        Step::Written(|r, _| exchange_axes(r)),
    ),
    fault("noise-1px", &["noise"], Step::Scene(|s| s.noise_px = 1.0)),
    fault(
        "outliers",
        &["outliers"],
        Step::Scene(|s| s.outlier_share = 0.08),
    ),
    // The dial; it may count either way.
    on_stage(unseen(
        "dial-other-sense",
        &[],
        Step::Written(|r, _| dial(r, |a| -a)),
    )),
    on_stage(fault(
        "dial-radians",
        &["stage-angles"],
        Step::Written(|r, _| {
            dial(r, f64::to_radians);
        }),
    )),
    on_stage(fault(
        "dial-shifted",
        &["stage-angles"],
        Step::Written(|r, _| {
            if let Some(dial) = &mut r.dial {
                dial.angles_deg.rotate_right(1);
            }
        }),
    )),
];

/// How far the board goes on before a late exposure, mm.
const LATE_MM: f64 = 0.3;

/// Views that a fault of some poses has.
const SOME: usize = 3;

fn pose_count(recording: &Recording) -> usize {
    recording
        .views
        .iter()
        .map(|view| view.pose + 1)
        .max()
        .unwrap_or(0)
}

/// [`SOME`] different poses, the first one, which is the datum, not among them.
fn draw_poses(count: usize, rng: &mut ChaCha8Rng) -> Vec<usize> {
    let mut left: Vec<usize> = (1..count).collect();
    let mut drawn = Vec::new();
    while drawn.len() < SOME && !left.is_empty() {
        let idx = (random::uniform(rng) * left.len() as f64) as usize;
        drawn.push(left.swap_remove(idx.min(left.len() - 1)));
    }
    drawn
}

fn some_poses(recording: &Recording, rng: &mut ChaCha8Rng) -> Vec<usize> {
    draw_poses(pose_count(recording), rng)
}

/// So many poses, spread over all.
fn few_poses(recording: &mut Recording, count: usize) {
    let all = pose_count(recording);
    let kept: Vec<usize> = (0..count).map(|k| k * (all - 1) / (count - 1)).collect();
    recording.keep_poses(&kept);
}

fn direction(rng: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::new(
        random::normal(rng),
        random::normal(rng),
        random::normal(rng),
    )
    .normalize()
}

fn late(take: &mut Take, shift_mm: &Vector3<f64>) {
    take.left_from_board.translation_mm += shift_mm;
}

fn board(session: &mut Session, stretch_and_shear: [f64; 2]) {
    session
        .of(BOTH)
        .for_each(|(_, take)| take.stretch_and_shear = stretch_and_shear);
}

/// Another bow in every pose, up to 0.2 mm either way.
fn flexing(session: &mut Session, rng: &mut ChaCha8Rng) {
    for pose in 0..session.pose_count() {
        let bow_mm = random::between(rng, -0.2, 0.2);
        session
            .takes
            .iter_mut()
            .for_each(|takes| takes[pose].bow_mm = bow_mm);
    }
}

/// A board that did not move before [`SOME`] poses.
fn standing(session: &mut Session, rng: &mut ChaCha8Rng) {
    for pose in draw_poses(session.pose_count(), rng) {
        for takes in &mut session.takes {
            takes[pose].left_from_board = takes[pose - 1].left_from_board;
        }
    }
}

fn dial(recording: &mut Recording, told: fn(f64) -> f64) {
    if let Some(dial) = &mut recording.dial {
        dial.angles_deg
            .iter_mut()
            .for_each(|angle| *angle = told(*angle));
    }
}
