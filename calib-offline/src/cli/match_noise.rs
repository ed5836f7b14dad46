//! How noisy the pixels of matches are, as an argument.

use ray_runtime::MatchNoise;

/// Reads a standard deviation, px.
pub(super) fn parse(text: &str) -> Result<f64, String> {
    let px: f64 = text.parse().map_err(|_| {
        "give the standard deviation of a pixel coordinate, px, such as 0.2".to_owned()
    })?;
    match in_f32(px) {
        Some(_) => Ok(px),
        None => Err(format!(
            "it must be 0 or {} to {} px",
            MatchNoise::LEAST_PX,
            MatchNoise::MOST_PX
        )),
    }
}

/// The same as blobs and devices have it; `None` out of range.
pub(super) fn in_f32(px: f64) -> Option<MatchNoise> {
    MatchNoise::from_px(px as f32)
}
