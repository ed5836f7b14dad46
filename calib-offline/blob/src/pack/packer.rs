//! The smallest blob that holds a bound: chosen by a sample of the pixels, proven by all.

use super::aligned_bytes::AlignedBytes;
use super::error::PackError;
use super::integers::Integers;
use super::packed::{Packed, PackedTable};
use super::proof::Proof;
use super::settings::PackSettings;
use super::table::Table;
use super::trials::{TableKey, Trials};
use super::work::Work;
use super::{curve, encode, search, self_test, uncertainty};
use calib_rays::field::Rig;
use calib_rays::in_order;
use calib_rays::progress::Progress;
use ray_runtime::format::{MAX_CELLS, MAX_EXTENT_PX};
use ray_runtime::{MatchNoise, RayBlob};
use rayon::prelude::*;

/// Packs one rig, for any number of bounds: what was tried and proven for one is known for the next.
pub struct Packer<'a> {
    rig: &'a Rig,
    settings: PackSettings,
    cameras: Vec<Trials<'a>>,
    progress: &'a dyn Progress,
}

/// A camera's table and the comparison of every pixel with it.
struct Chosen {
    table: Table,
    proof: Proof,
}

impl<'a> Packer<'a> {
    /// For a rig; `progress` is advanced by every table tried and every few rows of pixels proven.
    ///
    /// # Errors
    /// What is wrong with the rig and the settings as they stand.
    pub fn new(
        rig: &'a Rig,
        settings: &PackSettings,
        progress: &'a dyn Progress,
    ) -> Result<Self, PackError> {
        check(rig, settings)?;
        let cameras = in_order::try_map(&rig.cameras, |camera| {
            Trials::new(camera, settings, progress)
        })?;
        Ok(Self {
            rig,
            settings: *settings,
            cameras,
            progress,
        })
    }

    /// As if earlier bounds had left every camera only so many steps of fits, and so many pixels of proofs.
    #[cfg(test)]
    pub(super) fn leave(&mut self, fit_steps: u64, proven_px: u64) {
        for trials in &mut self.cameras {
            trials.work.fit_steps = super::work::MOST_FIT_STEPS - fit_steps;
            trials.work.proven_px = super::work::most_proven_px(trials.calibrated_px()) - proven_px;
        }
    }

    /// The settings.
    pub(super) fn settings(&self) -> &PackSettings {
        &self.settings
    }

    /// Packs within a bound, px.
    ///
    /// # Errors
    /// Any [`PackError`]; [`PackError::BoundNotReached`] says what would have been possible.
    pub fn within(&mut self, max_error_px: f64) -> Result<Packed, PackError> {
        let prefer = self.settings.prefer;
        let mut bounds_px = vec![max_error_px; self.cameras.len()];
        let mut chosen = in_order::try_map(self.cameras.par_iter_mut(), |trials| {
            search::choose(trials, prefer, max_error_px, max_error_px)
        })?;
        // The search looked at a sample of the pixels. Now all, and quarter pixels along the edge; for a
        // camera that fails, the search starts over with a tighter bound.
        loop {
            let tables = self.tables(&chosen)?;
            let bytes =
                AlignedBytes::from(self.parts()?.encode(self.rig, tables.iter())?.as_slice());
            let blob = RayBlob::open(&bytes)?;
            let mut proofs = Vec::new();
            let mut is_proven = true;
            for (idx, trials) in self.cameras.iter_mut().enumerate() {
                let Some(proof) = trials.prove(chosen[idx], (&blob, idx), max_error_px) else {
                    chosen[idx] = proven_instead(trials, max_error_px)?;
                    is_proven = false;
                    continue;
                };
                let worst_px = proof.worst_error_px;
                if worst_px > max_error_px {
                    bounds_px[idx] *= TIGHTER * max_error_px / worst_px;
                    if bounds_px[idx] < LEAST_SHARE * max_error_px {
                        return Err(PackError::BoundNotReached {
                            camera: trials.camera.name.clone(),
                            wanted_px: max_error_px,
                            best_px: worst_px,
                            cells: tables[idx].cells,
                        });
                    }
                    chosen[idx] = search::choose(trials, prefer, bounds_px[idx], max_error_px)?;
                    is_proven = false;
                }
                proofs.push(proof);
            }
            if is_proven {
                let both = tables.into_iter().zip(proofs);
                return self.finished(both.map(|(table, proof)| Chosen { table, proof }).collect());
            }
        }
    }

