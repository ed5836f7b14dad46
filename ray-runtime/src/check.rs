//! Single checks that opening a blob is made of.

use crate::OpenError;
#[cfg(feature = "integer")]
use crate::format::Arithmetic;
use crate::format::{
    self, ALIGNMENT, Axis, CameraMeta, HEADER_LEN, Header, MAGIC, MAX_CAMERAS, MAX_EXTENT_PX,
    MAX_SECTIONS, Messages, OLDEST_VERSION, SECTIONS_SINCE, Section, SelfTest, VERSION, tag,
};
use crate::match_noise::MatchNoise;
use crate::uncertainty::Pair;
use crate::vector::Vector;

/// The header, if magic and version are right.
pub(crate) fn recognized_header(bytes: &[u8]) -> Result<Header, OpenError> {
    let (magic, header) = Header::read(bytes).ok_or(OpenError::Truncated {
        need: HEADER_LEN as u32,
        have: bytes.len() as u32,
    })?;
    if magic != MAGIC {
        return Err(OpenError::BadMagic {
            found: u32::from_le_bytes(magic),
        });
    }
    if !(OLDEST_VERSION..=VERSION).contains(&header.version) {
        return Err(OpenError::WrongVersion {
            found: header.version,
            supported: VERSION,
        });
    }
    Ok(header)
}

/// The header of bytes that have the length and the checksum it states. The checksum is computed, unless
/// that of all bytes is known.
pub(crate) fn checked_header(bytes: &[u8], crc_of_all: Option<u32>) -> Result<Header, OpenError> {
    let header = recognized_header(bytes)?;
    let (need, have) = (
        header.total_len,
        u32::try_from(bytes.len()).unwrap_or(u32::MAX),
    );
    if have < need {
        return Err(OpenError::Truncated { need, have });
    }
    if have > need {
        return Err(OpenError::TrailingBytes { need, have });
    }
    let computed = match crc_of_all {
        Some(crc) => format::checksum_from_all(bytes, crc),
        None => format::checksum(bytes),
    };
    let computed = computed.ok_or(OpenError::BadHeader)?;
    if computed != header.crc {
        return Err(OpenError::BadCrc {
            stated: header.crc,
            computed,
        });
    }
    if usize::from(header.header_len) != HEADER_LEN
        || (header.version == 1 && header.pair_count != 0)
        || !bytes.len().is_multiple_of(ALIGNMENT)
        || !(1..=MAX_CAMERAS).contains(&header.camera_count)
    {
        return Err(OpenError::BadHeader);
    }
    Ok(header)
}

/// Checks that the bytes from `start` to `end` are there and zero.
#[inline(never)]
pub(crate) fn check_padding(bytes: &[u8], start: usize, end: usize) -> Result<(), OpenError> {
    bytes
        .get(start..end)
        .filter(|padding| padding.iter().all(|byte| *byte == 0))
        .map(|_| ())
        .ok_or(OpenError::BadPadding { at: start as u32 })
}

/// Checks that there are as many pairs as stated from `start` on, in order; where they end.
pub(crate) fn check_pairs(
    bytes: &[u8],
    start: usize,
    count: u16,
    camera_count: u16,
) -> Result<usize, OpenError> {
    let mut rest = bytes.get(start..).ok_or(OpenError::BadHeader)?;
    let mut last = None;
    for index in 0..count {
        let bad = OpenError::BadPair { pair: index };
        let (pair, after) = Pair::read(rest).ok_or(bad)?;
        // In ascending order no pair stands there twice.
        let cameras = pair.header.cameras;
        if !pair.is_valid(camera_count) || last.is_some_and(|last| last >= cameras) {
            return Err(bad);
        }
        last = Some(cameras);
        let from = bytes.len().saturating_sub(rest.len());
        let to = bytes.len().saturating_sub(after.len());
        check_padding(bytes, from.saturating_add(pair.header.section_len()), to)?;
        rest = after;
    }
    Ok(bytes.len().saturating_sub(rest.len()))
}

/// What sections say that this version knows.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Known {
    /// Of [`tag::MATCH_NOISE`].
    pub match_noise: Option<MatchNoise>,
}

