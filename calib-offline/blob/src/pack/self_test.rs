//! Questions for the blob's self-test, answered by the runtime on the packing host.

use calib_rays::field::{CalibratedCamera, Rig, transport};
use calib_rays::geometry::{PixelPoint, SensorSize};
use nalgebra::Vector3;
use ray_runtime::format::SelfTest;
use ray_runtime::{Measurement, RayBlob};

/// Rays asked of each camera.
const RAYS: usize = 2;
/// Matches asked of the first camera with each other one.
const PAIRS: usize = 4;
/// How many of those are asked for their standard deviations too, where the blob knows them.
const SIGMAS: usize = 2;
/// Places of the questions on the sensor, as shares of its width and height. They are spread and
/// lie on no symmetry; those outside the calibrated area are passed over.
const PLACES: [(f64, f64); 12] = [
    (0.37, 0.41),
    (0.81, 0.23),
    (0.29, 0.77),
    (0.66, 0.63),
    (0.13, 0.19),
    (0.52, 0.48),
    (0.91, 0.87),
    (0.07, 0.58),
    (0.47, 0.09),
    (0.59, 0.93),
    (0.44, 0.53),
    (0.71, 0.45),
];

/// The questions that have an answer, with the runtime's answers.
pub fn ask(rig: &Rig, blob: &RayBlob<'_>, working_distance_mm: f64) -> Vec<SelfTest> {
    let mut tests = Vec::new();
    for (idx, camera) in rig.cameras.iter().enumerate() {
        let rays = places(camera.field.sensor).filter_map(|pixel| ask_ray(blob, idx, pixel));
        tests.extend(rays.take(RAYS));
    }
    let Some((first, others)) = rig.cameras.split_first() else {
        return tests;
    };
    for (k, other) in others.iter().enumerate() {
        let matches = places(first.field.sensor).filter_map(|pixel| {
            let ray = first.ray_in_rig(pixel)?;
            let point = ray.origin_mm + ray.direction.normalize() * working_distance_mm;
            Some((pixel, pixel_nearest(other, &point)?))
        });
        let matches: Vec<_> = matches
            .filter_map(|(a, b)| Asked::new(blob, [0, k + 1], [a, b]))
            .take(PAIRS)
            .collect();
        tests.extend(matches.iter().map(Asked::pair));
        tests.extend(matches.iter().filter_map(Asked::sigma).take(SIGMAS));
    }
    tests
}

/// Quarter pixels, which f32 holds exactly.
fn places(sensor: SensorSize) -> impl Iterator<Item = PixelPoint> {
    let quarter = |x: f64| (4.0 * x).round() / 4.0;
    PLACES.into_iter().map(move |(a, b)| {
        PixelPoint::new(
            quarter(a * f64::from(sensor.width)),
            quarter(b * f64::from(sensor.height)),
        )
    })
}

fn ask_ray(blob: &RayBlob<'_>, camera: usize, pixel: PixelPoint) -> Option<SelfTest> {
    let pixel = device_pixel(pixel);
    let ray = blob.lookup(camera, pixel).ok()?;
    Some(SelfTest::Ray {
        camera: camera as u16,
        pixel: [pixel.u, pixel.v],
        origin_mm: ray.origin_mm,
        direction: ray.direction,
    })
}

/// A match and its answer.
struct Asked {
    cameras: [u16; 2],
    pixels: [[f32; 2]; 2],
    answer: Measurement,
}

impl Asked {
    fn new(blob: &RayBlob<'_>, cameras: [usize; 2], pixels: [PixelPoint; 2]) -> Option<Self> {
        let pixels = pixels.map(device_pixel);
        let [a, b] = [0, 1].map(|k| (cameras[k], pixels[k]));
        Some(Self {
            cameras: cameras.map(|camera| camera as u16),
            pixels: pixels.map(|pixel| [pixel.u, pixel.v]),
            answer: blob.triangulate_with_covariance(a, b).ok()?,
        })
    }

    fn pair(&self) -> SelfTest {
        let found = self.answer.found;
        SelfTest::Pair {
            cameras: self.cameras,
            pixels: self.pixels,
            point_mm: found.point_mm,
            gap_squared_mm2: found.gap_squared_mm2,
        }
    }

    fn sigma(&self) -> Option<SelfTest> {
        Some(SelfTest::Sigma {
            cameras: self.cameras,
            pixels: self.pixels,
            sigma_mm: self.answer.covariance?.sigma_mm(),
        })
    }
}

fn device_pixel(pixel: PixelPoint) -> ray_runtime::PixelPoint {
    ray_runtime::PixelPoint::new(pixel.u as f32, pixel.v as f32)
}

/// A quarter pixel whose ray passes near a point (rig frame, mm); `None` if there is none in the
/// calibrated area. Near is enough: two rays that miss each other have a point too.
pub fn pixel_nearest(camera: &CalibratedCamera, point_in_rig: &Vector3<f64>) -> Option<PixelPoint> {
    const STEPS: u32 = 16;
    let point = camera.rig_from_camera.inverse().point(point_in_rig);
    let sensor = camera.field.sensor;
    let angle = |pixel: &PixelPoint| camera.field.ray(*pixel).direction.angle(&point);
    let at = |k: u32, extent: u32| (f64::from(k) + 0.5) / f64::from(STEPS) * f64::from(extent);
    let mut pixel = (0..STEPS * STEPS)
        .map(|k| PixelPoint::new(at(k % STEPS, sensor.width), at(k / STEPS, sensor.height)))
        .filter(|pixel| camera.coverage.contains(*pixel))
        .min_by(|a, b| angle(a).total_cmp(&angle(b)))?;
    for _ in 0..10 {
        let sample = camera.field.sample(pixel);
        let local = transport::frame(&sample.s).transpose() * point;
        let turned = transport::local_point_derivative(&sample.s, &local);
        let mm_from_px = turned.fixed_rows::<2>(0) * sample.ds - sample.dm;
        let step = mm_from_px.try_inverse()? * (local.xy() - sample.m_mm);
        pixel = PixelPoint::new(pixel.u - step.x, pixel.v - step.y);
    }
    let quarter = |x: f64| (4.0 * x).round() / 4.0;
    let pixel = PixelPoint::new(quarter(pixel.u), quarter(pixel.v));
    camera.coverage.contains(pixel).then_some(pixel)
}
