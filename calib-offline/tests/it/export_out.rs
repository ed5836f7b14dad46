//! `export` to lenses, maps, images and clouds: the two ideal cameras of 600 px, toed in.

use crate::common::{SENSOR, calibration, contents, project, rig, run, with_uncertainty};
use calib_rays::geometry::PixelPoint;
use nalgebra::Vector3;
use serde_json::Value;
use std::fs;
use std::path::Path;

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let json = with_uncertainty().to_json().unwrap();
    fs::write(folder.path().join("calibration.json"), json).unwrap();
    folder
}

fn export<'a>(form: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let start = ["export", "calibration.json", "--format", form, "-o", "out"];
    [&start[..], more].concat()
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

/// The bytes of a file of `NumPy`, behind its head.
fn numbers(path: &Path) -> Vec<u8> {
    let bytes = fs::read(path).unwrap();
    assert!(bytes.starts_with(b"\x93NUMPY\x01\x00"));
    let start = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    bytes[start..].to_vec()
}

fn floats(path: &Path) -> Vec<[f32; 2]> {
    let number = |bytes: &[u8]| f32::from_le_bytes(bytes.try_into().unwrap());
    let bytes = numbers(path);
    bytes
        .chunks_exact(8)
        .map(|pair| [number(&pair[..4]), number(&pair[4..])])
        .collect()
}

#[test]
fn a_lens_is_chosen_and_the_loss_has_a_map() {
    for (form, model, file, says) in [
        ("opencv", "pinhole4", "left.yml", "fisheye_model: 0"),
        ("opencv", "tilted14", "left.yml", "cols: 14"),
        ("opencv", "equidistant", "left.yml", "fisheye_model: 1"),
        (
            "ros",
            "prism12",
            "left.yaml",
            "distortion_model: rational_polynomial",
        ),
        (
            "ros",
            "equidistant",
            "left.yaml",
            "distortion_model: equidistant",
        ),
        (
            "kalibr",
            "equidistant",
            "camchain.yaml",
            "distortion_model: equidistant",
        ),
        (
            "mrcal",
            "rational8",
            "left.cameramodel",
            "LENSMODEL_OPENCV8",
        ),
    ] {
        let folder = folder();
        let path = folder.path();
        run(
            path,
            &export(form, &["--model", model, "--distance-mm", "700"]),
        )
        .assert_code(0)
        .assert_prints(&["lost by the lenses at 700 mm", "left: "]);
        let text = fs::read_to_string(path.join("out").join(file)).unwrap();
        assert!(text.contains(says), "{form} {model}: {text}");
        let loss = json(&path.join("out.loss.json"));
        assert_eq!(
            (&loss["cameras"][0]["model"], &loss["distance_mm"]),
            (&model.into(), &700.0.into())
        );
        let map = &loss["maps"][1];
        assert_eq!(map["camera"], "right");
        let [columns, rows] = ["u_px", "v_px"].map(|key| map[key].as_array().unwrap().len());
        assert_eq!((columns, rows), (33, 25));
        for key in ["du_px", "dv_px", "mm"] {
            let table = map[key].as_array().unwrap();
            assert!(
                table.len() == rows
                    && table
                        .iter()
                        .all(|row| row.as_array().unwrap().len() == columns)
            );
            // Nothing is calibrated in the corner.
            assert!(table[0][0].is_null());
            // An equidistant lens is no pinhole: it needs its four coefficients for that, and loses a little.
            let most = if model == "equidistant" { 0.1 } else { 1e-5 };
            assert!(
                table[12][16].as_f64().unwrap().abs() < most,
                "{form} {model}"
            );
        }
    }
}

