//! Every planted fault is really in the data, as large as it is said to be, and nothing else is.

use super::exposure::LATE_MM;
use super::*;
use calib_rays::geometry::PixelPoint;
use std::collections::BTreeMap;
use std::collections::BTreeSet;

/// (camera, pose, row, column), and where it was seen.
type Corners = BTreeMap<(usize, usize, usize, usize), PixelPoint>;

fn planted(name: &str, poses: Poses) -> Recording {
    plant(named(name).unwrap(), Rig::Plain, poses, 1).unwrap()
}

fn corners(recording: &Recording) -> Corners {
    let views = recording.views.iter();
    views
        .flat_map(|view| {
            let corners = view.corners.iter();
            corners.map(|c| ((view.camera_idx, view.pose, c.row, c.col), c.pixel))
        })
        .collect()
}

/// Corners that both have, as (camera, pose), without the fault, with it.
fn both(name: &str, poses: Poses) -> Vec<((usize, usize), PixelPoint, PixelPoint)> {
    let (without, with) = (planted("none", poses), planted(name, poses));
    let with = corners(&with);
    corners(&without)
        .into_iter()
        .filter_map(|(key, before)| Some(((key.0, key.1), before, *with.get(&key)?)))
        .collect()
}

/// (camera, pose) of views that are not as without the fault.
fn changed(name: &str, poses: Poses) -> BTreeSet<(usize, usize)> {
    let [without, with] = ["none", name].map(|name| corners(&planted(name, poses)));
    let views = |corners: &Corners| -> BTreeMap<(usize, usize), Vec<_>> {
        let mut views = BTreeMap::new();
        for ((camera_idx, pose, row, col), pixel) in corners {
            let corners: &mut Vec<_> = views.entry((*camera_idx, *pose)).or_default();
            corners.push((*row, *col, pixel.u.to_bits(), pixel.v.to_bits()));
        }
        views
    };
    let (without, with) = (views(&without), views(&with));
    let keys = without.keys().chain(with.keys()).copied();
    keys.filter(|key| without.get(key) != with.get(key))
        .collect()
}

