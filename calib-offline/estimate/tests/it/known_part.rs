//! Poses of which only a part is known: the others are found from them, and the rig as well as if all were.

use calib_estimate::adjust::Observations;
use calib_estimate::init::rig::start_rig;
use calib_estimate::joint::estimate_screened;
use calib_rays::board::BoardSpec;
use calib_rays::geometry::{PixelPoint, Ray, RigidTransform, SensorSize, nearest_point, so3};
use calib_rays::observed::{Corner, KnownPose, View};
use calib_simulate::optics::{CameraOptics, Distortion, Lens, Media, PerspectiveLens};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;

const POSES: usize = 12;
const SENSOR: SensorSize = SensorSize::new(1280, 1024);
/// Uniform errors of this half width, px: a standard deviation of 0.05.
const HALF_WIDTH_PX: f64 = 0.0866;
const BOARD: BoardSpec = BoardSpec::chessboard(7, 9, 12.0);
/// Camera centers, mm, in the frame that poses are known in; the third camera sees another side.
const CENTERS: [[f64; 3]; 3] = [[0.0, 0.0, 0.0], [100.0, 0.0, 0.0], [-420.0, 30.0, 180.0]];
const TURNS: [[f64; 3]; 3] = [[0.0; 3], [0.0, -0.2, 0.0], [0.0, 0.95, 0.0]];

struct Session {
    observations: Observations,
    truth: Vec<RigidTransform>,
}

fn optics() -> CameraOptics {
    let lens = PerspectiveLens {
        focal_px: [1200.0; 2],
        principal: PixelPoint::new(645.0, 505.0),
        distortion: Distortion::Brown {
            k1: -0.1,
            k2: 0.05,
            k3: 0.0,
            p1: 0.0,
            p2: 0.0,
        },
        bumps: Vec::new(),
    };
    CameraOptics::new(SENSOR, Lens::Perspective(lens), Media::Air)
}

/// Boards held in the hand before three cameras.
fn session(seed: u64) -> Session {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = |low: f64, high: f64| rng.random_range(low..high);
    let optics = optics();
    let mut truth = Vec::new();
    let mut views = Vec::new();
    for pose in 0..POSES {
        let turn = Vector3::new(draw(-0.45, 0.45), draw(-0.45, 0.45), draw(-0.5, 0.5));
        let middle = Vector3::new(draw(-50.0, 50.0), draw(-40.0, 40.0), draw(350.0, 550.0));
        let rotation = so3::exp(&turn);
        let rig_from_board =
            RigidTransform::new(rotation, middle - rotation * BOARD.center_in_board());
        truth.push(rig_from_board);
        for (camera_idx, (center, turn)) in CENTERS.iter().zip(TURNS).enumerate() {
            let camera_from_rig =
                RigidTransform::new(so3::exp(&Vector3::from(turn)), Vector3::from(*center))
                    .inverse();
            let mut corners = Vec::new();
            for (row, col) in (0..7).flat_map(|row| (0..9).map(move |col| (row, col))) {
                let point = rig_from_board.point(&BOARD.corner_in_board(row, col));
                let Some(seen) = optics.project(&camera_from_rig.point(&point)) else {
                    continue;
                };
                let (du, dv) = (draw(-1.0, 1.0), draw(-1.0, 1.0));
                let pixel =
                    PixelPoint::new(seen.u + HALF_WIDTH_PX * du, seen.v + HALF_WIDTH_PX * dv);
                if SENSOR.contains(pixel) {
                    corners.push(Corner {
                        row,
                        col,
                        pixel,
                        sigma_px: None,
                    });
                }
            }
            if corners.len() > 20 {
                views.push(View {
                    camera_idx,
                    pose,
                    corners,
                });
            }
        }
    }
    Session {
        observations: Observations::new(BOARD, vec![SENSOR; 3], &views),
        truth,
    }
}

impl Session {
    fn with_known(&self, is_known: impl Fn(usize) -> bool) -> Observations {
        let known: BTreeMap<usize, KnownPose> = (0..POSES)
            .filter(|pose| is_known(*pose))
            .map(|pose| {
                let known = KnownPose {
                    rig_from_board: self.truth[pose],
                    sigma_mm: 0.0,
                    sigma_rad: 0.0,
                };
                (pose, known)
            })
            .collect();
        self.observations.clone().with_known_poses(known)
    }
}

/// Farthest camera center from where it is, mm, of the start and of the estimate, and the farthest start of a board.
fn errors_mm(session: &Session, observations: &Observations) -> [f64; 2] {
    let start = start_rig(observations).unwrap();
    let boards = start.rig_from_board.iter().zip(&session.truth);
    let middle = BOARD.center_in_board();
    let board_mm = boards
        .map(|(found, truth)| (found.unwrap().point(&middle) - truth.point(&middle)).norm())
        .fold(0.0, f64::max);
    let (estimate, _) = estimate_screened(observations, start).unwrap();
    let rig = estimate.rig(&observations.numbered_cameras());
    let centers = rig.cameras.iter().zip(CENTERS).map(|(camera, truth)| {
        let rays: Vec<Ray> = [(300.0, 300.0), (980.0, 320.0), (640.0, 800.0)]
            .into_iter()
            .map(|(u, v)| {
                camera
                    .field
                    .ray(PixelPoint::new(u, v))
                    .transformed(&camera.rig_from_camera)
            })
            .collect();
        (nearest_point(&rays).unwrap() - Vector3::from(truth)).norm()
    });
    [board_mm, centers.fold(0.0, f64::max)]
}

#[test]
fn poses_known_in_part_place_the_others_and_the_rig() {
    for seed in 1..=3 {
        let session = session(seed);
        let all = errors_mm(&session, &session.with_known(|_| true));
        for unknown in [3, 6, 9] {
            // Those known are scattered over the recording, others for every draw.
            let is_known = |pose: usize| (5 * pose + seed as usize) % POSES >= unknown;
            let observations = session.with_known(is_known);
            let [board_mm, center_mm] = errors_mm(&session, &observations);
            // A start is good to what a cubic field lacks: a percent of the distance.
            assert!(board_mm < 5.0, "{seed}, {unknown}: start {board_mm} mm off");
            // What is known fixes six numbers of the rig and its scale; the rest comes from all boards. A quarter of
            // the known boards doubles the error that is theirs; 0.02 mm are what 0.05 px make of the farthest
            // camera.
            assert!(
                center_mm < 2.0 * all[1] + 0.02,
                "{seed}, {unknown}: {center_mm} mm, all known {} mm",
                all[1]
            );
        }
    }
}

/// A camera that sees no known pose is placed by the poses that it shares with the others.
#[test]
fn a_camera_without_a_known_pose_is_placed_through_the_others() {
    let mut session = session(4);
    let known = |pose: usize| pose < 5;
    session
        .observations
        .views
        .retain(|view| view.camera_idx != 2 || !known(view.pose_idx));
    let observations = session.with_known(known);
    let [board_mm, center_mm] = errors_mm(&session, &observations);
    assert!(board_mm < 5.0, "{board_mm}");
    assert!(center_mm < 0.2, "{center_mm}");
}

/// One known pose of a flat board is no solid: cameras are joined over all boards, and it gives the frame.
#[test]
fn one_known_pose_gives_the_frame() {
    let session = session(5);
    let observations = session.with_known(|pose| pose == 7);
    let [board_mm, center_mm] = errors_mm(&session, &observations);
    assert!(board_mm < 8.0, "{board_mm}");
    // The frame is where one view of three cameras sees that board: a hundredth of a degree at 450 mm.
    assert!(center_mm < 0.4, "{center_mm}");
}
