//! Pictures of a folder, undistorted: PNG in, PNG out, through the maps of [`super::remap`].
//!
//! Quirks. A picture is of the camera whose name its file's name begins with (`left01.png`, `left_001.png`), the longest such name; other
//! files are passed over and named. Gray and color, 8 and 16 bits stay what they are. Linear between pixels; a pixel that no ray reaches is
//! 0, and `mask_NAME.png` of each camera says which these are. Lost: as for the maps, and sharpness by the linear interpolation.

use super::NamedFile;
use super::view::{OUTSIDE, ViewMap};
use calib_rays::geometry::SensorSize;
use calib_rays::remedy::Remedy;
use image::{DynamicImage, ImageBuffer, ImageFormat, ImageReader, Luma, Pixel};
use rayon::prelude::*;
use std::io::Cursor;
use std::path::{Path, PathBuf};

/// Why pictures were not undistorted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum UndistortError {
    /// The system refused to read it.
    #[error("{}: cannot be read", path.display())]
    Read {
        /// The folder or the file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Nothing to undistort.
    #[error("{}: has no PNG image whose name begins with that of a camera ({})", folder.display(), cameras.join(", "))]
    NoImages {
        /// The folder.
        folder: PathBuf,
        /// The rig's cameras.
        cameras: Vec<String>,
    },
    /// Not PNG, a damaged one, or of a kind that is not read.
    #[error("{}: is not a PNG image of 8 or 16 bits that can be read ({what})", path.display())]
    Image {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: String,
    },
    /// Another size than the camera's.
    #[error("{}: is {found} pixels, camera \"{camera}\" has {expected}", path.display())]
    Size {
        /// The file.
        path: PathBuf,
        /// The camera.
        camera: String,
        /// Its size.
        expected: SensorSize,
        /// The image's.
        found: SensorSize,
    },
}

impl Remedy for UndistortError {
    fn remedy(&self) -> Option<String> {
        let text = match self {
            Self::Read { .. } => "check the path",
            Self::NoImages { .. } => {
                "name the images after their cameras, such as left_001.png, and convert others to PNG"
            }
            Self::Image { .. } => "convert it to PNG without loss, or take it out of the folder",
            Self::Size { .. } => {
                "take images with the resolution, binning and region of the calibration"
            }
        };
        Some(text.to_owned())
    }
}

/// Undistorted pictures.
#[derive(Debug)]
pub struct Undistorted {
    /// The pictures under their own names, and a mask a camera.
    pub files: Vec<NamedFile>,
    /// Files of the folder that are no pictures of the rig's cameras.
    pub passed_over: Vec<String>,
}

/// Undistorts the pictures of a folder. All are held in memory as PNG until they are written.
///
/// # Errors
/// [`UndistortError`].
pub fn images(folder: &Path, maps: &[ViewMap]) -> Result<Undistorted, UndistortError> {
    let unreadable = |source| UndistortError::Read {
        path: folder.to_owned(),
        source,
    };
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let entry = entry.map_err(unreadable)?;
        if entry.file_type().map_err(unreadable)?.is_file() {
            names.push(entry.file_name().to_string_lossy().into_owned());
        }
    }
    names.sort();
    let (mut wanted, mut passed_over) = (Vec::new(), Vec::new());
    for name in names {
        match map_of(&name, maps) {
            Some(map) => wanted.push((name, map)),
            None => passed_over.push(name),
        }
    }
    if wanted.is_empty() {
        return Err(UndistortError::NoImages {
            folder: folder.to_owned(),
            cameras: maps.iter().map(|map| map.view.camera.clone()).collect(),
        });
    }
    let mut files = calib_rays::in_order::try_map(wanted, |(name, map)| {
        let bytes = image(&folder.join(&name), map)?;
        Ok((name, bytes))
    })?;
    for map in maps {
        let path = folder.join(mask_name(map));
        let in_mask = |pixel: &[f32; 2]| if *pixel == [OUTSIDE; 2] { 0 } else { u8::MAX };
        let mask: Vec<u8> = map.pixels.iter().map(in_mask).collect();
        let SensorSize { width, height } = map.view.size;
        if let Some(mask) = ImageBuffer::<Luma<u8>, _>::from_raw(width, height, mask) {
            files.push((mask_name(map), png(&path, &DynamicImage::ImageLuma8(mask))?));
        }
    }
    Ok(Undistorted { files, passed_over })
}

fn mask_name(map: &ViewMap) -> String {
    format!("mask_{}.png", map.view.camera)
}

