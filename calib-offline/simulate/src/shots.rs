//! Single images of a printed target by a wide lens, each with its truth: poses, blur and noise drawn
//! from a seed.

use super::optics::{CameraOptics, Distortion, Lens, Media, PerspectiveLens};
use super::pattern::Pattern;
use super::random::{Purpose, between, stream};
use super::render::{PlateView, RenderSettings, Rendered};
use calib_rays::geometry::{PixelPoint, RigidTransform, SensorSize, so3};
use calib_rays::print::Artwork;
use nalgebra::Vector3;
use std::sync::Arc;

/// What images are drawn from.
#[derive(Debug, Clone)]
pub struct ShotSettings {
    /// Size of the images.
    pub sensor: SensorSize,
    /// Coefficient of the lens's barrel distortion (division model, of r^2), from and to.
    pub barrel: (f64, f64),
    /// Angle between the target's normal and the line of sight, degrees, from and to.
    pub tilt_deg: (f64, f64),
    /// Standard deviation of the blur, px, from and to.
    pub blur_px: (f64, f64),
    /// Standard deviation of the noise, levels of 8 bits, from and to.
    pub noise_levels: (f64, f64),
    /// Diagonal of the target against the shorter side of the image, from and to.
    pub size: (f64, f64),
    /// Share of the images with something in front of the target.
    pub covered: f64,
    /// Share of the images without a target.
    pub without: f64,
}

impl Default for ShotSettings {
    /// Wide lenses of about 75 to 95 degrees across.
    fn default() -> Self {
        Self {
            sensor: SensorSize::new(960, 720),
            barrel: (-0.25, -0.05),
            tilt_deg: (0.0, 60.0),
            blur_px: (0.5, 2.0),
            noise_levels: (1.0, 10.0),
            size: (0.8, 1.4),
            covered: 0.2,
            without: 0.1,
        }
    }
}

/// Focal length of the shortest lens as a part of the image's width.
const FOCAL_OF_WIDTH: f64 = 0.55;

/// One image of a target.
#[derive(Debug, Clone)]
pub struct Shot {
    camera: CameraOptics,
    camera_from_plate: RigidTransform,
    art: Option<Arc<Artwork>>,
    /// How it looks.
    pub render: RenderSettings,
    /// Left, right, upper and lower end of what covers the target, px, and its brightness.
    covers: Vec<([f64; 4], f32)>,
    seed: u64,
}

impl Shot {
    /// The image with a number, by a camera of its own; the same number is the same image.
    pub fn draw(settings: &ShotSettings, art: &Arc<Artwork>, seed: u64) -> Self {
        Self::by_camera(&Self::camera(settings, seed), settings, art, seed)
    }

    /// A camera with a wide lens.
    pub fn camera(settings: &ShotSettings, seed: u64) -> CameraOptics {
        let mut rng = stream(seed, Purpose::HandHeld, 3, 0);
        let mut between = |(low, high): (f64, f64)| between(&mut rng, low, high);
        let sensor = settings.sensor;
        let (width, height) = (f64::from(sensor.width), f64::from(sensor.height));
        let focal_px = FOCAL_OF_WIDTH * width * between((1.0, 1.3));
        let lens = Lens::Perspective(PerspectiveLens {
            focal_px: [focal_px, focal_px * 1.0005],
            principal: PixelPoint::new(
                width * between((0.48, 0.52)),
                height * between((0.48, 0.52)),
            ),
            distortion: Distortion::Division {
                l1: between(settings.barrel),
                l2: 0.0,
            },
            bumps: Vec::new(),
        });
        CameraOptics::new(sensor, lens, Media::Air)
    }

