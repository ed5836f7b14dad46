//! Recordings that leave the lens half open: boards that hardly tilt, or all stand at one distance.

use calib_rays::board::BoardSpec;
use calib_rays::geometry::{PixelPoint, RigidTransform, SensorSize, so3};
use calib_simulate::optics::{Distortion, Lens, Media, PerspectiveLens};
use calib_simulate::{CameraOptics, OpticsKind, Scene, SceneError, SceneSettings};
use nalgebra::{Matrix3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// What the boards of a recording do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Boards {
    /// How many.
    pub count: usize,
    /// Largest tilt against the first camera's sensor, degrees.
    pub tilt_deg: f64,
    /// Least and largest distance over the working distance.
    pub depth: [f64; 2],
    /// Rows and columns of corners.
    pub corners: [usize; 2],
}

/// Twelve in the hand: the faultless recording.
pub const USUAL: Boards = Boards {
    count: 12,
    tilt_deg: 30.0,
    depth: [0.8, 1.25],
    corners: [8, 10],
};
/// Distance of the middle board, mm: some 770 of 1280 px wide.
pub const DISTANCE_MM: f64 = 470.0;
const BASELINE_MM: f64 = 124.0;

/// A pair of ordinary lenses before a board in the hand.
///
/// # Errors
/// If the settings make no scene.
pub fn scene(boards: &Boards, seed: u64) -> Result<Scene, SceneError> {
    let mut settings = SceneSettings::standard_noisy(OpticsKind::Brown, seed);
    let [rows, cols] = boards.corners;
    settings.board = BoardSpec::chessboard(rows, cols, 23.0 * 9.0 / (cols - 1) as f64);
    settings.placements = 1;
    settings.angles_deg = vec![0.0; boards.count];
    let sensor = SensorSize::new(1280, 1024);
    let mut scene = Scene::new(settings)?;
    scene.cameras = [0, 1]
        .map(|idx| CameraOptics::new(sensor, lens(idx), Media::Air))
        .to_vec();
    // Half of the angle between the axes, and the frame that looks straight ahead.
    let half_rad = (BASELINE_MM / 2.0 / DISTANCE_MM).atan() / 2.0;
    let left_from_rig = RigidTransform::new(
        so3::exp(&Vector3::new(0.0, -half_rad, 0.0)),
        Vector3::zeros(),
    );
    let middle = RigidTransform::new(
        Matrix3::identity(),
        Vector3::new(BASELINE_MM / 2.0, 0.0, 0.0),
    );
    scene.left_from_camera[1] = left_from_rig
        * RigidTransform::new(
            so3::exp(&Vector3::new(0.004, -half_rad, 0.006)),
            Vector3::new(BASELINE_MM, 1.5, 4.0),
        );
    let center = scene.settings.board.center_in_board();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    for pose in &mut scene.true_poses {
        let mut draw = |low: f64, high: f64| rng.random_range(low..high);
        let tilt = boards.tilt_deg.to_radians();
        let turn = Vector3::new(draw(-tilt, tilt), draw(-tilt, tilt), draw(-0.3, 0.3));
        let z = DISTANCE_MM * draw(boards.depth[0], boards.depth[1] + 1e-9);
        let place = Vector3::new(0.1 * z * draw(-1.0, 1.0), 0.1 * z * draw(-1.0, 1.0), z);
        let rotation = so3::exp(&turn);
        *pose = left_from_rig * middle * RigidTransform::new(rotation, place - rotation * center);
    }
    Ok(scene)
}

fn lens(idx: usize) -> Lens {
    let [k1, k2, k3, p1, p2] = [
        [-0.180, 0.120, -0.040, 6e-4, -4e-4],
        [-0.165, 0.095, -0.020, -5e-4, 7e-4],
    ][idx];
    let side = 2.0 * idx as f64 - 1.0;
    Lens::Perspective(PerspectiveLens {
        focal_px: [
            1750.0 * (1.0 + 0.004 * side),
            1750.0 * (1.0 + 0.004 * side) * 1.0007,
        ],
        principal: PixelPoint::new(643.5 - 9.0 * side, 506.5 + 6.0 * side),
        distortion: Distortion::Brown { k1, k2, k3, p1, p2 },
        bumps: Vec::new(),
    })
}

/// An exact match: where the point is (left camera), and where each camera sees it.
pub type Exact = (Vector3<f64>, [PixelPoint; 2]);

/// Exact matches at some range of distances over the working distance, all over the left image where
/// the boards were seen; fewer where the right camera does not see them.
pub fn matches(scene: &Scene, depth: [f64; 2], count: usize) -> Vec<Exact> {
    let mut rng = ChaCha8Rng::seed_from_u64(77);
    let mut found = Vec::new();
    for _ in 0..40 * count {
        if found.len() == count {
            break;
        }
        let pixel = PixelPoint::new(
            rng.random_range(60.0..1220.0),
            rng.random_range(60.0..964.0),
        );
        let z = DISTANCE_MM * rng.random_range(depth[0]..depth[1] + 1e-9);
        let point = scene.true_ray(0, pixel).map(|ray| {
            let along = (z - ray.origin_mm.z) / ray.direction.z;
            ray.origin_mm + ray.direction * along
        });
        let Some(point) = point else { continue };
        if let (Some(a), Some(b)) = (scene.true_project(0, &point), scene.true_project(1, &point)) {
            found.push((point, [a, b]));
        }
    }
    found
}
