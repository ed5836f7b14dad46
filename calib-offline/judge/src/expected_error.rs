//! What a user's measurement can be expected to be off by, and what makes it up (METHOD 5.1).

use super::task::Task;
use super::working_volume::lattice;
use calib_estimate::joint::{Ends, Estimate, EstimateError, LengthVariance};
use calib_rays::field::Rig;
use calib_rays::geometry::PixelPoint;
use calib_rays::remedy::Remedy;
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How much coarser than the check of the calibration the lattice of places is: about fifty.
const COARSER: f64 = 1.4;
/// Of a Gaussian 95 % lie within so many standard deviations.
pub const SIGMAS_OF_95_PERCENT: f64 = 1.96;

/// What the data do not say of a measurement's errors, one standard deviation each; `None` where nobody says.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Declared {
    /// Of the board's scale, parts per million.
    pub scale_ppm_sd: Option<f64>,
    /// Of the correction for the board's temperature, parts per million.
    pub temperature_ppm_sd: Option<f64>,
    /// Of the pixels of matches, px; they count as noisy as the corners.
    pub match_noise_px: Option<f64>,
}

/// Why there is no expected error.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TaskError {
    /// A method without a covariance.
    #[error("this method does not know how uncertain it is")]
    NoCovariance,
    /// One camera.
    #[error("a length takes two cameras, and there is one")]
    OneCamera,
    /// No board was there.
    #[error(
        "no board was recorded at {distance_mm} mm from the first camera: they were at {least_mm:.0} to {most_mm:.0} mm"
    )]
    NotCovered {
        /// The distance asked for.
        distance_mm: f64,
        /// To the nearest corner.
        least_mm: f64,
        /// To the farthest.
        most_mm: f64,
    },
    /// Too long.
    #[error(
        "no length of {length_mm} mm at {distance_mm} mm lies in what two cameras are calibrated for"
    )]
    NoPlace {
        /// The length asked for.
        length_mm: f64,
        /// The distance asked for.
        distance_mm: f64,
    },
    /// No covariance.
    #[error(transparent)]
    Estimate(#[from] EstimateError),
}

impl TaskError {
    /// Whether the request can be met, and the data cannot.
    pub fn is_undetermined(&self) -> bool {
        !matches!(self, Self::NoCovariance | Self::OneCamera)
    }
}

impl Remedy for TaskError {
    fn remedy(&self) -> Option<String> {
        let text = match self {
            Self::NoCovariance => "leave --method out: the joint estimate knows",
            Self::OneCamera => "calibrate two cameras together; a single one gives rays only",
            Self::NotCovered { .. } => {
                "ask for a distance between these, or record boards where you mean to measure"
            }
            Self::NoPlace { .. } => {
                "ask for a shorter length, or record boards up to the edges of both images"
            }
            Self::Estimate(_) => "record more poses of the board",
        };
        Some(text.to_owned())
    }
}

/// How a length lies, seen from the first camera: along an axis of its image, along its optical axis, or along
/// one of the four diagonals between the three.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Direction {
    /// Along u.
    AlongU,
    /// Along v.
    AlongV,
    /// Away from the camera.
    Depth,
    /// Between all three.
    Diagonal,
}

impl Direction {
    /// All, in the order in which they are told.
    pub const ALL: [Self; 4] = [Self::AlongU, Self::AlongV, Self::Depth, Self::Diagonal];

    /// In words.
    pub const fn words(self) -> &'static str {
        match self {
            Self::AlongU => "along u",
            Self::AlongV => "along v",
            Self::Depth => "in depth",
            Self::Diagonal => "diagonal",
        }
    }
}

/// The seven lines through a place, frame of the first camera.
fn seven_lines() -> [(Direction, Vector3<f64>); 7] {
    let diagonal = |x: f64, y: f64| (Direction::Diagonal, Vector3::new(x, y, 1.0) / 3.0f64.sqrt());
    [
        (Direction::AlongU, Vector3::x()),
        (Direction::AlongV, Vector3::y()),
        (Direction::Depth, Vector3::z()),
        diagonal(1.0, 1.0),
        diagonal(1.0, -1.0),
        diagonal(-1.0, 1.0),
        diagonal(-1.0, -1.0),
    ]
}

