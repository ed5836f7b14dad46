//! The tables of `dataset.toml` as they are read, before anything is checked.

use crate::dataset::description::ExpectedOptics;
use serde::Deserialize;
use toml::Spanned;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawManifest {
    pub dataset: Option<RawDataset>,
    pub board: Option<Spanned<RawBoard>>,
    #[serde(default)]
    pub camera: Vec<Spanned<RawCamera>>,
    pub stage: Option<RawStage>,
    pub poses: Option<RawPoses>,
    pub target: Option<Spanned<RawTarget>>,
    pub recording: Option<RawRecording>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawDataset {
    #[serde(default)]
    pub exclude: Vec<Spanned<usize>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawBoard {
    pub kind: Option<Spanned<String>>,
    pub rows: Option<Spanned<i64>>,
    pub cols: Option<Spanned<i64>>,
    pub square_mm: Option<Spanned<f64>>,
    pub square_height_mm: Option<Spanned<f64>>,
    pub marked: Option<Spanned<Vec<Spanned<Vec<i64>>>>>,
    pub marker_mm: Option<Spanned<f64>>,
    pub dictionary: Option<Spanned<String>>,
    pub legacy: Option<Spanned<bool>>,
    pub first_id: Option<Spanned<i64>>,
    pub tag_mm: Option<Spanned<f64>>,
    pub spacing: Option<Spanned<f64>>,
    pub family: Option<Spanned<String>>,
    pub border_bits: Option<Spanned<i64>>,
    pub pitch_mm: Option<Spanned<f64>>,
    pub diameter_mm: Option<Spanned<f64>>,
    pub asymmetric: Option<Spanned<bool>>,
    pub direction: Option<Spanned<Vec<Spanned<Vec<i64>>>>>,
    pub outer_radius_mm: Option<Spanned<f64>>,
    pub direction_outer_radius_mm: Option<Spanned<f64>>,
    pub certificate: Option<RawCertificate>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawCertificate {
    pub scale_ppm_sd: Option<Spanned<f64>>,
    pub flatness_mm_sd: Option<Spanned<f64>>,
    pub expansion_ppm_per_k: Option<Spanned<f64>>,
    pub expansion_ppm_per_k_sd: Option<Spanned<f64>>,
    pub calibrated_at_c: Option<Spanned<f64>>,
    pub used_at_c: Option<Spanned<f64>>,
    pub used_at_c_sd: Option<Spanned<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawRecording {
    pub name: Option<String>,
    pub by: Option<String>,
    pub date: Option<Spanned<String>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawCamera {
    pub name: Option<Spanned<String>>,
    pub width: Option<Spanned<i64>>,
    pub height: Option<Spanned<i64>>,
    pub images: Option<Spanned<String>>,
    pub image_list: Option<Spanned<Vec<String>>>,
    pub target_images: Option<Spanned<String>>,
    pub optics: Option<ExpectedOptics>,
    pub serial: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawStage {
    pub angles_deg: Option<Spanned<Vec<f64>>>,
    pub placement: Option<Spanned<Vec<usize>>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawPoses {
    pub known: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawTarget {
    pub kind: Option<Spanned<String>>,
    pub rows: Option<Spanned<i64>>,
    pub cols: Option<Spanned<i64>>,
    pub pitch_mm: Option<Spanned<f64>>,
    pub outer_radius_mm: Option<Spanned<f64>>,
    pub direction_outer_radius_mm: Option<Spanned<f64>>,
    pub direction: Option<Spanned<Vec<Spanned<Vec<i64>>>>>,
}
