//! How well the ratio of two methods' errors is known: boards drawn anew, both methods together.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

/// Draws; the ends of a 95 % interval then scatter by some 2 % of its width.
const DRAWS: usize = 4000;
/// The same draws every time.
const SEED: u64 = 1;
/// Share of the draws that lies below the interval, and above it.
const TAIL: f64 = 0.025;

/// Ratio of two RMS errors on the same boards.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Ratio {
    /// Error of the method over that of the reference.
    pub ratio: f64,
    /// Lower end of the 95 % interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Boards that it is from.
    pub boards: usize,
}

/// The ratio of the RMS of `own` to that of `reference`, errors per board, with the interval that
/// 95 % of the draws fall in when boards are drawn with replacement. Boards are what is independent;
/// the errors of one board share its pose and its corner of the image.
///
/// `None` with fewer than 2 boards, or if the reference has no errors.
pub fn ratio(own: &[&[f64]], reference: &[&[f64]]) -> Option<Ratio> {
    let squares = |errors: &[f64]| errors.iter().map(|e| e * e).sum::<f64>();
    let boards: Vec<[f64; 2]> = own
        .iter()
        .zip(reference)
        .filter(|(own, reference)| !own.is_empty() && own.len() == reference.len())
        .map(|(own, reference)| [squares(own), squares(reference)])
        .collect();
    let of = |[own, reference]: [f64; 2]| (own / reference).sqrt();
    let sum = |[a, b]: [f64; 2], [c, d]: &[f64; 2]| [a + c, b + d];
    let all = of(boards.iter().fold([0.0; 2], sum));
    if boards.len() < 2 || !all.is_finite() {
        return None;
    }
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let mut drawn: Vec<f64> = (0..DRAWS)
        .map(|_| {
            let draws = (0..boards.len()).map(|_| &boards[rng.random_range(0..boards.len())]);
            of(draws.fold([0.0; 2], sum))
        })
        .collect();
    drawn.sort_by(f64::total_cmp);
    let at = |share: f64| drawn[((DRAWS as f64 * share) as usize).min(DRAWS - 1)];
    Some(Ratio {
        ratio: all,
        low: at(TAIL),
        high: at(1.0 - TAIL),
        boards: boards.len(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_distr::StandardNormal;

    fn ratio_of(own: &[Vec<f64>], reference: &[Vec<f64>]) -> Option<Ratio> {
        let slices = |boards: &[Vec<f64>]| -> Vec<Vec<f64>> { boards.to_vec() };
        let (own, reference) = (slices(own), slices(reference));
        let own: Vec<&[f64]> = own.iter().map(Vec::as_slice).collect();
        let reference: Vec<&[f64]> = reference.iter().map(Vec::as_slice).collect();
        ratio(&own, &reference)
    }

    #[test]
    fn a_common_factor_has_no_uncertainty() {
        let reference: Vec<Vec<f64>> = (1..9).map(|k| vec![f64::from(k); 3]).collect();
        let own: Vec<Vec<f64>> = reference
            .iter()
            .map(|board| board.iter().map(|e| 0.5 * e).collect())
            .collect();
        let found = ratio_of(&own, &reference).unwrap();
        assert!((found.ratio - 0.5).abs() < 1e-15);
        assert!((found.low - 0.5).abs() < 1e-12 && (found.high - 0.5).abs() < 1e-12);
        assert_eq!(found.boards, 8);
    }

    #[test]
    fn the_interval_covers_the_truth_as_often_as_it_says() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut covered = 0;
        for _ in 0..200 {
            // 30 boards of 40 errors; the method's are 0.9 of the reference's, plus noise of its own.
            let (mut own, mut reference) = (Vec::new(), Vec::new());
            for _ in 0..30 {
                let mut normal = || rng.sample::<f64, _>(StandardNormal);
                let errors: Vec<f64> = (0..40).map(|_| normal()).collect();
                own.push(
                    errors
                        .iter()
                        .map(|e| 0.9 * (0.8 * e + 0.6 * normal()))
                        .collect(),
                );
                reference.push(errors);
            }
            let found = ratio_of(&own, &reference).unwrap();
            covered += usize::from((found.low..found.high).contains(&0.9));
        }
        // Binomial of 200 x 0.95, +- 3 standard deviations of 3, and a bootstrap of 30 is some 2 %
        // too narrow.
        assert!((176..=199).contains(&covered), "{covered}");
    }

    #[test]
    fn without_boards_or_errors_there_is_no_ratio() {
        assert_eq!(ratio_of(&[], &[]), None);
        assert_eq!(ratio_of(&[vec![1.0]], &[vec![1.0]]), None);
        let zero = vec![vec![0.0]; 3];
        assert_eq!(ratio_of(&zero, &zero), None);
        // Boards that one of both does not measure are left out.
        let own = vec![vec![1.0], vec![], vec![1.0]];
        let reference = vec![vec![2.0], vec![5.0], vec![2.0]];
        assert_eq!(ratio_of(&own, &reference).unwrap().boards, 2);
    }
}
