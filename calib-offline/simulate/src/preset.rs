//! The rigs: which optics, how the cameras stand, where the stage is put.
//!
//! Numbers are for a sensor 1280 px wide and scale with its width, so that a larger sensor sees the
//! same scene with more pixels.

use super::optics::{
    Bump, CameraOptics, Distortion, Dome, FisheyeLens, FlatWindow, Lens, Media, PerspectiveLens,
    TelecentricLens,
};
use super::random::{self, Purpose};
use super::stage::{Mount, Placement};
use calib_rays::geometry::{PixelPoint, RigidTransform, SensorSize, so3};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Kinds of optics; both cameras of a rig are of the same kind unless it says otherwise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum OpticsKind {
    /// Pinhole with Brown-Conrady distortion.
    Brown,
    /// The publication's set-up: Brown-Conrady with weak local distortion.
    Paper,
    /// Brown-Conrady with strong local distortion of several pixels.
    Bumps,
    /// Thick tilted glass plate in air before each lens.
    Window,
    /// Flat port into water before each lens: strongly non-central.
    Port,
    /// Spherical port into water, the lens off its center.
    Dome,
    /// 165 degrees, with a pupil that moves along the axis.
    Fisheye,
    /// Cheap wide lens, about 100 x 85 degrees, strong barrel distortion.
    Wide,
    /// Long lens, 9 degrees, at 1.4 m.
    Telephoto,
    /// Parallel rays.
    Telecentric,
    /// Two unlike cameras: other lens, other sensor, other distance.
    Unequal,
}

impl OpticsKind {
    /// Every kind.
    pub const ALL: [Self; 11] = [
        Self::Brown,
        Self::Paper,
        Self::Bumps,
        Self::Window,
        Self::Port,
        Self::Dome,
        Self::Fisheye,
        Self::Wide,
        Self::Telephoto,
        Self::Telecentric,
        Self::Unequal,
    ];

    /// Its name on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Brown => "brown",
            Self::Paper => "paper",
            Self::Bumps => "bumps",
            Self::Window => "window",
            Self::Port => "port",
            Self::Dome => "dome",
            Self::Fisheye => "fisheye",
            Self::Wide => "wide",
            Self::Telephoto => "telephoto",
            Self::Telecentric => "telecentric",
            Self::Unequal => "unequal",
        }
    }
}

/// A rig and the stage before it.
#[derive(Debug, Clone)]
pub(super) struct RigPreset {
    pub cameras: [CameraOptics; 2],
    /// Where the cameras stand on the bench.
    pub bench_from_camera: [RigidTransform; 2],
    pub mount: Mount,
    /// Middle of the working volume along the bench's z, mm.
    pub distance_mm: f64,
    /// How far placements go from the middle: shift across (mm) and look direction (degrees).
    pub spread_shift_mm: [f64; 2],
    pub spread_look_deg: [f64; 2],
}

impl RigPreset {
    /// Brings the placements closer together (or farther apart) across the view.
    pub fn scale_spread(&mut self, share: f64) {
        self.spread_shift_mm = self.spread_shift_mm.map(|shift| shift * share);
        self.spread_look_deg = self.spread_look_deg.map(|look| look * share);
    }
}

/// Geometry that kinds differ in.
pub(super) struct Layout {
    pub baseline_mm: f64,
    pub distance_mm: f64,
    /// Where the axes cross, mm before the bench; infinite for parallel axes.
    pub toe_in_mm: f64,
    pub radius_mm: f64,
    pub spread_shift_mm: [f64; 2],
    pub spread_look_deg: [f64; 2],
}

const NARROW: Layout = Layout {
    baseline_mm: 210.0,
    distance_mm: 350.0,
    toe_in_mm: 355.0,
    radius_mm: 85.0,
    spread_shift_mm: [36.0, 40.0],
    spread_look_deg: [0.0, 0.0],
};

/// Brown-Conrady coefficients of the two lenses (k1, k2, k3, p1, p2): a barrel of about 30 px at
/// the image's corner, and not quite the same twice.
const BROWN: [[f64; 5]; 2] = [
    [-0.180, 0.120, -0.040, 6e-4, -4e-4],
    [-0.165, 0.095, -0.020, -5e-4, 7e-4],
];

pub(super) fn rig(kind: OpticsKind, sensor: SensorSize) -> RigPreset {
    let sensors = match kind {
        OpticsKind::Unequal => [
            sensor,
            SensorSize::new(
                (sensor.width * 3 / 4).max(1),
                (sensor.height * 3 / 4).max(1),
            ),
        ],
        _ => [sensor; 2],
    };
    let cameras = [0, 1].map(|idx| {
        let (lens, media) = camera(kind, idx, sensors[idx]);
        CameraOptics::new(sensors[idx], lens, media)
    });
    let step_mm = if kind == OpticsKind::Unequal {
        60.0
    } else {
        0.0
    };
    layout(kind).rig(cameras, step_mm)
}