/// Views of cameras in the second half of the poses.
fn second_half(cameras: &[usize], poses: Poses) -> BTreeSet<(usize, usize)> {
    let half = poses.count() / 2..poses.count();
    let of = |camera_idx: &usize| {
        half.clone()
            .map(|pose| (*camera_idx, pose))
            .collect::<Vec<_>>()
    };
    cameras.iter().flat_map(of).collect()
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let squares: Vec<f64> = values.map(|value| value * value).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

#[test]
fn every_fault_has_a_name_of_its_own_and_shows() {
    let mut names = BTreeSet::new();
    for fault in all() {
        assert!(names.insert(fault.name), "{} twice", fault.name);
    }
    for poses in Poses::ALL {
        let text = |fault| format!("{:?}", plant(fault, Rig::Plain, poses, 1).unwrap());
        let faultless = text(&FAULTLESS);
        for fault in all().filter(|fault| fault.only.is_none_or(|only| only == poses)) {
            let differs = text(fault) != faultless;
            assert_eq!(differs, fault.name != FAULTLESS.name, "{}", fault.name);
        }
    }
}

#[test]
fn the_seed_makes_the_recording() {
    let text = |seed| {
        let fault = named("late-all-random").unwrap();
        format!(
            "{:?}",
            plant(fault, Rig::Wide, Poses::HandHeld, seed).unwrap()
        )
    };
    assert_eq!(text(2), text(2));
    assert_ne!(text(2), text(3));
}

#[test]
fn every_rig_sees_most_of_its_board_and_the_matches() {
    for rig in Rig::ALL {
        for poses in Poses::ALL {
            for seed in 1..=3 {
                let recording = plant(&FAULTLESS, rig, poses, seed).unwrap();
                let seen = corners(&recording).len();
                let all = 2 * poses.count() * recording.board.corner_count();
                assert!(
                    seen * 10 > all * 8,
                    "{} {} {seed}: {seen} of {all}",
                    rig.name(),
                    poses.name()
                );
                assert_eq!(recording.matches.len(), MATCHES);
            }
        }
    }
}

#[test]
fn what_happens_half_way_is_in_the_second_half_alone() {
    for poses in Poses::ALL {
        for (name, cameras) in [
            ("focus-both", &[0, 1][..]),
            ("focus-left", &[0]),
            ("half-size", &[0, 1]),
            ("window-both", &[0, 1]),
            ("window-right", &[1]),
            ("right-turned", &[1]),
            ("baseline", &[1]),
        ] {
            assert_eq!(changed(name, poses), second_half(cameras, poses), "{name}");
        }
    }
}

#[test]
fn moved_windows_and_half_sizes_move_pixels_by_what_they_say() {
    for (name, to) in [
        (
            "window-both",
            (|p| [p.u - 40.0, p.v - 24.0]) as fn(PixelPoint) -> [f64; 2],
        ),
        ("window-right", |p| [p.u - 4.0, p.v]),
    ] {
        let half = changed(name, Poses::Stage);
        let pairs = both(name, Poses::Stage);
        let pairs: Vec<_> = pairs
            .iter()
            .filter(|(view, ..)| half.contains(view))
            .collect();
        assert!(pairs.len() > 200);
        for (_, before, after) in pairs {
            let [u, v] = to(*before);
            // The search for a pixel ends at 1e-10 px.
            assert!(
                (after.u - u).hypot(after.v - v) < 1e-8,
                "{name}: {before:?} {after:?}"
            );
        }
    }
    // Noise is that of the smaller image, so pixels agree to three halves of it.
    let half = changed("half-size", Poses::Stage);
    for (view, before, after) in both("half-size", Poses::Stage) {
        if half.contains(&view) {
            let [u, v] = [(before.u + 0.5) / 2.0 - 0.5, (before.v + 0.5) / 2.0 - 0.5];
            assert!(
                (after.u - u).hypot(after.v - v) < 0.05 * 5.0,
                "{before:?} {after:?}"
            );
        }
    }
}

#[test]
fn another_focus_moves_pixels_by_a_thousandth_of_their_place() {
    let half = changed("focus-left", Poses::HandHeld);
    let pairs = both("focus-left", Poses::HandHeld);
    let pairs: Vec<_> = pairs
        .iter()
        .filter(|(view, ..)| half.contains(view))
        .collect();
    // du = 0.001 (u - u0) for some u0 near the middle, but for the noise, which is scaled by nothing.
    let mean = |of: &dyn Fn(&PixelPoint, &PixelPoint) -> f64| {
        pairs
            .iter()
            .map(|(_, before, after)| of(before, after))
            .sum::<f64>()
            / pairs.len() as f64
    };
    let (du, u) = (mean(&|b, a| a.u - b.u), mean(&|b, _| b.u));
    let by_place = mean(&|b, a| (a.u - b.u - du) * (b.u - u)) / mean(&|b, _| (b.u - u).powi(2));
    assert!((by_place - 0.001).abs() < 1e-5, "{by_place}");
    let middle = u - du / by_place;
    assert!((middle - 640.0).abs() < 40.0, "{middle}");
}

#[test]
fn a_turned_camera_and_a_longer_baseline_move_the_right_image_sideways() {
    // 1750 px by 0.02 degrees is 0.61 px; by a thousandth of 124 mm at half a meter 0.45 px.
    for (name, px, play) in [("right-turned", 0.61, 0.1), ("baseline", 0.45, 0.15)] {
        let half = changed(name, Poses::Stage);
        for (view, before, after) in both(name, Poses::Stage) {
            if half.contains(&view) {
                let [du, dv] = [after.u - before.u, after.v - before.v];
                assert!(
                    (du.abs() - px).abs() < play && dv.abs() < 0.1,
                    "{name}: {du} {dv}"
                );
            }
        }
    }
}

#[test]
fn late_exposures_move_the_right_image_by_up_to_their_way() {
    let right = |count: usize| {
        move |views: BTreeSet<(usize, usize)>| {
            assert_eq!(views.len(), count);
            assert!(views.iter().all(|(camera_idx, _)| *camera_idx == 1));
        }
    };
    right(3)(changed("late-some", Poses::Stage));
    for name in ["late-all-random", "late-all-same"] {
        right(14)(changed(name, Poses::Stage));
        let moved = both(name, Poses::Stage);
        let way = moved
            .iter()
            .map(|(_, before, after)| after.distance_px(*before));
        // The board is never nearer than 300 mm.
        assert!(way.clone().all(|px| px < LATE_MM / 300.0 * 1760.0));
        assert!(rms(way) > 0.2);
    }
}

#[test]
fn a_constant_delay_is_a_camera_that_stands_elsewhere() {
    let usual = scene(Rig::Plain, Poses::Stage, &Motion::USUAL, 1).unwrap();
    let mut late = Session::faultless(usual.clone());
    let mut elsewhere = Session::faultless(usual);
    let way_mm = nalgebra::Vector3::new(0.1, -0.2, 0.2);
    for pose in 0..late.pose_count() {
        late.takes[1][pose].left_from_board.translation_mm += way_mm;
        elsewhere.takes[1][pose].left_from_camera.translation_mm -= way_mm;
    }
    for (a, b) in late.views().iter().zip(elsewhere.views()) {
        for (a, b) in a.corners.iter().zip(b.corners) {
            assert!(a.pixel.distance_px(b.pixel) < 1e-8);
        }
    }
}

#[test]
fn skews_shear_images_about_their_middle_line() {
    for (view, before, after) in both("skew-same", Poses::HandHeld) {
        let line = before.v / 1024.0 - 0.5;
        // The line is that of the corner without its noise.
        assert!((after.u - before.u - line).abs() < 1e-3, "{view:?}");
        assert!((after.v - before.v).abs() < 1e-9);
    }
    let skews: BTreeSet<i64> = both("skew-per-pose", Poses::HandHeld)
        .iter()
        .filter(|(_, before, _)| before.v < 200.0)
        .map(|(_, before, after)| {
            ((after.u - before.u) / (before.v / 1024.0 - 0.5) * 1e2).round() as i64
        })
        .collect();
    assert!(skews.len() > 5 && skews.iter().all(|skew| skew.abs() <= 101));
}

#[test]
fn a_wrong_board_is_wrong_in_the_corners_and_not_in_the_manifest() {
    for (name, least_px) in [
        ("square-x-long", 0.5),
        ("board-sheared", 0.5),
        ("bowed-0.2mm", 0.05),
        ("bowed-2mm", 0.5),
        ("flexing", 0.02),
    ] {
        let recording = planted(name, Poses::HandHeld);
        assert_eq!(recording.board, planted("none", Poses::HandHeld).board);
        let moved = both(name, Poses::HandHeld);
        let moved = rms(moved
            .iter()
            .map(|(_, before, after)| after.distance_px(*before)));
        assert!(moved > least_px, "{name}: {moved}");
    }
    for (name, pitch) in [
        ("square-in-m", 0.023),
        ("square-in-cm", 2.3),
        ("square-in-inches", 0.9055),
        ("square-small", 22.885),
    ] {
        assert!(changed(name, Poses::Stage).is_empty());
        let found = planted(name, Poses::Stage).board.square_mm;
        assert!((found / pitch - 1.0).abs() < 1e-4, "{name}: {found}");
    }
}

#[test]
fn labels_are_wrong_where_they_are_said_to_be() {
    for (name, cameras, poses) in [
        ("half-turn-some", 1, 3),
        ("mirrored-some", 1, 3),
        ("mirrored-all", 2, 12),
        ("row-shift-right-one", 1, 1),
        ("row-shift-both-one", 2, 1),
        ("row-shift-right-all", 1, 12),
        ("exchanged-all", 2, 12),
        ("exchanged-some", 2, 3),
        ("poses-from-1", 2, 13),
        ("right-one-late", 1, 12),
    ] {
        let views = changed(name, Poses::HandHeld);
        assert_eq!(views.len(), cameras * poses, "{name}: {views:?}");
    }
    // The pixels of mirrored views are those of the right ones.
    let pixels = |name: &str| -> BTreeSet<[u64; 2]> {
        let corners = corners(&planted(name, Poses::Stage));
        corners
            .values()
            .map(|p| [p.u.to_bits(), p.v.to_bits()])
            .collect()
    };
    for name in ["half-turn-some", "mirrored-some", "exchanged-some"] {
        assert_eq!(pixels(name), pixels("none"), "{name}");
    }
}

#[test]
fn pixels_are_told_in_the_other_convention() {
    let half = |view: (usize, usize)| view.0 == 1 && view.1 < 7;
    for (name, told) in [
        (
            "origin-right-all",
            (|view, p| {
                if view.0 == 1 {
                    [p.u + 0.5, p.v + 0.5]
                } else {
                    [p.u, p.v]
                }
            }) as fn((usize, usize), PixelPoint) -> [f64; 2],
        ),
        ("v-upwards-both", |_, p| [p.u, 1023.0 - p.v]),
        ("v-upwards-right", |view, p| {
            [p.u, if view.0 == 1 { 1023.0 - p.v } else { p.v }]
        }),
        ("uv-exchanged", |_, p| [p.v, p.u]),
    ] {
        for (view, before, after) in both(name, Poses::Stage) {
            assert_eq!([after.u, after.v], told(view, before), "{name}");
        }
    }
    for (view, before, after) in both("origin-right-half", Poses::Stage) {
        let by_px = if half(view) { 0.5 } else { 0.0 };
        assert_eq!([after.u, after.v], [before.u + by_px, before.v + by_px]);
    }
}

#[test]
fn boards_are_shown_too_little() {
    // Of the boards' normals against their mean, degrees; and of their middles' distances, mm.
    let spans = |change: fn(&mut Motion), poses: Poses| -> (f64, f64) {
        let mut motion = Motion::USUAL;
        change(&mut motion);
        let scene = scene(Rig::Plain, poses, &motion, 1).unwrap();
        let middle = scene.settings.board.center_in_board();
        let normals = scene
            .true_poses
            .iter()
            .map(|pose| pose.rotation.column(2).into_owned());
        let mean = normals.clone().sum::<nalgebra::Vector3<f64>>().normalize();
        let tilts = normals.map(|normal| normal.dot(&mean).clamp(-1.0, 1.0).acos().to_degrees());
        let depths = scene.true_poses.iter().map(|pose| pose.point(&middle).z);
        let low = depths.clone().fold(f64::INFINITY, f64::min);
        (tilts.fold(0.0, f64::max), depths.fold(0.0, f64::max) - low)
    };
    for poses in Poses::ALL {
        let (tilt, depth) = spans(|_| (), poses);
        assert!(tilt > 30.0 && depth > 40.0, "{tilt} {depth}");
        let (tilt, depth) = spans(|motion| motion.tilt_deg = 3.0, poses);
        assert!(tilt < 5.0 && depth > 40.0, "{tilt} {depth}");
        let frontal = |motion: &mut Motion| {
            motion.tilt_deg = 2.0;
            motion.depth = 0.0;
        };
        let (tilt, depth) = spans(frontal, poses);
        assert!(tilt < 3.5 && depth < 8.0, "{tilt} {depth}");
    }
    for (name, count) in [
        ("poses-2", 2),
        ("poses-3", 3),
        ("poses-4", 4),
        ("poses-5", 5),
    ] {
        let recording = planted(name, Poses::Stage);
        assert_eq!(recording.pose_count(), count);
        assert_eq!(recording.dial.unwrap().angles_deg.len(), count);
    }
}

#[test]
fn copies_are_copies_and_standing_boards_have_noise_of_their_own() {
    let distinct = |name: &str| {
        let recording = planted(name, Poses::HandHeld);
        let views = recording.views.iter().filter(|view| view.camera_idx == 0);
        let texts: BTreeSet<String> = views.map(|view| format!("{:?}", view.corners)).collect();
        texts.len()
    };
    assert_eq!(distinct("copies"), 4);
    assert_eq!(distinct("standing-some"), 12);
    let recording = planted("standing-some", Poses::HandHeld);
    let corners = corners(&recording);
    let views = changed("standing-some", Poses::HandHeld);
    assert_eq!(views.len(), 6);
    for ((camera_idx, pose, row, col), pixel) in &corners {
        if views.contains(&(*camera_idx, *pose))
            && !views.contains(&(*camera_idx, pose - 1))
            && let Some(before) = corners.get(&(*camera_idx, pose - 1, *row, *col))
        {
            let way = pixel.distance_px(*before);
            assert!(way > 0.0 && way < 0.05 * 8.0, "{way}");
        }
    }
}

#[test]
fn matches_are_those_of_the_rig_as_it_is_at_the_end() {
    for fault in all().filter(|fault| fault.only.is_none()) {
        let recording = plant(fault, Rig::Plain, Poses::HandHeld, 2).unwrap();
        let is_moved = recording.matches
            != plant(&FAULTLESS, Rig::Plain, Poses::HandHeld, 2)
                .unwrap()
                .matches;
        // Another convention does not change the rig.
        let moves = fault.is_half_way && fault.name != "origin-right-half";
        assert_eq!(is_moved, moves, "{}", fault.name);
    }
}

#[test]
fn a_dial_is_told_wrong_and_the_corners_are_right() {
    for name in ["dial-other-sense", "dial-radians", "dial-shifted"] {
        assert!(changed(name, Poses::Stage).is_empty());
        let [without, with] = ["none", name].map(|name| planted(name, Poses::Stage).dial);
        assert_ne!(without, with);
    }
}
