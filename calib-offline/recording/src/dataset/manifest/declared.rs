//! `[board.certificate]` and `[recording]`: what the user declares beside what was recorded.

use super::error::ManifestError;
use super::raw::{RawCertificate, RawRecording};
use super::source::Source;
use crate::dataset::description::{Certificate, RecordingSpec};
use toml::Spanned;

/// Coldest and hottest that a board can be meant to be, degrees Celsius.
const TEMPERATURE_C: (f64, f64) = (-273.15, 1000.0);
/// Least and most that a solid can be meant to expand, parts per million and kelvin.
const EXPANSION_PPM_PER_K: (f64, f64) = (-100.0, 300.0);

/// Standard deviations must not be negative, temperatures must be such.
pub(super) fn certificate(
    source: &Source,
    raw: RawCertificate,
) -> Result<Certificate, ManifestError> {
    let within = |value: Option<Spanned<f64>>, key: &'static str, (least, most): (f64, f64)| {
        let Some(value) = value else { return Ok(None) };
        let line = source.line_of(&value);
        let value = value.into_inner();
        if value >= least && value <= most {
            return Ok(Some(value));
        }
        Err(ManifestError::Certificate {
            file: source.file.clone(),
            line,
            key,
            value,
            least,
            most,
        })
    };
    let deviation = (0.0, f64::MAX);
    Ok(Certificate {
        scale_ppm_sd: within(raw.scale_ppm_sd, "scale_ppm_sd", deviation)?,
        flatness_mm_sd: within(raw.flatness_mm_sd, "flatness_mm_sd", deviation)?,
        expansion_ppm_per_k: within(
            raw.expansion_ppm_per_k,
            "expansion_ppm_per_k",
            EXPANSION_PPM_PER_K,
        )?,
        expansion_ppm_per_k_sd: within(
            raw.expansion_ppm_per_k_sd,
            "expansion_ppm_per_k_sd",
            deviation,
        )?,
        calibrated_at_c: within(raw.calibrated_at_c, "calibrated_at_c", TEMPERATURE_C)?,
        used_at_c: within(raw.used_at_c, "used_at_c", TEMPERATURE_C)?,
        used_at_c_sd: within(raw.used_at_c_sd, "used_at_c_sd", deviation)?,
    })
}

/// The date must be one.
pub(super) fn recording(
    source: &Source,
    raw: RawRecording,
) -> Result<RecordingSpec, ManifestError> {
    if let Some(date) = &raw.date
        && !is_date(date.get_ref())
    {
        return Err(ManifestError::Date {
            file: source.file.clone(),
            line: source.line_of(date),
            text: date.get_ref().chars().take(40).collect(),
        });
    }
    Ok(RecordingSpec {
        name: raw.name,
        by: raw.by,
        date: raw.date.map(Spanned::into_inner),
    })
}

/// Whether the text is `year-month-day`, with a month and a day that there can be.
fn is_date(text: &str) -> bool {
    let parts: Vec<&str> = text.split('-').collect();
    let [year, month, day] = parts[..] else {
        return false;
    };
    let number = |text: &str, digits: usize| {
        (text.len() == digits && text.bytes().all(|b| b.is_ascii_digit()))
            .then(|| text.parse::<u32>().ok())
            .flatten()
    };
    number(year, 4).is_some()
        && number(month, 2).is_some_and(|m| (1..=12).contains(&m))
        && number(day, 2).is_some_and(|d| (1..=31).contains(&d))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_year_month_day() {
        assert!(is_date("2026-11-30"));
        for wrong in [
            "30.11.2026",
            "2026-13-01",
            "2026-1-1",
            "2026-11-32",
            "2026-11",
        ] {
            assert!(!is_date(wrong), "{wrong}");
        }
    }
}
