//! A device as a source of points.

use super::DeviceError;
use calib_rays::measure::{Answers, BatchSource, Point, Sighting, Status};
use firmware_sim::client::{ClientError, DeviceClient};
use ray_device::protocol::{self, Arithmetic, Match, Refusal};
use ray_runtime::{LookupError, MatchNoise, MeasureError};

/// A device that triangulates: the bits of the blob in its flash, measured there.
#[derive(Debug)]
pub struct DeviceSource {
    client: DeviceClient,
    cameras: Vec<String>,
    noise: Option<MatchNoise>,
}

impl DeviceSource {
    /// A source of the device's active blob.
    ///
    /// # Errors
    /// [`DeviceError`] if it has none, or one whose cameras it does not all name.
    pub fn new(mut client: DeviceClient, address: &str) -> Result<Self, DeviceError> {
        let blob = client
            .status()?
            .blob
            .map_err(|open_error| DeviceError::NoBlob {
                address: address.to_owned(),
                open_error,
            })?;
        let (count, named) = (usize::from(blob.camera_count), blob.cameras.len());
        if named < count {
            return Err(DeviceError::TooManyCameras { count, named });
        }
        if count < 2 {
            return Err(DeviceError::OneCamera);
        }
        let cameras = blob.cameras.iter();
        Ok(Self {
            client,
            cameras: cameras.map(|camera| camera.name.to_string()).collect(),
            noise: None,
        })
    }

    /// The same, of a device that computes in integers and no other.
    ///
    /// # Errors
    /// [`DeviceError::NotInIntegers`].
    pub fn in_integers(mut self, address: &str) -> Result<Self, DeviceError> {
        if self.client.status()?.arithmetic == Arithmetic::Integer {
            return Ok(self);
        }
        Err(DeviceError::NotInIntegers {
            address: address.to_owned(),
        })
    }

    /// The same, of pixels that are as noisy as this, whatever the device's blob says of them.
    #[must_use]
    pub fn with_noise(mut self, noise: Option<MatchNoise>) -> Self {
        self.noise = noise;
        self
    }
}

impl BatchSource for DeviceSource {
    type Number = f32;
    type Error = DeviceError;

    fn cameras(&self) -> Vec<String> {
        self.cameras.clone()
    }

    fn points(&mut self, matches: &[[Sighting<f32>; 2]]) -> Result<Answers<f32>, DeviceError> {
        let matches = on_wire(matches);
        let measured = match self.noise {
            None => self.client.measure(&matches)?,
            Some(noise) => {
                let measured = self.client.measure_noisy(&matches, noise);
                measured.map_err(|error| match error {
                    ClientError::Refused(Refusal::UnknownMessage) => DeviceError::NoMatchNoise,
                    error => error.into(),
                })?
            }
        };
        let answers = measured.into_iter().map(|answer| match answer.outcome {
            Ok(found) => Ok(Ok(Point {
                point_mm: found.point_mm,
                // Correctly rounded, as the runtime's own root: the same bits.
                gap_mm: found.gap_squared_mm2.sqrt(),
                sigma_mm: found.sigma_mm,
            })),
            Err(code) => match status(code) {
                Some(status) => Ok(Err(status)),
                None => Err(DeviceError::UnknownOutcome { code }),
            },
        });
        answers.collect()
    }
}

/// Matches as they travel, numbered from 0.
pub fn on_wire(matches: &[[Sighting<f32>; 2]]) -> Vec<Match> {
    let sighting = |(camera_idx, [u_px, v_px]): Sighting<f32>| protocol::Sighting {
        // A blob has 64 cameras at most.
        camera: u8::try_from(camera_idx).unwrap_or(u8::MAX),
        u_px,
        v_px,
    };
    (0..)
        .zip(matches)
        .map(|(id, [first, second])| Match {
            id,
            first: sighting(*first),
            second: sighting(*second),
        })
        .collect()
}

/// Why there is no point, by the runtime's code.
fn status(code: u8) -> Option<Status> {
    [
        (LookupError::Outside.code(), Status::Outside),
        (MeasureError::Parallel.code(), Status::Parallel),
        (MeasureError::Behind.code(), Status::Behind),
    ]
    .into_iter()
    .find_map(|(known, status)| (known == code).then_some(status))
}
