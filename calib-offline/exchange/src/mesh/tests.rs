//! The files, read back as the chips' documents have them and used as the chips use them, in whole numbers, against cameras that
//! are projected by their own formulas.

use super::*;
use calib_estimate::pinhole::BrownCamera;
use calib_rays::field::{
    BaseLens, CalibratedCamera, CoverageMask, Projection, RayField, Rig, SmoothMap,
};
use calib_rays::geometry::{PixelPoint, Ray, RigidTransform, SensorSize, so3};
use nalgebra::{Vector2, Vector3};

const DISTANCE_MM: f64 = 500.0;
/// What the search for a pixel may leave.
const SEARCH_PX: f64 = 1e-6;

fn brown(sensor: SensorSize) -> BrownCamera {
    let focal_px = 1.36 * f64::from(sensor.width);
    let center = sensor.center();
    BrownCamera {
        sensor,
        focal_px: [focal_px, 1.001 * focal_px],
        center_px: [center.u + 7.0, center.v - 5.0],
        distortion: [-0.18, 0.12, 6e-4, -4e-4, -0.04],
    }
}

fn place(turn: [f64; 3], at_mm: [f64; 3]) -> RigidTransform {
    RigidTransform::new(so3::exp(&Vector3::from(turn)), Vector3::from(at_mm))
}

/// Brown's cameras, calibrated within a radius of the middle of the sensor.
struct Browns {
    camera: BrownCamera,
    rig_from_camera: Vec<RigidTransform>,
    radius_px: f64,
}

impl Browns {
    fn one(sensor: SensorSize) -> Self {
        Self {
            camera: brown(sensor),
            rig_from_camera: vec![place([0.3, 0.1, -0.2], [40.0, 50.0, -600.0])],
            radius_px: f64::INFINITY,
        }
    }

    fn truth(&self, camera_idx: usize, point_mm: &Vector3<f64>) -> Option<PixelPoint> {
        let point = self.rig_from_camera[camera_idx].inverse().point(point_mm);
        self.camera.project(&point)
    }

    fn is_calibrated(&self, pixel: PixelPoint) -> bool {
        self.camera.sensor.contains(pixel)
            && pixel.distance_px(self.camera.sensor.center()) < self.radius_px
    }
}

impl RaySource for Browns {
    fn cameras(&self) -> Vec<SourceCamera> {
        let places = self.rig_from_camera.iter().enumerate();
        places
            .map(|(k, rig_from_camera)| SourceCamera {
                name: format!("c{k}"),
                sensor: self.camera.sensor,
                rig_from_camera: *rig_from_camera,
            })
            .collect()
    }

    fn ray(&self, camera_idx: usize, pixel: PixelPoint) -> Option<Ray> {
        if !self.is_calibrated(pixel) {
            return None;
        }
        let ray = self.camera.ray(pixel)?;
        let ray = ray.transformed(&self.rig_from_camera[camera_idx]);
        Some(Ray {
            direction: ray.direction.normalize(),
            ..ray
        })
    }
}

const fn settings(format: MeshFormat, step: Option<u32>) -> MeshSettings {
    MeshSettings {
        format,
        step,
        distance_mm: DISTANCE_MM,
        zoom: 1.0,
        camera_idx: None,
    }
}

/// Numbers that look like chance.
fn dice() -> impl FnMut(u32) -> u32 {
    let mut state = 7_u64;
    move |below| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        ((state >> 33) % u64::from(below)) as u32
    }
}

fn i16_at(bytes: &[u8], at: usize) -> i64 {
    i64::from(i16::from_le_bytes([bytes[at], bytes[at + 1]]))
}

fn f32_at(bytes: &[u8], at: usize) -> f64 {
    f64::from(f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()))
}

/// A sum of weights `2^bits`, as a chip may round it, in the units of the numbers.
fn roundings(sum: i64, bits: u32) -> [f64; 3] {
    let half = (1_i64 << bits) >> 1;
    [
        sum as f64 / f64::from(1_u32 << bits),
        (sum >> bits) as f64,
        ((sum + half) >> bits) as f64,
    ]
}

