//! Points with known places: a solid target in one pose, plates whose poses are known, and cameras that share no
//! point. Marks are located to whole pixels, which is noise of 0.29 px per axis; the oracle measures the same
//! pixels with the true rays.

use calib_estimate::adjust::Observations;
use calib_estimate::init::InitError;
use calib_estimate::init::rig::start_rig;
use calib_estimate::joint::{Estimate, estimate_screened};
use calib_rays::board::{BoardSpec, KnownPlace};
use calib_rays::field::Rig;
use calib_rays::geometry::{
    PixelPoint, Ray, RigidTransform, SensorSize, nearest_point, so3, triangulate_rays,
};
use calib_rays::measure::{PointSource, RigSource, Sighting};
use calib_rays::observed::{Corner, KnownPose, View};
use calib_simulate::optics::{CameraOptics, Distortion, Lens, Media, PerspectiveLens};
use calib_simulate::tank::Tank;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Marks of a plate of the tank along a side.
const SIDE: usize = 19;

fn whole(pixel: PixelPoint) -> PixelPoint {
    PixelPoint::new(pixel.u.round(), pixel.v.round())
}

fn exact(places: &[Vector3<f64>]) -> BoardSpec {
    BoardSpec::points(places.iter().copied().map(KnownPlace::exact).collect())
}

/// The views of a tank: what a mark is called, by its index, and in which pose.
fn views(tank: &Tank, label: impl Fn(usize) -> (usize, usize, usize)) -> Vec<View> {
    let mut views: BTreeMap<(usize, usize), Vec<Corner>> = BTreeMap::new();
    for seen in tank.seen() {
        let (pose, row, col) = label(seen.mark_idx);
        views
            .entry((pose, seen.camera_idx))
            .or_default()
            .push(Corner {
                row,
                col,
                pixel: whole(seen.pixel),
                sigma_px: None,
            });
    }
    views
        .into_iter()
        .map(|((pose, camera_idx), corners)| View {
            camera_idx,
            pose,
            corners,
        })
        .collect()
}

fn estimated(observations: &Observations) -> (Estimate, Rig) {
    let start = start_rig(observations).unwrap();
    let (estimate, _) = estimate_screened(observations, start).unwrap();
    let rig = estimate.rig(&observations.numbered_cameras());
    (estimate, rig)
}

/// RMS errors of all marks, mm: through a rig, and through the true rays.
fn errors_mm(tank: &Tank, rig: &Rig) -> [f64; 2] {
    let mut by_mark: Vec<Vec<(usize, PixelPoint)>> = vec![Vec::new(); tank.marks_mm.len()];
    for seen in tank.seen() {
        by_mark[seen.mark_idx].push((seen.camera_idx, whole(seen.pixel)));
    }
    let source = RigSource::new(rig, None).unwrap();
    let mut sums = [0.0; 2];
    for (sightings, truth) in by_mark.iter().zip(&tank.marks_mm) {
        let seen: Vec<Sighting<f64>> = sightings
            .iter()
            .map(|(camera_idx, pixel)| (*camera_idx, [pixel.u, pixel.v]))
            .collect();
        let own = Vector3::from(source.point(&seen).unwrap().point_mm);
        let rays: Vec<Ray> = sightings
            .iter()
            .map(|(camera_idx, pixel)| {
                let camera = &tank.cameras[*camera_idx];
                let ray = camera.optics.ray(*pixel).unwrap();
                ray.transformed(&camera.tank_from_camera)
            })
            .collect();
        let oracle = triangulate_rays(&rays).unwrap().point_mm;
        sums[0] += (own - truth).norm_squared();
        sums[1] += (oracle - truth).norm_squared();
    }
    sums.map(|sum| (sum / tank.marks_mm.len() as f64).sqrt())
}

/// What a rig may lose against the oracle: 14440 pixel coordinates pay for some 400 numbers of four lenses, so 3 % of
/// the variance, and three times that as the marks at the rim are a third of all.
const LOSS: f64 = 1.05;

#[test]
fn one_pose_of_a_solid_target_calibrates_a_rig_before_a_tank() {
    let tank = Tank::water();
    let sensors = tank.cameras.iter().map(|c| c.optics.sensor()).collect();
    let views = views(&tank, |mark| (0, 0, mark));
    let observations = Observations::new(exact(&tank.marks_mm), sensors, &views);
    let (estimate, rig) = estimated(&observations);
    // The target's coordinates are the rig's frame.
    let [own, oracle] = errors_mm(&tank, &rig);
    assert!(own < LOSS * oracle, "{own} mm, oracle {oracle} mm");
    // Whole pixels: a twelfth of a px^2 per axis.
    let sigma_px = estimate.noise.variance_px2.sqrt();
    assert!(
        (sigma_px - (1.0f64 / 12.0).sqrt()).abs() < 0.02,
        "{sigma_px}"
    );
}

/// Poses of the tank's plates; `off` is added to where they are said to be.
fn known(
    tank: &Tank,
    sigma_mm: f64,
    off: impl Fn(usize) -> Vector3<f64>,
) -> BTreeMap<usize, KnownPose> {
    let plates = tank.marks_mm.chunks(SIDE * SIDE).enumerate();
    plates
        .map(|(pose, plate)| {
            let place = plate[0] + off(pose);
            let known = KnownPose {
                rig_from_board: RigidTransform::new(so3::exp(&Vector3::zeros()), place),
                sigma_mm,
                sigma_rad: 0.0,
            };
            (pose, known)
        })
        .collect()
}

