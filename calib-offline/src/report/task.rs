//! The measurement that the user means to make, and what is declared of the board, in words: for the summary
//! and the page.

use super::record::{Calibration, ExpectedError};
use crate::present::numbers::short;
use calib_judge::expected_error::Shares;

/// Facts about the expected error, each with its name; nothing without a task.
pub fn facts(calibration: &Calibration) -> Vec<(&'static str, String)> {
    let Some(found) = &calibration.task else {
        return Vec::new();
    };
    vec![
        (
            "task",
            format!(
                "length {} mm at {} mm: expected error {} mm (standard deviation), 95 % within {} mm",
                found.task.length_mm,
                found.task.distance_mm,
                short(found.sd_mm),
                short(found.error95_mm)
            ),
        ),
        ("", by_direction(found)),
        ("", format!("shares: {}", shares(&found.shares_mm))),
        ("", assumed(found)),
    ]
}

/// How the directions differ, and the worst line.
pub fn by_direction(found: &ExpectedError) -> String {
    let directions: Vec<String> = found
        .directions
        .iter()
        .map(|own| format!("{} {}", own.direction.words(), short(own.sd_mm)))
        .collect();
    let [u, v] = found.worst.middle_px;
    format!(
        "{} mm; worst line {} mm, {} at pixel ({u:.0}, {v:.0}) of the first camera",
        directions.join(", "),
        short(found.worst.sd_mm),
        found.worst.direction.words()
    )
}

fn shares(shares: &Shares) -> String {
    let rows: Vec<String> = share_rows(shares)
        .into_iter()
        .map(|(name, share)| format!("{} {share}", name.to_lowercase()))
        .collect();
    rows.join(", ")
}

/// Each share with its name.
pub fn share_rows(shares: &Shares) -> [(&'static str, String); 5] {
    let mm = |share: f64| format!("{} mm", short(share));
    let declared = |share: Option<f64>| share.map_or_else(|| "not declared".to_owned(), mm);
    [
        ("Pixel noise", mm(shares.pixel_noise)),
        ("Calibration", mm(shares.calibration)),
        ("Board's scale", declared(shares.board_scale)),
        ("Board's shape", mm(shares.board_shape)),
        ("Temperature", declared(shares.temperature)),
    ]
}

/// What it is an average of, and under which assumption.
pub fn assumed(found: &ExpectedError) -> String {
    format!(
        "RMS over {} lines at {} places of the calibrated area; pixels with noise of {} px; were the two \
         ends independent, {} mm",
        found.lines,
        found.places,
        short(found.pixel_noise_px),
        short(found.if_ends_independent_mm)
    )
}

/// What the manifest declares of the board's lengths, each with its name.
pub fn certificate(calibration: &Calibration) -> Vec<(&'static str, String)> {
    let Some(certificate) = &calibration.certificate else {
        return Vec::new();
    };
    let mut facts = Vec::new();
    if let Some(ppm) = certificate.scale_ppm_sd {
        facts.push((
            "board's scale",
            format!("standard deviation {} ppm", short(ppm)),
        ));
    }
    if let Some(mm) = certificate.flatness_mm_sd {
        facts.push(("flatness", format!("standard deviation {} mm", short(mm))));
    }
    let temperature = match (
        certificate.expansion_ppm(),
        certificate.calibrated_at_c,
        certificate.used_at_c,
    ) {
        (Some(ppm), Some(certified_c), Some(used_c)) => {
            let square_mm = calibration.board.square_mm;
            let exactness = certificate.expansion_ppm_sd().map_or_else(
                || "no standard deviation declared".to_owned(),
                |sd| format!("standard deviation {} ppm", short(sd)),
            );
            Some(format!(
                "squares of {:.6} mm at {used_c} C, corrected by {ppm:+.1} ppm from {:.6} mm at {certified_c} C ({exactness})",
                square_mm,
                square_mm / (1.0 + 1e-6 * ppm)
            ))
        }
        (None, None, None) if certificate.expansion_ppm_per_k.is_none() => None,
        _ => Some(
            "not corrected for: it takes expansion_ppm_per_k, calibrated_at_c and used_at_c"
                .to_owned(),
        ),
    };
    facts.extend(temperature.map(|words| ("temperature", words)));
    facts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::example;
    use crate::report::record::Certificate;

    #[test]
    fn squares_are_told_before_and_after_their_correction() {
        let mut calibration = example::calibration();
        calibration.certificate = None;
        assert!(certificate(&calibration).is_empty());
        calibration.board.square_mm = 10.000_27;
        let declared = Certificate {
            expansion_ppm_per_k: Some(9.0),
            calibrated_at_c: Some(20.0),
            used_at_c: Some(23.0),
            ..Certificate::default()
        };
        calibration.certificate = Some(declared);
        let facts = certificate(&calibration);
        let [(name, words)] = &facts[..] else {
            panic!("{facts:?}")
        };
        assert_eq!(*name, "temperature");
        assert!(
            words.starts_with(
                "squares of 10.000270 mm at 23 C, corrected by +27.0 ppm from 10.000000 mm at 20 C"
            ),
            "{words}"
        );
        calibration.certificate = Some(Certificate {
            used_at_c: None,
            ..declared
        });
        assert!(certificate(&calibration)[0].1.starts_with("not corrected"));
    }
}