/// Where TI's chip may take a pixel from: three pairs.
fn ti_taken(bytes: &[u8], width: u32, m: u32, u: u32, v: u32) -> Vec<[f64; 2]> {
    let pitch = ((width >> m) as usize + 1 + 15) & !15;
    let (i, j) = ((u >> m) as usize, (v >> m) as usize);
    let mask = (1_u32 << m) - 1;
    let (a, b) = (i64::from(u & mask), i64::from(v & mask));
    let one = 1_i64 << m;
    let sum = |part: usize| {
        let node = |di: usize, dj: usize| i16_at(bytes, 4 * ((j + dj) * pitch + i + di) + 2 * part);
        // Where a weight is zero there need be no node.
        let mut sum = 0;
        for (di, dj, weight) in [
            (0, 0, (one - a) * (one - b)),
            (1, 0, a * (one - b)),
            (0, 1, (one - a) * b),
            (1, 1, a * b),
        ] {
            if weight > 0 {
                sum += weight * node(di, dj);
            }
        }
        sum
    };
    // Vertical comes first.
    let (dy, dx) = (roundings(sum(0), 2 * m), roundings(sum(1), 2 * m));
    (0..3)
        .map(|k| [f64::from(u) + dx[k] / 8.0, f64::from(v) + dy[k] / 8.0])
        .collect()
}

/// Where NXP's chip may take a pixel from, in blocks that 16 divides.
fn dw100_taken(bytes: &[u8], width: u32, u: u32, v: u32) -> Vec<[f64; 2]> {
    let per_row = width.div_ceil(16) as usize + 1;
    let (i, j) = ((u / 16) as usize, (v / 16) as usize);
    let (a, b) = (i64::from(u % 16), i64::from(v % 16));
    let sum = |shift: u32| {
        let vertex = |di: usize, dj: usize| {
            let at = 4 * ((j + dj) * per_row + i + di);
            let word = u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
            i64::from((word >> shift) & 0xffff)
        };
        (16 - a) * (16 - b) * vertex(0, 0)
            + a * (16 - b) * vertex(1, 0)
            + (16 - a) * b * vertex(0, 1)
            + a * b * vertex(1, 1)
    };
    let (x, y) = (roundings(sum(0), 8), roundings(sum(16), 8));
    (0..3).map(|k| [x[k] / 16.0, y[k] / 16.0]).collect()
}

/// At 1000 pixels the use of a file misses the truth by no more than the loss; its largest share of the loss.
fn assert_within(
    source: &Browns,
    made: &Meshes,
    taken: impl Fn(&[u8], u32, u32) -> Vec<[f64; 2]>,
) -> f64 {
    let (camera, size) = (&made.cameras[0], source.camera.sensor);
    let mut dice = dice();
    let (mut most, mut compared) = (0.0_f64, 0);
    while compared < 1000 {
        let (u, v) = (dice(size.width), dice(size.height));
        let point_mm = camera
            .view
            .point_mm([f64::from(u), f64::from(v)], DISTANCE_MM);
        let Some(truth) = source.truth(0, &point_mm) else {
            continue;
        };
        if !source.is_calibrated(truth) {
            continue;
        }
        compared += 1;
        for [x, y] in taken(&made.files[0].1, u, v) {
            let missed_px = truth.distance_px(PixelPoint::new(x, y));
            assert!(
                missed_px <= camera.loss.max_px + SEARCH_PX,
                "({u}, {v}): {missed_px} px, printed {:?}",
                camera.loss
            );
            most = most.max(missed_px / camera.loss.max_px);
            // The ray of the pixel that the chip takes, beside the point. To first order, hence the percent.
            if let Some(ray) = source.ray(0, PixelPoint::new(x, y)) {
                let missed_mm = ray.distance_mm(&point_mm);
                assert!(missed_mm <= 1.01 * camera.loss.max_mm, "{missed_mm} mm");
            }
        }
    }
    most
}

#[test]
fn tis_chip_misses_the_rays_by_no_more_than_the_loss() {
    let source = Browns::one(SensorSize::new(1280, 1024));
    for (m, most_px) in [(0, 0.2), (3, 0.28), (4, 0.3), (6, 0.6)] {
        let made = meshes(&source, &settings(MeshFormat::Ti, Some(1 << m))).unwrap();
        let loss = made.loss();
        let share = assert_within(&source, &made, |bytes, u, v| ti_taken(bytes, 1280, m, u, v));
        println!("m {m}: {loss:?}, {share}");
        // Down to an eighth of a pixel each way, and the nodes' own sixteenth.
        assert!(
            loss.max_px < most_px && share > 0.7,
            "m {m}: {loss:?} {share}"
        );
    }
}

