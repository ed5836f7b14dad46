//! Reads the metadata's postcard messages field by field, as they stand there one behind the other: each
//! field by `postcard`, but the structs and enums by hand, for which its general way takes 2 KB more of a
//! device's flash. The tests compare both.

use super::meta::{CameraMeta, LengthUnit, Meta, PixelConvention, SelfTest};
use serde::Deserialize;

/// Messages one behind the other. `None` of a message that is cut short or says what has no meaning;
/// nothing can be read after that.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Messages<'a> {
    /// What is left.
    pub rest: &'a [u8],
}

impl<'a> Messages<'a> {
    pub fn meta(&mut self) -> Option<Meta<'a>> {
        Some(Meta {
            identity: self.bytes()?,
            frame: self.text()?,
            written_by: self.text()?,
            pixel_convention: match self.integer()? {
                0 => PixelConvention::TopLeftPixelCenter,
                _ => return None,
            },
            length_unit: match self.integer()? {
                0 => LengthUnit::Millimeter,
                _ => return None,
            },
            max_error_px: self.number()?,
            working_distance_mm: self.number()?,
            self_test_count: self.index()?,
        })
    }

    #[inline(never)]
    pub fn camera(&mut self) -> Option<CameraMeta<'a>> {
        let name = self.text()?;
        let mut numbers = [0; 6];
        for number in &mut numbers {
            *number = self.integer()?;
        }
        let [
            sensor_width,
            sensor_height,
            region_u,
            region_v,
            region_width,
            region_height,
        ] = numbers;
        Some(CameraMeta {
            name,
            sensor_width,
            sensor_height,
            region_u,
            region_v,
            region_width,
            region_height,
        })
    }

    pub fn self_test(&mut self) -> Option<SelfTest> {
        let variant = self.integer()?;
        if variant > 2 {
            return None;
        }
        let camera = self.index()?;
        if variant == 0 {
            let [u, v, a, b, c, d, e, f] = self.numbers()?;
            return Some(SelfTest::Ray {
                camera,
                pixel: [u, v],
                origin_mm: [a, b, c],
                direction: [d, e, f],
            });
        }
        let cameras = [camera, self.index()?];
        let [u_a, v_a, u_b, v_b, x, y, z] = self.numbers()?;
        let (pixels, xyz) = ([[u_a, v_a], [u_b, v_b]], [x, y, z]);
        Some(if variant == 1 {
            SelfTest::Pair {
                cameras,
                pixels,
                point_mm: xyz,
                gap_squared_mm2: self.number()?,
            }
        } else {
            SelfTest::Sigma {
                cameras,
                pixels,
                sigma_mm: xyz,
            }
        })
    }

    // One copy of each in the code: they are asked for in many places.

    #[inline(never)]
    fn integer(&mut self) -> Option<u32> {
        self.take()
    }

    #[inline(never)]
    fn index(&mut self) -> Option<u16> {
        self.take()
    }

    #[inline(never)]
    fn text(&mut self) -> Option<&'a str> {
        core::str::from_utf8(self.bytes()?).ok()
    }

    /// Their length is a u32 on every target: postcard reads as many digits as its `usize` has, so that a host
    /// would take lengths that a device refuses.
    #[inline(never)]
    fn bytes(&mut self) -> Option<&'a [u8]> {
        let length = usize::try_from(self.integer()?).ok()?;
        let (bytes, rest) = self.rest.split_at_checked(length)?;
        self.rest = rest;
        Some(bytes)
    }

    #[inline(never)]
    fn number(&mut self) -> Option<f32> {
        self.take()
    }

    #[inline(always)]
    fn take<T: Deserialize<'a>>(&mut self) -> Option<T> {
        let (value, rest) = postcard::take_from_bytes(self.rest).ok()?;
        self.rest = rest;
        Some(value)
    }

    #[inline(always)]
    fn numbers<const COUNT: usize>(&mut self) -> Option<[f32; COUNT]> {
        let mut numbers = [0.0; COUNT];
        for number in &mut numbers {
            *number = self.number()?;
        }
        Some(numbers)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use serde::{Deserialize, Serialize};
    use std::vec::Vec;

    fn encoded(message: &impl Serialize) -> Vec<u8> {
        postcard::to_extend(message, Vec::new()).unwrap()
    }

    /// Cut anywhere and with any byte changed, a message is read as postcard reads it, or not at all.
    fn is_read_as_postcard_does<'a, T>(bytes: &'a [u8], read: fn(&mut Messages<'a>) -> Option<T>)
    where
        T: Deserialize<'a> + PartialEq + core::fmt::Debug,
    {
        let mut messages = Messages { rest: bytes };
        let (expected, rest) = postcard::take_from_bytes::<T>(bytes)
            .map_or((None, None), |(message, rest)| (Some(message), Some(rest)));
        let found = read(&mut messages);
        assert_eq!(found, expected, "{bytes:?}");
        if found.is_some() {
            assert_eq!(Some(messages.rest), rest);
        }
    }

    fn with_damage(bytes: &[u8]) -> Vec<Vec<u8>> {
        let cut = (0..=bytes.len()).map(|length| bytes[..length].to_vec());
        let changed = (0..bytes.len()).flat_map(|at| {
            // Not the top bits of both: NaN is not equal to itself.
            [0x80, 0x7f, 0x01, 0x10].map(|change| {
                let mut bytes = bytes.to_vec();
                bytes[at] ^= change;
                bytes.extend([0x81, 0x02, 0x03]);
                bytes
            })
        });
        cut.chain(changed).collect()
    }

    #[test]
    fn messages_are_read_as_postcard_reads_them() {
        let meta = Meta {
            identity: &[7; 16],
            frame: "the datum pose",
            written_by: "test é",
            pixel_convention: PixelConvention::TopLeftPixelCenter,
            length_unit: LengthUnit::Millimeter,
            max_error_px: 0.5,
            working_distance_mm: 300.0,
            self_test_count: 40_000,
        };
        for bytes in with_damage(&encoded(&meta)) {
            is_read_as_postcard_does(&bytes, Messages::meta);
        }
        let camera = CameraMeta {
            name: "left",
            sensor_width: 32_768,
            sensor_height: u32::MAX,
            region_u: 1 << 28,
            region_v: 127,
            region_width: 128,
            region_height: 0,
        };
        for bytes in with_damage(&encoded(&camera)) {
            is_read_as_postcard_does(&bytes, Messages::camera);
        }
        let (pixels, xyz) = ([[1.0, 2.0], [3.0, 4.0]], [5.0, 6.0, 7.0]);
        let tests = [
            SelfTest::Ray {
                camera: 300,
                pixel: [1.0, 2.0],
                origin_mm: xyz,
                direction: xyz,
            },
            SelfTest::Pair {
                cameras: [u16::MAX, 0],
                pixels,
                point_mm: xyz,
                gap_squared_mm2: 8.0,
            },
            SelfTest::Sigma {
                cameras: [1, 2],
                pixels,
                sigma_mm: xyz,
            },
        ];
        for test in tests {
            for bytes in with_damage(&encoded(&test)) {
                is_read_as_postcard_does(&bytes, Messages::self_test);
            }
        }
    }
}