#[test]
fn mrcals_models_come_back_as_the_rig_that_they_were() {
    for form in ["mrcal", "mrcal-splined"] {
        let folder = folder();
        let path = folder.path();
        run(path, &export(form, &[]))
            .assert_code(0)
            .assert_prints(&["px RMS"]);
        let import = [
            "import",
            "out/left.cameramodel",
            "out/right.cameramodel",
            "-o",
            "back.json",
        ];
        run(path, &import).assert_code(0);
        fs::write(
            path.join("pixels.csv"),
            "id,u,v\na,100,100\nb,320.5,240.25\nc,540,400\n",
        )
        .unwrap();
        let rays = |rig: &str, out: &str| {
            let rays = ["rays", rig, "pixels.csv", "--camera", "right", "-o", out];
            run(path, &rays).assert_code(0);
            let text = fs::read_to_string(path.join(out)).unwrap();
            text.lines()
                .skip(1)
                .flat_map(|line| {
                    line.split(',')
                        .skip(1)
                        .take(6)
                        .map(|x| x.parse::<f64>().unwrap())
                        .collect::<Vec<_>>()
                })
                .collect::<Vec<_>>()
        };
        let max_px = json(&path.join("out.loss.json"))["max_px"]
            .as_f64()
            .unwrap();
        assert!(max_px < 2e-3, "{form}: {max_px}");
        for (a, b) in rays("calibration.json", "a.csv")
            .iter()
            .zip(rays("back.json", "b.csv"))
        {
            // Directions to the loss of a lens of 600 px and to what a field differs from its model, 1e-5 px; the origins' mm alike.
            assert!(
                (a - b).abs() < (max_px + 1e-4) / 600.0 * 3.0 + 1e-7,
                "{form}: {a} {b}"
            );
        }
    }
}

#[test]
fn maps_say_where_the_cameras_see_a_plane() {
    let folder = folder();
    let path = folder.path();
    run(path, &export("remap", &["--distance-mm", "500"]))
        .assert_code(0)
        .assert_prints(&["10 files of remap", "exact at 500 mm"]);
    let index = json(&path.join("out/remap.json"));
    let view = &index["views"][1];
    assert_eq!(view["camera"], "right");
    assert_eq!(view["map"]["shape"], serde_json::json!([480, 640, 2]));
    let map = floats(&path.join("out/map_right.npy"));
    let mask = numbers(&path.join("out/mask_right.npy"));
    assert_eq!((map.len(), mask.len()), (640 * 480, 640 * 480));
    // The cameras are ideal: the view is the picture.
    for (k, (pixel, mask)) in map.iter().zip(&mask).enumerate() {
        let here = [(k % 640) as f32, (k / 640) as f32];
        if *mask == 255 {
            assert!(
                (0..2).all(|axis| (pixel[axis] - here[axis]).abs() < 1e-3),
                "{pixel:?} {here:?}"
            );
        } else {
            assert_eq!((*pixel, *mask), ([-1.0; 2], 0));
        }
    }
    assert_eq!((mask[240 * 640 + 320], mask[0]), (255, 0));
    assert_eq!(
        numbers(&path.join("out/fixed_right.npy")).len(),
        640 * 480 * 4
    );
    assert_eq!(
        numbers(&path.join("out/fraction_right.npy")).len(),
        640 * 480 * 2
    );
}

#[test]
fn a_rectified_pair_sees_a_point_in_one_row_of_both_pictures() {
    let folder = folder();
    let path = folder.path();
    run(path, &export("rectify", &["--distance-mm", "500"])).assert_code(0);
    let index = json(&path.join("out/rectify.json"));
    let number = |value: &Value| value.as_f64().unwrap();
    let rig = rig();
    let maps = ["left", "right"].map(|name| floats(&path.join(format!("out/map_{name}.npy"))));
    let mut count = 0;
    for point in [[0.0, 0.0, 0.0], [30.0, 20.0, 0.0], [-40.0, 35.0, 0.0]] {
        let in_pair: Vec<[f64; 2]> = (0..2)
            .map(|k| {
                let view = &index["views"][k];
                let turn: Vec<f64> = view["rig_from_view"]["rotation"]
                    .as_array()
                    .unwrap()
                    .iter()
                    .map(number)
                    .collect();
                let at: Vec<f64> = view["rig_from_view"]["translation_mm"]
                    .as_array()
                    .unwrap()
                    .iter()
                    .map(number)
                    .collect();
                let turn = nalgebra::Matrix3::from_row_slice(&turn);
                let p = turn.transpose() * (Vector3::from(point) - Vector3::from_column_slice(&at));
                let matrix = &view["camera_matrix"];
                [
                    number(&matrix[0]) * p.x / p.z + number(&matrix[2]),
                    number(&matrix[4]) * p.y / p.z + number(&matrix[5]),
                ]
            })
            .collect();
        assert!((in_pair[0][1] - in_pair[1][1]).abs() < 1e-6);
        let q: Vec<f64> = index["Q"].as_array().unwrap().iter().map(number).collect();
        let disparity = in_pair[0][0] - in_pair[1][0];
        let depth = q[11] / (q[14] * disparity + q[15]);
        assert!((depth - 500.0).abs() < 1.0, "{depth}");
        for k in 0..2 {
            let truth = project(&rig, k, &Vector3::from(point));
            // The map of the pixel nearest to it leads near the truth: half a pixel both ways.
            let [u, v] = in_pair[k].map(f64::round);
            let [mu, mv] = maps[k][v as usize * 640 + u as usize].map(f64::from);
            assert!(
                PixelPoint::new(mu, mv).distance_px(truth) < 1.0,
                "{mu} {mv} {truth:?}"
            );
            count += 1;
        }
    }
    assert_eq!(count, 6);
    let storage = fs::read_to_string(path.join("out/rectify.yml")).unwrap();
    for key in ["R1: !!opencv-matrix", "R2: ", "P1: ", "P2: ", "Q: "] {
        assert!(storage.contains(key), "{storage}");
    }
}

