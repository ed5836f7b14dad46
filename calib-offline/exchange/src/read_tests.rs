//! Files of every format: what is read, and what is refused with its file, key and remedy.

use crate::content::content;
use crate::foreign::{Content, ForeignCamera, Format};
use crate::foreign_rig::{ForeignRig, Naming};
use crate::read::{Hint, ImportError, Problem, ReadOptions, RotationForm, Unit};
use calib_rays::geometry::{PixelPoint, RigidTransform, SensorSize, so3};
use calib_rays::remedy::Remedy;
use nalgebra::Vector3;
use std::path::Path;

const MM: ReadOptions = ReadOptions {
    unit: Some(Unit::Mm),
    sensor: None,
    model: None,
    rotation: None,
};

fn read(text: &str, options: &ReadOptions) -> Result<ForeignRig, ImportError> {
    let file = Path::new("folder/cam.txt");
    let held = content(file, text.as_bytes(), options)?;
    ForeignRig::of(vec![(file, held)], &Naming::default())
}

#[track_caller]
fn refused(text: &str, options: &ReadOptions) -> Problem {
    let error = read(text, options).expect_err("a file that ought to be refused");
    assert!(error.to_string().starts_with("folder/cam.txt: "), "{error}");
    assert!(error.remedy().is_some());
    error.problem
}

/// A text with one of its parts replaced.
#[track_caller]
fn with(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "{from}");
    text.replacen(from, to, 1)
}

fn pixel(camera: &ForeignCamera, point: [f64; 3]) -> PixelPoint {
    camera.model.project(&Vector3::from(point)).unwrap()
}

const OPENCV: &str = "\
%YAML:1.0
---
image_width: 640
image_height: 480
M1: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 500., 0., 320., 0., 501., 240., 0., 0., 1. ]
D1: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -0.1, 0.01, 0.0001, 0.0002, 0.001 ]
M2: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 502., 0., 321., 0., 503., 241., 0., 0., 1. ]
D2: !!opencv-nd-matrix
   sizes: [ 5 ]
   dt: d
   data: [ 0., 0., 0., 0., 0. ]
R: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 1., 0., 0., 0., 1., 0., 0., 0., 1. ]
T: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ -60., 0., 0. ]
rms: .Nan
";

#[test]
fn a_pair_of_opencv_stands_as_r_and_t_say() {
    let rig = read(OPENCV, &MM).unwrap();
    assert_eq!(rig.format, Format::OpenCv);
    assert_eq!(rig.cameras[0].name, "cam1");
    // T = (-60, 0, 0) takes points of the first into the second: it stands 60 to the right.
    let place = rig.cameras[1].rig_from_camera.unwrap();
    assert_eq!(place.translation_mm, Vector3::new(60.0, 0.0, 0.0));
    assert_eq!(pixel(&rig.cameras[1], [0.0, 0.0, 1.0]).u, 321.0);
    let meters = ReadOptions {
        unit: Some(Unit::M),
        ..MM
    };
    let far = read(OPENCV, &meters).unwrap().cameras[1]
        .rig_from_camera
        .unwrap();
    assert_eq!(far.translation_mm.x, 60_000.0);
}