#[test]
fn nxps_chip_misses_the_rays_by_no_more_than_the_loss() {
    let source = Browns::one(SensorSize::new(1280, 1024));
    let mut settings = settings(MeshFormat::Dw100, None);
    // The whole output image lies within the camera's.
    settings.zoom = 1.05;
    let made = meshes(&source, &settings).unwrap();
    let share = assert_within(&source, &made, |bytes, u, v| dw100_taken(bytes, 1280, u, v));
    println!("{:?} {share} {}", made.cameras[0], made.files[0].1.len());
    assert!(made.loss().max_px < 0.15 && share > 0.7);
    assert_eq!(made.cameras[0].held_back_nodes, 0);
    assert_eq!(made.files[0].1.len(), 4 * 81 * 65);
}

#[test]
fn what_no_word_without_sign_holds_is_held_back_and_in_the_loss() {
    let source = Browns::one(SensorSize::new(1280, 1024));
    let mut settings = settings(MeshFormat::Dw100, None);
    settings.zoom = 0.9;
    let made = meshes(&source, &settings).unwrap();
    let camera = &made.cameras[0];
    assert_within(&source, &made, |bytes, u, v| dw100_taken(bytes, 1280, u, v));
    assert!(camera.held_back_nodes > 100 && camera.outside_pixels > 10_000);
    assert!(camera.loss.max_px > 0.5, "{:?}", camera.loss);
}

#[test]
fn the_last_block_is_the_remainder() {
    let source = Browns::one(SensorSize::new(648, 488));
    let made = meshes(&source, &settings(MeshFormat::Dw100, None)).unwrap();
    assert_eq!(made.files[0].1.len(), 4 * 42 * 32);
    let index: Value = serde_json::from_slice(&made.files[1].1).unwrap();
    assert_eq!(index["cameras"][0]["last_node_px"], json!([648, 488]));
    assert!(made.loss().rms_px < 0.1, "{:?}", made.loss());
}

#[test]
fn rows_of_tis_table_are_filled_and_its_frame_is_rounded_up() {
    let source = Browns::one(SensorSize::new(650, 490));
    let made = meshes(&source, &settings(MeshFormat::Ti, Some(16))).unwrap();
    let index: Value = serde_json::from_slice(&made.files[1].1).unwrap();
    let facts = &index["cameras"][0]["format"];
    assert_eq!(facts["mesh_frame_width"], 656);
    assert_eq!(facts["mesh_frame_height"], 496);
    assert_eq!(facts["subsample_factor"], 4);
    // 656 / 16 + 1 = 42 entries, in rows of 48.
    let bytes = &made.files[0].1;
    assert_eq!(bytes.len(), 4 * 48 * 32);
    for row in bytes.chunks(4 * 48) {
        assert!(row[4 * 42..].iter().all(|byte| *byte == 0));
        assert!(row[..4 * 42].iter().any(|byte| *byte != 0));
    }
    let share = assert_within(&source, &made, |bytes, u, v| ti_taken(bytes, 656, 4, u, v));
    assert!(share > 0.7);
}

#[test]
fn every_pixel_that_shows_something_calibrated_is_counted() {
    let mut source = Browns::one(SensorSize::new(640, 480));
    source.radius_px = 250.0;
    let made = meshes(&source, &settings(MeshFormat::Plain, None)).unwrap();
    let camera = &made.cameras[0];
    let shows_nothing = |k: u32| {
        let at = [k % 640, k / 640].map(f64::from);
        let pixel = source.truth(0, &camera.view.point_mm(at, DISTANCE_MM));
        !pixel.is_some_and(|pixel| source.is_calibrated(pixel))
    };
    let outside = (0..640 * 480).filter(|k| shows_nothing(*k)).count();
    assert!(outside > 50_000);
    assert_eq!(camera.outside_pixels, outside);
    assert_eq!(camera.loss.count + outside, 640 * 480);
    // Beyond the calibrated area the mesh goes on, and its edge is hardly worse than the middle.
    assert!(camera.loss.max_px < 0.1, "{:?}", camera.loss);
}

