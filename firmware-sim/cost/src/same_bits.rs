//! One number for the bits of many answers, so that machines can be compared: the host, a Cortex-M4F,
//! and a processor without a floating-point unit.

#[cfg(feature = "integer")]
use ray_runtime::integer::Rig;
use ray_runtime::{Camera, Measurement, PixelPoint, RayBlob};
use split_mix::SplitMix;

/// How many matches a blob is asked in each mode of the floating-point unit.
pub const FLOAT_MODE_MATCHES: u32 = 10_000;

/// A checksum of the answers to `count` matches of the first two cameras of a blob: point, gap and
/// standard deviations, or the code of why there is no point; and of the pixels that some points are
/// projected to. `None` if there are not two cameras.
///
/// The pixels are drawn from a sequence of integers that is the same everywhere, over the sensors and a
/// little beyond. Rays that miss each other by much have a point too, where they are nearest.
pub fn digest(blob: &RayBlob<'_>, count: u32) -> Option<Digest> {
    let cameras = [blob.camera(0)?, blob.camera(1)?];
    let mut random = SplitMix(0x0b17_5eed);
    let mut digest = Digest {
        checksum: FNV_OFFSET,
        points: 0,
    };
    for _ in 0..count {
        let [a, b] = [0, 1].map(|k| pixel(&mut random, &cameras[k]));
        match blob.triangulate_with_covariance((0, a), (1, b)) {
            Ok(measured) => {
                digest.add_point(&measured);
                if digest.points.is_multiple_of(PROJECTED_EVERY) {
                    digest.add_projection(blob, &measured);
                }
            }
            Err(error) => digest.add(u32::from(error.code())),
        }
    }
    Some(digest)
}

#[cfg(feature = "integer")]
/// The same of the arithmetic of integers: points and gaps of the same matches. `None` too of a blob that it cannot look up.
pub fn digest_of_integers(blob: &RayBlob<'_>, count: u32) -> Option<Digest> {
    let cameras = [blob.camera(0)?, blob.camera(1)?];
    let integers = Rig::<2>::prepare(blob).ok()?;
    let mut random = SplitMix(0x0b17_5eed);
    let mut digest = Digest {
        checksum: FNV_OFFSET,
        points: 0,
    };
    for _ in 0..count {
        let [a, b] = [0, 1].map(|k| pixel(&mut random, &cameras[k]));
        match integers.triangulate((0, a), (1, b)) {
            Ok(found) => {
                digest.points += 1;
                let [x, y, z] = found.point_mm;
                for number in [x, y, z, found.gap_squared_mm2] {
                    digest.add(number.to_bits());
                }
            }
            Err(error) => digest.add(u32::from(error.code())),
        }
    }
    Some(digest)
}

/// What a machine answers to many matches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Digest {
    /// Of all bits of all answers.
    pub checksum: u32,
    /// How many of the answers are points.
    pub points: u32,
}

/// Every so many points one is projected into the second camera: it costs as much as ten points.
const PROJECTED_EVERY: u32 = 32;

const FNV_OFFSET: u32 = 0x811c_9dc5;
const FNV_PRIME: u32 = 0x0100_0193;

impl Digest {
    /// FNV-1a (Fowler, Noll, Vo), a byte at a time.
    fn add(&mut self, word: u32) {
        for byte in word.to_le_bytes() {
            self.checksum = (self.checksum ^ u32::from(byte)).wrapping_mul(FNV_PRIME);
        }
    }

    fn add_projection(&mut self, blob: &RayBlob<'_>, measured: &Measurement) {
        let words = match blob.project(1, measured.found.point_mm) {
            Ok(pixel) => [pixel.u, pixel.v].map(f32::to_bits),
            Err(error) => [u32::from(error.code()); 2],
        };
        for word in words {
            self.add(word);
        }
    }

    fn add_point(&mut self, measured: &Measurement) {
        self.points += 1;
        let found = &measured.found;
        for x in found.point_mm {
            self.add(x.to_bits());
        }
        self.add(found.gap_squared_mm2.to_bits());
        if let Some(covariance) = measured.covariance {
            for x in covariance.sigma_mm() {
                self.add(x.to_bits());
            }
        }
    }
}

/// Anywhere from 2 px outside the sensor on one side to 2 px outside on the other, in steps of 1/64 px.
fn pixel(random: &mut SplitMix, camera: &Camera<'_>) -> PixelPoint {
    let mut along = |extent_px: u32| {
        let steps = 64 * (extent_px + 4);
        let step = (random.next() % u64::from(steps)) as u32;
        step as f32 / 64.0 - 2.0
    };
    PixelPoint::new(along(camera.sensor_width), along(camera.sensor_height))
}