#[test]
fn what_opencv_does_not_say_is_asked_and_what_is_wrong_is_named() {
    assert_eq!(refused(OPENCV, &ReadOptions::default()), Problem::NeedsUnit);
    assert_eq!(
        refused(&with(OPENCV, "image_width: 640\n", ""), &MM),
        Problem::NeedsSize
    );
    let other_size = ReadOptions {
        sensor: Some(SensorSize::new(1280, 960)),
        ..MM
    };
    assert!(matches!(
        refused(OPENCV, &other_size),
        Problem::Disagrees { .. }
    ));
    let key = |problem: Problem| match problem {
        Problem::Missing { key }
        | Problem::Wrong { key, .. }
        | Problem::NotFinite { key }
        | Problem::Disagrees { key, .. } => key,
        other => panic!("{other}"),
    };
    for (from, to, named) in [
        ("D1: !!", "E1: !!", "distortion_coefficients1"),
        ("500.", ".Nan", "M1.data[0]"),
        ("500.", "-500.", "M1"),
        ("500., 0.,", "500., 3.,", "M1"),
        ("cols: 3\n   dt: d", "cols: 2\n   dt: d", "M1.data"),
        ("dt: d", "dt: i", "M1.dt"),
        ("-0.1,", "\"-0.1\",", "D1.data[0]"),
        ("sizes: [ 5 ]", "sizes: [ 6 ]", "D2.data"),
        (
            "data: [ 1., 0., 0., 0., 1.",
            "data: [ 1., 0., 0., 0., -1.",
            "R",
        ),
    ] {
        assert_eq!(
            key(refused(&with(OPENCV, from, to), &MM)),
            named,
            "{from} -> {to}"
        );
    }
    for broken in ["", "a: [", "hello", "{", "<a>", "%YAML:1.0\n---\nx: 1\n"] {
        refused(broken, &MM);
    }
    let four = with(
        OPENCV,
        "cols: 5\n   dt: d\n   data: [ -0.1, 0.01, 0.0001, 0.0002, 0.001 ]",
        "cols: 4\n   dt: d\n   data: [ -0.1, 0.01, 0.0001, 0.0002 ]",
    );
    assert_eq!(refused(&four, &MM), Problem::NeedsModel);
    for hint in [Hint::Pinhole, Hint::Fisheye] {
        let said = ReadOptions {
            model: Some(hint),
            ..MM
        };
        let rig = read(
            &four
                .replace("sizes: [ 5 ]", "sizes: [ 4 ]")
                .replace("[ 0., 0., 0., 0., 0. ]", "[ 0., 0., 0., 0. ]"),
            &said,
        )
        .unwrap();
        assert_eq!(
            rig.cameras[0].model_name.contains("fisheye"),
            hint == Hint::Fisheye
        );
    }
    let flagged = with(
        OPENCV,
        "rms: .Nan",
        "fisheye_model: !!opencv-matrix\n   rows: 4\n   cols: 1\n   dt: d\n   data: [ 1., 0., 0., 0. ]",
    );
    assert_eq!(key(refused(&flagged, &MM)), "fisheye_model");
}

const KALIBR: &str = "\
cam0:
  camera_model: pinhole
  distortion_coeffs: [-0.28, 0.07, 0.0002, 1.0e-05]
  distortion_model: radtan
  intrinsics: [458.6, 457.3, 367.2, 248.4]
  resolution: [752, 480]
  rostopic: /left/image_raw
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.11]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: omni
  distortion_coeffs: [-0.28, 0.07, 0.0002, 1.0e-05]
  distortion_model: radtan
  intrinsics: [1.2, 458.6, 457.3, 367.2, 248.4]
  resolution: [752, 480]
";

#[test]
fn a_chain_of_kalibr_is_in_meters_and_each_from_the_one_before() {
    let third = "cam2:\n  T_cn_cnm1: [[0, -1, 0, 0], [1, 0, 0, 0.05], [0, 0, 1, 0], [0, 0, 0, 1.0]]\n  camera_model: ds\n  distortion_coeffs: []\n  distortion_model: none\n  intrinsics: [-0.2, 0.6, 300, 301, 367.2, 248.4]\n  resolution: [752, 480]\n";
    let rig = read(&format!("{KALIBR}{third}"), &ReadOptions::default()).unwrap();
    let names: Vec<&str> = rig.cameras.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["left", "cam1", "cam2"]);
    let place = |k: usize| rig.cameras[k].rig_from_camera.unwrap();
    assert_eq!(place(1).translation_mm, Vector3::new(110.0, 0.0, 0.0));
    // The third's origin: R^T (0 - t) = -(0.05, 0, 0) in the second.
    assert!((place(2).translation_mm - Vector3::new(60.0, 0.0, 0.0)).norm() < 1e-9);
    assert_eq!(rig.cameras[2].model_name, "ds-none");
}

