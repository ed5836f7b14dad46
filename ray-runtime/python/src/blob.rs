//! A blob in Python's hands.

use crate::arrays::{Held, list, table};
use crate::loops::{self, Depth, Pair, Points, Rays, Search};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use ray_runtime::{Camera, MatchNoise, OpenError, RayBlob};
use self_cell::self_cell;

/// The blob's bytes at a multiple of 8, which is what the runtime asks for.
pub struct Memory {
    words: Vec<[u8; 8]>,
    /// Where the first multiple of 8 stands.
    start: usize,
    len: usize,
}

impl Memory {
    fn new(bytes: &[u8]) -> Self {
        // One word more than it takes, to start anywhere in the first one.
        let mut words = vec![[0; 8]; bytes.len().div_ceil(8) + 1];
        let flat = words.as_flattened_mut();
        let start = flat.as_ptr().align_offset(8).min(8);
        flat[start..start + bytes.len()].copy_from_slice(bytes);
        Self {
            words,
            start,
            len: bytes.len(),
        }
    }

    fn bytes(&self) -> &[u8] {
        &self.words.as_flattened()[self.start..self.start + self.len]
    }
}

self_cell!(
    /// A blob with the bytes that it lies in.
    pub struct Opened {
        owner: Memory,
        #[covariant]
        dependent: RayBlob,
    }
);

/// A blob that was checked and opened. The class `rays.Rig` asks it.
#[pyclass(frozen, module = "rays._rays")]
pub struct Blob {
    opened: Opened,
}

type Table<'py> = Bound<'py, PyArray2<f32>>;
type Numbers<'py> = Bound<'py, PyArray1<f32>>;
type Codes<'py> = Bound<'py, PyArray1<u8>>;

/// Name, width and height of the sensor (px), region (u, v, width, height; px), rotation row by row and translation (mm)
/// of rig from camera, and whether all rays start in one point.
type CameraFacts = (String, [u32; 2], [u32; 4], [f32; 9], [f32; 3], bool);

/// Points, gaps, status, and what was asked for beyond.
type PointArrays<'py> = (
    Table<'py>,
    Numbers<'py>,
    Codes<'py>,
    Option<Table<'py>>,
    Option<Table<'py>>,
);

#[pymethods]
impl Blob {
    /// Copies bytes and opens them. A failure is a ValueError of two arguments: the runtime's code and its words.
    #[new]
    fn new(bytes: &[u8]) -> PyResult<Self> {
        let memory = Memory::new(bytes);
        let opened = Opened::try_new(memory, |memory| RayBlob::open(memory.bytes()));
        let refused = |error: OpenError| PyValueError::new_err((error.code(), error.to_string()));
        let opened = opened.map_err(refused)?;
        Ok(Self { opened })
    }

    /// What is known of each camera.
    fn cameras(&self) -> Vec<CameraFacts> {
        let blob = self.blob();
        let cameras = (0..blob.camera_count()).filter_map(|k| blob.camera(k));
        cameras.map(|camera| facts(&camera)).collect()
    }

    /// The frame in words, who wrote the blob, the calibration's identity, the blob's bound (px) and the distance
    /// that it holds for (mm), and how noisy the blob says that matches are (px).
    fn facts(&self) -> (String, String, Vec<u8>, f32, f32, Option<f32>) {
        let blob = self.blob();
        (
            blob.frame().to_owned(),
            blob.written_by().to_owned(),
            blob.identity().to_vec(),
            blob.max_error_px(),
            blob.working_distance_mm(),
            blob.match_noise().map(MatchNoise::px),
        )
    }

    /// The pairs of cameras whose uncertainty is known.
    fn uncertain_pairs(&self) -> Vec<[u16; 2]> {
        let pairs = self.blob().uncertain_pairs();
        pairs.map(|pair| pair.cameras).collect()
    }

    /// How many questions of known answer there are, or the first that is answered with other bits.
    fn self_test(&self, py: Python<'_>) -> (usize, bool) {
        let tested = py.detach(|| self.blob().run_self_tests());
        match tested {
            Ok(count) => (count, true),
            Err(failure) => (failure.test, false),
        }
    }