/// Checks the sections from `start` to the end of the blob; what those say that are known.
#[inline(never)]
pub(crate) fn check_sections(bytes: &[u8], start: usize, version: u16) -> Result<Known, OpenError> {
    let mut known = Known { match_noise: None };
    let mut at = start;
    let mut last_tag = 0;
    for index in 0..=MAX_SECTIONS {
        let rest = bytes.get(at..).unwrap_or_default();
        if rest.is_empty() {
            break;
        }
        if version < SECTIONS_SINCE {
            return Err(OpenError::BadHeader);
        }
        let bad = OpenError::BadSection { section: index };
        let (section, behind) = Section::read(rest).ok_or(bad)?;
        // In ascending order none stands there twice, and none has the tag 0.
        if index == MAX_SECTIONS || section.header.tag <= last_tag {
            return Err(bad);
        }
        last_tag = section.header.tag;
        let end = bytes.len().saturating_sub(behind.len());
        at = format::aligned(end);
        check_padding(bytes, end, at)?;
        match section.header.tag {
            tag::MATCH_NOISE => known.match_noise = Some(section.match_noise().ok_or(bad)?),
            // Checked by itself, and only by those who use it.
            tag::ARITHMETIC if cfg!(feature = "integer") => {}
            tag if section.header.is_required => return Err(OpenError::UnknownSection { tag }),
            _ => {}
        }
    }
    Ok(known)
}

/// What the sections from `start` on, which were checked, say of the arithmetic of integers: as many numbers as the self-tests
/// of rays and matches ask for.
#[cfg(feature = "integer")]
pub(crate) fn check_arithmetic(
    bytes: &[u8],
    start: usize,
    self_tests: impl Iterator<Item = SelfTest>,
) -> Result<Option<Arithmetic<'_>>, OpenError> {
    let mut at = start;
    for index in 0..MAX_SECTIONS {
        let Some((section, behind)) = bytes.get(at..).and_then(Section::read) else {
            break;
        };
        if section.header.tag == tag::ARITHMETIC {
            let numbers: usize = self_tests.map(|test| test.answer_len()).sum();
            return Arithmetic::read(section.content)
                .filter(|arithmetic| arithmetic.answers.len() == numbers)
                .map(Some)
                .ok_or(OpenError::BadSection { section: index });
        }
        at = format::aligned(bytes.len().saturating_sub(behind.len()));
    }
    Ok(None)
}

/// Checks that there are as many self-tests as stated, of cameras that exist and of pairs whose
/// uncertainty is known where they ask for it, and nothing else.
pub(crate) fn check_self_tests(
    mut messages: Messages<'_>,
    count: u16,
    camera_count: u16,
    is_known_pair: impl Fn([u16; 2]) -> bool,
) -> Result<(), OpenError> {
    for _ in 0..count {
        let test = messages.self_test().ok_or(OpenError::BadMeta)?;
        let has_cameras = match test {
            SelfTest::Ray { camera, .. } => camera < camera_count,
            SelfTest::Pair { cameras, .. } => cameras.iter().all(|c| *c < camera_count),
            SelfTest::Sigma { cameras, .. } => is_known_pair(cameras),
        };
        if !has_cameras {
            return Err(OpenError::BadMeta);
        }
    }
    if messages.rest.is_empty() {
        Ok(())
    } else {
        Err(OpenError::BadMeta)
    }
}

/// Whether the calibrated region lies on the sensor and neither is too large.
pub(crate) fn is_region_on_sensor(meta: &CameraMeta<'_>) -> bool {
    let fits = |first: u32, extent: u32, sensor: u32| {
        sensor <= MAX_EXTENT_PX && extent >= 1 && first <= sensor && extent <= sensor - first
    };
    fits(meta.region_u, meta.region_width, meta.sensor_width)
        && fits(meta.region_v, meta.region_height, meta.sensor_height)
}

/// Whether the working numbers are the same to the last bit.
pub(crate) fn same_bits(a: Axis, b: Axis) -> bool {
    let (a, b) = (a.to_numbers(), b.to_numbers());
    a.iter().zip(&b).all(|(a, b)| a.to_bits() == b.to_bits())
}

/// Whether the rows are orthonormal and right-handed to within the round-off of f32 entries.
pub(crate) fn is_rotation([a, b, c, d, e, f, g, h, i]: [f32; 9]) -> bool {
    const TOLERANCE: f32 = 1e-5;
    let [x, y, z] = [[a, b, c], [d, e, f], [g, h, i]].map(Vector::from);
    // NaN is near nothing.
    let is_near = |value: f32, goal: f32| (goal - TOLERANCE..=goal + TOLERANCE).contains(&value);
    is_near(x.norm_squared(), 1.0)
        && is_near(y.norm_squared(), 1.0)
        && is_near(z.norm_squared(), 1.0)
        && is_near(x.dot(y), 0.0)
        && is_near(y.dot(z), 0.0)
        && is_near(z.dot(x), 0.0)
        && is_near(x.cross(y).dot(z), 1.0)
}
