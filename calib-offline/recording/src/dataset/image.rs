//! Gray images: PNG, JPEG, TIFF, BMP, PGM of 8 or 16 bits, as numbers to measure in.

pub mod bayer;
mod jpeg_end;
mod pixels;

use calib_rays::geometry::SensorSize;
use calib_rays::remedy::Remedy;
use image::{DynamicImage, ImageFormat, ImageReader, Rgb};
use pixels::Pixels;
use std::io::Cursor;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// A gray image; values are the file's own code values (0 to [`GrayImage::white_level`]).
#[derive(Debug, Clone, PartialEq)]
pub struct GrayImage {
    /// Width and height.
    pub sensor: SensorSize,
    /// Row-major, `width * height`, in no more bytes than the file's own.
    pixels: Pixels,
    /// The largest value that its pixels can have: 255, or of 16 bits what the bits in use can hold: 1023 where no
    /// pixel has more, then 4095, 16383, 65535.
    pub white_level: f32,
}

/// Why an image could not be used. Each names the file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImageError {
    /// The file could not be opened or read.
    #[error("{}: cannot be read", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file is no image of a known format, or a damaged one.
    #[error("{}: is not a PNG, JPEG, TIFF, BMP or PGM image that can be decoded", path.display())]
    Undecodable {
        /// The file.
        path: PathBuf,
        /// What the decoder said.
        source: image::ImageError,
    },
    /// A kind of image that is not read.
    #[error(
        "{}: this kind of image is not read: {what}; read are PNG, JPEG, TIFF, BMP and PGM with whole numbers of \
         8 or 16 bits, gray or color", path.display()
    )]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// What it is.
        what: String,
    },
    /// The file ends before the image does.
    #[error("{}: the file ends early: its lower part is missing", path.display())]
    CutOff {
        /// The file.
        path: PathBuf,
    },
    /// The image is not as large as the manifest says.
    #[error(
        "{}: is {found} pixels, but the manifest says {expected} for this camera", path.display()
    )]
    WrongSize {
        /// The file.
        path: PathBuf,
        /// Size of the image.
        found: SensorSize,
        /// Size in the manifest.
        expected: SensorSize,
    },
}

impl Remedy for ImageError {
    fn remedy(&self) -> Option<String> {
        let text = match self {
            Self::Unsupported { .. } => {
                "convert the images without loss: to PNG or TIFF with 8 or 16 bits a pixel, neither scaled nor cropped"
            }
            Self::Unreadable { .. } | Self::Undecodable { .. } | Self::CutOff { .. } => {
                "copy the image again; or leave the pose out with exclude under [dataset], or take \
                 the image out of the camera's list (image_list, with \"\" in its place)"
            }
            Self::WrongSize {
                found, expected, ..
            } if (found.width, found.height) == (expected.height, expected.width) => {
                "width and height swapped? Correct them in dataset.toml"
            }
            Self::WrongSize { .. } => {
                "correct width and height of this camera in dataset.toml, or use the images as they \
                 came from the sensor (not scaled, not cropped)"
            }
        };
        Some(text.to_owned())
    }
}

impl GrayImage {
    /// An image from its values, row-major; `None` if their number is not `width * height` or no
    /// pixel is left.
    pub fn from_values(sensor: SensorSize, values: Vec<f32>, white_level: f32) -> Option<Self> {
        let pixel_count = sensor.width as usize * sensor.height as usize;
        (pixel_count > 0 && values.len() == pixel_count).then_some(Self {
            sensor,
            pixels: Pixels::Float(values),
            white_level,
        })
    }