/// The map for a file's name: the longest camera's name that it begins with, and goes on with no letter.
fn map_of<'a>(name: &str, maps: &'a [ViewMap]) -> Option<&'a ViewMap> {
    let (stem, ending) = name.rsplit_once('.')?;
    if !ending.eq_ignore_ascii_case("png") {
        return None;
    }
    let is_of = |map: &&ViewMap| {
        let rest = stem.strip_prefix(map.view.camera.as_str());
        rest.is_some_and(|rest| !rest.starts_with(char::is_alphabetic))
    };
    maps.iter()
        .filter(is_of)
        .max_by_key(|map| map.view.camera.len())
}

/// A picture, undistorted, as PNG.
fn image(path: &Path, map: &ViewMap) -> Result<Vec<u8>, UndistortError> {
    let bytes = std::fs::read(path).map_err(|source| UndistortError::Read {
        path: path.to_owned(),
        source,
    })?;
    let broken = |what: String| UndistortError::Image {
        path: path.to_owned(),
        what,
    };
    let reader = ImageReader::with_format(Cursor::new(bytes), ImageFormat::Png);
    let decoded = reader.decode().map_err(|error| broken(error.to_string()))?;
    let found = SensorSize::new(decoded.width(), decoded.height());
    if found != map.camera_sensor {
        return Err(UndistortError::Size {
            path: path.to_owned(),
            camera: map.view.camera.clone(),
            expected: map.camera_sensor,
            found,
        });
    }
    let new = match &decoded {
        DynamicImage::ImageLuma8(image) => DynamicImage::ImageLuma8(resampled(image, map)),
        DynamicImage::ImageLumaA8(image) => DynamicImage::ImageLumaA8(resampled(image, map)),
        DynamicImage::ImageRgb8(image) => DynamicImage::ImageRgb8(resampled(image, map)),
        DynamicImage::ImageRgba8(image) => DynamicImage::ImageRgba8(resampled(image, map)),
        DynamicImage::ImageLuma16(image) => DynamicImage::ImageLuma16(resampled(image, map)),
        DynamicImage::ImageLumaA16(image) => DynamicImage::ImageLumaA16(resampled(image, map)),
        DynamicImage::ImageRgb16(image) => DynamicImage::ImageRgb16(resampled(image, map)),
        DynamicImage::ImageRgba16(image) => DynamicImage::ImageRgba16(resampled(image, map)),
        _ => return Err(broken("of another kind".to_owned())),
    };
    png(path, &new)
}

fn png(path: &Path, image: &DynamicImage) -> Result<Vec<u8>, UndistortError> {
    let mut bytes = Cursor::new(Vec::new());
    let written = image.write_to(&mut bytes, ImageFormat::Png);
    written.map_err(|error| UndistortError::Image {
        path: path.to_owned(),
        what: error.to_string(),
    })?;
    Ok(bytes.into_inner())
}

/// A number of a pixel.
trait Sample: Copy + Into<f64> + Send + Sync {
    /// Rounded, within its range.
    fn nearest(value: f64) -> Self;
}

impl Sample for u8 {
    fn nearest(value: f64) -> Self {
        value.round() as Self
    }
}

impl Sample for u16 {
    fn nearest(value: f64) -> Self {
        value.round() as Self
    }
}

type Buffer<P> = ImageBuffer<P, Vec<<P as Pixel>::Subpixel>>;

/// An image seen through a map.
fn resampled<P>(image: &Buffer<P>, map: &ViewMap) -> Buffer<P>
where
    P: Pixel<Subpixel: Sample> + Sync,
{
    let channels = usize::from(P::CHANNEL_COUNT);
    let (width, height) = (image.width() as usize, image.height() as usize);
    let values = image.as_raw();
    let SensorSize {
        width: new_width,
        height: new_height,
    } = map.view.size;
    let mut new = vec![P::Subpixel::nearest(0.0); channels * map.pixels.len()];
    new.par_chunks_mut(channels)
        .zip(&map.pixels)
        .for_each(|(out, seen)| {
            if *seen == [OUTSIDE; 2] {
                return;
            }
            let [(left, right, a), (upper, lower, b)] =
                [between(seen[0], width), between(seen[1], height)];
            for (channel, out) in out.iter_mut().enumerate() {
                let at = |u: usize, v: usize| -> f64 {
                    values[(v * width + u) * channels + channel].into()
                };
                let above = at(left, upper) * (1.0 - a) + at(right, upper) * a;
                let below = at(left, lower) * (1.0 - a) + at(right, lower) * a;
                *out = P::Subpixel::nearest(above * (1.0 - b) + below * b);
            }
        });
    // Its length is that of the map.
    ImageBuffer::from_raw(new_width, new_height, new)
        .unwrap_or_else(|| ImageBuffer::new(new_width, new_height))
}

/// The two pixels around a place and the second one's share; at the edge the outermost twice.
fn between(place: f32, length: usize) -> (usize, usize, f64) {
    let place = f64::from(place).clamp(0.0, (length - 1) as f64);
    let first = place as usize;
    (first, (first + 1).min(length - 1), place - first as f64)
}