#[test]
fn a_broken_chain_is_refused() {
    let is = |from: &str, to: &str| refused(&with(KALIBR, from, to), &ReadOptions::default());
    assert!(
        matches!(is("  T_cn_cnm1:\n", "  T_cam_imu:\n"), Problem::Missing { key } if key == "cam1.T_cn_cnm1")
    );
    assert!(matches!(is("radtan", "equi"), Problem::Model { .. }));
    assert!(
        matches!(is("[-0.28, 0.07,", "[0.07,"), Problem::Wrong { key, .. } if key == "cam0.distortion_coeffs")
    );
    assert!(matches!(
        is("[752, 480]", "[752.5, 480]"),
        Problem::Wrong { .. }
    ));
    assert!(matches!(
        is("[1.0, 0.0, 0.0, -0.11]", "[2.0, 0.0, 0.0, -0.11]"),
        Problem::Wrong { .. }
    ));
    assert!(matches!(is("cam1:", "cam2:"), Problem::Missing { key } if key == "cam1"));
    assert!(matches!(is("cam1:", "cam0:"), Problem::Twice { .. }));
    // What a reader of YAML 1.1 takes for text is a number here; what is in quotes is not.
    assert!(matches!(is("458.6,", "\"458.6\","), Problem::Wrong { .. }));
}

