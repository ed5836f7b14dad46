//! What boards would bring that were not recorded, against recordings with them.

use crate::common::against_truth::run_scene;
use crate::weak_rigs::{SMALL_TILTS, matches, scene};
use calib_judge::what_next::{Shot, what_to_record_next};
use calib_rays::geometry::best_placement;

/// Draws. Errors are those of a few weak numbers, so their sum of squares over the predicted one
/// scatters like a chi-square variable of about as many degrees of freedom over its mean.
const DRAWS: u64 = 6;
/// Of such a variable, 0.1 % and 99.9 %: 0.06 and 3.74.
const CHANCE: [f64; 2] = [0.06, 3.74];

#[test]
fn two_tilted_boards_bring_what_was_predicted() {
    let names = ["left", "right"].map(str::to_owned);
    let (mut errors, mut predicted, mut now) = (0.0, 0.0, 0.0);
    for seed in 1..=DRAWS {
        let mut scene = scene(&SMALL_TILTS, seed).unwrap();
        let (mut estimate, _) = run_scene(&scene);
        let rig = estimate.rig(&names);
        let next = what_to_record_next(&mut estimate, &rig).unwrap().unwrap();
        let tilted = next
            .gains
            .iter()
            .find(|gain| gain.shot == Shot::TiltedAboutVertical);
        let tilted = tilted.unwrap();
        let left_from_rig = rig.cameras[0].rig_from_camera.inverse();
        for rig_from_board in &tilted.rig_from_board {
            scene.true_poses.push(left_from_rig * *rig_from_board);
        }
        let (estimate, _) = run_scene(&scene);
        let with_them = estimate.rig(&names);
        let points = matches(&scene, [0.7, 1.3], 300);
        let measured = points.iter().filter_map(|(truth, [a, b])| {
            let found = with_them.triangulate(&[(0, *a), (1, *b)]).ok()?;
            Some((found.point_mm, *truth))
        });
        let (from, to): (Vec<_>, Vec<_>) = measured.unzip();
        let placement = best_placement(&from, &to).unwrap();
        let squares = from.iter().zip(&to);
        let squares = squares.map(|(p, t)| (placement.point(p) - t).norm_squared());
        errors += squares.sum::<f64>() / from.len() as f64;
        predicted += tilted.error_mm.powi(2);
        now += next.now_mm.powi(2);
    }
    let ratio = errors / predicted;
    assert!(ratio > CHANCE[0] && ratio < CHANCE[1], "{ratio}");
    // Tilts are what such a recording lacks.
    assert!(predicted < now / 4.0, "{predicted} {now}");
}
