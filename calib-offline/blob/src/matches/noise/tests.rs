use super::*;
use split_mix::SplitMix;

/// About normal: the sum of twelve evenly spread numbers.
fn normal(random: &mut SplitMix) -> f64 {
    let spread = |random: &mut SplitMix| random.below(1 << 20) as f64 / f64::from(1 << 20);
    (0..12).map(|_| spread(random)).sum::<f64>() - 6.0
}

/// Gaps of pixels that are off by `px`, of a calibration whose share of each has the standard deviation
/// `calibration_mm`, and is the same number of it in all.
fn gaps(count: usize, px: f64, calibration_mm: f64, random: &mut SplitMix) -> Vec<Gap> {
    let shared = normal(random);
    (0..count)
        .map(|k| {
            let mm_per_px = 0.2 + 0.1 * (k % 3) as f64;
            let signed_mm = normal(random) * px * mm_per_px + shared * calibration_mm;
            Gap {
                gap_mm: signed_mm.abs(),
                calibration_mm2: calibration_mm * calibration_mm,
                mm2_per_px2: mm_per_px * mm_per_px,
            }
        })
        .collect()
}

#[test]
fn the_noise_is_found_and_lies_in_its_interval() {
    let mut random = SplitMix(13);
    let (mut covered, mut sum) = (0, 0.0);
    for _ in 0..400 {
        let found = of_gaps(&gaps(300, 0.05, 0.003, &mut random)).unwrap();
        covered += usize::from((found.low_px..=found.high_px).contains(&0.05));
        sum += found.px;
    }
    // 95 %, and the interval allows for the calibration besides; 380 -+ 4.4 of 400.
    assert!(covered >= 371, "{covered}");
    // A median of 300 is known to 1.166 / sqrt(300) = 6.7 %, the mean of 400 of them to 0.34 %; the calibration's
    // share, 0.3 of the noise's, is the same number in all gaps of a draw and no variance of them.
    assert!((sum / 400.0 / 0.05 - 1.0).abs() < 0.02, "{}", sum / 400.0);
}

#[test]
fn wrong_matches_hardly_move_it() {
    let mut random = SplitMix(5);
    let mut all = gaps(2000, 0.05, 0.0, &mut random);
    for gap in all.iter_mut().step_by(10) {
        gap.gap_mm += 5.0;
    }
    let found = of_gaps(&all).unwrap();
    // A tenth is wrong: half of all are 0.556 of the right ones, within 0.764 for 0.674 of the noise, 13 % more; and
    // chance, 1.166 / sqrt(2000) = 2.6 %.
    assert!((found.px / 0.05 - 1.13).abs() < 0.08, "{found:?}");
}

#[test]
fn gaps_that_say_nothing_are_told_from_each_other() {
    let mut random = SplitMix(1);
    assert_eq!(
        of_gaps(&gaps(99, 0.05, 0.0, &mut random)),
        Err(NoiseError::TooFew { have: 99 })
    );
    assert!(of_gaps(&gaps(100, 0.05, 0.0, &mut random)).is_ok());
    let unseen = of_gaps(&gaps(500, 0.001, 0.0, &mut random).map_calibration(0.01));
    let Err(NoiseError::NotSeen { at_most_px }) = unseen else {
        panic!("{unseen:?}");
    };
    assert!((0.001..0.0013).contains(&at_most_px), "{at_most_px}");
    for error in [
        NoiseError::NothingPredicted,
        NoiseError::TooFew { have: 3 },
        NoiseError::NotSeen { at_most_px },
    ] {
        assert!(error.remedy().is_some_and(|text| !text.is_empty()));
    }
}

trait MapCalibration {
    fn map_calibration(self, calibration_mm: f64) -> Self;
}

impl MapCalibration for Vec<Gap> {
    fn map_calibration(mut self, calibration_mm: f64) -> Self {
        for gap in &mut self {
            gap.calibration_mm2 = calibration_mm * calibration_mm;
        }
        self
    }
}