/// The plate that is moved through the tank as a chessboard whose poses are known. It is said to be flat: a bow that
/// is moved along with it looks like one of the rays.
fn plates(tank: &Tank, known: BTreeMap<usize, KnownPose>) -> Observations {
    let sensors = tank.cameras.iter().map(|c| c.optics.sensor()).collect();
    let in_plate = |mark: usize| mark % (SIDE * SIDE);
    let views = views(tank, |mark| {
        let pose = mark / (SIDE * SIDE);
        (pose, in_plate(mark) / SIDE, in_plate(mark) % SIDE)
    });
    Observations::new(BoardSpec::chessboard(SIDE, SIDE, 15.0), sensors, &views)
        .with_flatness(Some(0.001))
        .with_known_poses(known)
}

#[test]
fn parallel_plates_at_known_depths_calibrate_a_rig() {
    let tank = Tank::water();
    let observations = plates(&tank, known(&tank, 0.0, |_| Vector3::zeros()));
    let (_, rig) = estimated(&observations);
    assert!(rig.frame_is_known);
    let [own, oracle] = errors_mm(&tank, &rig);
    assert!(own < LOSS * oracle, "{own} mm, oracle {oracle} mm");
}

#[test]
fn a_plate_that_stands_elsewhere_than_its_stage_says_is_found_there() {
    let tank = Tank::new(1.0);
    // One plate stands 0.6 mm off, which is two standard deviations.
    let off = |pose: usize| Vector3::new(0.0, 0.0, if pose == 2 { 0.6 } else { 0.0 });
    let observations = plates(&tank, known(&tank, 0.3, off));
    let (estimate, rig) = estimated(&observations);
    let truth = tank.marks_mm[2 * SIDE * SIDE];
    let found = estimate.rig_from_board()[2].translation_mm;
    // Five plates share one frame: a fifth of the error stays in it.
    let away = (found - truth).norm();
    assert!(away < 0.3, "{away} mm");
    assert!(errors_mm(&tank, &rig)[0] < 0.6);
}

/// A camera that looks along z from a distance before a place, or from behind it.
fn facing(sign: f64, focal_px: f64) -> (CameraOptics, RigidTransform) {
    let lens = PerspectiveLens {
        focal_px: [focal_px; 2],
        principal: PixelPoint::new(640.0, 500.0),
        distortion: Distortion::Brown {
            k1: -0.1,
            k2: 0.05,
            k3: 0.0,
            p1: 0.0,
            p2: 0.0,
        },
        bumps: Vec::new(),
    };
    let sensor = SensorSize::new(1280, 1024);
    let optics = CameraOptics::new(sensor, Lens::Perspective(lens), Media::Air);
    let turn = if sign > 0.0 {
        0.0
    } else {
        std::f64::consts::PI
    };
    let rotation = so3::exp(&Vector3::new(0.0, turn, 0.0));
    let camera_from_target = RigidTransform::new(rotation, Vector3::new(0.0, 0.0, 500.0));
    (optics, camera_from_target)
}

#[test]
fn cameras_that_share_no_point_are_joined_through_a_rigid_target() {
    // A block whose near half one camera sees and whose far half the other.
    let places: Vec<Vector3<f64>> = (0..2 * 7 * 7 * 3)
        .map(|k| [k % 7, k / 7 % 7, k / 49].map(f64::from))
        .map(|[x, y, z]| Vector3::new(20.0 * (x - 3.0), 20.0 * (y - 3.0), 15.0 * (z - 2.5)))
        .collect();
    let cameras = [facing(1.0, 1500.0), facing(-1.0, 1400.0)];
    let mut views = Vec::new();
    for (camera_idx, (optics, camera_from_target)) in cameras.iter().enumerate() {
        let sees = |place: &Vector3<f64>| (place.z < 0.0) == (camera_idx == 0);
        let corners = places.iter().enumerate().filter(|(_, place)| sees(place));
        let corners: Vec<Corner> = corners
            .map(|(col, place)| Corner {
                row: 0,
                col,
                pixel: optics.project(&camera_from_target.point(place)).unwrap(),
                sigma_px: None,
            })
            .collect();
        assert_eq!(corners.len(), 147);
        views.push(View {
            camera_idx,
            pose: 0,
            corners,
        });
    }
    let sensors = cameras.iter().map(|(optics, _)| optics.sensor()).collect();
    let observations = Observations::new(exact(&places), sensors, &views);
    let (_, rig) = estimated(&observations);
    for (camera, (_, camera_from_target)) in rig.cameras.iter().zip(&cameras) {
        // The center of rays, wherever the camera's frame has its origin.
        let truth = camera_from_target.inverse().translation_mm;
        let rays: Vec<Ray> = [(300.0, 300.0), (980.0, 320.0), (640.0, 800.0)]
            .into_iter()
            .map(|(u, v)| {
                let ray = camera.field.ray(PixelPoint::new(u, v));
                ray.transformed(&camera.rig_from_camera)
            })
            .collect();
        let center = nearest_point(&rays).unwrap();
        // Exact pixels; what remains are the priors.
        let away = (center - truth).norm();
        assert!(away < 0.05, "{away} mm");
    }
}

#[test]
fn one_pose_of_a_flat_target_determines_nothing() {
    let tank = Tank::new(1.0);
    let sensors = tank.cameras.iter().map(|c| c.optics.sensor()).collect();
    let plate = SIDE * SIDE;
    let mut views = views(&tank, |mark| (mark / plate, 0, mark % plate));
    views.retain(|view| view.pose == 0);
    let observations = Observations::new(exact(&tank.marks_mm[..plate]), sensors, &views);
    let refused = start_rig(&observations).unwrap_err();
    assert!(matches!(refused, InitError::TooFewPoses { have: 1, .. }));
}
