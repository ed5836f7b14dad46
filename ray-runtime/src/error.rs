//! Why something was refused: `Copy`, without strings, each with the numbers a caller needs and a
//! stable code for the wire and for logs.
//!
//! One code space for the whole crate: 1 to 63 a blob that does not open, 64 to 127 a question
//! that has no answer. Codes are never reused.

use crate::rounding::Rounding;

/// Which part of the blob an [`OpenError`] speaks of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Table {
    /// The working numbers of a camera.
    Record,
    /// A control grid.
    Grid,
    /// A mask of the calibrated area.
    Mask,
}

/// Why bytes are not a blob that this version reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum OpenError {
    /// There are fewer bytes than the header states (or than a header has).
    Truncated {
        /// Bytes needed.
        need: u32,
        /// Bytes given.
        have: u32,
    },
    /// The first four bytes are not [`MAGIC`](crate::format::MAGIC).
    BadMagic {
        /// What stands there, little endian.
        found: u32,
    },
    /// The blob is of another format version.
    WrongVersion {
        /// The blob's.
        found: u16,
        /// The one that this library reads.
        supported: u16,
    },
    /// There are more bytes than the header states.
    TrailingBytes {
        /// Bytes stated.
        need: u32,
        /// Bytes given.
        have: u32,
    },
    /// The checksum does not fit: the blob was damaged on the way.
    BadCrc {
        /// Stated in the header.
        stated: u32,
        /// Computed over the bytes.
        computed: u32,
    },
    /// The slice does not start on a multiple of 8 ([`Aligned`](crate::Aligned)).
    Misaligned {
        /// Bytes past the last multiple of 8.
        offset: u8,
    },
    /// The header contradicts itself or has a reserved field that is not zero.
    BadHeader,
    /// The metadata cannot be decoded, is longer or shorter than stated, or has a field out of
    /// its range.
    BadMeta,
    /// Bytes between two parts, or at the end, that must be zero are not.
    BadPadding {
        /// Offset of the padding in the blob.
        at: u32,
    },
    /// A camera's encoding is not known to this version.
    UnknownEncoding {
        /// Index of the camera.
        camera: u16,
        /// The encoding's number.
        found: u32,
    },
    /// A camera's table is of a form that this library was built without: build it with the feature
    /// `patches`, `quantized` or `old-versions`, or pack the blob in another form.
    FormLeftOut {
        /// Index of the camera.
        camera: u16,
        /// The encoding's number.
        found: u32,
    },
    /// A table's place or size does not fit the blob or the camera it belongs to.
    BadLayout {
        /// Index of the camera.
        camera: u16,
        /// Which table.
        table: Table,
    },
    /// A number is not finite, out of range, or not the one that follows from the metadata.
    BadNumber {
        /// Index of the camera.
        camera: u16,
        /// In which table.
        table: Table,
    },
    /// The uncertainty of a pair of cameras is cut short, out of order, or has a number out of
    /// its range.
    BadPair {
        /// Which, in the blob's order.
        pair: u16,
    },
    /// A section is cut short, out of order, one too many, or says what has no meaning.
    BadSection {
        /// Which, in the blob's order.
        section: u16,
    },
    /// A section that must be understood is not known to this version.
    UnknownSection {
        /// Its tag.
        tag: u16,
    },
    /// The processor does not round to nearest, ties to even, so that its answers would be others. Nothing is wrong
    /// with the blob: set the mode before it is opened, and leave it.
    WrongRounding {
        /// What it does.
        found: Rounding,
    },
}

impl OpenError {
    /// The stable number of the error.
    pub const fn code(self) -> u8 {
        match self {
            Self::Truncated { .. } => 1,
            Self::BadMagic { .. } => 2,
            Self::WrongVersion { .. } => 3,
            Self::TrailingBytes { .. } => 4,
            Self::BadCrc { .. } => 5,
            Self::Misaligned { .. } => 6,
            Self::BadHeader => 7,
            Self::BadMeta => 8,
            Self::BadPadding { .. } => 9,
            Self::UnknownEncoding { .. } => 10,
            Self::BadLayout { .. } => 11,
            Self::BadNumber { .. } => 12,
            Self::BadPair { .. } => 13,
            Self::BadSection { .. } => 14,
            Self::UnknownSection { .. } => 15,
            Self::WrongRounding { .. } => 16,
            Self::FormLeftOut { .. } => 17,
        }
    }
}

/// Why a pixel has no ray.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum LookupError {
    /// The pixel lies outside the calibrated area, or is not a number.
    Outside,
    /// The blob has no such camera.
    NoSuchCamera {
        /// The index asked for.
        camera: usize,
        /// How many cameras there are.
        count: usize,
    },
}

impl LookupError {
    /// The stable number of the error.
    pub const fn code(self) -> u8 {
        match self {
            Self::Outside => 64,
            Self::NoSuchCamera { .. } => 65,
        }
    }
}

