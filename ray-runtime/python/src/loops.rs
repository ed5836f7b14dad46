//! One question after the other, the answers into vectors: no Python in here.

use crate::arrays::{Coordinate, Rows};
use ray_runtime::{
    LookupError, MatchNoise, MeasureError, Measurement, PixelPoint, Ray, RayBlob, Triangulation,
};

/// There is an answer.
const OK: u8 = 0;
/// A pixel outside of the calibrated area, or not a number.
const OUTSIDE: u8 = 1;
/// Parallel rays.
const PARALLEL: u8 = 2;
/// Rays that meet behind a camera.
const BEHIND: u8 = 3;

fn pixel<T: Coordinate>([u, v]: [T; 2]) -> PixelPoint {
    PixelPoint::new(u.narrow(), v.narrow())
}

fn status(error: MeasureError) -> u8 {
    match error {
        MeasureError::Parallel => PARALLEL,
        MeasureError::Behind => BEHIND,
        // Cameras that are none do not come this far.
        _ => OUTSIDE,
    }
}

/// Rays of pixels.
pub struct Rays {
    /// Three numbers each, mm.
    pub origins_mm: Vec<f32>,
    /// Three numbers each.
    pub directions: Vec<f32>,
    /// One each.
    pub status: Vec<u8>,
}

/// The rays of pixels of a camera.
pub fn rays(blob: &RayBlob<'_>, camera: usize, pixels: Rows<'_, 2>) -> Rays {
    let count = pixels.len();
    let mut found = Rays {
        origins_mm: Vec::with_capacity(3 * count),
        directions: Vec::with_capacity(3 * count),
        status: Vec::with_capacity(count),
    };
    match pixels {
        Rows::Single(pixels) => found.add(blob, camera, pixels),
        Rows::Double(pixels) => found.add(blob, camera, pixels),
    }
    found
}

impl Rays {
    fn add<T: Coordinate>(&mut self, blob: &RayBlob<'_>, camera: usize, pixels: &[[T; 2]]) {
        for at in pixels {
            let ray: Result<Ray, LookupError> = blob.lookup(camera, pixel(*at));
            let (origin, direction, status) = match ray {
                Ok(ray) => (ray.origin_mm, ray.direction, OK),
                Err(_) => ([f32::NAN; 3], [f32::NAN; 3], OUTSIDE),
            };
            self.origins_mm.extend_from_slice(&origin);
            self.directions.extend_from_slice(&direction);
            self.status.push(status);
        }
    }
}

/// Where matches come from and how noisy they are.
#[derive(Clone, Copy)]
pub struct Pair {
    /// The cameras of the first pixels and of the second ones.
    pub cameras: [usize; 2],
    /// What the blob says, if it is none.
    pub noise: Option<MatchNoise>,
}

/// How much is asked of a match.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Depth {
    /// The point.
    Point,
    /// Its standard deviations too.
    Sigma,
    /// And its covariance.
    Covariance,
}

/// Points of matches.
#[derive(Default)]
pub struct Points {
    /// Three numbers each, mm.
    pub xyz_mm: Vec<f32>,
    /// One each, mm.
    pub gap_mm: Vec<f32>,
    /// One each.
    pub status: Vec<u8>,
    /// Three numbers each, mm.
    pub sigma_mm: Vec<f32>,
    /// Nine numbers each, mm^2.
    pub covariance_mm2: Vec<f32>,
}

/// The points of matches; both lists have the same length.
pub fn points(
    blob: &RayBlob<'_>,
    pair: Pair,
    depth: Depth,
    first: Rows<'_, 2>,
    second: Rows<'_, 2>,
) -> Points {
    match (first, second) {
        (Rows::Single(a), Rows::Single(b)) => of_pixels(blob, pair, depth, a, b),
        (Rows::Single(a), Rows::Double(b)) => of_pixels(blob, pair, depth, a, b),
        (Rows::Double(a), Rows::Single(b)) => of_pixels(blob, pair, depth, a, b),
        (Rows::Double(a), Rows::Double(b)) => of_pixels(blob, pair, depth, a, b),
    }
}

