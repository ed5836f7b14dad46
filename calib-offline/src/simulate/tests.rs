//! The scene as a whole: coverage, statistics, handedness, reproducibility.

use super::*;
use crate::dataset::View;

fn scene(settings: SceneSettings) -> Scene {
    Scene::new(settings).unwrap()
}

#[test]
fn stats() {
    for kind in OpticsKind::ALL {
        let t = std::time::Instant::now();
        let scene = scene(SceneSettings::standard_noisy(kind, 1));
        let views = scene.observe_corners();
        let dt = t.elapsed();
        let count: usize = views.iter().map(|v| v.corners.len()).sum();
        let full = scene.true_poses.len() * 195 * 2;
        for (camera_idx, camera) in scene.cameras.iter().enumerate() {
            let mut pts = Vec::new();
            let hulls: Vec<_> = (0..scene.true_poses.len())
                .map(|pose| {
                    let c: Vec<_> = (0..195)
                        .filter_map(|k| scene.true_corner(camera_idx, pose, k / 13, k % 13))
                        .collect();
                    pts.extend(c.iter().copied());
                    matches::convex_hull(c)
                })
                .collect();
            let hull = matches::convex_hull(pts);
            let (mut inside, mut inhull, mut n) = (0, 0, 0);
            let mut depth = (f64::MAX, 0.0f64);
            for p in &scene.true_poses {
                let z = scene.left_from_camera[camera_idx]
                    .inverse()
                    .point(&p.point(&scene.settings.board.center_in_board()))
                    .norm();
                depth = (depth.0.min(z), depth.1.max(z));
            }
            for j in 0..50 {
                for i in 0..60 {
                    let px = crate::geometry::PixelPoint::new(
                        (i as f64 + 0.5) / 60.0 * f64::from(camera.sensor().width),
                        (j as f64 + 0.5) / 50.0 * f64::from(camera.sensor().height),
                    );
                    if camera.ray(px).is_none() {
                        continue;
                    }
                    n += 1;
                    if matches::contains(&hull, px) {
                        inhull += 1;
                    }
                    if hulls.iter().any(|h| matches::contains(h, px)) {
                        inside += 1;
                    }
                }
            }
            eprintln!(
                "{kind:?} cam {camera_idx}: hull {:.3} union {:.3} depth {:.0}..{:.0}",
                inhull as f64 / n as f64,
                inside as f64 / n as f64,
                depth.0,
                depth.1
            );
        }
        let mut poses = 0;
        for v in &views {
            if v.corners.len() > 30 {
                poses += 1;
            }
        }
        for set in [MatchSet::Points, MatchSet::Holdout] {
            let t = std::time::Instant::now();
            let m = scene.matches(set, 500);
            let rms = (m
                .iter()
                .map(|m| (m.oracle_in_datum - m.point_in_datum).norm_squared())
                .sum::<f64>()
                / m.len() as f64)
                .sqrt();
            eprintln!(
                "   {set:?} {} oracle rms {rms:.4}  {:?}",
                m.len(),
                t.elapsed()
            );
        }
        eprintln!(
            "   corners {count} of {full}, views>30 {poses} of {}, {dt:?}",
            2 * scene.true_poses.len()
        );
    }
    let _: Vec<View> = Vec::new();
}
