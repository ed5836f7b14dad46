//! An image's values in the least memory that holds them: a photograph of 50 million pixels is 50 MB, not 200.

use calib_rays::geometry::SensorSize;
use std::ops::Range;

/// Values, row by row.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Pixels {
    /// Whole numbers of 8 bits.
    Bytes(Vec<u8>),
    /// Multiples of a step.
    Words {
        /// How many steps.
        counts: Vec<u16>,
        /// What each is.
        step: f32,
    },
    /// Any values; what is not a number is covered.
    Float(Vec<f32>),
}

impl Pixels {
    pub fn words(counts: Vec<u16>, step: f32) -> Self {
        Self::Words { counts, step }
    }

    /// Values from 0 to `most` to a 65535th of it.
    pub fn fine(values: impl Iterator<Item = f32>, most: f32) -> Self {
        let step = most / f32::from(u16::MAX);
        Self::words(values.map(|v| (v / step).round() as u16).collect(), step)
    }

    pub fn len(&self) -> usize {
        match self {
            Self::Bytes(values) => values.len(),
            Self::Words { counts, .. } => counts.len(),
            Self::Float(values) => values.len(),
        }
    }

    #[inline]
    pub fn at(&self, index: usize) -> f32 {
        match self {
            Self::Bytes(values) => f32::from(values[index]),
            Self::Words { counts, step } => f32::from(counts[index]) * step,
            Self::Float(values) => values[index],
        }
    }

    /// The values, to be changed to any other.
    pub fn make_floats(&mut self) -> &mut [f32] {
        if !matches!(self, Self::Float(_)) {
            let values = (0..self.len()).map(|index| self.at(index)).collect();
            *self = Self::Float(values);
        }
        match self {
            Self::Float(values) => values,
            _ => &mut [],
        }
    }

    /// The values below which the given fractions of all lie.
    pub fn quantiles<const N: usize>(&self, fractions: [f64; N]) -> [f32; N] {
        let last = (self.len() - 1) as f64;
        let ranks = fractions.map(|fraction| (last * fraction.clamp(0.0, 1.0)).round() as usize);
        match self {
            Self::Bytes(values) => {
                let counts = counted::<256>(values.iter().map(|v| usize::from(*v)));
                ranks.map(|rank| ranked(&counts, rank))
            }
            Self::Words { counts, step } => {
                let counts = counted::<65536>(counts.iter().map(|v| usize::from(*v)));
                ranks.map(|rank| ranked(&counts, rank) * step)
            }
            Self::Float(values) => {
                let mut values = values.clone();
                ranks.map(|rank| *values.select_nth_unstable_by(rank, f32::total_cmp).1)
            }
        }
    }

    /// Values at some places in 8 bits, `black` and below to 0, `white` and above to 255.
    pub fn stretched(&self, black: f32, white: f32, places: Range<usize>) -> Vec<u8> {
        let scale = 255.0 / (white - black).max(f32::MIN_POSITIVE);
        // To the nearest: the conversion cuts, and stops at 0 and 255.
        let stretch = |v: f32| ((v - black) * scale + 0.5) as u8;
        match self {
            Self::Bytes(values) => {
                let table: [u8; 256] = std::array::from_fn(|v| stretch(v as f32));
                let values = values[places].iter();
                values.map(|v| table[usize::from(*v)]).collect()
            }
            Self::Words { counts, step } => {
                let counts = counts[places].iter();
                counts.map(|v| stretch(f32::from(*v) * step)).collect()
            }
            Self::Float(values) => values[places].iter().map(|v| stretch(*v)).collect(),
        }
    }

    /// The means of 2 x 2 values each, of rows of `width`, none more than `most`.
    pub fn halved(&self, width: usize, half: SensorSize, most: f32) -> Self {
        fn sums<T: Copy, S>(
            values: &[T],
            width: usize,
            half: SensorSize,
            sum: impl Fn([T; 4]) -> S,
        ) -> Vec<S> {
            let mut sums = Vec::with_capacity(half.width as usize * half.height as usize);
            for rows in values.chunks_exact(2 * width).take(half.height as usize) {
                let (upper, lower) = rows.split_at(width);
                let pairs = upper.chunks_exact(2).zip(lower.chunks_exact(2));
                sums.extend(pairs.map(|(a, b)| sum([a[0], a[1], b[0], b[1]])));
            }
            sums
        }
        match self {
            Self::Bytes(values) => {
                let sum = |four: [u8; 4]| four.map(u16::from).iter().sum();
                Self::words(sums(values, width, half, sum), 0.25)
            }
            Self::Words { counts, step } if most / step * 4.0 <= f32::from(u16::MAX) => {
                let sum = |four: [u16; 4]| four.iter().fold(0, |a: u16, b| a.saturating_add(*b));
                Self::words(sums(counts, width, half, sum), step / 4.0)
            }
            Self::Words { counts, step } => {
                let sum = |four: [u16; 4]| four.map(f32::from).iter().sum::<f32>() * (step / 4.0);
                Self::Float(sums(counts, width, half, sum))
            }
            Self::Float(values) => {
                let sum = |[a, b, c, d]: [f32; 4]| (a + b + c + d) / 4.0;
                Self::Float(sums(values, width, half, sum))
            }
        }
    }
}

/// How often each number occurs.
fn counted<const N: usize>(numbers: impl Iterator<Item = usize>) -> Vec<usize> {
    let mut counts = vec![0; N];
    for number in numbers {
        counts[number] += 1;
    }
    counts
}

/// The number with this many below it.
fn ranked(counts: &[usize], rank: usize) -> f32 {
    let mut below = 0;
    let found = counts.iter().position(|count| {
        below += count;
        below > rank
    });
    found.unwrap_or(counts.len() - 1) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_words_and_floats_give_the_same() {
        let counts: Vec<u16> = (0..35u16).map(|k| k * 97 % 251).collect();
        let bytes = Pixels::Bytes(counts.iter().map(|v| *v as u8).collect());
        let words = Pixels::words(counts.clone(), 1.0);
        let floats = Pixels::Float(counts.iter().map(|v| f32::from(*v)).collect());
        let half = SensorSize::new(3, 2);
        let all = |pixels: &Pixels| -> Vec<f32> {
            (0..pixels.len()).map(|index| pixels.at(index)).collect()
        };
        for pixels in [&bytes, &words] {
            assert_eq!(
                pixels.quantiles([0.0, 0.3, 0.995]),
                floats.quantiles([0.0, 0.3, 0.995])
            );
            assert_eq!(
                pixels.stretched(20.0, 180.0, 7..28),
                floats.stretched(20.0, 180.0, 7..28)
            );
            let quarter = |pixels: &Pixels| {
                let halved = pixels.halved(7, half, 255.0);
                all(&halved.halved(3, SensorSize::new(1, 1), 255.0))
            };
            assert_eq!(
                all(&pixels.halved(7, half, 255.0)),
                all(&floats.halved(7, half, 255.0))
            );
            assert_eq!(quarter(pixels), quarter(&floats));
        }
        // Too large to be summed in 16 bits.
        let large = Pixels::words(vec![65535; 4], 1.0);
        assert_eq!(
            large.halved(2, SensorSize::new(1, 1), 65535.0).at(0),
            65535.0
        );
        let mut covered = bytes;
        covered.make_floats()[3] = f32::NAN;
        assert!(covered.at(3).is_nan() && covered.at(4) == f32::from(counts[4]));
    }
}
