//! Models against the projections of the tools that they are of, and against themselves turned around.

use super::*;
use crate::content::content;
use crate::foreign::Content;
use crate::read::{ReadOptions, Unit};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

fn golden() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("golden")
}

/// Point, and the pixel that the tool sees it at.
type Seen = (Vector3<f64>, PixelPoint);

/// The projections of a peer by file and camera.
fn projections(peer: &str) -> BTreeMap<(String, String), Vec<Seen>> {
    let mut found: BTreeMap<_, Vec<_>> = BTreeMap::new();
    let mut reader = csv::Reader::from_path(golden().join(peer).join("projections.csv")).unwrap();
    for row in reader.records() {
        let row = row.unwrap();
        let number = |k: usize| row[k].parse::<f64>().unwrap();
        let point = Vector3::new(number(2), number(3), number(4));
        let pixel = PixelPoint::new(number(5), number(6));
        let key = (row[0].to_owned(), row[1].to_owned());
        found.entry(key).or_default().push((point, pixel));
    }
    found
}

/// Every model of a peer: its largest difference, forward and back.
fn agrees(peer: &str, origin_px: f64, within_px: impl Fn(&str) -> f64) {
    // The unit does not matter, as no file's places are used: points are handed over as they are.
    let options = ReadOptions {
        unit: Some(Unit::Mm),
        ..ReadOptions::default()
    };
    let all = projections(peer);
    assert!(!all.is_empty());
    for ((file, name), seen) in &all {
        let path = golden().join(peer).join(file);
        let bytes = std::fs::read(&path).unwrap();
        let Content::Cameras(held) = content(&path, &bytes, &options).unwrap() else {
            panic!("{file}: no cameras");
        };
        let camera = held
            .cameras
            .iter()
            .find(|c| name.is_empty() || c.name == *name)
            .unwrap();
        let (mut forward_px, mut back_px) = (0.0_f64, 0.0_f64);
        for (point, pixel) in seen {
            let pixel = PixelPoint::new(pixel.u - origin_px, pixel.v - origin_px);
            let own = camera
                .model
                .project(point)
                .unwrap_or_else(|| panic!("{file} {name}: {point}"));
            forward_px = forward_px.max(own.distance_px(pixel));
            let ray = camera
                .model
                .ray(own)
                .unwrap_or_else(|| panic!("{file} {name}: back from {own:?}"));
            assert!((ray.direction.norm() - 1.0).abs() < 1e-12);
            // How far the ray passes from the point, as pixels of some 1/700 rad.
            back_px = back_px.max(700.0 * ray.distance_mm(point) / point.norm());
            assert!(ray.direction.dot(&(point - ray.origin_mm)) > 0.0);
        }
        println!(
            "{peer} {file} {name} {}: {forward_px:.1e} px, back {back_px:.1e} px",
            camera.model_name
        );
        assert!(
            forward_px < within_px(&camera.model_name),
            "{peer} {file} {name}: {forward_px}"
        );
        assert!(back_px < 1e-8, "{peer} {file} {name}: {back_px}");
    }
}

#[test]
fn pinholes_and_fisheyes_of_opencv() {
    // Version 4 undistorts nothing here: both only project, in doubles.
    for peer in ["opencv4", "opencv5"] {
        agrees(peer, 0.0, |_| 1e-9);
    }
}

#[test]
fn all_models_of_mrcal() {
    agrees("mrcal", 0.0, |_| 1e-9);
}

#[test]
fn all_models_of_colmap() {
    // COLMAP takes a series of few terms near the axis in FOV.
    agrees(
        "colmap",
        0.5,
        |model| if model == "FOV" { 1e-5 } else { 1e-9 },
    );
}

#[test]
fn unified_models_turn_around() {
    let plane = ImagePlane::new([400.0, 410.0, 640.0, 480.0]);
    let models: [Box<dyn CameraModel>; 4] = [
        Box::new(Omni {
            plane: ImagePlane::new([900.0, 910.0, 640.0, 480.0]),
            xi: 1.4,
            coefficients: [-0.1, 0.02, 1e-3, -5e-4, 0.0, 0.0, 0.0, 0.0],
        }),
        Box::new(Eucm {
            plane,
            alpha: 0.62,
            beta: 1.08,
        }),
        Box::new(DoubleSphere {
            plane,
            xi: -0.2,
            alpha: 0.58,
        }),
        Box::new(Fov {
            plane,
            angle_rad: 0.95,
        }),
    ];
    for model in models {
        let mut count = 0;
        for k in 0..40 {
            let angle = f64::from(k) * 0.04;
            let around = f64::from(k) * 2.4;
            let point = Vector3::new(
                angle.sin() * around.cos(),
                angle.sin() * around.sin(),
                angle.cos(),
            ) * 3.0;
            let Some(pixel) = model.project(&point) else {
                continue;
            };
            count += 1;
            let ray = model.ray(pixel).unwrap();
            assert!(ray.distance_mm(&point) < 1e-11, "{model:?} {angle}");
        }
        assert!(count >= 30, "{model:?}: {count}");
        assert!(model.project(&Vector3::new(0.0, 0.0, -1.0)).is_none());
    }
}

#[test]
fn hand_computed_places() {
    // Mei with xi = 1 at 90 degrees: m = (1, 0, 0), 1 / (0 + 1).
    let plane = ImagePlane::new([100.0, 100.0, 0.0, 0.0]);
    let omni = Omni {
        plane,
        xi: 1.0,
        coefficients: [0.0; 8],
    };
    let side = Vector3::new(5.0, 0.0, 0.0);
    assert!((omni.project(&side).unwrap().u - 100.0).abs() < 1e-12);
    // EUCM with alpha = 1/2, beta = 1 is that with twice the scale.
    let eucm = Eucm {
        plane,
        alpha: 0.5,
        beta: 1.0,
    };
    assert!((eucm.project(&side).unwrap().u - 200.0).abs() < 1e-12);
    // Double sphere, xi = 0 and alpha = 1/2: the same.
    let double = DoubleSphere {
        plane,
        xi: 0.0,
        alpha: 0.5,
    };
    assert!((double.project(&side).unwrap().u - 200.0).abs() < 1e-12);
}

#[test]
fn beyond_a_fold_there_is_neither_pixel_nor_ray() {
    let plane = ImagePlane::new([500.0, 500.0, 640.0, 480.0]);
    // x (1 - 0.3 x^2) rises to x = 1.054, to 0.703.
    let pinhole = Pinhole::new(plane, &[-0.3, 0.0, 0.0, 0.0]).unwrap();
    assert!(pinhole.project(&Vector3::new(1.0, 0.0, 1.0)).is_some());
    assert!(pinhole.project(&Vector3::new(1.1, 0.0, 1.0)).is_none());
    assert!(
        pinhole
            .ray(PixelPoint::new(640.0 + 500.0 * 0.70, 480.0))
            .is_some()
    );
    assert!(
        pinhole
            .ray(PixelPoint::new(640.0 + 500.0 * 0.71, 480.0))
            .is_none()
    );
    let fisheye = Fisheye::radial(plane, &[-0.1, 0.0, 0.0, 0.0]);
    assert!(fisheye.project(&Vector3::new(0.0, 0.0, -1.0)).is_none());
    assert!(fisheye.ray(PixelPoint::new(1e6, 0.0)).is_none());
    assert!(pinhole.ray(PixelPoint::new(f64::NAN, 0.0)).is_none());
}