    /// Reads a file and makes it gray (colors by their luminance; transparency is ignored).
    ///
    /// # Errors
    /// [`ImageError`], naming the file, if it cannot be read or decoded.
    pub fn load(path: &Path) -> Result<Self, ImageError> {
        let unreadable = |source| ImageError::Unreadable {
            path: path.to_path_buf(),
            source,
        };
        let bytes = std::fs::read(path).map_err(unreadable)?;
        if jpeg_end::is_cut_off(&bytes) {
            return Err(ImageError::CutOff {
                path: path.to_path_buf(),
            });
        }
        // From memory: the decoders are compiled once, in their own crate, and not for files here again.
        let format = format_of(&bytes, path)?;
        let decoded = image::load_from_memory_with_format(&bytes, format);
        let decoded = decoded.map_err(|source| not_decoded(path, source))?;
        drop(bytes);
        if matches!(
            decoded,
            DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_)
        ) {
            return Err(ImageError::Unsupported {
                path: path.to_path_buf(),
                what: "floating-point numbers".to_owned(),
            });
        }
        Ok(Self::from_decoded(decoded))
    }

    /// Width and height that a file's header gives, without decoding it.
    ///
    /// # Errors
    /// [`ImageError`], naming the file, if there is no header that is known.
    pub fn size_of(path: &Path) -> Result<SensorSize, ImageError> {
        let bytes = std::fs::read(path).map_err(|source| ImageError::Unreadable {
            path: path.to_path_buf(),
            source,
        })?;
        let format = format_of(&bytes, path)?;
        let reader = ImageReader::with_format(Cursor::new(bytes), format);
        let (width, height) = reader
            .into_dimensions()
            .map_err(|source| not_decoded(path, source))?;
        Ok(SensorSize::new(width, height))
    }

    /// Like [`GrayImage::load`], and refuses an image of another size than the manifest's.
    ///
    /// # Errors
    /// As [`GrayImage::load`]; [`ImageError::WrongSize`].
    pub fn load_sized(path: &Path, expected: SensorSize) -> Result<Self, ImageError> {
        let image = Self::load(path)?;
        if image.sensor == expected {
            Ok(image)
        } else {
            Err(ImageError::WrongSize {
                path: path.to_path_buf(),
                found: image.sensor,
                expected,
            })
        }
    }

    fn from_decoded(decoded: DynamicImage) -> Self {
        let sensor = SensorSize::new(decoded.width(), decoded.height());
        let deep = matches!(
            decoded,
            DynamicImage::ImageLuma16(_)
                | DynamicImage::ImageLumaA16(_)
                | DynamicImage::ImageRgb16(_)
                | DynamicImage::ImageRgba16(_)
        );
        let (pixels, white_level) = if let DynamicImage::ImageRgb8(colors) = decoded {
            // As the image crate's conversion, without another copy of a large image.
            let luminance = |p: &Rgb<u8>| {
                let [r, g, b] = p.0.map(u32::from);
                ((2126 * r + 7152 * g + 722 * b + 5000) / 10_000) as u8
            };
            let gray = colors.pixels().map(luminance).collect();
            (Pixels::Bytes(gray), f32::from(u8::MAX))
        } else if deep {
            let gray = decoded.into_luma16().into_raw();
            let largest = gray.iter().copied().max().unwrap_or(0);
            let white = BITS_IN_USE.into_iter().find(|white| largest <= *white);
            let white_level = f32::from(white.unwrap_or(u16::MAX));
            (Pixels::words(gray, 1.0), white_level)
        } else {
            let gray = decoded.into_luma8().into_raw();
            (Pixels::Bytes(gray), f32::from(u8::MAX))
        };
        Self {
            sensor,
            pixels,
            white_level,
        }
    }

    /// All values, row by row.
    pub fn values(&self) -> impl ExactSizeIterator<Item = f32> + '_ {
        (0..self.pixels.len()).map(|index| self.pixels.at(index))
    }

    /// The value at a place in the row-major order, which must be inside the image.
    #[inline]
    pub fn value(&self, index: usize) -> f32 {
        self.pixels.at(index)
    }

    /// Takes away the values of pixels (row-major places inside the image): what is covered says nothing.
    pub fn cover(&mut self, places: impl Iterator<Item = usize>) {
        let values = self.pixels.make_floats();
        for place in places {
            values[place] = f32::NAN;
        }
    }

    /// The value of a pixel, or `None` outside the image and where it is covered (not a number).
    pub fn at(&self, u: i64, v: i64) -> Option<f32> {
        let inside = (0..i64::from(self.sensor.width)).contains(&u)
            && (0..i64::from(self.sensor.height)).contains(&v);
        inside
            .then(|| self.value(v as usize * self.sensor.width as usize + u as usize))
            .filter(|value| !value.is_nan())
    }

    /// The value between pixels, bilinear; `None` outside the outermost pixel centers.
    pub fn between(&self, u: f64, v: f64) -> Option<f64> {
        if !(u.is_finite() && v.is_finite()) {
            return None;
        }
        let (u0, v0) = (u.floor(), v.floor());
        let (fu, fv) = (u - u0, v - v0);
        let value = |du: i64, dv: i64| self.at(u0 as i64 + du, v0 as i64 + dv).map(f64::from);
        let top = lerp(value(0, 0)?, if fu > 0.0 { value(1, 0)? } else { 0.0 }, fu);
        if fv == 0.0 {
            return Some(top);
        }
        let bottom = lerp(value(0, 1)?, if fu > 0.0 { value(1, 1)? } else { 0.0 }, fu);
        Some(lerp(top, bottom, fv))
    }

    /// The values below which the given fractions of the pixels lie.
    pub fn quantiles<const N: usize>(&self, fractions: [f64; N]) -> [f32; N] {
        self.pixels.quantiles(fractions)
    }

    /// The image in 8 bits, `black` and below to 0, `white` and above to 255.
    pub fn stretched(&self, black: f32, white: f32) -> Vec<u8> {
        self.stretched_rows(black, white, 0..self.sensor.height as usize)
    }

    /// Some rows of [`GrayImage::stretched`], inside the image.
    pub fn stretched_rows(&self, black: f32, white: f32, rows: Range<usize>) -> Vec<u8> {
        let width = self.sensor.width as usize;
        self.pixels
            .stretched(black, white, rows.start * width..rows.end * width)
    }

    /// Twice the size, bilinear between the pixels and constant beyond the outermost.
    ///
    /// Pixel (u, v) of the result is centered on (u / 2 - 0.25, v / 2 - 0.25) of this image. `None`
    /// if that is more pixels than can be counted.
    pub fn doubled(&self) -> Option<Self> {
        let (width, height) = (self.sensor.width, self.sensor.height);
        let double = SensorSize::new(width.checked_mul(2)?, height.checked_mul(2)?);
        let place =
            |k: u32, count: u32| (f64::from(k) / 2.0 - 0.25).clamp(0.0, f64::from(count) - 1.0);
        let mut values = Vec::with_capacity(4 * self.pixels.len());
        for v in 0..double.height {
            for u in 0..double.width {
                let value = self.between(place(u, width), place(v, height))?;
                values.push(value as f32);
            }
        }
        Self::from_values(double, values, self.white_level)
    }

    /// Half the size, each pixel the mean of four; `None` below 2 x 2 pixels.
    ///
    /// Pixel (u, v) of the result is centered on (2u + 0.5, 2v + 0.5) of this image. An odd last
    /// row or column is left out.
    pub fn halved(&self) -> Option<Self> {
        let half = SensorSize::new(self.sensor.width / 2, self.sensor.height / 2);
        (half.width > 0 && half.height > 0).then(|| Self {
            sensor: half,
            pixels: self
                .pixels
                .halved(self.sensor.width as usize, half, self.white_level),
            white_level: self.white_level,
        })
    }
}

