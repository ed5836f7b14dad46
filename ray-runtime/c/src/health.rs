//! Whether the calibration still fits: the first half of `rays_device.h`, which is its documentation.

use core::ffi::c_int;
use core::mem::MaybeUninit;
use ray_device::health::{Health as Counted, Verdict};

use crate::{BAD_ARGUMENT, Measurement, NOT_OPEN, OK};

/// Memory for the gaps, owned by the caller.
#[repr(C)]
pub struct Health {
    opaque: [MaybeUninit<u32>; 224],
}

/// What lies in a [`Health`].
struct Started {
    /// [`STARTED`], or something else.
    state: u32,
    counted: Counted,
}

/// "GAPS".
const STARTED: u32 = 0x5350_4147;

const _: () = assert!(
    size_of::<Started>() <= size_of::<Health>() && align_of::<Started>() <= align_of::<Health>(),
    "the counted gaps do not fit into a rays_health: enlarge it here and in rays_device.h"
);

/// What the gaps say.
#[repr(C)]
#[derive(Default)]
pub struct Gaps {
    verdict: c_int,
    points: u32,
    mean_signed_mm: f32,
    mean_size_mm: f32,
    within_95_mm: f32,
    predicted_points: u32,
    mean_sigma_mm: f32,
    shift: f32,
    spread: f32,
}

/// Nothing measured yet.
///
/// # Safety
/// As `rays_device.h` says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rays_health_start(health: *mut Health) -> c_int {
    if health.is_null() {
        return BAD_ARGUMENT;
    }
    // SAFETY: not null, hence memory for a health, which a `Started` fits into (asserted above).
    unsafe {
        health.cast::<Started>().write(Started {
            state: STARTED,
            counted: Counted::new(),
        });
    }
    OK
}

/// Counts a point.
///
/// # Safety
/// As `rays_device.h` says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rays_health_note(
    health: *mut Health,
    measurement: *const Measurement,
) -> c_int {
    // SAFETY: null or a measurement, says the caller.
    let Some(measured) = (unsafe { measurement.as_ref() }) else {
        return BAD_ARGUMENT;
    };
    // SAFETY: null or a health that went through `rays_health_start`, which nobody else uses meanwhile.
    let Some(started) = (unsafe { health.cast::<Started>().as_mut() }) else {
        return BAD_ARGUMENT;
    };
    if started.state != STARTED {
        return NOT_OPEN;
    }
    let counted = &mut started.counted;
    counted.note_gap(measured.gap_mm, measured.gap_variance_mm2);
    OK
}

/// What has been counted.
///
/// # Safety
/// As `rays_device.h` says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rays_health_report(health: *const Health, gaps: *mut Gaps) -> c_int {
    // SAFETY: null or a health that went through `rays_health_start`, says the caller.
    let started = unsafe { health.cast::<Started>().as_ref() };
    let (Some(started), false) = (started, gaps.is_null()) else {
        return BAD_ARGUMENT;
    };
    if started.state != STARTED {
        return NOT_OPEN;
    }
    // SAFETY: not null, hence memory for gaps.
    unsafe { gaps.write(Gaps::of_rust(&started.counted)) };
    OK
}

impl Gaps {
    fn of_rust(counted: &Counted) -> Self {
        let Some(report) = counted.report() else {
            return Self::default();
        };
        let verdict = match report.verdict() {
            Verdict::NothingPredicted => 0,
            Verdict::TooFewPoints => 1,
            Verdict::Fits => 2,
            Verdict::Scattered => 3,
            Verdict::Shifted => 4,
        };
        let gaps = Self {
            verdict,
            points: report.points,
            mean_signed_mm: report.mean_signed_mm,
            mean_size_mm: report.mean_size_mm,
            within_95_mm: report.within_95_mm,
            ..Self::default()
        };
        match report.predicted {
            None => gaps,
            Some(predicted) => Self {
                predicted_points: predicted.points,
                mean_sigma_mm: predicted.mean_sigma_mm,
                shift: predicted.shift,
                spread: predicted.spread,
                ..gaps
            },
        }
    }
}
