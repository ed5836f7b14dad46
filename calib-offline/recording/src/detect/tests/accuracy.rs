//! How near the corners come to the truth.

use super::*;

/// RMS per axis of the corners of several tilted boards, px.
fn rms_per_axis_px(noise: f64, blur_px: f64) -> f64 {
    let poses = [
        [0.0, 0.0],
        [30.0, 10.0],
        [-15.0, 45.0],
        [55.0, -20.0],
        [5.0, -62.0],
    ];
    let squared: Vec<f64> = poses
        .par_iter()
        .enumerate()
        .flat_map_iter(|(k, &tilt)| {
            let mut photo = tilted(board(6, 9), 7.0 + 11.0 * k as f64, tilt, 3.3, -2.1);
            (photo.noise, photo.blur_px) = (noise, blur_px);
            let image = photo.take();
            let raw = ChessTopologicalDetector.detect(&image, &photo.board.clone());
            let half_px = DetectSettings::default().max_half_window_px;
            let grid = FittedGrid::from_raw(&image, &raw[0], &photo.board, half_px).unwrap();
            assert_eq!(grid.corners.len(), 54, "tilt {tilt:?}");
            let errors: Vec<f64> = grid
                .corners
                .values()
                .map(|corner| {
                    (0..54)
                        .map(|n| photo.true_corner(n / 9, n % 9).distance_px(corner.pixel))
                        .fold(f64::INFINITY, f64::min)
                        .powi(2)
                })
                .collect();
            errors
        })
        .collect();
    (squared.iter().sum::<f64>() / squared.len() as f64 / 2.0).sqrt()
}

#[test]
fn rendered_corners_are_found_to_a_hundredth_of_a_pixel() {
    for (noise, blur_px, limit_px) in [
        // 8-bit rounding and the renderer's own sampling are what is left without noise.
        (0.0, 0.7, 0.008),
        (2.0, 0.7, 0.008),
        (2.0, 1.5, 0.012),
        // A perfect lens: only the pixel's area blurs, which is no Gaussian.
        (1.0, 0.0, 0.015),
    ] {
        let rms_px = rms_per_axis_px(noise, blur_px);
        println!("noise {noise}, blur {blur_px} px: {rms_px:.4} px RMS per axis");
        assert!(rms_px < limit_px, "{noise} {blur_px}: {rms_px}");
    }
}

#[test]
fn predicted_sigma_is_the_scatter_of_the_corners() {
    let mut photo = tilted(board(6, 9), 12.0, [20.0, -15.0], 0.0, 0.0);
    photo.noise = 8.0;
    let image = photo.take();
    let raw = ChessTopologicalDetector.detect(&image, &photo.board);
    let grid = FittedGrid::from_raw(&image, &raw[0], &photo.board, 20.0).unwrap();
    let normalized: Vec<f64> = grid
        .corners
        .values()
        .map(|corner| {
            let distance = (0..54)
                .map(|n| photo.true_corner(n / 9, n % 9).distance_px(corner.pixel))
                .fold(f64::INFINITY, f64::min);
            distance.powi(2) / (2.0 * corner.sigma_px.powi(2))
        })
        .collect();
    let ratio = (normalized.iter().sum::<f64>() / normalized.len() as f64).sqrt();
    // 108 numbers: the ratio scatters by 7 %.
    assert!((0.75..1.3).contains(&ratio), "{ratio}");
}

#[test]
fn real_images_are_found_whole() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/opencv-stereo/images");
    let images = |name: &str| {
        (1..=14)
            .map(|k| folder.join(format!("{name}{k:02}.jpg")))
            .filter(|path| path.exists())
            .map(Some)
            .collect::<Vec<_>>()
    };
    let camera = |name: &str| CameraSpec {
        name: name.to_string(),
        sensor: SENSOR,
        images: images(name),
        optics: None,
        serial: None,
    };
    let dataset = Dataset {
        folder: folder.clone(),
        kind: BoardKind::Chessboard,
        board: board(6, 9),
        cameras: vec![camera("left"), camera("right")],
        stage: None,
        known_poses: [].into(),
        known_poses_file: None,
        excluded_poses: std::collections::BTreeSet::new(),
        target: None,
        certificate: None,
        recording: None,
    };
    let detection = detect(&dataset).unwrap();
    assert_eq!(detection.views.len(), 26);
    assert!(detection.views.iter().all(|v| v.corners.len() == 54));
    // The labels agree between left and right: distances from epipolar lines are far below a
    // square (30 px), although lens distortion is left in.
    let check = detection.pair_checks[0];
    assert!(check.median_px < 0.2 && check.worst_px < 1.0, "{check:?}");
}