const ROS: &str = "\
image_width: 640
image_height: 480
camera_name: right
camera_matrix:
  rows: 3
  cols: 3
  data: [500, 0, 320, 0, 501, 240, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.1, 0.01, 0.0001, 0.0002, 0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
projection_matrix:
  rows: 3
  cols: 4
  data: [400, 0, 320, -40, 0, 400, 240, 0, 0, 0, 1, 0]
binning_x: 0
roi: {x_offset: 0, y_offset: 0, height: 0, width: 0, do_rectify: false}
";

#[test]
fn a_camera_of_ros_stands_where_its_projection_says() {
    let rig = read(ROS, &ReadOptions::default()).unwrap();
    assert_eq!(
        (rig.format, rig.cameras[0].name.as_str()),
        (Format::Ros, "right")
    );
    // -40 px over 400 px is -0.1 m for points: the camera stands 100 mm to the right.
    let place = rig.cameras[0].rig_from_camera.unwrap();
    assert_eq!(place.translation_mm, Vector3::new(100.0, 0.0, 0.0));
    let is = |from: &str, to: &str| refused(&with(ROS, from, to), &ReadOptions::default());
    assert!(matches!(
        is("plumb_bob", "thin_prism"),
        Problem::Model { .. }
    ));
    assert!(matches!(
        is("plumb_bob", "rational_polynomial"),
        Problem::Wrong { .. }
    ));
    assert!(matches!(
        is("binning_x: 0", "binning_x: 2"),
        Problem::Wrong { .. }
    ));
    assert!(matches!(
        is("rectification_matrix", "rectification"),
        Problem::Missing { .. }
    ));
}

const MRCAL: &str = "\
# a note
{
    'lensmodel':  'LENSMODEL_PINHOLE',
    'intrinsics': [ 500, 501, 320, 240,],
    'valid_intrinsics_region': [ [ 0, 0 ], [ 0, 479 ], [ 639, 479 ], [ 639, 0 ], [ 0, 0 ], ],
    'extrinsics': [ 0, 0, 0.5, 0.1, 0, 0,],
    'imagersize': [ 640, 480,],
    'icam_intrinsics': 0,
    'optimization_inputs': b'abc',
}
";

#[test]
fn both_keys_of_mrcal_must_agree() {
    let expected = RigidTransform::new(
        so3::exp(&Vector3::new(0.0, 0.0, 0.5)),
        Vector3::new(100.0, 0.0, 0.0),
    );
    let both = with(
        MRCAL,
        "    'imager",
        "    'rt_cam_ref': [ 0, 0, 0.5, 0.1, 0, 0,],\n    'imager",
    );
    let only_new = with(MRCAL, "'extrinsics'", "'rt_cam_ref'");
    for text in [MRCAL, &both, &only_new] {
        let rig = read(text, &ReadOptions::default()).unwrap();
        assert_eq!(rig.cameras[0].rig_from_camera.unwrap(), expected.inverse());
        assert_eq!(rig.cameras[0].valid.as_ref().unwrap().len(), 5);
        // The region ends with the centers of the last pixels: all of the image is calibrated.
        assert_eq!(rig.rays(None).unwrap().cameras[0].covered_share, 1.0);
    }
    let is = |from: &str, to: &str| refused(&with(&both, from, to), &ReadOptions::default());
    assert!(matches!(
        is("'rt_cam_ref': [ 0,", "'rt_cam_ref': [ 1,"),
        Problem::Disagrees { .. }
    ));
    assert!(matches!(is("PINHOLE", "OPENCV5"), Problem::Wrong { key, .. } if key == "intrinsics"));
    assert!(matches!(is("PINHOLE", "NEWEST"), Problem::Model { .. }));
    let splined = "SPLINED_STEREOGRAPHIC_order=1_Nx=4_Ny=4_fov_x_deg=90";
    assert!(matches!(is("PINHOLE", splined), Problem::Wrong { key, .. } if key == "lensmodel"));
    assert!(matches!(is("[ 500,", "[ nan,"), Problem::NotFinite { .. }));
    assert!(matches!(
        is(
            "'extrinsics': [ 0, 0, 0.5, 0.1, 0, 0,]",
            "'extrinsics': [ 0, 0 ]"
        ),
        Problem::Wrong { .. }
    ));
    let half = with(
        MRCAL,
        "[ 639, 479 ], [ 639, 0 ]",
        "[ 319, 479 ], [ 319, 0 ]",
    );
    let share = read(&half, &ReadOptions::default())
        .unwrap()
        .rays(None)
        .unwrap()
        .cameras[0]
        .covered_share;
    assert!((0.45..0.51).contains(&share), "{share}");
    let none = with(
        MRCAL,
        "[ [ 0, 0 ], [ 0, 479 ], [ 639, 479 ], [ 639, 0 ], [ 0, 0 ], ]",
        "[]",
    );
    let error = read(&none, &ReadOptions::default())
        .unwrap()
        .rays(None)
        .unwrap_err();
    assert!(matches!(error.problem, Problem::NoRays { .. }));
}

#[test]
fn cameras_of_colmap_are_half_a_pixel_off_and_stand_nowhere() {
    let one = "# a list\n7 SIMPLE_RADIAL 640 480 500 320 240 0.01\n";
    let rig = read(one, &ReadOptions::default()).unwrap();
    assert_eq!(
        (rig.format, rig.cameras[0].name.as_str()),
        (Format::Colmap, "7")
    );
    assert_eq!(
        pixel(&rig.cameras[0], [0.0, 0.0, 1.0]),
        PixelPoint::new(319.5, 239.5)
    );
    let two = format!("{one}8 PINHOLE 640 480 500 500 320 240\n");
    assert_eq!(
        refused(&two, &ReadOptions::default()),
        Problem::NoExtrinsics
    );
    let is = |from: &str, to: &str| refused(&with(one, from, to), &ReadOptions::default());
    assert!(matches!(is(" 0.01", ""), Problem::Wrong { .. }));
    assert!(matches!(
        is("SIMPLE_RADIAL", "EQUIRECTANGULAR"),
        Problem::Model { .. }
    ));
    assert!(matches!(is("500", "nan"), Problem::NotFinite { .. }));
    assert!(matches!(is("640", "0"), Problem::Syntax { line: 2, .. }));
}

const MATLAB: &str = r#"{
"CameraParameters1": {"RadialDistortion": [-0.1, 0.01], "TangentialDistortion": [0, 0], "ImageSize": [480, 640],
  "IntrinsicMatrix": [[500, 0, 0], [0, 501, 0], [321, 241, 1]], "WorldUnits": "millimeters"},
"CameraParameters2": {"RadialDistortion": [-0.1, 0.01, 0.001], "TangentialDistortion": [0, 0], "ImageSize": [480, 640],
  "K": [[500, 0, 322], [0, 501, 242], [0, 0, 1]]},
"RotationOfCamera2": [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], "TranslationOfCamera2": [-60, 1, 2]}
"#;

