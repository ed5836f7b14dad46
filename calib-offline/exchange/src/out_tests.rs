//! What is written for other tools, read back by our own readers and held against the rays.

use super::tests::{BROWN, Known, SENSOR, place};
use super::*;
use crate::content::content;
use crate::foreign::{Content, ForeignCamera};
use crate::model::CameraModel;
use crate::read::ReadOptions;
use calib_blob::rays::RaySource;
use calib_rays::geometry::{PixelPoint, Ray, RigidTransform};
use nalgebra::{Matrix4, Vector3, Vector4};
use std::path::Path;

const DISTANCE_MM: f64 = 600.0;

/// What a fisheye of 760 px sees, up to 62 degrees off axis.
fn equidistant(pixel: PixelPoint) -> Ray {
    let (x, y) = ((pixel.u - 640.5) / 760.0, (pixel.v - 500.5) / 760.0);
    let angle = f64::hypot(x, y);
    let share = if angle > 0.0 {
        angle.sin() / angle
    } else {
        1.0
    };
    Ray {
        origin_mm: Vector3::zeros(),
        direction: Vector3::new(x * share, y * share, angle.cos()),
    }
}

/// A rig of two of Brown's cameras, toed in.
fn pair() -> Known<fn(usize, PixelPoint) -> Option<Ray>> {
    Known {
        rig_from_camera: vec![
            place([0.01, 0.1, -0.02], [-60.0, 2.0, -600.0]),
            place([-0.02, -0.12, 0.01], [55.0, -3.0, -590.0]),
        ],
        ray: |_, pixel| BROWN.ray(pixel),
    }
}

fn camera(file: &NamedFile) -> ForeignCamera {
    let options = ReadOptions::default();
    match content(Path::new(&file.0), &file.1, &options).unwrap() {
        Content::Cameras(mut held) => {
            assert!(held.notes.iter().all(|note| !note.contains("open polygon")));
            held.cameras.remove(0)
        }
        Content::Extrinsics(_) => panic!("{}: no camera", file.0),
    }
}

/// The largest distance between a pixel and where a camera that was read back sees its ray, at a distance in the rig.
fn worst_px(source: &dyn RaySource, camera_idx: usize, read: &ForeignCamera) -> f64 {
    let camera_from_rig = read.rig_from_camera.unwrap().inverse();
    let mut worst = 0.0_f64;
    for k in 0..400 {
        let pixel = PixelPoint::new(f64::from(k % 20) * 67.3, f64::from(k / 20) * 53.7);
        let ray = source.ray(camera_idx, pixel).unwrap();
        let point = camera_from_rig.point(&(ray.origin_mm + ray.direction * DISTANCE_MM));
        worst = worst.max(read.model.project(&point).unwrap().distance_px(pixel));
    }
    worst
}

#[test]
fn mrcals_pinholes_stand_in_the_rigs_frame() {
    let source = pair();
    let forms = [Distortion::Four, Distortion::Five, Distortion::Eight];
    let pinholes = nearest_pinholes(&source, DISTANCE_MM, &forms).unwrap();
    for (camera_idx, file) in mrcal::files(&source, &pinholes).iter().enumerate() {
        let text = std::str::from_utf8(&file.1).unwrap();
        assert!(text.contains("'lensmodel':  'LENSMODEL_OPENCV5'"), "{text}");
        for key in ["'extrinsics': [ ", "'rt_cam_ref': [ "] {
            assert!(text.contains(key));
        }
        let read = camera(file);
        let valid = read.valid.as_ref().unwrap();
        assert_eq!((valid.len(), valid.first()), (5, valid.last()));
        assert!(worst_px(&source, camera_idx, &read) < 1e-6);
    }
}

#[test]
fn a_fisheye_and_brown_are_splined_within_their_stated_loss() {
    let fisheye = Known {
        rig_from_camera: vec![place([0.2, 0.1, -0.3], [10.0, -20.0, 30.0])],
        ray: |_, pixel| Some(equidistant(pixel)),
    };
    let brown = pair();
    let sources: [&dyn RaySource; 2] = [&fisheye, &brown];
    for source in sources {
        let splined = nearest_splined(source, DISTANCE_MM).unwrap();
        let files = mrcal::splined_files(source, &splined);
        for (camera_idx, (file, own)) in files.iter().zip(&splined.cameras).enumerate() {
            println!(
                "{}: {:?} {} deg, {:?}",
                own.name, own.knots, own.fov_x_deg, own.loss
            );
            assert!(own.loss.rms_px < 1e-3, "{:?}", own.loss);
            let read = camera(file);
            // Ours of memory and ours of the file.
            let model = own.model().unwrap();
            let point = Vector3::new(0.3, -0.2, 1.0);
            let [a, b] = [
                model.project(&point).unwrap(),
                read.model.project(&point).unwrap(),
            ];
            assert!(a.distance_px(b) < 1e-9);
            // The lattices differ: what lies between may be off by a little more.
            assert!(worst_px(source, camera_idx, &read) < 1.5 * own.loss.max_px + 1e-6);
        }
    }
}