fn of_pixels<A: Coordinate, B: Coordinate>(
    blob: &RayBlob<'_>,
    Pair { cameras, noise }: Pair,
    depth: Depth,
    first: &[[A; 2]],
    second: &[[B; 2]],
) -> Points {
    let count = first.len();
    let mut points = Points {
        xyz_mm: Vec::with_capacity(3 * count),
        gap_mm: Vec::with_capacity(count),
        status: Vec::with_capacity(count),
        ..Points::default()
    };
    let matches = first
        .iter()
        .zip(second)
        .map(|(a, b)| ((cameras[0], pixel(*a)), (cameras[1], pixel(*b))));
    if depth == Depth::Point {
        for (a, b) in matches {
            points.add(&blob.triangulate(a, b));
        }
        return points;
    }
    points.sigma_mm.reserve_exact(3 * count);
    if depth == Depth::Covariance {
        points.covariance_mm2.reserve_exact(9 * count);
    }
    for (a, b) in matches {
        let measured = match noise {
            Some(noise) => blob.triangulate_with_noise(a, b, noise),
            None => blob.triangulate_with_covariance(a, b),
        };
        points.add(&measured.map(|measured| measured.found));
        points.add_sigma(measured.ok(), depth);
    }
    points
}

impl Points {
    #[inline(always)]
    fn add(&mut self, found: &Result<Triangulation, MeasureError>) {
        let (xyz_mm, gap_mm, status) = match found {
            Ok(found) => (found.point_mm, found.gap_mm(), OK),
            Err(error) => ([f32::NAN; 3], f32::NAN, status(*error)),
        };
        self.xyz_mm.extend_from_slice(&xyz_mm);
        self.gap_mm.push(gap_mm);
        self.status.push(status);
    }

    #[inline(always)]
    fn add_sigma(&mut self, measured: Option<Measurement>, depth: Depth) {
        let known = measured.and_then(|measured| measured.covariance);
        let sigma_mm = known.map_or([f32::NAN; 3], |known| known.sigma_mm());
        self.sigma_mm.extend_from_slice(&sigma_mm);
        if depth == Depth::Covariance {
            let total = known.map_or([[f32::NAN; 3]; 3], |known| known.total_mm2());
            self.covariance_mm2.extend_from_slice(total.as_flattened());
        }
    }
}

/// From where the pixel of a point is sought.
#[derive(Clone, Copy)]
pub enum Search<'a> {
    /// Anywhere.
    Anywhere,
    /// From the pixel of the point before it, then anywhere.
    FromLast,
    /// From these pixels alone, one for each point.
    From(Rows<'a, 2>),
}

/// The pixels that see points, two numbers each; not a number where none does.
pub fn pixels(
    blob: &RayBlob<'_>,
    camera: usize,
    points_mm: Rows<'_, 3>,
    search: Search<'_>,
) -> Vec<f32> {
    match points_mm {
        Rows::Single(points_mm) => of_points(blob, camera, points_mm, search),
        Rows::Double(points_mm) => of_points(blob, camera, points_mm, search),
    }
}

fn of_points<T: Coordinate>(
    blob: &RayBlob<'_>,
    camera: usize,
    points_mm: &[[T; 3]],
    search: Search<'_>,
) -> Vec<f32> {
    let mut found = Vec::with_capacity(2 * points_mm.len());
    let mut last: Option<PixelPoint> = None;
    for (k, point_mm) in points_mm.iter().enumerate() {
        let point_mm = point_mm.map(T::narrow);
        let anywhere = || blob.project(camera, point_mm).ok();
        let near = |start| blob.project_near(camera, point_mm, start).ok();
        let seen = match search {
            Search::Anywhere => anywhere(),
            Search::FromLast => last.and_then(near).or_else(anywhere),
            Search::From(Rows::Single(starts)) => starts.get(k).and_then(|at| near(pixel(*at))),
            Search::From(Rows::Double(starts)) => starts.get(k).and_then(|at| near(pixel(*at))),
        };
        last = seen;
        let [u, v] = seen.map_or([f32::NAN; 2], |seen| [seen.u, seen.v]);
        found.extend_from_slice(&[u, v]);
    }
    found
}

/// Whether each pixel of a sensor, row by row, has a ray.
pub fn mask(blob: &RayBlob<'_>, camera: usize, [width, height]: [u32; 2]) -> Vec<bool> {
    let mut mask = Vec::with_capacity(width as usize * height as usize);
    for v in 0..height {
        for u in 0..width {
            // Below 32768: exact.
            let at = PixelPoint::new(u as f32, v as f32);
            mask.push(blob.is_calibrated(camera, at));
        }
    }
    mask
}