impl Layout {
    /// Puts two cameras on the bench, the right one `step_mm` nearer to the scene.
    pub fn rig(&self, cameras: [CameraOptics; 2], step_mm: f64) -> RigPreset {
        let bench_from_camera = [-1.0, 1.0].map(|side: f64| {
            let toe_in_rad = (self.baseline_mm / 2.0 / self.toe_in_mm).atan();
            // A mechanical rig is never square: small turns and offsets, mirrored by no symmetry.
            let crooked = Vector3::new(0.006 - 0.009 * side, 0.0, 0.011 * side + 0.004);
            RigidTransform::new(
                so3::exp(&Vector3::new(0.0, -side * toe_in_rad, 0.0)) * so3::exp(&crooked),
                Vector3::new(
                    side * self.baseline_mm / 2.0,
                    1.5 * side,
                    2.0 * side + step_mm * (side + 1.0) / 2.0,
                ),
            )
        });
        RigPreset {
            cameras,
            bench_from_camera,
            mount: Mount {
                radius_mm: self.radius_mm,
                tilt_deg: [4.0, -2.0, 1.5],
            },
            distance_mm: self.distance_mm,
            spread_shift_mm: self.spread_shift_mm,
            spread_look_deg: self.spread_look_deg,
        }
    }
}

fn layout(kind: OpticsKind) -> Layout {
    match kind {
        OpticsKind::Fisheye => Layout {
            baseline_mm: 140.0,
            distance_mm: 230.0,
            toe_in_mm: f64::INFINITY,
            radius_mm: 190.0,
            spread_shift_mm: [0.0, 0.0],
            spread_look_deg: [46.0, 38.0],
        },
        OpticsKind::Wide => Layout {
            baseline_mm: 90.0,
            distance_mm: 140.0,
            toe_in_mm: 400.0,
            radius_mm: 110.0,
            spread_shift_mm: [0.0, 0.0],
            spread_look_deg: [18.0, 18.0],
        },
        OpticsKind::Telephoto => Layout {
            baseline_mm: 420.0,
            distance_mm: 1400.0,
            toe_in_mm: 1400.0,
            ..NARROW
        },
        OpticsKind::Telecentric => Layout {
            spread_shift_mm: [15.0, 20.0],
            ..NARROW
        },
        _ => NARROW,
    }
}

fn camera(kind: OpticsKind, idx: usize, sensor: SensorSize) -> (Lens, Media) {
    let scale = f64::from(sensor.width) / 1280.0;
    let side = if idx == 0 { -1.0 } else { 1.0 };
    let center = sensor.center();
    let principal = PixelPoint::new(
        center.u + scale * (4.0 - 9.0 * side),
        center.v + scale * (6.0 * side - 5.0),
    );
    let perspective = |focal_px: f64, distortion: Distortion, bumps: Vec<Bump>| {
        let focal_px = focal_px * scale * (1.0 + 0.004 * side);
        Lens::Perspective(PerspectiveLens {
            focal_px: [focal_px, focal_px * 1.0007],
            principal,
            distortion,
            bumps,
        })
    };
    let [k1, k2, k3, p1, p2] = BROWN[idx];
    let brown = Distortion::Brown { k1, k2, k3, p1, p2 };
    // Into water the same lens sees a narrower field; the shorter one keeps the scene.
    match kind {
        OpticsKind::Brown => (perspective(2050.0, brown, Vec::new()), Media::Air),
        OpticsKind::Paper => (
            perspective(2050.0, brown, paper_bumps(idx, sensor)),
            Media::Air,
        ),
        OpticsKind::Bumps => (
            perspective(2050.0, brown, strong_bumps(idx, sensor)),
            Media::Air,
        ),
        OpticsKind::Window => (
            perspective(2050.0, brown, Vec::new()),
            Media::Flat(FlatWindow {
                normal: tilted_normal(8.0, 24.0 * side),
                distance_mm: 40.0,
                thickness_mm: 12.0,
                index: 1.52,
                index_behind: 1.0,
            }),
        ),
        OpticsKind::Port => (
            perspective(1540.0, brown, Vec::new()),
            Media::Flat(FlatWindow {
                normal: tilted_normal(1.5, 2.0 * side),
                distance_mm: 30.0,
                thickness_mm: 12.0,
                index: 1.49,
                index_behind: 1.333,
            }),
        ),
        OpticsKind::Dome => (
            perspective(2330.0, brown, Vec::new()),
            Media::Dome(Dome {
                center_mm: Vector3::new(4.0 * side, -6.0, 12.0),
                inner_radius_mm: 50.0,
                thickness_mm: 7.0,
                index: 1.49,
                index_behind: 1.333,
            }),
        ),
        OpticsKind::Fisheye => (fisheye(sensor, principal, side), Media::Air),
        OpticsKind::Wide => {
            let division = Distortion::Division {
                l1: -0.20 + 0.01 * side,
                l2: 0.012,
            };
            (perspective(640.0, division, Vec::new()), Media::Air)
        }
        OpticsKind::Telephoto => {
            let weak = Distortion::Brown {
                k1: 0.35 + 0.1 * side,
                k2: 0.0,
                k3: 0.0,
                p1: 2e-4,
                p2: -3e-4,
            };
            (perspective(8000.0, weak, Vec::new()), Media::Air)
        }
        OpticsKind::Telecentric => (
            Lens::Telecentric(TelecentricLens {
                mm_per_px: 0.14 / scale,
                principal,
                skew_rad_per_mm: 1e-5,
            }),
            Media::Air,
        ),
        OpticsKind::Unequal => {
            let focal_px = if idx == 0 { 2280.0 } else { 1680.0 };
            (perspective(focal_px, brown, Vec::new()), Media::Air)
        }
    }
}