#[test]
fn every_form_is_found_back_and_says_where_it_loses() {
    let fisheye = Known {
        rig_from_camera: vec![RigidTransform::identity()],
        ray: |_, pixel| Some(equidistant(pixel)),
    };
    let found = nearest_pinholes(&fisheye, DISTANCE_MM, &[Distortion::Equidistant]).unwrap();
    let lens = &found.cameras[0];
    assert!(lens.loss.max_px < 1e-6, "{:?}", lens.loss);
    assert!(lens.lens.own_coefficients().iter().all(|k| k.abs() < 1e-8));
    // Brown's lens by every form that holds it; the other numbers may take any value that does nothing.
    for form in [
        Distortion::Five,
        Distortion::Eight,
        Distortion::Twelve,
        Distortion::Fourteen,
    ] {
        let found = nearest_pinholes(&pair(), DISTANCE_MM, &[form]).unwrap();
        println!("{form:?} {:?}", found.loss());
        assert!(found.loss().max_px < 1e-4, "{form:?} {:?}", found.loss());
    }
    // Four coefficients lose what the map says.
    let found = nearest_pinholes(&pair(), DISTANCE_MM, &[Distortion::Four]).unwrap();
    let (map, loss) = (&found.cameras[0].map, found.cameras[0].loss);
    let places = || map.du_px.iter().flatten().zip(map.dv_px.iter().flatten());
    let most = places().fold(0.0_f64, |most, (u, v)| {
        most.max(u.unwrap().hypot(v.unwrap()))
    });
    assert!(
        loss.max_px > 0.01 && (most / loss.max_px - 1.0).abs() < 0.1,
        "{most} {loss:?}"
    );
    let most = map
        .mm
        .iter()
        .flatten()
        .fold(0.0_f64, |most, mm| most.max(mm.unwrap()));
    assert!((most / loss.max_mm - 1.0).abs() < 0.1);
}

#[test]
fn a_region_is_all_that_counts() {
    let source = pair();
    let region = Region::new([300.0, 200.0, 900.0, 700.0]).unwrap();
    let within = Within::new(&source, region).unwrap();
    let loss = |source: &dyn RaySource| {
        nearest_pinholes(source, DISTANCE_MM, &[Distortion::Four])
            .unwrap()
            .loss()
    };
    // A smaller part needs fewer coefficients.
    assert!(loss(&within).max_px < 0.2 * loss(&source).max_px);
    let pinholes = nearest_pinholes(&within, DISTANCE_MM, &[Distortion::Five]).unwrap();
    let read = camera(&mrcal::files(&within, &pinholes)[0]);
    let valid = read.valid.unwrap();
    assert!(
        valid
            .iter()
            .all(|p| (300.0..=900.0).contains(&p.u) && (200.0..=700.0).contains(&p.v))
    );
    for beyond in [[-2.0, 0.0, 100.0, 100.0], [0.0, 0.0, 1280.0, 100.0]] {
        let region = Region::new(beyond).unwrap();
        assert!(matches!(
            Within::new(&source, region),
            Err(ExchangeError::Region { .. })
        ));
    }
    assert_eq!(Region::new([5.0, 0.0, 5.0, 9.0]), None);
    assert_eq!(Region::new([f64::NAN, 0.0, 5.0, 9.0]), None);
}

#[test]
fn maps_lead_where_the_rays_come_from() {
    let source = pair();
    for (camera_idx, map) in remap::maps(&source, DISTANCE_MM)
        .unwrap()
        .iter()
        .enumerate()
    {
        assert!(map.loss.max_px < 1e-3, "central: {:?}", map.loss);
        let view_from_rig = map.view.rig_from_view.inverse();
        let mut count = 0;
        for (k, pixel) in map.pixels.iter().enumerate().step_by(911) {
            if *pixel == [view::OUTSIDE; 2] {
                continue;
            }
            count += 1;
            let pixel = PixelPoint::new(pixel[0].into(), pixel[1].into());
            let ray = source
                .ray(camera_idx, pixel)
                .unwrap()
                .transformed(&view_from_rig);
            let [fx, fy] = map.view.focal_px;
            let [cx, cy] = map.view.center_px;
            let width = SENSOR.width as usize;
            let off_u = cx + fx * ray.direction.x / ray.direction.z - (k % width) as f64;
            let off_v = cy + fy * ray.direction.y / ray.direction.z - (k / width) as f64;
            // f32 of a thousand px.
            assert!(off_u.hypot(off_v) < 2e-4, "{off_u} {off_v}");
        }
        assert!(count > 1000);
    }
}