#[test]
fn images_are_undistorted_and_others_named() {
    let folder = folder();
    let path = folder.path();
    let images = path.join("images");
    fs::create_dir(&images).unwrap();
    let gray = image::ImageBuffer::from_fn(640, 480, |u, v| image::Luma([(u + 7 * v) as u16]));
    gray.save(images.join("left_1.png")).unwrap();
    let color = image::RgbImage::from_pixel(640, 480, image::Rgb([9, 200, 77]));
    color.save(images.join("right01.png")).unwrap();
    color.save(images.join("leftover.png")).unwrap();
    fs::write(images.join("notes.txt"), "none").unwrap();
    let undistort = export("undistort", &["--images", "images"]);
    run(path, &undistort).assert_code(0).assert_prints(&[
        "5 files of undistort",
        "passed over",
        "leftover.png, notes.txt",
    ]);
    let mask = image::open(path.join("out/mask_left.png"))
        .unwrap()
        .into_luma8();
    let image::DynamicImage::ImageLuma16(new) = image::open(path.join("out/left_1.png")).unwrap()
    else {
        panic!("16 bits stay");
    };
    for (u, v, value) in new.enumerate_pixels() {
        let expected = if mask.get_pixel(u, v)[0] == 255 {
            gray.get_pixel(u, v)[0]
        } else {
            0
        };
        assert_eq!(value[0], expected, "{u} {v}");
    }
    let new = image::open(path.join("out/right01.png"))
        .unwrap()
        .into_rgb8();
    assert_eq!(new.get_pixel(320, 240), &image::Rgb([9, 200, 77]));
    // Never over its own input.
    let over = [
        "export",
        "calibration.json",
        "--format",
        "undistort",
        "--images",
        "images",
        "-o",
        "images",
        "--force",
    ];
    run(path, &over)
        .assert_code(2)
        .assert_says(&["is what the command reads"]);
}

#[test]
fn npy_has_masks_and_what_is_known_of_uncertainty() {
    let folder = folder();
    let path = folder.path();
    run(path, &export("npy", &[])).assert_code(0);
    let index = json(&path.join("out/rays.json"));
    assert_eq!(index["masks"][0]["file"], "mask_left.npy");
    let mask = numbers(&path.join("out/mask_left.npy"));
    assert_eq!(
        (mask.len(), mask[0], mask[240 * 640 + 320]),
        (640 * 480, 0, 255)
    );
    let entry = &index["uncertainty"][0];
    assert_eq!(entry["shape"], serde_json::json!([2, 3, 4, 4]));
    assert_eq!(
        (&entry["noise_px2"], &entry["first"]),
        (&0.0016.into(), &"left".into())
    );
    let bytes = numbers(&path.join("out/uncertainty_left_right.npy"));
    let values: Vec<f64> = bytes
        .chunks_exact(8)
        .map(|b| f64::from_le_bytes(b.try_into().unwrap()))
        .collect();
    assert_eq!(values.len(), 2 * 3 * 16);
    for (k, value) in values.iter().enumerate() {
        let expected = if k % 16 % 5 == 0 { 0.0009 } else { 0.0 };
        assert_eq!(*value, expected);
    }
}

#[test]
fn points_become_a_cloud() {
    let folder = folder();
    let path = folder.path();
    let table = "id,x,y,z,gap,sigma_x,sigma_y,sigma_z,status\na,1.5,-2,3,0.25,0.1,0.2,0.3,ok\nb,,,,,,,,outside\n";
    fs::write(path.join("points.csv"), table).unwrap();
    let ply = ["export", "points.csv", "--format", "ply", "-o", "cloud.ply"];
    run(path, &ply)
        .assert_code(0)
        .assert_prints(&["1 points, with sigma, 1 rows"]);
    let bytes = fs::read(path.join("cloud.ply")).unwrap();
    assert!(bytes.starts_with(b"ply\nformat binary_little_endian 1.0\n"));
    assert!(bytes.ends_with(&0.3_f64.to_le_bytes()));
}