/// The largest numbers of 10, 12 and 14 bits, as sensors deliver them in 16.
const BITS_IN_USE: [u16; 3] = [1023, 4095, 16383];

/// Beginnings of files that are images of a kind that is not read.
const OTHER_KINDS: [(usize, &[u8], &str); 8] = [
    (4, b"jP  ", "JPEG 2000"),
    (0, b"\xff\x4f\xff\x51", "JPEG 2000"),
    (4, b"ftypavif", "AVIF"),
    (4, b"ftypheic", "HEIC"),
    (8, b"WEBP", "WebP"),
    (0, b"GIF8", "GIF"),
    (0, b"\x76\x2f\x31\x01", "OpenEXR"),
    (0, b"FUJIFILMCCD-RAW", "a camera maker's raw file"),
];

/// What a file is, by its beginning or else by its name.
fn format_of(bytes: &[u8], path: &Path) -> Result<ImageFormat, ImageError> {
    let begins = |(at, mark, _): &&(usize, &[u8], &str)| {
        bytes.get(*at..).is_some_and(|rest| rest.starts_with(mark))
    };
    if let Some((.., what)) = OTHER_KINDS.iter().find(begins) {
        return Err(ImageError::Unsupported {
            path: path.to_path_buf(),
            what: (*what).to_owned(),
        });
    }
    image::guess_format(bytes)
        .or_else(|unknown| ImageFormat::from_path(path).map_err(|_| unknown))
        .map_err(|source| ImageError::Undecodable {
            path: path.to_path_buf(),
            source,
        })
}

fn not_decoded(path: &Path, source: image::ImageError) -> ImageError {
    let path = path.to_path_buf();
    match source {
        image::ImageError::IoError(source) => ImageError::Unreadable { path, source },
        image::ImageError::Unsupported(what) => ImageError::Unsupported {
            path,
            what: what.to_string(),
        },
        source => ImageError::Undecodable { path, source },
    }
}

