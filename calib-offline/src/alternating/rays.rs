//! The rays of one camera: from control points to a table with one ray per pixel.

use super::alternation::{MIN_BOARDS, PixelControl, control_points};
use super::line_fit::fit_line;
use super::plane_map::PlaneMap;
use crate::geometry::{PixelPoint, Ray, RigidTransform, SensorSize};
use nalgebra::Vector3;
use rayon::prelude::*;

/// A ray with the stretch of it that control points support, rig frame.
#[derive(Debug, Clone, Copy)]
pub struct SupportedRay {
    /// Which pixel sees it.
    pub pixel: PixelPoint,
    /// Origin at the foot point of the camera's place; direction of length 1, into the scene.
    pub ray: Ray,
    /// Distances along it, from the origin, of the nearest and the farthest control point, mm.
    pub near_mm: f64,
    /// See [`Self::near_mm`].
    pub far_mm: f64,
}

/// What turns a pixel of one camera into its ray: a map to each board that the camera saw, the
/// boards' poses, and where the camera is about.
#[derive(Debug, Clone)]
pub struct RaySource {
    /// Per pose index; `None` where the camera saw no board.
    pub maps: Vec<Option<PlaneMap>>,
    /// Per pose index, rig frame.
    pub rig_from_board: Vec<Option<RigidTransform>>,
    /// Where the camera is about, rig frame, mm: which side of the boards is its side.
    pub place_mm: Vector3<f64>,
}

impl RaySource {
    /// Where a pixel looks on each board.
    pub fn control(&self, pixel: PixelPoint) -> PixelControl {
        control(&self.maps, pixel)
    }

    /// The ray of a pixel, anywhere between pixels too; `None` if fewer than [`MIN_BOARDS`] boards
    /// or boards in one depth support it.
    pub fn ray(&self, pixel: PixelPoint) -> Option<SupportedRay> {
        let control = self.control(pixel);
        let points: Vec<Vector3<f64>> = control_points(&control, &self.rig_from_board)
            .into_iter()
            .map(|(_, _, point)| point)
            .collect();
        if points.len() < MIN_BOARDS {
            return None;
        }
        let line = fit_line(&points)?;
        let forward = (line.origin_mm - self.place_mm).dot(&line.direction);
        let direction = line.direction * 1f64.copysign(forward);
        let origin_mm = line.foot_point(&self.place_mm);
        let mut along: Vec<f64> = points
            .iter()
            .map(|point| (point - origin_mm).dot(&direction))
            .collect();
        along.sort_by(f64::total_cmp);
        let (near_mm, far_mm) = (*along.first()?, *along.last()?);
        Some(SupportedRay {
            pixel,
            ray: Ray {
                origin_mm,
                direction,
            },
            near_mm,
            far_mm,
        })
        .filter(|_| super::alternation::is_supported(&points, &line, &self.place_mm))
    }

    /// The rays of a lattice over the sensor, `spacing_px` apart, row by row.
    pub fn lattice(&self, sensor: SensorSize, spacing_px: f64) -> Vec<Option<SupportedRay>> {
        lattice(sensor, spacing_px)
            .into_par_iter()
            .map(|pixel| self.ray(pixel))
            .collect()
    }

    /// One ray per pixel: the publication's form of a camera.
    ///
    /// Cost: an exponential per neuron, board and pixel; a few seconds for a megapixel.
    pub fn table(&self, sensor: SensorSize) -> RayTable {
        let rays = (0..sensor.height)
            .into_par_iter()
            .flat_map_iter(|v| {
                (0..sensor.width).map(move |u| {
                    let pixel = PixelPoint::new(f64::from(u), f64::from(v));
                    self.ray(pixel).map(|supported| supported.ray)
                })
            })
            .collect();
        RayTable { sensor, rays }
    }
}

/// Where a pixel looks on each board.
pub fn control(maps: &[Option<PlaneMap>], pixel: PixelPoint) -> PixelControl {
    PixelControl {
        boards: maps
            .iter()
            .enumerate()
            .filter_map(|(pose_idx, map)| Some((pose_idx, map.as_ref()?.board_point(pixel)?)))
            .collect(),
    }
}

/// Pixels `spacing_px` apart over a sensor, row by row, the outer ones half of that from its edges.
pub fn lattice(sensor: SensorSize, spacing_px: f64) -> Vec<PixelPoint> {
    let axis = |extent: u32| {
        let count = (f64::from(extent) / spacing_px).round().max(1.0);
        let step = f64::from(extent) / count;
        (0..count as usize).map(move |k| (k as f64 + 0.5) * step - 0.5)
    };
    axis(sensor.height)
        .flat_map(|v| axis(sensor.width).map(move |u| PixelPoint::new(u, v)))
        .collect()
}

/// One ray per pixel of a sensor, rig frame.
#[derive(Debug, Clone)]
pub struct RayTable {
    /// The sensor.
    pub sensor: SensorSize,
    /// Row-major; `None` where nothing supports a ray.
    pub rays: Vec<Option<Ray>>,
}

impl RayTable {
    /// The table as a NumPy file: an array of shape (height, width, 6) of little-endian f64, for each
    /// pixel the origin (mm) and the unit direction of its ray in the rig frame; NaN where it has
    /// none.
    pub fn to_npy(&self) -> Vec<u8> {
        let shape = [self.sensor.height as usize, self.sensor.width as usize, 6];
        let numbers = self.rays.iter().flat_map(|ray| match ray {
            Some(ray) => {
                let (o, d) = (ray.origin_mm, ray.direction);
                [o.x, o.y, o.z, d.x, d.y, d.z]
            }
            None => [f64::NAN; 6],
        });
        npy(&shape, numbers)
    }
}

/// A NumPy file, format version 1.0, C order.
fn npy(shape: &[usize], numbers: impl Iterator<Item = f64>) -> Vec<u8> {
    let sizes: Vec<String> = shape.iter().map(usize::to_string).collect();
    let mut header = format!(
        "{{'descr': '<f8', 'fortran_order': False, 'shape': ({},), }}",
        sizes.join(", ")
    );
    // Magic, version and length take 10 bytes; numbers begin at a multiple of 64.
    while (10 + header.len() + 1) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(numbers.flat_map(f64::to_le_bytes));
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_an_array_that_numpy_reads() {
        let ray = Ray {
            origin_mm: Vector3::new(1.0, 2.0, 3.0),
            direction: Vector3::z(),
        };
        let table = RayTable {
            sensor: SensorSize::new(2, 1),
            rays: vec![Some(ray), None],
        };
        let bytes = table.to_npy();
        let header_len = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        assert_eq!((10 + header_len) % 64, 0);
        let header = std::str::from_utf8(&bytes[10..10 + header_len]).unwrap();
        assert!(header.contains("'shape': (1, 2, 6,)"), "{header}");
        let numbers: Vec<f64> = bytes[10 + header_len..]
            .chunks(8)
            .map(|chunk| f64::from_le_bytes(chunk.try_into().unwrap()))
            .collect();
        assert_eq!(numbers[..6], [1.0, 2.0, 3.0, 0.0, 0.0, 1.0]);
        assert!(numbers[6..].iter().all(|x| x.is_nan()) && numbers.len() == 12);
    }

    #[test]
    fn a_lattice_covers_the_sensor_evenly() {
        let pixels = lattice(SensorSize::new(40, 20), 10.0);
        assert_eq!(pixels.len(), 8);
        assert_eq!(pixels[0], PixelPoint::new(4.5, 4.5));
        assert_eq!(pixels[7], PixelPoint::new(34.5, 14.5));
    }
}