/// What is asked for, and what is said of it.
const REFUSED: &[(&[&str], &[&str])] = &[
    (
        &["calibration.json", "--format", "opencv", "--model", "kb9"],
        &["kb9", "pinhole4", "equidistant"],
    ),
    (
        &[
            "calibration.json",
            "--format",
            "kalibr",
            "--model",
            "rational8",
        ],
        &["it holds pinhole4, equidistant", "--format opencv"],
    ),
    (
        &[
            "calibration.json",
            "--format",
            "mrcal",
            "--model",
            "equidistant",
        ],
        &["it holds pinhole4, pinhole5, rational8"],
    ),
    (
        &[
            "calibration.json",
            "--format",
            "remap",
            "--model",
            "pinhole4",
        ],
        &["remap has no place for --model"],
    ),
    (
        &[
            "calibration.json",
            "--format",
            "npy",
            "--distance-mm",
            "500",
        ],
        &["npy has no place for --distance-mm"],
    ),
    (
        &[
            "calibration.json",
            "--format",
            "rectify",
            "--region",
            "0,0,9,9",
        ],
        &["rectify has no place for --region"],
    ),
    (
        &[
            "calibration.json",
            "--format",
            "opencv",
            "--images",
            "images",
        ],
        &["opencv has no place for --images"],
    ),
    (
        &[
            "calibration.json",
            "--format",
            "opencv",
            "--region",
            "100,100,640,300",
        ],
        &["\"left\"", "639.5", "within the sensor"],
    ),
    (
        &[
            "calibration.json",
            "--format",
            "opencv",
            "--region",
            "100,100,90,300",
        ],
        &["upper left", "100,100,1180,924"],
    ),
    (
        &["calibration.json", "--format", "opencv", "--distance-mm=-5"],
        &["distance above 0"],
    ),
    (
        &["mono.json", "--format", "rectify"],
        &["1 cameras", "--format remap"],
    ),
    (
        &[
            "calibration.json",
            "--format",
            "rectify",
            "--distance-mm",
            "20",
        ],
        &["no point at 20 mm", "--distance-mm"],
    ),
    (
        &["calibration.json", "--format", "undistort"],
        &["--images is missing", "--images FOLDER"],
    ),
    (
        &[
            "calibration.json",
            "--format",
            "undistort",
            "--images",
            "gone",
        ],
        &["gone: cannot be read", "check the path"],
    ),
    (
        &[
            "calibration.json",
            "--format",
            "undistort",
            "--images",
            "none",
        ],
        &["no PNG", "left, right", "left_001.png"],
    ),
    (
        &[
            "calibration.json",
            "--format",
            "undistort",
            "--images",
            "images",
        ],
        &["left.png", "is not a PNG"],
    ),
    (
        &["points.csv", "--format", "ply"],
        &["the header is \"id,u,v\"", "measure"],
    ),
    (
        &["gone.csv", "--format", "ply"],
        &["gone.csv: cannot be read", "check the path"],
    ),
];

#[test]
fn what_a_form_cannot_do_is_said_with_the_remedy() {
    let folder = folder();
    let path = folder.path();
    let mut mono = calibration();
    mono.rig.cameras.truncate(1);
    mono.rig.uncertainty.clear();
    fs::write(path.join("mono.json"), mono.to_json().unwrap()).unwrap();
    fs::create_dir(path.join("images")).unwrap();
    fs::write(path.join("images/left.png"), "no image").unwrap();
    fs::create_dir(path.join("none")).unwrap();
    fs::write(path.join("points.csv"), "id,u,v\na,1,2\n").unwrap();
    let before = contents(path);
    for (arguments, says) in REFUSED {
        let all = [&["export", "-o", "out"][..], arguments].concat();
        run(path, &all).assert_code(2).assert_says(says);
        assert_eq!(contents(path), before, "{arguments:?}");
    }
    let size = SENSOR.width;
    let small = image::GrayImage::new(size / 2, SENSOR.height);
    small.save(path.join("images/left.png")).unwrap();
    let all = [&["export", "-o", "out"][..], REFUSED[15].0].concat();
    run(path, &all)
        .assert_code(2)
        .assert_says(&["320x480", "640x480", "resolution"]);
}
