//! The rigs that faults are planted in, and where they are shown the board.

use crate::preset::{self, Layout, OpticsKind, RigPreset};
use crate::random::{self, Purpose};
use crate::scene::Scene;
use crate::settings::{SceneError, SceneSettings};
use calib_rays::board::BoardSpec;
use calib_rays::geometry::{RigidTransform, SensorSize, so3};
use nalgebra::Vector3;

/// Focal length of the plain lens over that of [`OpticsKind::Brown`]: 1750 px.
const PLAIN_FOCAL: f64 = 1750.0 / 2050.0;

/// 124 mm apart before a board half a meter away.
const PLAIN: Layout = Layout {
    baseline_mm: 124.0,
    distance_mm: 480.0,
    toe_in_mm: 1200.0,
    radius_mm: 60.0,
    spread_shift_mm: [32.0, 28.0],
    spread_look_deg: [0.0, 0.0],
};

/// The same board near a lens of 100 degrees.
const WIDE: Layout = Layout {
    baseline_mm: 90.0,
    distance_mm: 210.0,
    toe_in_mm: 600.0,
    radius_mm: 60.0,
    spread_shift_mm: [0.0, 0.0],
    spread_look_deg: [18.0, 18.0],
};

/// Boards, one a draw in turn.
const BOARDS: [BoardSpec; 3] = [
    BoardSpec::chessboard(8, 10, 23.0),
    BoardSpec::chessboard(9, 12, 18.0),
    BoardSpec::chessboard(7, 6, 30.0),
];

/// Which cameras.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rig {
    /// Ordinary lenses, 40 x 33 degrees, 1280 x 1024 pixels, 124 mm apart.
    Plain,
    /// About 100 x 85 degrees with strong barrel distortion, 90 mm apart.
    Wide,
    /// [`Self::Plain`] behind thick tilted glass plates: not central.
    Window,
}

impl Rig {
    /// Every rig.
    pub const ALL: [Self; 3] = [Self::Plain, Self::Wide, Self::Window];

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Wide => "wide",
            Self::Window => "window",
        }
    }

    fn preset(self) -> RigPreset {
        let (kind, layout) = match self {
            Self::Plain => (OpticsKind::Brown, PLAIN),
            Self::Wide => (OpticsKind::Wide, WIDE),
            Self::Window => (OpticsKind::Window, PLAIN),
        };
        let focal = if self == Self::Wide { 1.0 } else { PLAIN_FOCAL };
        let cameras = preset::rig(kind, SensorSize::new(1280, 1024)).cameras;
        layout.rig(cameras.map(|camera| camera.refocused(focal)), 0.0)
    }
}

/// How the board is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Poses {
    /// On a rotation stage, two placements of seven angles.
    Stage,
    /// In the hand, twelve times.
    HandHeld,
}

impl Poses {
    /// Both ways.
    pub const ALL: [Self; 2] = [Self::Stage, Self::HandHeld];

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Stage => "stage",
            Self::HandHeld => "hand-held",
        }
    }

    /// How many.
    pub fn count(self) -> usize {
        match self {
            Self::Stage => 14,
            Self::HandHeld => 12,
        }
    }
}

/// How far the board is moved about.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Largest tilt against the rig's axis, degrees.
    pub tilt_deg: f64,
    /// How far the distances spread, as a share of what they usually do.
    pub depth: f64,
    /// The same across the image.
    pub across: f64,
    /// Distance over the usual one.
    pub distance: f64,
}

impl Motion {
    /// As a user ought to.
    pub const USUAL: Self = Self {
        tilt_deg: 36.0,
        depth: 1.0,
        across: 1.0,
        distance: 1.0,
    };
}

/// A rig and the board before it, with 0.05 px of noise.
///
/// # Errors
/// None that the rigs here could raise: [`SceneError`] is the scene's own.
pub fn scene(rig: Rig, poses: Poses, motion: &Motion, seed: u64) -> Result<Scene, SceneError> {
    let mut preset = rig.preset();
    preset.distance_mm *= motion.distance;
    preset.scale_spread(motion.across);
    let tilt = motion.tilt_deg / Motion::USUAL.tilt_deg;
    preset.mount.tilt_deg = preset.mount.tilt_deg.map(|angle| angle * tilt);
    let (count, angles_deg) = match poses {
        Poses::Stage => (
            2,
            (-3..=3)
                .map(|k| f64::from(k) / 3.0 * motion.tilt_deg)
                .collect(),
        ),
        Poses::HandHeld => (1, vec![0.0; poses.count()]),
    };
    let mut placements = preset::placements(&preset, count, seed);
    for placement in &mut placements {
        let depth_mm = placement.distance_mm - preset.distance_mm;
        placement.distance_mm = preset.distance_mm + depth_mm * motion.depth;
        placement.axis_tilt_deg = placement.axis_tilt_deg.map(|angle| angle * tilt);
    }
    let spread = [preset.spread_shift_mm, preset.spread_look_deg];
    let mut scene = Scene::of_rig(
        SceneSettings {
            board: BOARDS[(seed.max(1) - 1) as usize % BOARDS.len()].clone(),
            placements: count,
            angles_deg,
            ..SceneSettings::standard_noisy(OpticsKind::Brown, seed)
        },
        preset,
        placements,
    )?;
    if poses == Poses::HandHeld {
        show_by_hand(&mut scene, motion, spread);
    }
    Ok(scene)
}

/// Moves the board of every pose to a place, distance and tilt of its own.
fn show_by_hand(scene: &mut Scene, motion: &Motion, [shift_mm, look_deg]: [[f64; 2]; 2]) {
    let middle_in_board = scene.settings.board.center_in_board();
    let seed = scene.settings.seed;
    for (idx, pose) in scene.true_poses.iter_mut().enumerate() {
        let mut rng = random::stream(seed, Purpose::HandHeld, 0, idx);
        let mut draw = |most: f64| random::between(&mut rng, -most, most);
        let tilt_rad = motion.tilt_deg.to_radians();
        let tilt = Vector3::new(draw(tilt_rad), draw(tilt_rad), draw(0.5));
        let middle = pose.point(&middle_in_board);
        let distance = 1.0 + motion.depth * (0.05 + draw(0.25));
        let place = Vector3::new(
            middle.x + draw(shift_mm[0]) + middle.z * draw(look_deg[0]).to_radians().tan(),
            middle.y + draw(shift_mm[1]) + middle.z * draw(look_deg[1]).to_radians().tan(),
            middle.z * distance,
        );
        let rotation = so3::exp(&tilt) * pose.rotation;
        *pose = RigidTransform::new(rotation, place - rotation * middle_in_board);
    }
}
