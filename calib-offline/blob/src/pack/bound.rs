//! The smallest blob that holds a bound: chosen by a sample of the pixels, proven by all.

use super::aligned_bytes::AlignedBytes;
use super::error::PackError;
use super::packed::{Packed, PackedTable};
use super::proof::Proof;
use super::settings::PackSettings;
use super::{encode, proof, search, self_test, uncertainty};
use calib_rays::field::Rig;
use calib_rays::in_order;
use ray_runtime::format::{MAX_CELLS, MAX_EXTENT_PX};
use ray_runtime::{MatchNoise, RayBlob};

/// Packs a rig.
///
/// # Errors
/// Any [`PackError`]; [`PackError::BoundNotReached`] says what would have been possible.
pub fn pack(rig: &Rig, settings: &PackSettings) -> Result<Packed, PackError> {
    check(rig, settings)?;
    let distance_mm = settings.working_distance_mm;
    let mut bounds_px = vec![settings.max_error_px; rig.cameras.len()];
    let choose = |camera, bound_px: &f64| search::choose(camera, settings, *bound_px);
    let mut chosen = in_order::try_map(0..rig.cameras.len(), |idx| {
        choose(&rig.cameras[idx], &bounds_px[idx])
    })?;

    let frame = rig.frame();
    let mut parts = encode::BlobParts {
        identity: settings.identity,
        frame: &frame,
        max_error_px: settings.max_error_px as f32,
        working_distance_mm: distance_mm as f32,
        self_tests: Vec::new(),
        pairs: Vec::new(),
        match_noise: match_noise(rig)?,
    };
    // The search looked at a sample of the pixels. Now all, and quarter pixels along the edge; for a
    // camera that fails, the search starts over with a tighter bound.
    let proofs = loop {
        let bytes = parts.encode(rig, chosen.iter().map(|choice| &choice.table))?;
        let bytes = AlignedBytes::from(bytes.as_slice());
        let blob = RayBlob::open(&bytes)?;
        let prove = |idx: usize| {
            let camera = &rig.cameras[idx];
            proof::prove(camera, &blob, idx, distance_mm, 1).merged(proof::prove_edges(
                camera,
                &blob,
                idx,
                distance_mm,
            ))
        };
        let proofs: Vec<Proof> = (0..rig.cameras.len()).map(prove).collect();
        let mut is_proven = true;
        for (idx, camera) in rig.cameras.iter().enumerate() {
            let worst_px = proofs[idx].worst_error_px;
            if worst_px > settings.max_error_px {
                bounds_px[idx] *= TIGHTER * settings.max_error_px / worst_px;
                if bounds_px[idx] < LEAST_SHARE * settings.max_error_px {
                    return Err(PackError::BoundNotReached {
                        camera: camera.name.clone(),
                        wanted_px: settings.max_error_px,
                        best_px: worst_px,
                        cells: chosen[idx].table.cells,
                    });
                }
                chosen[idx] = choose(camera, &bounds_px[idx])?;
                is_proven = false;
            }
        }
        if is_proven {
            break proofs;
        }
    };

    let tables = || chosen.iter().map(|choice| &choice.table);
    let pairs = if settings.with_uncertainty {
        uncertainty::choose(rig, distance_mm, |sections| {
            parts.pairs = sections.to_vec();
            parts.encode(rig, tables())
        })?
    } else {
        Vec::new()
    };
    let worst_error_px = proofs
        .iter()
        .fold(0.0, |worst, p| p.worst_error_px.max(worst));
    parts.max_error_px = encode::rounded_up(worst_error_px);
    let unasked = AlignedBytes::from(parts.encode(rig, tables())?.as_slice());
    parts.self_tests = self_test::ask(rig, &RayBlob::open(&unasked)?, distance_mm);
    let bytes = parts.encode(rig, tables())?;
    RayBlob::open(&AlignedBytes::from(bytes.as_slice()))?
        .run_self_tests()
        .map_err(PackError::SelfTest)?;

    let tried: Vec<_> = chosen
        .iter()
        .map(|choice| choice.tried.as_slice())
        .collect();
    let curve = search::curve(&tried);
    let tables: Vec<PackedTable> = rig
        .cameras
        .iter()
        .zip(chosen)
        .zip(proofs)
        .map(|((camera, choice), proof)| PackedTable {
            camera: camera.name.clone(),
            encoding: choice.table.encoding,
            cells: choice.table.cells,
            bytes: choice.table.bytes.len(),
            proof,
            tried: choice.tried,
        })
        .collect();
    let worst_mm = tables.iter().map(|table| table.proof.worst_error_mm);
    Ok(Packed {
        bytes,
        worst_error_px,
        worst_error_mm: worst_mm.fold(0.0, f64::max),
        tables,
        pairs,
        curve,
    })
}

/// By how much the bound of a search is tightened beyond what the worst pixel asks for.
const TIGHTER: f64 = 0.98;
/// A search whose bound fell below this share of the one asked for is given up.
const LEAST_SHARE: f64 = 0.2;

/// How noisy matches are, as a blob can say it.
fn match_noise(rig: &Rig) -> Result<Option<MatchNoise>, PackError> {
    let Some(value) = rig.match_noise_px else {
        return Ok(None);
    };
    let noise = MatchNoise::from_px(value as f32);
    noise.map(Some).ok_or(PackError::MatchNoise { px: value })
}

/// Settings and sizes, before anything is computed.
fn check(rig: &Rig, settings: &PackSettings) -> Result<(), PackError> {
    for (setting, value) in [
        ("max_error_px", settings.max_error_px),
        ("working_distance_mm", settings.working_distance_mm),
    ] {
        if !(value > 0.0 && value.is_finite()) {
            return Err(PackError::BadSetting { setting, value });
        }
    }
    for camera in &rig.cameras {
        let (sensor, mask) = (camera.field.sensor, &camera.coverage);
        let is_extent = |extent| (1..=MAX_EXTENT_PX).contains(&extent);
        if !(is_extent(sensor.width) && is_extent(sensor.height)) {
            return Err(PackError::SensorSize {
                camera: camera.name.clone(),
                sensor,
            });
        }
        let is_count = |cells| (1..=MAX_CELLS as usize).contains(&cells);
        if mask.sensor != sensor
            || !is_count(mask.cells_u)
            || !is_count(mask.cells_v)
            || mask.covered.len() != mask.cells_u * mask.cells_v
        {
            return Err(PackError::Mask {
                camera: camera.name.clone(),
                mask: mask.sensor,
                sensor,
                cells_u: mask.cells_u,
                cells_v: mask.cells_v,
            });
        }
        if !mask.covered.contains(&true) {
            return Err(PackError::NothingCalibrated {
                camera: camera.name.clone(),
            });
        }
    }
    Ok(())
}
