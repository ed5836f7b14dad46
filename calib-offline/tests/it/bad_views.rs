//! Views and pairs that are not what they claim: found, named, and harmless.

use crate::common::against_truth::{
    Named, hand_held, measure, named, observations, run_scene, run_views, scene,
};
use calib_estimate::init::InitError;
use calib_estimate::init::rig::start_rig;
use calib_rays::observed::View;
use calib_simulate::OpticsKind;

#[test]
fn views_numbered_from_the_other_end_are_renumbered() {
    let scene = scene(OpticsKind::Brown, |s| {
        s.flipped_views = vec![(1, 3), (1, 20), (0, 9), (0, 30), (1, 30)];
    });
    let (estimate, findings) = run_scene(&scene);
    let measured = measure(&scene, &estimate, true);
    // Pose 30 is flipped in both cameras: then the board itself is turned, which is as good.
    let expected = Named {
        renumbered: vec![(1, 3), (0, 9), (1, 20)],
        ..Named::default()
    };
    assert_eq!(named(&findings), expected);
    assert!(measured.ratio < 1.02, "{measured:?}");
}

#[test]
fn a_camera_whose_every_view_is_numbered_from_the_other_end() {
    let scene = scene(OpticsKind::Brown, |s| {
        s.flipped_views = (0..34).map(|pose| (1, pose)).collect();
    });
    let (estimate, findings) = run_scene(&scene);
    let named = named(&findings);
    let mut poses: Vec<usize> = named.renumbered.iter().map(|(_, pose)| *pose).collect();
    poses.sort_unstable();
    assert_eq!(poses, (0..34).collect::<Vec<_>>());
    assert!(named.unsynchronized.is_empty() && named.misfits.is_empty());
    let measured = measure(&scene, &estimate, true);
    assert!(measured.ratio < 1.02, "{measured:?}");
}

/// A third of the pairs exposed late by some 2 px, in rigs where a cubic field fits well and badly.
#[test]
fn pairs_not_exposed_together_are_split_and_named() {
    for (optics, limit) in [(OpticsKind::Brown, 1.03), (OpticsKind::Port, 1.03)] {
        let scene = scene(optics, |s| {
            let poses = s.placements * s.angles_deg.len();
            s.unsynchronized_poses = (0..poses).filter(|pose| pose % 3 == 1).collect();
        });
        let (estimate, findings) = run_scene(&scene);
        let expected = Named {
            unsynchronized: scene
                .settings
                .unsynchronized_poses
                .iter()
                .map(|pose| (1, *pose))
                .collect(),
            ..Named::default()
        };
        let measured = measure(&scene, &estimate, true);
        assert_eq!(named(&findings), expected, "{optics:?}");
        // Two thirds of the pairs remain, and every view for its own camera.
        assert!(measured.ratio < limit, "{optics:?}: {measured:?}");
        let poses = scene.true_poses.len();
        assert_eq!(estimate.observations.different_pose_count(), poses);
        assert_eq!(
            estimate.observations.poses.len(),
            poses + scene.settings.unsynchronized_poses.len()
        );
    }
}

#[test]
fn a_board_that_moved_during_the_exposure_is_left_out() {
    let scene = scene(OpticsKind::Brown, |_| ());
    let mut views = scene.observe_corners();
    let moved = (1, 12);
    let view = find(&mut views, moved);
    for corner in view.corners.iter_mut().filter(|corner| corner.row > 7) {
        corner.pixel.u += 1.5;
        corner.pixel.v -= 1.0;
    }
    let (estimate, findings) = run_views(&scene, &views);
    let expected = Named {
        misfits: vec![moved],
        ..Named::default()
    };
    assert_eq!(named(&findings), expected);
    let measured = measure(&scene, &estimate, true);
    assert!(measured.ratio < 1.02, "{measured:?}");
}

