//! A blob opened in place: everything is checked once, nothing is copied.

use crate::camera::Camera;
use crate::camera_check::CameraCheck;
#[cfg(feature = "integer")]
use crate::check::check_arithmetic;
use crate::check::{
    check_padding, check_pairs, check_sections, check_self_tests, checked_header,
    is_region_on_sensor, recognized_header,
};
#[cfg(feature = "integer")]
use crate::format::Arithmetic;
use crate::format::{
    self, ALIGNMENT, CameraMeta, HEADER_LEN, IDENTITY_LEN, Messages, PairHeader, RECORD_LEN,
    RECORD_WORDS, Record,
};
use crate::lookup::Views;
use crate::match_noise::MatchNoise;
use crate::rounding::wrong_rounding;
use crate::self_test::SelfTests;
use crate::triangulate::{self, Triangulation};
use crate::uncertainty::{Measurement, Pair};
use crate::{LookupError, MeasureError, OpenError, PixelPoint, Ray, lookup};

/// A rig's ray fields, borrowed from the bytes they lie in.
///
/// It can only be made by [`RayBlob::open`], which checks everything; a lookup therefore needs no
/// other check than whether the pixel is in the calibrated area.
#[derive(Debug, Clone, Copy)]
pub struct RayBlob<'a> {
    views: Views<'a>,
    records: &'a [[u32; RECORD_WORDS]],
    identity: &'a [u8; IDENTITY_LEN],
    frame: &'a str,
    written_by: &'a str,
    camera_meta: Messages<'a>,
    self_tests: Messages<'a>,
    self_test_count: u16,
    pair_bytes: &'a [u8],
    match_noise: Option<MatchNoise>,
    max_error_px: f32,
    working_distance_mm: f32,
    #[cfg(feature = "integer")]
    arithmetic: Option<Arithmetic<'a>>,
}

impl<'a> RayBlob<'a> {
    /// Checks the bytes and borrows them. They must start on a multiple of 8
    /// ([`Aligned`](crate::Aligned)) and hold the blob and nothing more.
    ///
    /// The cost is one pass of the checksum and one over the numbers; nothing is copied.
    ///
    /// # Errors
    /// Any [`OpenError`]. A blob that was cut short or had a bit changed is always refused.
    pub fn open(bytes: &'a [u8]) -> Result<Self, OpenError> {
        Self::open_checked(bytes, None)
    }

    /// [`RayBlob::open`] for whoever has just computed zlib's CRC-32 of *all* `bytes`, such as a device that read
    /// them through its flash driver: `crc_of_all`. The checksum that the blob states, which leaves out the four
    /// bytes where it stands, follows from that in some thousand instructions, and the pass over the bytes is saved.
    ///
    /// # Errors
    /// Any [`OpenError`]; [`OpenError::BadCrc`] also where the bytes are right and `crc_of_all` is not theirs.
    pub fn open_with_crc_of_all(bytes: &'a [u8], crc_of_all: u32) -> Result<Self, OpenError> {
        Self::open_checked(bytes, Some(crc_of_all))
    }