#[test]
fn matlab_counts_from_one_and_is_asked_how_it_turns() {
    let key = "RotationOfCamera2".to_owned();
    assert_eq!(
        refused(MATLAB, &ReadOptions::default()),
        Problem::NeedsRotationForm { key }
    );
    let said = |rotation| ReadOptions {
        rotation: Some(rotation),
        ..ReadOptions::default()
    };
    let rig = read(MATLAB, &said(RotationForm::Row)).unwrap();
    assert_eq!(
        pixel(&rig.cameras[0], [0.0, 0.0, 1.0]),
        PixelPoint::new(320.0, 240.0)
    );
    assert_eq!(
        pixel(&rig.cameras[1], [0.0, 0.0, 1.0]),
        PixelPoint::new(321.0, 241.0)
    );
    assert_eq!(rig.cameras[0].sensor, SensorSize::new(640, 480));
    // x2 = x1 R + t: (1, 0, 0) goes to (0, 1, 0) + t.
    let second_from_first = rig.cameras[1].rig_from_camera.unwrap().inverse();
    let moved = second_from_first.point(&Vector3::x());
    assert!((moved - Vector3::new(-60.0, 2.0, 2.0)).norm() < 1e-12);
    let other = read(MATLAB, &said(RotationForm::Column)).unwrap();
    let moved = other.cameras[1]
        .rig_from_camera
        .unwrap()
        .inverse()
        .point(&Vector3::x());
    assert!((moved - Vector3::new(-60.0, 0.0, 2.0)).norm() < 1e-12);
    let row = said(RotationForm::Row);
    let is = |from: &str, to: &str| refused(&with(MATLAB, from, to), &row);
    assert_eq!(is("\"millimeters\"", "\"furlongs\""), Problem::NeedsUnit);
    // The transposed of what the key means.
    let turned = "[[500, 0, 321], [0, 501, 241], [0, 0, 1]]";
    assert!(matches!(
        is("[[500, 0, 0], [0, 501, 0], [321, 241, 1]]", turned),
        Problem::Wrong { .. }
    ));
    assert!(matches!(
        is("[-0.1, 0.01]", "[-0.1, null]"),
        Problem::Wrong { .. }
    ));
}

const DICE: &str = r#"<ParameterList>
  <Parameter name="xml_file_format" type="string" value="DICe_xml_camera_system_file" />
  <Parameter name="system_type_3D" type="string" value="OPENCV" />
  <Parameter name="extrinsics_relative_camera_to_camera" type="bool" value="false" />
  <ParameterList name="CAMERA 0">
    <Parameter name="CX" type="double" value="872.1577" /> <Parameter name="CY" type="double" value="579.955" />
    <Parameter name="FX" type="double" value="6673.3159" /> <Parameter name="FY" type="double" value="6669.3027" />
    <Parameter name="K1" type="double" value="0.0319436" />
    <Parameter name="LENS_DISTORTION_MODEL" type="string" value="OPENCV_LENS_DISTORTION" />
    <Parameter name="IMAGE_HEIGHT_WIDTH" type="string" value="{ 1200, 1920 }" />
  </ParameterList>
  <ParameterList name="CAMERA 1">
    <Parameter name="CX" type="double" value="917.973" /> <Parameter name="CY" type="double" value="531.635" />
    <Parameter name="FX" type="double" value="6607.61" /> <Parameter name="FY" type="double" value="6602.85" />
    <Parameter name="LENS_DISTORTION_MODEL" type="string" value="OPENCV_LENS_DISTORTION" />
    <Parameter name="TX" type="double" value="122.2488" /> <Parameter name="TZ" type="double" value="17.62463" />
    <Parameter name="BETA" type="double" value="-90" /> <Parameter name="ALPHA" type="double" value="90" />
    <Parameter name="IMAGE_HEIGHT_WIDTH" type="string" value="{ 1200, 1920 }" />
  </ParameterList>