/// What makes up an error, standard deviations, mm. They are independent: their squares add up.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Shares {
    /// Noise of the measured pixels.
    pub pixel_noise: f64,
    /// What the calibration leaves open of rays and cameras.
    pub calibration: f64,
    /// Scale of the board; `None` where its certificate does not say.
    pub board_scale: Option<f64>,
    /// Shape of the board, as far as the calibration leaves it open.
    pub board_shape: f64,
    /// Temperature of the board; `None` where its certificate does not say.
    pub temperature: Option<f64>,
}

impl Shares {
    fn of(variance: &LengthVariance, noise_px2: f64, declared: &Declared, length_mm: f64) -> Self {
        let by_ppm = |ppm: f64| ppm * 1e-6 * length_mm;
        Self {
            pixel_noise: (variance.per_px2 * noise_px2).sqrt(),
            calibration: variance.calibration_mm2.sqrt(),
            board_scale: declared.scale_ppm_sd.map(by_ppm),
            board_shape: variance.board_shape_mm2.sqrt(),
            temperature: declared.temperature_ppm_sd.map(by_ppm),
        }
    }

    /// All together, mm.
    pub fn total_mm(&self) -> f64 {
        let known = [self.pixel_noise, self.calibration, self.board_shape];
        let declared = [self.board_scale, self.temperature];
        let squares = known.iter().chain(declared.iter().flatten());
        squares.map(|share| share * share).sum::<f64>().sqrt()
    }

    /// RMS of each over some; the total of it is the RMS of their totals.
    fn rms(all: &[&Self]) -> Self {
        let rms = |of: &dyn Fn(&Self) -> f64| {
            let sum: f64 = all.iter().map(|shares| of(shares).powi(2)).sum();
            (sum / all.len().max(1) as f64).sqrt()
        };
        let declared = |of: &dyn Fn(&Self) -> Option<f64>| {
            let first = all.first().and_then(|shares| of(shares));
            first.map(|_| rms(&|shares| of(shares).unwrap_or(0.0)))
        };
        Self {
            pixel_noise: rms(&|shares| shares.pixel_noise),
            calibration: rms(&|shares| shares.calibration),
            board_scale: declared(&|shares| shares.board_scale),
            board_shape: rms(&|shares| shares.board_shape),
            temperature: declared(&|shares| shares.temperature),
        }
    }
}

/// What is expected of lines of one direction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OfDirection {
    /// Which.
    pub direction: Direction,
    /// Lines.
    pub lines: usize,
    /// RMS of their standard deviations, mm.
    pub sd_mm: f64,
}

/// The line that is known worst.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct WorstLine {
    /// How it lies.
    pub direction: Direction,
    /// Where the first camera sees its middle, px.
    pub middle_px: [f64; 2],
    /// Standard deviation, mm.
    pub sd_mm: f64,
    /// 95 % of errors are smaller, mm.
    pub error95_mm: f64,
}

/// The expected error of a measurement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ExpectedError {
    /// What was asked for.
    #[serde(flatten)]
    pub task: Task,
    /// RMS over all lines of the standard deviation, mm.
    pub sd_mm: f64,
    /// 95 % of errors are smaller, mm.
    pub error95_mm: f64,
    /// The worst line.
    pub worst: WorstLine,
    /// What makes up `sd_mm`.
    pub shares_mm: Shares,
    /// What `sd_mm` would be, did the calibration's errors of the two ends not go together, mm.
    pub if_ends_independent_mm: f64,
    /// By direction; those that fit nowhere are left out.
    pub directions: Vec<OfDirection>,
    /// Places in the calibrated area where at least one line was asked for.
    pub places: usize,
    /// Lines asked for.
    pub lines: usize,
    /// Noise of the measured pixels that was assumed: as declared, else that of the corners, px.
    pub pixel_noise_px: f64,
}

struct Line {
    direction: Direction,
    place: usize,
    middle: PixelPoint,
    ends: Ends,
}