    fn open_checked(bytes: &'a [u8], crc_of_all: Option<u32>) -> Result<Self, OpenError> {
        let header = checked_header(bytes, crc_of_all)?;
        let misalignment = bytes.as_ptr().addr() % ALIGNMENT;
        if misalignment != 0 {
            return Err(OpenError::Misaligned {
                offset: misalignment as u8,
            });
        }
        // Before any number is checked against what it should be.
        if let Some(found) = wrong_rounding() {
            return Err(OpenError::WrongRounding { found });
        }
        let pairs = bytemuck::try_cast_slice(bytes).map_err(|_| OpenError::BadHeader)?;
        let meta_end = HEADER_LEN.saturating_add(header.meta_len as usize);
        let meta_bytes = bytes
            .get(HEADER_LEN..meta_end)
            .ok_or(OpenError::BadHeader)?;
        let records_start = format::aligned(meta_end);
        let records_len = usize::from(header.camera_count) * RECORD_LEN;
        let tables_start = records_start.saturating_add(records_len);
        let records = bytes
            .get(records_start..tables_start)
            .ok_or(OpenError::BadHeader)?;
        let records = bytemuck::try_cast_slice(records).map_err(|_| OpenError::BadHeader)?;
        check_padding(bytes, meta_end, records_start)?;

        let mut messages = Messages { rest: meta_bytes };
        let meta = messages.meta().ok_or(OpenError::BadMeta)?;
        let blob = Self {
            views: Views { bytes, pairs },
            records,
            identity: meta.identity.try_into().map_err(|_| OpenError::BadMeta)?,
            frame: meta.frame,
            written_by: meta.written_by,
            camera_meta: messages,
            self_tests: Messages { rest: &[] },
            self_test_count: meta.self_test_count,
            pair_bytes: &[],
            match_noise: None,
            max_error_px: meta.max_error_px,
            working_distance_mm: meta.working_distance_mm,
            #[cfg(feature = "integer")]
            arithmetic: None,
        };
        let is_positive = |x: f32| x > 0.0 && x.is_finite();
        if !(is_positive(meta.max_error_px) && is_positive(meta.working_distance_mm)) {
            return Err(OpenError::BadMeta);
        }
        let (self_tests, pairs_start) = blob.check_cameras(tables_start, header.version)?;
        let pairs_end = check_pairs(bytes, pairs_start, header.pair_count, header.camera_count)?;
        let pair_bytes = bytes.get(pairs_start..pairs_end);
        let known = check_sections(bytes, pairs_end, header.version)?;
        let blob = Self {
            self_tests,
            pair_bytes: pair_bytes.ok_or(OpenError::BadHeader)?,
            match_noise: known.match_noise,
            ..blob
        };
        check_self_tests(
            self_tests,
            meta.self_test_count,
            header.camera_count,
            |cameras| blob.pair(cameras.map(usize::from)).is_some(),
        )?;
        #[cfg(feature = "integer")]
        let blob = Self {
            arithmetic: check_arithmetic(bytes, pairs_end, blob.self_tests())?,
            ..blob
        };
        Ok(blob)
    }

    /// Length that the header states, bytes, if magic and version are right: how much of a longer
    /// slice (a flash sector) to give to [`RayBlob::open`]. Nothing else is checked.
    ///
    /// # Errors
    /// [`OpenError::Truncated`] below the size of a header, [`OpenError::BadMagic`],
    /// [`OpenError::WrongVersion`].
    pub fn stated_len(bytes: &[u8]) -> Result<u32, OpenError> {
        Ok(recognized_header(bytes)?.total_len)
    }

    /// How many cameras there are.
    pub const fn camera_count(&self) -> usize {
        self.records.len()
    }