#[test]
fn labels_shifted_by_a_row_are_seen_by_the_pair() {
    let scene = scene(OpticsKind::Brown, |_| ());
    let mut views = scene.observe_corners();
    let shifted = (0, 15);
    let view = find(&mut views, shifted);
    view.corners.retain(|corner| corner.row > 0);
    for corner in &mut view.corners {
        corner.row -= 1;
    }
    let (_, findings) = run_views(&scene, &views);
    let expected = Named {
        unsynchronized: vec![(1, 15)],
        ..Named::default()
    };
    assert_eq!(named(&findings), expected);
}

#[test]
fn cameras_that_share_three_poses() {
    let scene = scene(OpticsKind::Brown, |_| ());
    let mut views = scene.observe_corners();
    let shared = [4, 17, 29];
    views.retain(|view| shared.contains(&view.pose) || view.pose % 2 == view.camera_idx);
    let (estimate, findings) = run_views(&scene, &views);
    assert_eq!(findings, []);
    let measured = measure(&scene, &estimate, true);
    // Half the views, and the relative pose from three boards: a few per cent.
    assert!(measured.ratio < 1.1, "{measured:?}");
}

#[test]
fn cameras_that_share_no_pose_are_refused() {
    let scene = scene(OpticsKind::Brown, |_| ());
    let mut views = scene.observe_corners();
    views.retain(|view| view.pose % 2 == view.camera_idx);
    let error = start_rig(&observations(&scene, &views)).unwrap_err();
    assert_eq!(error, InitError::NoCommonPose { camera_idx: 1 });
}

#[test]
fn images_of_different_poses_paired_are_refused() {
    let scene = scene(OpticsKind::Brown, |_| ());
    let mut views = scene.observe_corners();
    for view in views.iter_mut().filter(|view| view.camera_idx == 1) {
        view.pose = (view.pose * 13 + 5) % 34;
    }
    let error = start_rig(&observations(&scene, &views)).unwrap_err();
    assert!(
        matches!(error, InitError::CamerasDisagree { pairs: 34, .. }),
        "{error:?}"
    );
}

#[test]
fn one_camera_alone() {
    let scene = scene(OpticsKind::Brown, |_| ());
    let mut views = scene.observe_corners();
    views.retain(|view| view.camera_idx == 0);
    let mut all = observations(&scene, &views);
    all.sensors.truncate(1);
    let start = start_rig(&all).unwrap();
    let (estimate, findings) = calib_estimate::joint::estimate_screened(&all, start).unwrap();
    assert_eq!(findings, []);
    let sigma_px = estimate.noise.variance_px2.sqrt();
    // 0.05 px, from 12 000 numbers.
    assert!((sigma_px / 0.05 - 1.0).abs() < 0.03, "{sigma_px}");
}

#[test]
fn few_hand_held_views() {
    for (poses, limit) in [(5, 1.6), (8, 1.4), (10, 1.3)] {
        let scene = hand_held(poses, 3);
        let (estimate, findings) = run_scene(&scene);
        let measured = measure(&scene, &estimate, true);
        assert_eq!(findings, [], "{poses}");
        assert!(measured.ratio < limit, "{poses}: {measured:?}");
    }
}

#[test]
fn boards_seen_in_part() {
    let scene = scene(OpticsKind::Brown, |_| ());
    let mut views = scene.observe_corners();
    // Four corners, a 3 x 3 patch, one column, and a strip along the image's edge.
    find(&mut views, (0, 2)).corners.truncate(4);
    find(&mut views, (1, 7))
        .corners
        .retain(|c| c.row < 3 && c.col < 3);
    find(&mut views, (0, 11)).corners.retain(|c| c.col == 5);
    find(&mut views, (1, 16))
        .corners
        .retain(|c| c.pixel.v < 150.0);
    find(&mut views, (0, 16)).corners.truncate(5);
    let (estimate, findings) = run_views(&scene, &views);
    assert_eq!(findings, []);
    let measured = measure(&scene, &estimate, true);
    assert!(measured.ratio < 1.02, "{measured:?}");
    assert_eq!(estimate.observations.different_pose_count(), 34);
}

fn find(views: &mut [View], (camera_idx, pose): (usize, usize)) -> &mut View {
    views
        .iter_mut()
        .find(|view| (view.camera_idx, view.pose) == (camera_idx, pose))
        .expect("the view is there")
}