/// Why a match has no point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum MeasureError {
    /// A pixel lies outside its camera's calibrated area, or is not a number.
    Outside {
        /// Index of the camera.
        camera: usize,
    },
    /// The blob has no such camera.
    NoSuchCamera {
        /// The index asked for.
        camera: usize,
        /// How many cameras there are.
        count: usize,
    },
    /// Fewer than two rays.
    TooFewRays {
        /// How many there were.
        have: usize,
    },
    /// The rays are parallel to within [`MIN_PARALLAX_SIN`](crate::MIN_PARALLAX_SIN).
    Parallel,
    /// The rays meet behind a camera.
    Behind,
}

impl MeasureError {
    /// The stable number of the error; the first two are those of [`LookupError`].
    pub const fn code(self) -> u8 {
        match self {
            Self::Outside { .. } => 64,
            Self::NoSuchCamera { .. } => 65,
            Self::TooFewRays { .. } => 66,
            Self::Parallel => 67,
            Self::Behind => 68,
        }
    }

    /// The error of looking up a pixel of this camera.
    pub(crate) const fn of_lookup(error: LookupError, camera: usize) -> Self {
        match error {
            LookupError::Outside => Self::Outside { camera },
            LookupError::NoSuchCamera { camera, count } => Self::NoSuchCamera { camera, count },
        }
    }
}

/// Why a point has no pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ProjectError {
    /// No pixel of the camera's calibrated area was found to see the point.
    Unseen,
    /// The blob has no such camera.
    NoSuchCamera {
        /// The index asked for.
        camera: usize,
        /// How many cameras there are.
        count: usize,
    },
}

impl ProjectError {
    /// The stable number of the error; one is that of [`LookupError`].
    pub const fn code(self) -> u8 {
        match self {
            Self::NoSuchCamera { .. } => 65,
            Self::Unseen => 69,
        }
    }
}

impl From<LookupError> for ProjectError {
    fn from(error: LookupError) -> Self {
        match error {
            LookupError::Outside => Self::Unseen,
            LookupError::NoSuchCamera { camera, count } => Self::NoSuchCamera { camera, count },
        }
    }
}

/// Why what a sensor delivers cannot be mapped to the pixels of the calibration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ReadoutError {
    /// The camera was calibrated on a sensor of another size. Nothing is ever scaled.
    WrongSensor {
        /// Columns and rows of the calibrated one.
        calibrated: [u32; 2],
        /// Columns and rows of this one.
        found: [u32; 2],
    },
    /// Nothing is read, or something beyond the sensor's edge, or a binning is zero.
    NotOnSensor,
}

impl ReadoutError {
    /// The stable number of the error.
    pub const fn code(self) -> u8 {
        match self {
            Self::WrongSensor { .. } => 70,
            Self::NotOnSensor => 71,
        }
    }
}

/// Text for people, and the trait that error chains ask for; neither is linked unless used.
macro_rules! impl_display {
    ($($error:ty),*) => {$(
        impl core::fmt::Display for $error {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                write!(f, "{self:?} (code {})", self.code())
            }
        }

        impl core::error::Error for $error {}
    )*};
}

impl_display!(
    OpenError,
    LookupError,
    MeasureError,
    ProjectError,
    ReadoutError
);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_never_change() {
        let open = [
            OpenError::Truncated { need: 0, have: 0 },
            OpenError::BadMagic { found: 0 },
            OpenError::WrongVersion {
                found: 0,
                supported: 0,
            },
            OpenError::TrailingBytes { need: 0, have: 0 },
            OpenError::BadCrc {
                stated: 0,
                computed: 0,
            },
            OpenError::Misaligned { offset: 1 },
            OpenError::BadHeader,
            OpenError::BadMeta,
            OpenError::BadPadding { at: 0 },
            OpenError::UnknownEncoding {
                camera: 0,
                found: 0,
            },
            OpenError::BadLayout {
                camera: 0,
                table: Table::Grid,
            },
            OpenError::BadNumber {
                camera: 0,
                table: Table::Mask,
            },
            OpenError::BadPair { pair: 0 },
            OpenError::BadSection { section: 0 },
            OpenError::UnknownSection { tag: 2 },
            OpenError::WrongRounding {
                found: Rounding::TowardZero,
            },
        ];
        assert!(open.iter().map(|e| e.code()).eq(1..=16));
        let left_out = OpenError::FormLeftOut {
            camera: 0,
            found: 0,
        };
        assert_eq!(left_out.code(), 17);
        assert_eq!(LookupError::Outside.code(), 64);
        assert_eq!(
            LookupError::NoSuchCamera {
                camera: 2,
                count: 2
            }
            .code(),
            65
        );
        let measure = [
            MeasureError::Outside { camera: 0 },
            MeasureError::NoSuchCamera {
                camera: 2,
                count: 2,
            },
            MeasureError::TooFewRays { have: 1 },
            MeasureError::Parallel,
            MeasureError::Behind,
        ];
        assert!(measure.iter().map(|e| e.code()).eq(64..=68));
        assert_eq!(ProjectError::Unseen.code(), 69);
        let no_camera = LookupError::NoSuchCamera {
            camera: 2,
            count: 2,
        };
        assert_eq!(ProjectError::from(no_camera).code(), no_camera.code());
        let wrong = ReadoutError::WrongSensor {
            calibrated: [1, 1],
            found: [2, 2],
        };
        assert_eq!([wrong.code(), ReadoutError::NotOnSensor.code()], [70, 71]);
    }
}