    /// Packs the tables that turned out best so far, whatever they hold.
    ///
    /// # Errors
    /// Any [`PackError`]; [`PackError::BoundNotReached`] if there is nothing but what the runtime refuses.
    pub(super) fn best(&mut self) -> Result<Packed, PackError> {
        let not_reached = |trials: &Trials<'_>, cells| PackError::BoundNotReached {
            camera: trials.camera.name.clone(),
            wanted_px: self.settings.max_error_px,
            best_px: f64::INFINITY,
            cells,
        };
        let mut keys = Vec::new();
        for trials in &self.cameras {
            let proven = trials.best_proven().map(|(key, _)| key);
            let best = proven.or(trials.best_tried().map(|(key, _)| key));
            keys.push(best.ok_or_else(|| not_reached(trials, [0, 0]))?);
        }
        let tables = self.tables(&keys)?;
        let bytes = AlignedBytes::from(self.parts()?.encode(self.rig, tables.iter())?.as_slice());
        let blob = RayBlob::open(&bytes)?;
        let mut chosen = Vec::new();
        for ((idx, trials), table) in self.cameras.iter_mut().enumerate().zip(tables) {
            let proof = trials.prove(keys[idx], (&blob, idx), f64::INFINITY);
            let proof = proof.filter(|proof| proof.worst_error_px.is_finite());
            let proof = proof.ok_or_else(|| PackError::BoundNotReached {
                camera: trials.camera.name.clone(),
                wanted_px: self.settings.max_error_px,
                best_px: f64::INFINITY,
                cells: table.cells,
            })?;
            chosen.push(Chosen { table, proof });
        }
        self.finished(chosen)
    }

    fn tables(&mut self, keys: &[TableKey]) -> Result<Vec<Table>, PackError> {
        let both = self.cameras.iter_mut().zip(keys);
        both.map(|(trials, key)| trials.table(*key)).collect()
    }

    /// What stands in the blob besides the tables, before anything is known of them.
    fn parts(&self) -> Result<encode::BlobParts, PackError> {
        Ok(encode::BlobParts {
            identity: self.settings.identity,
            frame: self.rig.frame(),
            max_error_px: self.settings.max_error_px as f32,
            working_distance_mm: self.settings.working_distance_mm as f32,
            self_tests: Vec::new(),
            pairs: Vec::new(),
            match_noise: match_noise(self.rig)?,
            arithmetic: None,
        })
    }

    /// The blob of proven tables.
    fn finished(&self, chosen: Vec<Chosen>) -> Result<Packed, PackError> {
        let (rig, distance_mm) = (self.rig, self.settings.working_distance_mm);
        let mut parts = self.parts()?;
        let tables = || chosen.iter().map(|chosen| &chosen.table);
        let pairs = if self.settings.with_uncertainty {
            uncertainty::choose(rig, distance_mm, |sections| {
                parts.pairs = sections.to_vec();
                parts.encode(rig, tables())
            })?
        } else {
            Vec::new()
        };
        let worst_error_px = chosen
            .iter()
            .fold(0.0, |worst, chosen| chosen.proof.worst_error_px.max(worst));
        parts.max_error_px = encode::rounded_up(worst_error_px);
        let unasked = AlignedBytes::from(parts.encode(rig, tables())?.as_slice());
        parts.self_tests = self_test::ask(rig, &RayBlob::open(&unasked)?, distance_mm);
        let integer_error_px = if self.settings.with_integers {
            let unproven = AlignedBytes::from(parts.encode(rig, tables())?.as_slice());
            let proven =
                Integers::prove(rig, &RayBlob::open(&unproven)?, distance_mm, self.progress)?;
            parts.arithmetic = Some(proven.content);
            Some(proven.error_px)
        } else {
            None
        };
        let bytes = parts.encode(rig, tables())?;
        RayBlob::open(&AlignedBytes::from(bytes.as_slice()))?
            .run_self_tests()
            .map_err(PackError::SelfTest)?;

        let tried: Vec<_> = self.cameras.iter().map(Trials::tried).collect();
        let curve = curve::curve(&tried.iter().map(Vec::as_slice).collect::<Vec<_>>());
        let work = self
            .cameras
            .iter()
            .fold(Work::default(), |sum, trials| sum.with(trials.work));
        let tables: Vec<PackedTable> = rig
            .cameras
            .iter()
            .zip(chosen)
            .zip(tried)
            .map(|((camera, chosen), tried)| PackedTable {
                camera: camera.name.clone(),
                encoding: chosen.table.encoding,
                cells: chosen.table.cells,
                bytes: chosen.table.bytes.len(),
                proof: chosen.proof,
                tried,
            })
            .collect();
        let worst_mm = tables.iter().map(|table| table.proof.worst_error_mm);
        Ok(Packed {
            bytes,
            worst_error_px,
            integer_error_px,
            worst_error_mm: worst_mm.fold(0.0, f64::max),
            tables,
            pairs,
            curve,
            work,
        })
    }
}

/// The smallest table that is proven to hold a bound, where no more can be proven.
fn proven_instead(trials: &Trials<'_>, max_error_px: f64) -> Result<TableKey, PackError> {
    trials.smallest_proven(max_error_px).ok_or_else(|| {
        let best = trials.best_proven();
        PackError::BoundNotReached {
            camera: trials.camera.name.clone(),
            wanted_px: max_error_px,
            best_px: best.map_or(f64::INFINITY, |(_, proof)| proof.worst_error_px),
            cells: best.map_or([0, 0], |(key, _)| key.cells()),
        }
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