    /// What the blob says of a camera; `None` if there is no such camera.
    pub fn camera(&self, camera: usize) -> Option<Camera<'a>> {
        let record = Record(self.records.get(camera)?);
        let meta = self.camera_metas().nth(camera)?;
        Some(Camera::new(&meta, record))
    }

    /// The index of the camera with this name.
    pub fn camera_index(&self, name: &str) -> Option<usize> {
        self.camera_metas().position(|meta| meta.name == name)
    }

    /// First 16 bytes of the hash that identifies the calibration.
    pub const fn identity(&self) -> &'a [u8; IDENTITY_LEN] {
        self.identity
    }

    /// The frame of rays and points, in words.
    pub const fn frame(&self) -> &'a str {
        self.frame
    }

    /// Program and version that wrote the blob.
    pub const fn written_by(&self) -> &'a str {
        self.written_by
    }

    /// No pixel in the calibrated area is further than this from the field that was packed, px.
    pub const fn max_error_px(&self) -> f32 {
        self.max_error_px
    }

    /// The distance for which [`max_error_px`](Self::max_error_px) holds if a camera is not
    /// central, mm.
    pub const fn working_distance_mm(&self) -> f32 {
        self.working_distance_mm
    }

    /// What the packer has proven of the arithmetic of integers ([`integer`](crate::integer)), if the blob says so.
    #[cfg(feature = "integer")]
    pub const fn arithmetic(&self) -> Option<Arithmetic<'a>> {
        self.arithmetic
    }

    /// How noisy the pixels of matches are, if the blob says so; else they are taken to be as exact as the
    /// corners of the calibration.
    pub const fn match_noise(&self) -> Option<MatchNoise> {
        self.match_noise
    }

    /// Length of the blob, bytes.
    pub const fn len(&self) -> usize {
        self.views.bytes.len()
    }

    /// Whether the blob has no bytes: never.
    pub const fn is_empty(&self) -> bool {
        self.views.bytes.is_empty()
    }

    /// Questions whose answers' bits are known.
    pub const fn self_tests(&self) -> SelfTests<'a> {
        SelfTests {
            messages: self.self_tests,
            left: self.self_test_count,
        }
    }

    /// What the pixel of a camera sees, rig frame.
    ///
    /// # Errors
    /// [`LookupError::Outside`], [`LookupError::NoSuchCamera`].
    pub fn lookup(&self, camera: usize, pixel: PixelPoint) -> Result<Ray, LookupError> {
        self.ray((camera, pixel))
    }

    /// [`RayBlob::lookup`] where it is called: rays that stay in registers are not copied.
    #[inline(always)]
    fn ray(&self, (camera, pixel): (usize, PixelPoint)) -> Result<Ray, LookupError> {
        self.views.lookup(self.record(camera)?, pixel)
    }

    /// Whether the pixel of a camera has a ray.
    pub fn is_calibrated(&self, camera: usize, pixel: PixelPoint) -> bool {
        self.record(camera)
            .is_ok_and(|record| lookup::is_calibrated(self.views.bytes, record, pixel))
    }

    /// The point that two cameras see: the midpoint of the common perpendicular of their rays.
    ///
    /// # Errors
    /// Any [`MeasureError`] but `TooFewRays`.
    pub fn triangulate(
        &self,
        a: (usize, PixelPoint),
        b: (usize, PixelPoint),
    ) -> Result<Triangulation, MeasureError> {
        let ray_a = self
            .ray(a)
            .map_err(|error| MeasureError::of_lookup(error, a.0))?;
        let ray_b = self
            .ray(b)
            .map_err(|error| MeasureError::of_lookup(error, b.0))?;
        Ok(triangulate::meet(&ray_a, &ray_b)?.found)
    }

    /// [`RayBlob::triangulate`] with the covariance of the point, rig frame. The cameras may come in
    /// either order. The pixels are taken to be as noisy as [`match_noise`](Self::match_noise) says.
    ///
    /// The point's bits are those of `triangulate`. It costs about four of them, as the
    /// rays are looked up with their derivatives. Whoever does not call it has none of it linked but
    /// what checks the blob.
    ///
    /// # Errors
    /// Those of `triangulate`.
    pub fn triangulate_with_covariance(
        &self,
        a: (usize, PixelPoint),
        b: (usize, PixelPoint),
    ) -> Result<Measurement, MeasureError> {
        self.measure(a, b, self.match_noise)
    }

    /// [`RayBlob::triangulate_with_covariance`] of pixels that are as noisy as `noise`, whatever the blob
    /// says of them.
    ///
    /// # Errors
    /// Those of `triangulate`.
    pub fn triangulate_with_noise(
        &self,
        a: (usize, PixelPoint),
        b: (usize, PixelPoint),
        noise: MatchNoise,
    ) -> Result<Measurement, MeasureError> {
        self.measure(a, b, Some(noise))
    }

    /// `noise` is that of the calibration's corners where it is none.
    #[inline(never)]
    fn measure(
        &self,
        a: (usize, PixelPoint),
        b: (usize, PixelPoint),
        noise: Option<MatchNoise>,
    ) -> Result<Measurement, MeasureError> {
        let (ray_a, ray_b) = (self.moving_sighting(a)?, self.moving_sighting(b)?);
        let meeting = triangulate::meet(&ray_a.ray, &ray_b.ray)?;
        let [lambda_a, lambda_b] = meeting.lambda;
        let covariance = self.pair([a.0, b.0]).and_then(|(pair, is_swapped)| {
            let rays = (&ray_a.ray, &ray_b.ray);
            let by_a = meeting.by_shifts_of_first(rays.0, rays.1, ray_a.shifts_at(lambda_a));
            let by_b = meeting.by_shifts_of_second(rays.0, rays.1, ray_b.shifts_at(lambda_b));
            let (pixel, by_first, by_second) = if is_swapped {
                (b.1, by_b, by_a)
            } else {
                (a.1, by_a, by_b)
            };
            let ([u1, v1], [u2, v2]) = (by_first, by_second);
            pair.covariance(
                pixel,
                &[u1, v1, u2, v2],
                // Of the other sign with the cameras in the other order, as squares alone are taken.
                meeting.gap_by_pixels(&by_first, &by_second),
                meeting.gap_scale(),
                noise,
            )
        });
        Ok(Measurement {
            found: meeting.found,
            is_second_above: meeting.is_along_normal,
            covariance,
        })
    }

    /// The pairs of cameras whose uncertainty the blob carries.
    pub fn uncertain_pairs(&self) -> impl Iterator<Item = PairHeader> {
        self.pairs().map(|pair| pair.header)
    }

    /// The point nearest to the rays of any number of cameras, by least squares. Two give the
    /// bits of [`RayBlob::triangulate`].
    ///
    /// Nothing is stored, so each ray is looked up about five times if there are more than two. A sighting is a
    /// camera and a pixel, or whatever becomes such a pair.
    ///
    /// # Errors
    /// Any [`MeasureError`].
    pub fn triangulate_many<S: Copy + Into<(usize, PixelPoint)>>(
        &self,
        sightings: &[S],
    ) -> Result<Triangulation, MeasureError> {
        triangulate::triangulate_many(sightings.len(), |k| match sightings.get(k) {
            Some(&sighting) => self.sighting(sighting.into()),
            None => Err(MeasureError::TooFewRays { have: k }),
        })
    }

    fn sighting(&self, (camera, pixel): (usize, PixelPoint)) -> Result<Ray, MeasureError> {
        self.lookup(camera, pixel)
            .map_err(|error| MeasureError::of_lookup(error, camera))
    }

    fn moving_sighting(
        &self,
        (camera, pixel): (usize, PixelPoint),
    ) -> Result<lookup::MovingRay, MeasureError> {
        self.record(camera)
            .and_then(|record| {
                if lookup::is_calibrated(self.views.bytes, record, pixel) {
                    self.views().lookup_moving(record, pixel)
                } else {
                    Err(LookupError::Outside)
                }
            })
            .map_err(|error| MeasureError::of_lookup(error, camera))
    }

    /// The uncertainty of two cameras, and whether they stand in the other order there.
    fn pair(&self, cameras: [usize; 2]) -> Option<(Pair<'a>, bool)> {
        let [a, b] = cameras;
        self.pairs().find_map(|pair| {
            let known = pair.header.cameras.map(usize::from);
            (known == [a, b] || known == [b, a]).then_some((pair, known != [a, b]))
        })
    }

    fn pairs(&self) -> impl Iterator<Item = Pair<'a>> + use<'a> {
        let mut rest = self.pair_bytes;
        core::iter::from_fn(move || {
            let (pair, after) = Pair::read(rest)?;
            rest = after;
            Some(pair)
        })
    }

    pub(crate) const fn views(&self) -> Views<'a> {
        self.views
    }

    pub(crate) fn record(&self, camera: usize) -> Result<Record<'a>, LookupError> {
        self.records
            .get(camera)
            .map(Record)
            .ok_or(LookupError::NoSuchCamera {
                camera,
                count: self.records.len(),
            })
    }

    fn camera_metas(&self) -> impl Iterator<Item = CameraMeta<'a>> {
        let mut messages = self.camera_meta;
        self.records.iter().map_while(move |_| messages.camera())
    }

    /// Checks every camera and its tables; what is left of the metadata behind the cameras, and
    /// where the tables end.
    fn check_cameras(
        &self,
        tables_start: usize,
        version: u16,
    ) -> Result<(Messages<'a>, usize), OpenError> {
        let mut messages = self.camera_meta;
        let mut end = tables_start;
        for (camera, words) in self.records.iter().enumerate() {
            let meta = messages.camera().ok_or(OpenError::BadMeta)?;
            let is_first = self.camera_index(meta.name) == Some(camera);
            if meta.name.is_empty() || !is_first || !is_region_on_sensor(&meta) {
                return Err(OpenError::BadMeta);
            }
            let check = CameraCheck {
                views: self.views(),
                camera: camera as u16,
                record: Record(words),
                version,
            };
            end = check.run(&meta, end)?;
        }
        Ok((messages, end))
    }
}
