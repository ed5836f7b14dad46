//! One ray per pixel, as a table: for whoever works with rays elsewhere.

use super::CalibratedCamera;
use crate::geometry::{PixelPoint, Ray, SensorSize};
use rayon::prelude::*;

/// One ray per pixel of a sensor, rig frame.
#[derive(Debug, Clone)]
pub struct RayTable {
    /// The sensor.
    pub sensor: SensorSize,
    /// Row-major; `None` where nothing supports a ray.
    pub rays: Vec<Option<Ray>>,
}

impl RayTable {
    /// Asks for the ray of every pixel, rows in parallel.
    pub fn new(sensor: SensorSize, ray: impl Fn(PixelPoint) -> Option<Ray> + Sync) -> Self {
        let rows: Vec<Vec<Option<Ray>>> = (0..sensor.height)
            .into_par_iter()
            .map(|v| {
                (0..sensor.width)
                    .map(|u| ray(PixelPoint::new(f64::from(u), f64::from(v))))
                    .collect()
            })
            .collect();
        Self {
            sensor,
            rays: rows.concat(),
        }
    }

    /// What a field gives the pixels of its calibrated area.
    pub fn of_camera(camera: &CalibratedCamera) -> Self {
        Self::new(camera.field.sensor, |pixel| {
            camera.ray_in_rig(pixel).map(|ray| Ray {
                direction: ray.direction.normalize(),
                ..ray
            })
        })
    }

    /// The table as a file of `NumPy`: an array of shape (height, width, 6) of little-endian f64, for each
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

/// A file of `NumPy`, format version 1.0, C order.
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
    use nalgebra::Vector3;

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
}
