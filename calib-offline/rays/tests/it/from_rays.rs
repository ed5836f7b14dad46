//! Fields from the rays of cameras that are known: an integration test, as the simulator stands above this crate.

use calib_rays::field::from_rays::{FromRaysSettings, SampledRay, field_of_rays, ray_error_px};
use calib_rays::field::{BaseLens, Projection, RayField};
use calib_rays::geometry::{PixelPoint, Ray, SensorSize};
use calib_simulate::optics::{CameraOptics, Distortion, FlatWindow, Lens, Media, PerspectiveLens};
use nalgebra::Vector3;

const SENSOR: SensorSize = SensorSize::new(1280, 1024);

/// Every so many pixels, the sensor's edge included.
fn sampled(
    spacing_px: u32,
    [near_mm, far_mm]: [f64; 2],
    ray: impl Fn(PixelPoint) -> Option<Ray>,
) -> Vec<SampledRay> {
    let axis = |extent: u32| (0..=extent / spacing_px).map(move |k| f64::from(k * spacing_px));
    axis(SENSOR.height)
        .flat_map(|v| axis(SENSOR.width).map(move |u| PixelPoint::new(u - 0.5, v - 0.5)))
        .map(|pixel| SampledRay {
            pixel,
            ray: ray(pixel).unwrap(),
            near_mm,
            far_mm,
        })
        .collect()
}

fn worst_px(field: &RayField, rays: &[SampledRay]) -> f64 {
    let errors = rays.iter().map(|ray| ray_error_px(field, ray).unwrap());
    errors.fold(0.0, f64::max)
}

fn camera(media: Media) -> CameraOptics {
    let lens = Lens::Perspective(PerspectiveLens {
        focal_px: [1200.0, 1196.0],
        principal: PixelPoint::new(645.0, 505.0),
        distortion: Distortion::Brown {
            k1: -0.28,
            k2: 0.12,
            k3: -0.03,
            p1: 6e-4,
            p2: -4e-4,
        },
        bumps: Vec::new(),
    });
    CameraOptics::new(SENSOR, lens, media)
}

fn settings(is_central: bool) -> FromRaysSettings {
    FromRaysSettings {
        cell_px: 1280.0 / 24.0,
        is_central,
    }
}

#[test]
fn a_distorted_lens_comes_back() {
    let camera = camera(Media::Air);
    let base = BaseLens::ideal(Projection::Perspective, 1200.0);
    let rays = sampled(16, [300.0, 500.0], |pixel| camera.ray(pixel));
    let field = field_of_rays(SENSOR, base, &rays, &settings(true)).unwrap();
    assert!(field.is_central());
    // Between the samples too. A cubic's error at 53 px: (0.044)^4 / 384 of the fourth
    // derivative, 10 or so, times the focal length.
    let between = sampled(7, [300.0, 500.0], |pixel| camera.ray(pixel));
    let worst = worst_px(&field, &between);
    assert!(worst < 1e-3, "{worst}");
}

#[test]
fn a_flat_port_comes_back_where_its_rays_are_known() {
    let window = FlatWindow {
        distance_mm: 30.0,
        normal: Vector3::new(0.05, -0.03, 1.0).normalize(),
        thickness_mm: 10.0,
        index: 1.52,
        index_behind: 1.333,
    };
    let camera = camera(Media::Flat(window));
    let base = BaseLens::ideal(Projection::Perspective, 1600.0);
    let range = [300.0, 500.0];
    let rays = sampled(16, range, |pixel| camera.ray(pixel));
    let field = field_of_rays(SENSOR, base, &rays, &settings(false)).unwrap();
    let worst = worst_px(&field, &sampled(7, range, |pixel| camera.ray(pixel)));
    assert!(worst < 1e-3, "{worst}");
    // Its rays are some millimeters off any one point: a central field cannot have them.
    let central = field_of_rays(SENSOR, base, &rays, &settings(true)).unwrap();
    assert!(worst_px(&central, &rays) > 1.0);
}

#[test]
fn errors_that_cancel_between_the_distances_do_not_count() {
    // Half the rays are turned about their point at 400 mm: between 399 and 401 mm that moves
    // them by 0.01 mm, though the foot point moves by 4 mm.
    let base = BaseLens::ideal(Projection::Perspective, 1200.0);
    let lens = RayField::ideal(SENSOR, base, 0);
    let turned = |pixel: PixelPoint| {
        let direction = lens.ray(pixel).direction.normalize();
        let sign = if (pixel.u / 16.0).round() as i64 % 2 == 0 {
            0.01
        } else {
            -0.01
        };
        Some(Ray {
            origin_mm: direction * 400.0,
            direction: direction + Vector3::x() * sign,
        })
    };
    let rays = sampled(16, [399.0, 401.0], turned);
    let field = field_of_rays(SENSOR, base, &rays, &settings(false)).unwrap();
    let straight = sampled(16, [399.0, 401.0], |pixel| Some(lens.ray(pixel)));
    // 0.01 mm at 400 mm is 0.03 px, of which neighbors of other sign leave little.
    let worst = worst_px(&field, &straight);
    assert!(worst < 0.03, "{worst}");
}

#[test]
fn rays_without_a_direction_or_distance_have_no_field() {
    let base = BaseLens::ideal(Projection::Perspective, 1200.0);
    let lens = RayField::ideal(SENSOR, base, 0);
    let good = sampled(64, [300.0, 500.0], |pixel| Some(lens.ray(pixel)));
    let with = |change: fn(&mut SampledRay)| {
        let mut rays = good.clone();
        change(&mut rays[5]);
        field_of_rays(SENSOR, base, &rays, &settings(false))
    };
    assert!(with(|_| ()).is_some());
    assert!(with(|ray| ray.near_mm = 0.0).is_none());
    assert!(with(|ray| ray.far_mm = f64::NAN).is_none());
    assert!(with(|ray| ray.ray.direction = -Vector3::z()).is_none());
    assert!(with(|ray| ray.ray.direction = Vector3::zeros()).is_none());
    assert!(field_of_rays(SENSOR, base, &[], &settings(true)).is_none());
}