#[test]
fn rows_of_a_rectified_pair_are_in_common_and_q_gives_points() {
    let source = pair();
    let found = rectify::rectified(&source, DISTANCE_MM).unwrap();
    assert!(found.is_side_by_side);
    let [first, second] = &found.maps;
    let to_points = Matrix4::from_row_slice(&found.to_points);
    assert!(
        found.projections[1][3] < 0.0,
        "the second camera stands on the right"
    );
    let mut count = 0;
    for k in 0..400 {
        let point = Vector3::new(
            f64::from(k % 20) * 8.0 - 80.0,
            f64::from(k / 20) * 6.0 - 60.0,
            f64::from(k % 7) * 20.0,
        );
        let see = |map: &ViewMap| {
            let p = map.view.rig_from_view.inverse().point(&point);
            let [f, _] = map.view.focal_px;
            PixelPoint::new(
                map.view.center_px[0] + f * p.x / p.z,
                map.view.center_px[1] + f * p.y / p.z,
            )
        };
        let (a, b) = (see(first), see(second));
        assert!((a.v - b.v).abs() < 1e-9);
        let at = to_points * Vector4::new(a.u, a.v, a.u - b.u, 1.0);
        let at = at.xyz() / at.w;
        assert!((first.view.rig_from_view.point(&at) - point).norm() < 1e-8);
        count += 1;
    }
    assert_eq!(count, 400);
    for map in &found.maps {
        let shown = map
            .pixels
            .iter()
            .filter(|p| **p != [view::OUTSIDE; 2])
            .count();
        assert!(shown * 10 > map.pixels.len() * 8, "{shown}");
    }
    // R turns the lens's frame into the view's.
    for (k, map) in found.maps.iter().enumerate() {
        let forward = found.rotations[k].transpose() * Vector3::z();
        let in_rig = source.rig_from_camera[k].rotation * forward;
        assert!((in_rig - map.view.rig_from_view.rotation * Vector3::z()).norm() < 1e-6);
    }
}

#[test]
fn cameras_that_see_nothing_together_are_no_pair() {
    let apart = |turns: [f64; 2]| Known {
        rig_from_camera: vec![
            place([0.0, turns[0], 0.0], [-60.0, 0.0, 0.0]),
            place([0.0, turns[1], 0.0], [60.0, 0.0, 0.0]),
        ],
        ray: |_, pixel| BROWN.ray(pixel),
    };
    for turns in [[-0.6, 0.6], [0.0, 3.1], [1.57, 1.57]] {
        let found = rectify::rectified(&apart(turns), DISTANCE_MM);
        assert!(
            matches!(found, Err(ExchangeError::NoOverlap { .. })),
            "{turns:?} {:?}",
            found.is_ok()
        );
    }
    let one = Known {
        rig_from_camera: vec![RigidTransform::identity()],
        ray: |_, pixel| BROWN.ray(pixel),
    };
    assert_eq!(
        rectify::rectified(&one, DISTANCE_MM).unwrap_err(),
        ExchangeError::NoPair { have: 1 }
    );
}

#[test]
fn a_view_is_off_elsewhere_where_rays_do_not_meet() {
    // Rays that start up to 2 mm off the center: at half the distance, and at twice that, things move.
    let source = Known {
        rig_from_camera: vec![RigidTransform::identity()],
        ray: |_, pixel: PixelPoint| {
            let ray = BROWN.ray(pixel)?;
            let shift = Vector3::new((pixel.u - 640.0) / 320.0, 0.0, 0.0);
            Some(Ray {
                origin_mm: ray.origin_mm + shift,
                ..ray
            })
        },
    };
    let maps = remap::maps(&source, DISTANCE_MM).unwrap();
    println!("{:?}", maps[0].loss);
    // To first order in the shift a non-central camera is one whose center lies elsewhere; what is left is of the second.
    assert!(maps[0].loss.max_px > 1e-3);
    assert!(maps[0].loss.max_px < 2.0 * 1745.0 * 2.0 / DISTANCE_MM);
}