    /// Origins, directions and status of pixels.
    fn rays<'py>(
        &self,
        py: Python<'py>,
        camera: usize,
        uv: &Bound<'py, PyAny>,
    ) -> PyResult<(Table<'py>, Table<'py>, Codes<'py>)> {
        self.check(camera)?;
        let held = Held::new(uv)?;
        let pixels = held.rows()?;
        let Rays {
            origins_mm,
            directions,
            status,
        } = py.detach(|| loops::rays(self.blob(), camera, pixels));
        Ok((
            table(py, origins_mm, 3)?,
            table(py, directions, 3)?,
            list(py, status),
        ))
    }

    /// Points of matches; `depth` is 0 for points alone, 1 for standard deviations too, 2 for covariances too.
    fn triangulate<'py>(
        &self,
        py: Python<'py>,
        cameras: [usize; 2],
        uv_a: &Bound<'py, PyAny>,
        uv_b: &Bound<'py, PyAny>,
        depth: u8,
        noise_px: Option<f32>,
    ) -> PyResult<PointArrays<'py>> {
        for camera in cameras {
            self.check(camera)?;
        }
        let depth = match depth {
            0 => Depth::Point,
            1 => Depth::Sigma,
            _ => Depth::Covariance,
        };
        let noise = noise_px.map(noise).transpose()?;
        let pair = Pair { cameras, noise };
        let (held_a, held_b) = (Held::new(uv_a)?, Held::new(uv_b)?);
        let (first, second) = (held_a.rows()?, held_b.rows()?);
        if first.len() != second.len() {
            return Err(PyValueError::new_err(
                "expected as many pixels of both cameras",
            ));
        }
        let Points {
            xyz_mm,
            gap_mm,
            status,
            sigma_mm,
            covariance_mm2,
        } = py.detach(|| loops::points(self.blob(), pair, depth, first, second));
        let sigma = (depth != Depth::Point).then(|| table(py, sigma_mm, 3));
        let covariance = (depth == Depth::Covariance).then(|| table(py, covariance_mm2, 9));
        Ok((
            table(py, xyz_mm, 3)?,
            list(py, gap_mm),
            list(py, status),
            sigma.transpose()?,
            covariance.transpose()?,
        ))
    }

    /// The pixels that see points: sought from `near` where it is given, else anywhere, where `follow` is set first from
    /// the pixel of the point before.
    fn project<'py>(
        &self,
        py: Python<'py>,
        camera: usize,
        xyz: &Bound<'py, PyAny>,
        near: Option<&Bound<'py, PyAny>>,
        follow: bool,
    ) -> PyResult<Table<'py>> {
        self.check(camera)?;
        let held = Held::new(xyz)?;
        let points = held.rows()?;
        let near = near.map(Held::new).transpose()?;
        let search = match &near {
            Some(near) => Search::From(near.rows()?),
            None if follow => Search::FromLast,
            None => Search::Anywhere,
        };
        let found = py.detach(|| loops::pixels(self.blob(), camera, points, search));
        table(py, found, 2)
    }

    /// Whether each pixel of a camera's sensor has a ray.
    fn mask<'py>(&self, py: Python<'py>, camera: usize) -> PyResult<Bound<'py, PyArray2<bool>>> {
        let found = self.check(camera)?;
        let size = [found.sensor_width, found.sensor_height];
        let mask = py.detach(|| loops::mask(self.blob(), camera, size));
        list(py, mask).reshape([size[1] as usize, size[0] as usize])
    }
}

impl Blob {
    /// The blob itself.
    pub fn blob(&self) -> &RayBlob<'_> {
        self.opened.borrow_dependent()
    }

    fn check(&self, camera: usize) -> PyResult<Camera<'_>> {
        let found = self.blob().camera(camera);
        found.ok_or_else(|| PyIndexError::new_err(format!("there is no camera {camera}")))
    }
}

/// The noise of so many pixels.
pub fn noise(px: f32) -> PyResult<MatchNoise> {
    MatchNoise::from_px(px).ok_or_else(|| {
        PyValueError::new_err(format!(
            "the noise of a match is 0 or {:e} to {} px, not {px}",
            MatchNoise::LEAST_PX,
            MatchNoise::MOST_PX
        ))
    })
}

fn facts(camera: &Camera<'_>) -> CameraFacts {
    let region = camera.region;
    let [[r11, r12, r13], [r21, r22, r23], [r31, r32, r33]] = camera.rig_from_camera.rotation;
    (
        camera.name.to_owned(),
        [camera.sensor_width, camera.sensor_height],
        [region.u, region.v, region.width, region.height],
        [r11, r12, r13, r21, r22, r23, r31, r32, r33],
        camera.rig_from_camera.translation_mm,
        camera.encoding.is_central,
    )
}