fn lerp(a: f64, b: f64, t: f64) -> f64 {
    if t == 0.0 { a } else { a + (b - a) * t }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{ImageBuffer, Luma, Rgb};

    fn ramp(scale: u16) -> ImageBuffer<Luma<u16>, Vec<u16>> {
        ImageBuffer::from_fn(7, 5, |u, v| Luma([scale * (u as u16 + 7 * v as u16)]))
    }

    #[test]
    fn every_format_and_depth_gives_the_values_written() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.png", "a.tiff", "a.bmp", "a.pgm"] {
            let path = folder.path().join(name);
            let gray: image::GrayImage =
                ImageBuffer::from_fn(7, 5, |u, v| Luma([3 * (u as u8 + 7 * v as u8)]));
            gray.save(&path).unwrap();
            let read = GrayImage::load_sized(&path, SensorSize::new(7, 5)).unwrap();
            assert_eq!(read.white_level, 255.0, "{name}");
            assert_eq!(read.at(6, 4), Some(3.0 * 34.0), "{name}");
        }
        for name in ["b.png", "b.tiff", "b.pgm"] {
            let path = folder.path().join(name);
            for (scale, white_level) in [(1000, 65535.0), (100, 4095.0), (30, 1023.0)] {
                ramp(scale).save(&path).unwrap();
                let read = GrayImage::load(&path).unwrap();
                assert_eq!(read.white_level, white_level, "{name}");
                assert_eq!(read.at(2, 1), Some(9.0 * f32::from(scale)), "{name}");
            }
        }
        // JPEG is lossy; a flat image comes back to within the quantization of its mean.
        let path = folder.path().join("c.jpg");
        ImageBuffer::from_pixel(16, 16, Rgb([90u8, 90, 90]))
            .save(&path)
            .unwrap();
        let read = GrayImage::load(&path).unwrap();
        assert!(read.values().all(|v| (v - 90.0).abs() <= 1.0));
    }

    #[test]
    fn errors_name_the_file_and_both_sizes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("small.png");
        ramp(1).save(&path).unwrap();
        let wrong = GrayImage::load_sized(&path, SensorSize::new(640, 480)).unwrap_err();
        let message = wrong.to_string();
        for part in ["small.png", "7x5", "640x480"] {
            assert!(message.contains(part), "{message}");
        }
        let missing = GrayImage::load(&folder.path().join("none.png")).unwrap_err();
        assert!(matches!(missing, ImageError::Unreadable { .. }));
        for (name, bytes) in [("empty.png", &b""[..]), ("binary.jpg", &[7u8; 300][..])] {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            let message = GrayImage::load(&path).unwrap_err().to_string();
            assert!(message.contains(name), "{message}");
        }
    }

    #[test]
    fn kinds_that_are_not_read_are_named_with_those_that_are() {
        let folder = tempfile::tempdir().unwrap();
        let float: ImageBuffer<Rgb<f32>, Vec<f32>> = ImageBuffer::new(4, 4);
        let path = folder.path().join("float.tiff");
        float.save(&path).unwrap();
        let avif = folder.path().join("b.png");
        std::fs::write(&avif, b"\0\0\0\x1cftypavif\0\0\0\0").unwrap();
        for path in [path, avif] {
            let error = GrayImage::load(&path).unwrap_err();
            assert!(matches!(error, ImageError::Unsupported { .. }), "{error}");
            assert!(error.to_string().contains("8 or 16 bits"), "{error}");
        }
    }

    #[test]
    fn values_between_pixels_are_bilinear_and_end_at_the_outer_centers() {
        let image =
            GrayImage::from_values(SensorSize::new(2, 2), vec![0.0, 10.0, 20.0, 30.0], 255.0)
                .unwrap();
        assert_eq!(image.between(0.25, 0.5), Some(12.5));
        assert_eq!(image.between(1.0, 1.0), Some(30.0));
        assert_eq!(image.between(1.01, 0.0), None);
        assert_eq!(image.between(-0.01, 0.0), None);
        assert_eq!(image.between(f64::NAN, 0.0), None);
        assert_eq!(image.halved().unwrap().value(0), 15.0);
        let doubled = image.doubled().unwrap();
        let first: Vec<f32> = doubled.values().take(4).collect();
        assert_eq!(first, [0.0, 2.5, 7.5, 10.0]);
        let back: Vec<f32> = doubled.halved().unwrap().values().collect();
        assert_eq!(back, [3.75, 11.25, 18.75, 26.25]);
    }
}