#[test]
fn vpis_points_are_as_many_as_nvidia_says_and_near() {
    let source = Browns::one(SensorSize::new(700, 500));
    let dense = meshes(&source, &settings(MeshFormat::Vpi, None)).unwrap();
    // Tiles of 64 x 16: 704 x 512 points.
    assert_eq!(dense.files[0].1.len(), 8 * 704 * 512);
    let near = |per_row: usize, step: u32| {
        move |bytes: &[u8], u: u32, v: u32| {
            let at = 8 * ((v / step) as usize * per_row + (u / step) as usize);
            vec![[f32_at(bytes, at), f32_at(bytes, at + 4)]]
        }
    };
    assert_within(&source, &dense, near(704, 1));
    // Half the last place of an f32 near 700.
    assert!(dense.loss().max_px < 5e-5, "{:?}", dense.loss());
    let sparse = meshes(&source, &settings(MeshFormat::Vpi, Some(64))).unwrap();
    // 704 / 64 = 11, an even number of steps is 12; 512 / 64 = 8.
    assert_eq!(sparse.files[0].1.len(), 8 * 13 * 9);
    let across = |[a, b, c]: [f64; 3], t: f64| {
        // Neville's scheme through 0, 1 and 2.
        let (ab, bc) = (a + t * (b - a), b + (t - 1.0) * (c - b));
        ab + t / 2.0 * (bc - ab)
    };
    let share = assert_within(&source, &sparse, |bytes, u, v| {
        let (i, j) = (u / 128, v / 128);
        let (s, t) = (f64::from(u % 128) / 64.0, f64::from(v % 128) / 64.0);
        let axis = |axis: u32| {
            let point = |di: u32, dj: u32| {
                f32_at(
                    bytes,
                    (8 * ((2 * j + dj) * 13 + 2 * i + di) + 4 * axis) as usize,
                )
            };
            let row = |dj: u32| across([0, 1, 2].map(|di| point(di, dj)), s);
            across([0, 1, 2].map(row), t)
        };
        vec![[axis(0), axis(1)]]
    });
    let bilinear = meshes(&source, &settings(MeshFormat::Plain, Some(64))).unwrap();
    println!("{:?} {:?}, {share}", sparse.loss(), bilinear.loss());
    assert!(share > 0.5 && sparse.loss().rms_px < bilinear.loss().rms_px);
}

#[test]
fn a_pair_for_luxonis_is_rectified() {
    let mut source = Browns::one(SensorSize::new(640, 480));
    let right = source.rig_from_camera[0] * place([0.01, 0.1, -0.02], [60.0, 2.0, 1.0]);
    source.rig_from_camera.push(right);
    let made = meshes(&source, &settings(MeshFormat::Luxonis, None)).unwrap();
    assert!(made.is_rectified);
    let [left, right] = [0, 1].map(|k| made.cameras[k].view);
    assert_eq!(left.focal_px, right.focal_px);
    assert_eq!(left.center_px, right.center_px);
    // A point is in the same row of both.
    for point in [[10.0, -60.0, 450.0], [-80.0, 40.0, 700.0]] {
        let point_mm = source.rig_from_camera[0].point(&Vector3::from(point));
        let rows = [left, right].map(|view| {
            let seen = view.rig_from_view.inverse().point(&point_mm);
            view.center_px[1] + view.focal_px[1] * seen.y / seen.z
        });
        assert!((rows[0] - rows[1]).abs() < 1e-9, "{rows:?}");
    }
    for (k, camera) in made.cameras.iter().enumerate() {
        let bytes = &made.files[k].1;
        assert_eq!(bytes.len(), 8 * 41 * 31);
        // y comes first.
        let point_mm = camera.view.point_mm([320.0, 240.0], DISTANCE_MM);
        let truth = source.truth(k, &point_mm).unwrap();
        let at = 8 * (15 * 41 + 20);
        assert!((f32_at(bytes, at) - truth.v).abs() < 1e-4);
        assert!((f32_at(bytes, at + 4) - truth.u).abs() < 1e-4);
        assert!(camera.loss.max_px < 0.2, "{:?}", camera.loss);
    }
    let mut alone = settings(MeshFormat::Luxonis, None);
    alone.camera_idx = Some(1);
    assert!(!meshes(&source, &alone).unwrap().is_rectified);
}