    /// The image with a number by this camera.
    pub fn by_camera(
        camera: &CameraOptics,
        settings: &ShotSettings,
        art: &Arc<Artwork>,
        seed: u64,
    ) -> Self {
        let mut rng = stream(seed, Purpose::HandHeld, 1, 0);
        let mut between = |(low, high): (f64, f64)| between(&mut rng, low, high);
        let sensor = settings.sensor;
        let (width, height) = (f64::from(sensor.width), f64::from(sensor.height));
        // That of the shortest lens; the others see a little less.
        let focal_px = FOCAL_OF_WIDTH * width;
        let [left, right, upper, lower] = art.plate_mm;
        let middle = Vector3::new((left + right) / 2.0, (upper + lower) / 2.0, 0.0);
        let diagonal_mm = (right - left).hypot(lower - upper);
        let tilt = between(settings.tilt_deg).to_radians();
        let about = between((0.0, std::f64::consts::TAU));
        let turn = between((-std::f64::consts::PI, std::f64::consts::PI));
        let rotation = so3::exp(&(Vector3::new(about.cos(), about.sin(), 0.0) * tilt))
            * so3::exp(&Vector3::new(0.0, 0.0, turn));
        let size_px = between(settings.size) * height;
        let distance_mm = diagonal_mm * focal_px / size_px;
        let aside = Vector3::new(
            between((-0.12, 0.12)) * width / focal_px,
            between((-0.12, 0.12)) * height / focal_px,
            1.0,
        ) * distance_mm;
        let mut covers = Vec::new();
        if between((0.0, 1.0)) < settings.covered {
            for _ in 0..2 {
                let (u, v) = (width * between((0.2, 0.8)), height * between((0.2, 0.8)));
                let (w, h) = (
                    width * between((0.03, 0.12)),
                    height * between((0.03, 0.12)),
                );
                covers.push(([u - w, u + w, v - h, v + h], between((0.2, 0.7)) as f32));
            }
        }
        let has_target = between((0.0, 1.0)) >= settings.without;
        let render = RenderSettings {
            blur_px: between(settings.blur_px),
            noise_levels: between(settings.noise_levels),
            ..RenderSettings::default()
        };
        Self {
            camera: camera.clone(),
            camera_from_plate: RigidTransform::new(rotation, aside - rotation * middle),
            art: has_target.then(|| Arc::clone(art)),
            render,
            covers,
            seed,
        }
    }

    /// Whether there is a target at all.
    pub fn has_target(&self) -> bool {
        self.art.is_some()
    }

    /// The image, noise included.
    pub fn image(&self) -> Rendered {
        let art = self
            .art
            .clone()
            .unwrap_or_else(|| Arc::new(clutter(self.seed)));
        let view = PlateView {
            camera: &self.camera,
            camera_from_plate: self.camera_from_plate,
            pattern: Pattern::Printed(art),
            bow_mm: 0.0,
            displaced: None,
        };
        let mut image = view.render(&self.render);
        let width = image.sensor.width as usize;
        for &([left, right, upper, lower], brightness) in &self.covers {
            for (i, value) in image.brightness.iter_mut().enumerate() {
                let (u, v) = ((i % width) as f64, (i / width) as f64);
                if (left..right).contains(&u) && (upper..lower).contains(&v) {
                    *value = brightness;
                }
            }
        }
        image.add_noise(self.render.noise_levels, self.seed, 0, 0);
        image
    }

    /// The pixel that sees a point of the plate, mm; `None` where it is out of view. That something
    /// may cover it is not looked at.
    pub fn pixel(&self, [x, y]: [f64; 2]) -> Option<PixelPoint> {
        let point = self.camera_from_plate.point(&Vector3::new(x, y, 0.0));
        self.camera.project(&point)
    }

    /// Whether something in front covers a pixel or comes within some pixels of it.
    pub fn is_covered(&self, pixel: PixelPoint, within_px: f64) -> bool {
        self.covers.iter().any(|([left, right, upper, lower], _)| {
            (left - within_px..right + within_px).contains(&pixel.u)
                && (upper - within_px..lower + within_px).contains(&pixel.v)
        })
    }
}

/// Rectangles and disks without any order.
fn clutter(seed: u64) -> Artwork {
    use calib_rays::print::Shape;
    let mut rng = stream(seed, Purpose::HandHeld, 2, 0);
    let mut between = |low: f64, high: f64| between(&mut rng, low, high);
    let shapes = (0..80)
        .map(|k| {
            let (x, y) = (between(-50.0, 250.0), between(-50.0, 250.0));
            let black = k % 3 != 0;
            if k % 2 == 0 {
                let to = [x + between(4.0, 40.0), y + between(4.0, 40.0)];
                Shape::Rect {
                    from: [x, y],
                    to,
                    black,
                }
            } else {
                Shape::Disk {
                    at: [x, y],
                    radius: between(2.0, 15.0),
                    black,
                }
            }
        })
        .collect();
    Artwork::new([-60.0, 300.0, -60.0, 300.0], shapes)
}
