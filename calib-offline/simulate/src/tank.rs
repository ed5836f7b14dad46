//! Cameras in air that look through one glass wall into water, and a plate of marks that is moved to known
//! depths: how laboratories that measure flow calibrate. What the cameras see of all places together is one
//! solid target, whose frame is the tank's.

use crate::optics::{CameraOptics, Distortion, FlatWindow, Lens, Media, PerspectiveLens};
use calib_rays::geometry::{PixelPoint, RigidTransform, SensorSize, so3};
use nalgebra::{Matrix3, Vector3};

/// Sensor of every camera.
const SENSOR: SensorSize = SensorSize {
    width: 2560,
    height: 2160,
};
/// Focal length, px.
const FOCAL_PX: f64 = 9200.0;
/// Distance of the cameras from the middle of the marks, mm.
const DISTANCE_MM: f64 = 1500.0;
/// Where the cameras stand: angles from the wall's normal about the vertical and the horizontal, degrees.
const ANGLES_DEG: [[f64; 2]; 4] = [[-18.0, -9.0], [18.0, -10.0], [-16.0, 11.0], [20.0, 9.0]];
/// Marks along a side of the plate, and their pitch, mm.
const MARKS: usize = 19;
const PITCH_MM: f64 = 15.0;
/// Depths of the plate, mm.
const DEPTHS_MM: [f64; 5] = [26.0, 88.0, 150.0, 212.0, 274.0];
/// Inner face of the wall, mm in z: the plate stands behind it, the cameras before.
const WALL_MM: f64 = -20.0;
/// Thickness of the wall, mm, and its refractive index.
const GLASS: (f64, f64) = (12.0, 1.52);
/// Refractive index of water.
const WATER: f64 = 1.333;

/// One camera of a tank.
#[derive(Debug, Clone)]
pub struct TankCamera {
    /// Name.
    pub name: String,
    /// Lens and wall.
    pub optics: CameraOptics,
    /// Where it is; the tank's frame is that of the marks.
    pub tank_from_camera: RigidTransform,
}

/// Four cameras before a tank.
#[derive(Debug, Clone)]
pub struct Tank {
    /// The cameras.
    pub cameras: Vec<TankCamera>,
    /// The marks, mm: plate by plate.
    pub marks_mm: Vec<Vector3<f64>>,
}

/// A mark as a camera sees it.
#[derive(Debug, Clone, Copy)]
pub struct SeenMark {
    /// Index of the camera.
    pub camera_idx: usize,
    /// Index of the mark.
    pub mark_idx: usize,
    /// Exactly.
    pub pixel: PixelPoint,
}

impl Tank {
    /// The tank; `index_behind` is what it is filled with, [`Tank::water`] unless it is empty.
    pub fn new(index_behind: f64) -> Self {
        let middle_mm = PITCH_MM * (MARKS + 1) as f64 / 2.0;
        let middle = Vector3::new(middle_mm, middle_mm, DEPTHS_MM[DEPTHS_MM.len() / 2]);
        let cameras = ANGLES_DEG
            .iter()
            .enumerate()
            .map(|(k, angles)| camera(k, angles.map(f64::to_radians), &middle, index_behind))
            .collect();
        let marks_mm = DEPTHS_MM
            .iter()
            .flat_map(|z| {
                (0..MARKS * MARKS).map(move |k| {
                    let [x, y] = [k % MARKS, k / MARKS].map(|k| PITCH_MM * (k + 1) as f64);
                    Vector3::new(x, y, *z)
                })
            })
            .collect();
        Self { cameras, marks_mm }
    }

    /// Filled with water.
    pub fn water() -> Self {
        Self::new(WATER)
    }

    /// All marks in all cameras, camera by camera.
    pub fn seen(&self) -> Vec<SeenMark> {
        let cameras = self.cameras.iter().enumerate();
        cameras
            .flat_map(|(camera_idx, camera)| {
                let camera_from_tank = camera.tank_from_camera.inverse();
                let marks = self.marks_mm.iter().enumerate();
                marks.filter_map(move |(mark_idx, mark)| {
                    Some(SeenMark {
                        camera_idx,
                        mark_idx,
                        pixel: camera.optics.project(&camera_from_tank.point(mark))?,
                    })
                })
            })
            .collect()
    }
}

fn camera(
    k: usize,
    [across, up]: [f64; 2],
    middle: &Vector3<f64>,
    index_behind: f64,
) -> TankCamera {
    let turn = so3::exp(&Vector3::new(up, 0.0, 0.0)) * so3::exp(&Vector3::new(0.0, across, 0.0));
    // From the tank's axes to the camera's; the camera looks along z, as the tank gets deeper.
    let camera_from_tank: Matrix3<f64> = turn;
    let toward = camera_from_tank.transpose() * Vector3::z();
    let place = middle - toward * DISTANCE_MM;
    let tank_from_camera = RigidTransform::new(camera_from_tank.transpose(), place);
    let lens = PerspectiveLens {
        focal_px: [FOCAL_PX, FOCAL_PX * 1.0005],
        principal: PixelPoint::new(1279.5 + 14.0 * k as f64, 1079.5 - 11.0 * k as f64),
        distortion: Distortion::Brown {
            k1: -0.11 + 0.02 * k as f64,
            k2: 0.3,
            k3: 0.0,
            p1: 2e-4,
            p2: -3e-4,
        },
        bumps: Vec::new(),
    };
    let wall = FlatWindow {
        normal: camera_from_tank * Vector3::z(),
        distance_mm: WALL_MM - GLASS.0 - place.z,
        thickness_mm: GLASS.0,
        index: GLASS.1,
        index_behind,
    };
    TankCamera {
        name: format!("cam{k}"),
        optics: CameraOptics::new(SENSOR, Lens::Perspective(lens), Media::Flat(wall)),
        tank_from_camera,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_see_nearly_all_marks_and_their_rays_meet_there() {
        let tank = Tank::water();
        let seen = tank.seen();
        // The nearest corners of the cell are just outside one image.
        assert!(100 * seen.len() >= 99 * tank.cameras.len() * tank.marks_mm.len());
        for mark in seen.iter().step_by(97) {
            let camera = &tank.cameras[mark.camera_idx];
            let ray = camera.optics.ray(mark.pixel).unwrap();
            let ray = ray.transformed(&camera.tank_from_camera);
            assert!(ray.distance_mm(&tank.marks_mm[mark.mark_idx]) < 1e-8);
        }
    }
}