/// 165 degrees across 1270 of 1280 px; the pupil moves by some 3 mm.
fn fisheye(sensor: SensorSize, principal: PixelPoint, side: f64) -> Lens {
    let long_side = f64::from(sensor.width.min(sensor.height * 5 / 4));
    Lens::Fisheye(FisheyeLens {
        focal_px: 440.0 * long_side / 1280.0 * (1.0 + 0.004 * side),
        principal,
        k1: 0.012 + 0.004 * side,
        k2: -0.006,
        pupil_mm: [1.4 + 0.1 * side, 0.15],
        max_angle_rad: 82.5_f64.to_radians(),
    })
}

/// Unit normal of a plate turned by degrees about x and y from facing the lens.
fn tilted_normal(about_x_deg: f64, about_y_deg: f64) -> Vector3<f64> {
    so3::exp(&Vector3::new(
        about_x_deg.to_radians(),
        about_y_deg.to_radians(),
        0.0,
    )) * Vector3::z()
}

/// Weak local distortion: 0.3 to 0.8 px over 90 to 160 px.
fn paper_bumps(idx: usize, sensor: SensorSize) -> Vec<Bump> {
    bumps(idx, sensor, 14, [0.3, 0.8], [90.0, 160.0])
}

/// Strong local distortion: 2 to 5 px over 80 to 150 px.
fn strong_bumps(idx: usize, sensor: SensorSize) -> Vec<Bump> {
    bumps(idx, sensor, 12, [2.0, 5.0], [80.0, 150.0])
}

/// Bumps at fixed pseudo-random places: a lens does not change with the scene's seed.
fn bumps(
    idx: usize,
    sensor: SensorSize,
    count: usize,
    amplitude_px: [f64; 2],
    width_px: [f64; 2],
) -> Vec<Bump> {
    let scale = f64::from(sensor.width) / 1280.0;
    let mut rng = random::stream(0x0b75, Purpose::Placements, idx, count);
    (0..count)
        .map(|_| {
            let center = PixelPoint::new(
                random::between(&mut rng, 0.05, 0.95) * f64::from(sensor.width) - 0.5,
                random::between(&mut rng, 0.05, 0.95) * f64::from(sensor.height) - 0.5,
            );
            let size = scale * random::between(&mut rng, amplitude_px[0], amplitude_px[1]);
            let angle = random::between(&mut rng, 0.0, std::f64::consts::TAU);
            Bump {
                center,
                amplitude_px: [size * angle.cos(), size * angle.sin()],
                width_px: scale * random::between(&mut rng, width_px[0], width_px[1]),
            }
        })
        .collect()
}

/// Where the first placements stand, as fractions of the spread: across, down, and nearer.
const PLACEMENTS: [[f64; 3]; 5] = [
    [-1.0, -1.0, -0.06],
    [1.0, 1.0, 0.06],
    [1.0, -1.0, 0.03],
    [-1.0, 1.0, -0.03],
    [0.0, 0.0, 0.0],
];

/// `count` placements: one stands in the middle, two on a diagonal at two depths, five at the
/// corners and in the middle, any more at random.
pub(super) fn placements(rig: &RigPreset, count: usize, seed: u64) -> Vec<Placement> {
    (0..count)
        .map(|idx| {
            let mut rng = random::stream(seed, Purpose::Placements, 0, idx);
            let [x, y, depth] = if count == 1 {
                [0.0; 3]
            } else if let Some(place) = PLACEMENTS.get(idx) {
                *place
            } else {
                [
                    random::between(&mut rng, -1.0, 1.0),
                    random::between(&mut rng, -1.0, 1.0),
                    random::between(&mut rng, -0.06, 0.06),
                ]
            };
            placement(rig, [x, y, depth], idx)
        })
        .collect()
}

/// A placement at fractions of the spread (right, down) and of the distance.
pub(super) fn placement(rig: &RigPreset, fraction: [f64; 3], idx: usize) -> Placement {
    let [x, y, depth] = fraction;
    Placement {
        look_deg: [x * rig.spread_look_deg[0], -y * rig.spread_look_deg[1]],
        shift_mm: [x * rig.spread_shift_mm[0], y * rig.spread_shift_mm[1]],
        distance_mm: rig.distance_mm * (1.0 + depth),
        axis_tilt_deg: [3.0 - 2.0 * (idx % 4) as f64, -4.0 + 3.0 * (idx % 3) as f64],
    }
}
