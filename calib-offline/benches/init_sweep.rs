//! How often initialization finds its way, over many simulated rigs: one line per rig, then counts.
//!
//! ```text
//! cargo bench -p calib-offline --bench init_sweep [-- ONLY]
//! ```
//!
//! `ONLY` is part of a line's name ("fisheye", "640x480", "hand-held" ...).

use calib_estimate::adjust::Observations;
use calib_estimate::init::rig::start_rig;
use calib_estimate::init::screening::Finding;
use calib_rays::board::BoardSpec;
use calib_rays::geometry::{RigidTransform, SensorSize, so3};
use calib_simulate::{CameraOptics, OpticsKind, Scene, SceneSettings};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// How the board is moved.
#[derive(Debug, Clone, Copy)]
enum Motion {
    Stage(usize),
    HandHeld(usize),
}

fn main() {
    let mut arguments = std::env::args()
        .skip(1)
        .filter(|argument| argument != "--bench");
    let only = arguments.next().unwrap_or_default();
    let sensors = [
        SensorSize::new(640, 480),
        SensorSize::new(1280, 1024),
        SensorSize::new(6000, 4000),
    ];
    let motions = [
        ("1 placement", Motion::Stage(1)),
        ("2 placements", Motion::Stage(2)),
        ("hand-held 12", Motion::HandHeld(12)),
        ("hand-held 6", Motion::HandHeld(6)),
    ];
    let (mut runs, mut refused, mut wrong, mut accused) = (0, 0, 0, 0);
    for optics in OpticsKind::ALL {
        for sensor in sensors {
            for (motion_name, motion) in motions {
                for outlier_share in [0.0, 0.05] {
                    let name = format!(
                        "{}, {sensor}, {motion_name}, {:.0} % outliers",
                        optics.name(),
                        100.0 * outlier_share
                    );
                    if !name.contains(&only) {
                        continue;
                    }
                    runs += 1;
                    match judge(&scene(optics, sensor, motion, outlier_share)) {
                        Err(error) => {
                            refused += 1;
                            println!("{name}: REFUSED {error}");
                        }
                        Ok(found) => {
                            let bad = found.worst_turn_deg > 3.0;
                            wrong += usize::from(bad);
                            accused += usize::from(!found.findings.is_empty());
                            println!(
                                "{name}: {}medians {:.3?} px, poses off by {:.2} degrees at most, {:.2} in the middle; {} views accused",
                                if bad { "WRONG " } else { "" },
                                found.median_px,
                                found.worst_turn_deg,
                                found.median_turn_deg,
                                found.findings.len()
                            );
                            for finding in &found.findings {
                                println!("    {finding:?}");
                            }
                        }
                    }
                }
            }
        }
    }
    println!("{runs} rigs: {refused} refused, {wrong} wrong, {accused} with sound views accused");
}

fn scene(optics: OpticsKind, sensor: SensorSize, motion: Motion, outlier_share: f64) -> Scene {
    let mut settings = SceneSettings {
        sensor,
        outlier_share,
        ..SceneSettings::standard_noisy(optics, 7)
    };
    if let Motion::Stage(placements) = motion {
        if !(optics == OpticsKind::Fisheye && placements > 1) {
            settings.placements = placements;
        }
        return Scene::new(settings).expect("the settings are in range");
    }
    let Motion::HandHeld(count) = motion else {
        unreachable!()
    };
    settings.placements = 1;
    settings.angles_deg = (0..count).map(|k| k as f64).collect();
    settings.board = BoardSpec::chessboard(7, 9, 15.0);
    let mut scene = Scene::new(settings).expect("the settings are in range");
    let reach = match optics {
        OpticsKind::Fisheye => 0.9,
        OpticsKind::Wide => 0.4,
        OpticsKind::Telephoto => 0.02,
        _ => 0.12,
    };
    let middle_in_board = scene.settings.board.center_in_board();
    let mut rng = ChaCha8Rng::seed_from_u64(99);
    for pose in &mut scene.true_poses {
        let mut draw = |low: f64, high: f64| rng.random_range(low..high);
        let middle = pose.point(&middle_in_board);
        let tilt = Vector3::new(draw(-0.6, 0.6), draw(-0.6, 0.6), draw(-0.8, 0.8));
        let place = Vector3::new(
            middle.x + reach * middle.z * draw(-1.0, 1.0),
            middle.y + reach * middle.z * draw(-1.0, 1.0),
            middle.z * draw(0.75, 1.4),
        );
        let rotation = so3::exp(&tilt) * pose.rotation;
        *pose = RigidTransform::new(rotation, place - rotation * middle_in_board);
    }
    scene
}

struct Found {
    median_px: Vec<f64>,
    worst_turn_deg: f64,
    median_turn_deg: f64,
    findings: Vec<Finding>,
}

/// Turns between poses against the truth: free of the choice of a camera's frame.
fn judge(scene: &Scene) -> Result<Found, calib_estimate::init::InitError> {
    let sensors = scene.cameras.iter().map(CameraOptics::sensor).collect();
    let observations = Observations::new(
        scene.settings.board.clone(),
        sensors,
        &scene.observe_corners(),
    );
    let start = start_rig(&observations)?;
    let placed: Vec<(RigidTransform, RigidTransform)> = start
        .observations
        .poses
        .iter()
        .zip(&start.rig_from_board)
        .filter_map(|(pose, found)| Some(((*found)?, scene.true_poses[*pose])))
        .collect();
    let turns: Vec<_> = placed
        .iter()
        .map(|(found, truth)| found.rotation * truth.rotation.transpose())
        .collect();
    let frame = so3::geodesic_median(&turns).expect("there are poses");
    let mut off_deg: Vec<f64> = turns
        .iter()
        .map(|turn| so3::angle_rad(&(turn * frame.transpose())).to_degrees())
        .collect();
    off_deg.sort_by(f64::total_cmp);
    Ok(Found {
        median_px: start.median_px,
        worst_turn_deg: *off_deg.last().expect("there are poses"),
        median_turn_deg: off_deg[off_deg.len() / 2],
        findings: start.findings,
    })
}