/// The expected error of a task: over a lattice of places in the calibrated area at its distance, and
/// seven directions at each: the axes of the first camera and the four diagonals. A line counts if both ends are
/// seen by the first camera and another one, in the calibrated area.
///
/// Cost: two assemblies of the equations, and eight solutions for each of some three hundred lines.
///
/// # Errors
/// [`TaskError`] if no board stood at that distance, or if no such line lies in the calibrated area.
pub fn expected_error(
    estimate: &Estimate,
    rig: &Rig,
    task: &Task,
    declared: &Declared,
) -> Result<ExpectedError, TaskError> {
    if rig.cameras.len() < 2 {
        return Err(TaskError::OneCamera);
    }
    check_distance(estimate, rig, task.distance_mm)?;
    let lines = lines(rig, task);
    let ends: Vec<Ends> = lines.iter().map(|line| line.ends).collect();
    let variances = estimate.length_variances(rig, &ends)?;
    let noise_px2 = declared
        .match_noise_px
        .map_or_else(|| estimate.pixel_variance_px2(), |px| px * px);
    let found: Vec<(&Line, LengthVariance, Shares)> = lines
        .iter()
        .zip(variances)
        .filter_map(|(line, variance)| {
            let variance = variance?;
            let shares = Shares::of(&variance, noise_px2, declared, task.length_mm);
            Some((line, variance, shares))
        })
        .collect();
    let worst = found
        .iter()
        .max_by(|a, b| a.2.total_mm().total_cmp(&b.2.total_mm()));
    let Some((worst, _, worst_shares)) = worst else {
        return Err(TaskError::NoPlace {
            length_mm: task.length_mm,
            distance_mm: task.distance_mm,
        });
    };
    let of = |keep: &dyn Fn(&Line) -> bool| -> Vec<&Shares> {
        let kept = found.iter().filter(|(line, ..)| keep(line));
        kept.map(|(_, _, shares)| shares).collect()
    };
    let shares_mm = Shares::rms(&of(&|_| true));
    let sd_mm = shares_mm.total_mm();
    // Only the calibration's part is another.
    let mean = |of: &dyn Fn(&LengthVariance) -> f64| {
        found.iter().map(|(_, v, _)| of(v)).sum::<f64>() / found.len() as f64
    };
    let together = mean(&|v| v.calibration_mm2 + v.board_shape_mm2);
    let apart = mean(&|v| v.if_independent_mm2);
    let mut places: Vec<usize> = found.iter().map(|(line, ..)| line.place).collect();
    places.dedup();
    let directions = Direction::ALL.into_iter().filter_map(|direction| {
        let own = of(&|line| line.direction == direction);
        (!own.is_empty()).then(|| OfDirection {
            direction,
            lines: own.len(),
            sd_mm: Shares::rms(&own).total_mm(),
        })
    });
    Ok(ExpectedError {
        task: *task,
        sd_mm,
        error95_mm: SIGMAS_OF_95_PERCENT * sd_mm,
        worst: WorstLine {
            direction: worst.direction,
            middle_px: [worst.middle.u, worst.middle.v],
            sd_mm: worst_shares.total_mm(),
            error95_mm: SIGMAS_OF_95_PERCENT * worst_shares.total_mm(),
        },
        shares_mm,
        if_ends_independent_mm: (sd_mm * sd_mm - together + apart).max(0.0).sqrt(),
        directions: directions.collect(),
        places: places.len(),
        lines: found.len(),
        pixel_noise_px: noise_px2.sqrt(),
    })
}

/// Corners of boards must have stood nearer and farther than that.
fn check_distance(estimate: &Estimate, rig: &Rig, distance_mm: f64) -> Result<(), TaskError> {
    let place = rig.cameras[0].rig_from_camera.translation_mm;
    let poses = estimate.rig_from_board();
    let (mut least_mm, mut most_mm) = (f64::INFINITY, 0.0_f64);
    let views = estimate.observations.views.iter();
    for (view, weights) in views.zip(&estimate.robust_weights) {
        for (corner, weight) in view.corners.iter().zip(weights) {
            if *weight > 0.0 {
                let point = poses[view.pose_idx].point(&corner.point_in_board);
                let from_camera_mm = (point - place).norm();
                least_mm = least_mm.min(from_camera_mm);
                most_mm = most_mm.max(from_camera_mm);
            }
        }
    }
    if distance_mm < least_mm || distance_mm > most_mm {
        return Err(TaskError::NotCovered {
            distance_mm,
            least_mm,
            most_mm,
        });
    }
    Ok(())
}