</ParameterList>
"#;

#[test]
fn dice_turns_about_x_first_and_has_no_unit() {
    assert_eq!(refused(DICE, &ReadOptions::default()), Problem::NeedsUnit);
    let rig = read(DICE, &MM).unwrap();
    assert_eq!(rig.format, Format::Dice);
    assert_eq!(rig.cameras[1].sensor, SensorSize::new(1920, 1200));
    // About x by 90 degrees: y goes to z; then about y by -90: z goes to -x.
    let second_from_world = rig.cameras[1].rig_from_camera.unwrap().inverse();
    assert!((second_from_world.direction(&Vector3::y()) + Vector3::x()).norm() < 1e-12);
    assert!(
        (second_from_world.translation_mm - Vector3::new(122.2488, 0.0, 17.62463)).norm() < 1e-9
    );
    let is = |from: &str, to: &str| refused(&with(DICE, from, to), &MM);
    assert!(matches!(
        is("OPENCV_LENS", "VIC3D_LENS"),
        Problem::Model { .. }
    ));
    assert!(matches!(
        is("{ 1200, 1920 }", "1200 1920"),
        Problem::Wrong { .. }
    ));
    assert!(matches!(is("\"FX\"", "\"FZ\""), Problem::Missing { key } if key == "CAMERA 0.FX"));
    assert!(matches!(is("0.0319436", "nan"), Problem::NotFinite { .. }));
    assert!(matches!(
        is("value=\"false\"", "value=\"maybe\""),
        Problem::Wrong { .. }
    ));
    assert!(matches!(is("</ParameterList>", ""), Problem::Syntax { .. }));
}

#[test]
fn files_of_one_rig_go_together_or_say_why_not() {
    let named = |name: &'static str, text: &str| {
        let file = Path::new(name);
        (file, content(file, text.as_bytes(), &MM).unwrap())
    };
    let one = |focal: &str| {
        let head = OPENCV.split("M2:").next().unwrap();
        head.replace("M1", "camera_matrix")
            .replace("D1", "distortion_coefficients")
            .replace("500.", focal)
    };
    let places = format!(
        "%YAML:1.0\n---\nR: {}",
        OPENCV.split("\nR: ").nth(1).unwrap()
    );
    assert!(matches!(named("e.yml", &places).1, Content::Extrinsics(_)));
    let files = || vec![named("a.yml", &one("500.")), named("b.yml", &one("510."))];
    let all = |mut more: Vec<(&'static Path, Content)>| {
        let mut files = files();
        files.append(&mut more);
        ForeignRig::of(files, &Naming::default())
    };
    let rig = all(vec![named("e.yml", &places)]).unwrap();
    assert_eq!(
        rig.cameras
            .iter()
            .map(|c| c.name.as_str())
            .collect::<Vec<_>>(),
        ["a", "b"]
    );
    assert_eq!(
        rig.cameras[1].rig_from_camera.unwrap().translation_mm.x,
        60.0
    );
    let problem = |result: Result<ForeignRig, ImportError>| result.unwrap_err().problem;
    assert_eq!(problem(all(vec![])), Problem::NoExtrinsics);
    assert!(matches!(
        problem(all(vec![named("m.cameramodel", MRCAL)])),
        Problem::Apart { .. }
    ));
    assert!(matches!(
        problem(all(vec![named("e.yml", &places), named("f.yml", &places)])),
        Problem::Apart { .. }
    ));
    let twice = vec![
        named("x/a.yml", &one("500.")),
        named("y/a.yml", &one("500.")),
    ];
    assert!(matches!(
        problem(ForeignRig::of(twice, &Naming::default())),
        Problem::SameName { .. }
    ));
    let names = Naming {
        names: Some(vec!["left".to_owned()]),
        ..Naming::default()
    };
    assert_eq!(
        problem(ForeignRig::of(files(), &names)),
        Problem::Names { given: 1, found: 2 }
    );
}