/// Rays that meet in no point, and a calibrated area with a margin: the pixel by the field's own search.
#[test]
fn a_field_without_a_center_is_seen_at_its_distance() {
    let sensor = SensorSize::new(640, 480);
    let base = BaseLens::ideal(Projection::Perspective, 700.0);
    let mut field = RayField::ideal(sensor, base, 3);
    field.direction.polynomial.coefficients[7] = Vector2::new(5e-3, -2e-3);
    let mut offset = SmoothMap::zero(1);
    offset.polynomial.coefficients[1] = Vector2::new(2.0, 0.5);
    field.offset = Some(offset);
    let corners = [(60.0, 50.0), (580.0, 50.0), (580.0, 430.0), (60.0, 430.0)];
    let corners = corners.map(|(u, v)| PixelPoint::new(u, v));
    let rig = Rig {
        cameras: vec![CalibratedCamera {
            name: "only".to_owned(),
            field,
            coverage: CoverageMask::from_corners(sensor, corners.into_iter()),
            rig_from_camera: place([0.1, 0.2, 0.3], [5.0, 6.0, 7.0]),
        }],
        datum_pose: 0,
        frame_is_known: false,
        uncertainty: Vec::new(),
        match_noise_px: None,
    };
    let made = meshes(&rig, &settings(MeshFormat::Ti, Some(8))).unwrap();
    let mesh = &made.cameras[0];
    let camera = &rig.cameras[0];
    let mut dice = dice();
    let mut compared = 0;
    while compared < 300 {
        let (u, v) = (dice(640), dice(480));
        let at = [f64::from(u), f64::from(v)];
        let point_mm = mesh.view.point_mm(at, DISTANCE_MM);
        let truth = camera
            .field
            .project(&camera.rig_from_camera.inverse().point(&point_mm));
        let Some(truth) = truth.filter(|pixel| camera.coverage.contains(*pixel)) else {
            continue;
        };
        compared += 1;
        for [x, y] in ti_taken(&made.files[0].1, 640, 3, u, v) {
            let missed_px = truth.distance_px(PixelPoint::new(x, y));
            assert!(
                missed_px <= mesh.loss.max_px + SEARCH_PX,
                "({u}, {v}): {missed_px}"
            );
        }
    }
    assert!(
        mesh.loss.max_px < 0.3 && mesh.outside_pixels > 10_000,
        "{mesh:?}"
    );
}

#[test]
fn what_a_format_cannot_hold_is_refused() {
    let refused = |sensor: SensorSize, format: MeshFormat, step: Option<u32>| {
        meshes(&Browns::one(sensor), &settings(format, step)).unwrap_err()
    };
    let small = SensorSize::new(640, 480);
    for (format, step) in [
        (MeshFormat::Ti, 12),
        (MeshFormat::Ti, 0),
        (MeshFormat::Ti, 256),
        (MeshFormat::Dw100, 8),
        (MeshFormat::Vpi, 3),
        (MeshFormat::Vpi, 128),
        (MeshFormat::Luxonis, 0),
        (MeshFormat::Plain, 0),
        (MeshFormat::Plain, 5000),
    ] {
        let error = refused(small, format, Some(step));
        assert!(matches!(error, MeshError::Step { .. }), "{error}");
    }
    for sensor in [(5120, 3072), (640, 484), (160, 144)] {
        let error = refused(SensorSize::new(sensor.0, sensor.1), MeshFormat::Dw100, None);
        assert!(matches!(error, MeshError::Sensor { .. }), "{error}");
    }
    let error = refused(SensorSize::new(1920, 1080), MeshFormat::Luxonis, None);
    assert!(matches!(error, MeshError::Rest { .. }), "{error}");
    // Nodes in the middle of a long output image that see both ends of the camera's.
    let mut far = settings(MeshFormat::Ti, Some(4));
    far.zoom = 0.02;
    let error = meshes(&Browns::one(SensorSize::new(9200, 300)), &far).unwrap_err();
    assert!(matches!(error, MeshError::Range { .. }), "{error}");
    let mut behind = Browns::one(small);
    behind
        .rig_from_camera
        .push(place([0.3, 0.1, -0.2], [40.0, 50.0, -700.0]));
    let error = meshes(&behind, &settings(MeshFormat::Luxonis, None)).unwrap_err();
    assert_eq!(error, MeshError::NoPair);
}