/// All lines that both cameras of a pair see, place by place. Of several other cameras the first that sees both
/// ends counts.
fn lines(rig: &Rig, task: &Task) -> Vec<Line> {
    let mut lines = Vec::new();
    let [first, others @ ..] = &rig.cameras[..] else {
        return lines;
    };
    let places = lattice(&first.coverage, COARSER);
    for (place, pixel) in places.into_iter().enumerate() {
        let Some(ray) = first.ray_in_rig(pixel) else {
            continue;
        };
        let middle = ray.origin_mm + ray.direction.normalize() * task.distance_mm;
        for (direction, along) in seven_lines() {
            let half = first.rig_from_camera.rotation * along * (task.length_mm / 2.0);
            let points = [middle - half, middle + half];
            let ends = (1..=others.len()).find_map(|second| {
                let [a, b] = points.map(|point| seen_by_both(rig, second, &point));
                Some([a?, b?])
            });
            if let Some(ends) = ends {
                lines.push(Line {
                    direction,
                    place,
                    middle: pixel,
                    ends,
                });
            }
        }
    }
    lines
}

/// Where the first camera and another one see a point (rig frame), if both are calibrated there.
fn seen_by_both(
    rig: &Rig,
    second: usize,
    point: &Vector3<f64>,
) -> Option<[(usize, PixelPoint); 2]> {
    let seen = |camera_idx: usize| {
        let camera = &rig.cameras[camera_idx];
        let in_camera = camera.rig_from_camera.inverse().point(point);
        let pixel = camera.field.project(&in_camera)?;
        camera
            .coverage
            .contains(pixel)
            .then_some((camera_idx, pixel))
    };
    Some([seen(0)?, seen(second)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terms_of_the_certificate_are_proportional_to_the_length() {
        let variance = LengthVariance {
            length_mm: 250.0,
            calibration_mm2: 0.0,
            board_shape_mm2: 0.0,
            per_px2: 0.0,
            if_independent_mm2: 0.0,
        };
        let board = Declared {
            scale_ppm_sd: Some(30.0),
            temperature_ppm_sd: Some(40.0),
            match_noise_px: None,
        };
        let shares = Shares::of(&variance, 1.0, &board, 250.0);
        // 30 and 40 millionths of 250 mm, and a right triangle.
        assert_eq!(shares.board_scale, Some(250.0 * (30.0 * 1e-6)));
        assert!((shares.board_scale.unwrap() - 0.0075).abs() < 1e-15);
        assert!((shares.temperature.unwrap() - 0.01).abs() < 1e-15);
        assert!((shares.total_mm() - 0.0125).abs() < 1e-15);
        let none = Shares::of(&variance, 1.0, &Declared::default(), 250.0);
        assert_eq!((none.board_scale, none.temperature), (None, None));
        assert_eq!(none.total_mm(), 0.0);
    }

    #[test]
    fn shares_of_many_lines_add_up_in_squares() {
        let shares = |calibration: f64, pixel_noise: f64| Shares {
            pixel_noise,
            calibration,
            board_scale: Some(0.5),
            board_shape: 0.25,
            temperature: None,
        };
        let all = [shares(1.0, 2.0), shares(3.0, 0.5), shares(0.2, 0.7)];
        let rms = Shares::rms(&all.iter().collect::<Vec<_>>());
        let mean: f64 = all.iter().map(|s| s.total_mm().powi(2)).sum::<f64>() / 3.0;
        assert!((rms.total_mm() - mean.sqrt()).abs() < 1e-14);
        assert_eq!(rms.temperature, None);
        assert!((rms.board_scale.unwrap() - 0.5).abs() < 1e-15);
    }
}
