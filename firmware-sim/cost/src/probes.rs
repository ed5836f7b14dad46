//! What the counting images do, whatever they run on: every piece of work between two looks at a counter, for every
//! match of the job.

use core::cell::RefCell;
use core::hint::black_box;

use ray_runtime::integer::{FixedPixel, Rig};
use ray_runtime::{PixelPoint, Ray, RayBlob, Row, format, triangulate_pair};

use crate::counting::{Job, Probe, ROW_LEN, Record, WRAPPED, job_start};

/// What a probe works on.
#[derive(Debug)]
pub struct Task<'a> {
    bytes: &'a [u8],
    blob: RayBlob<'a>,
    job: Job<'a>,
    cameras: [usize; 2],
    pixels: [PixelPoint; 2],
    /// What the arithmetic of integers works on; `None` of a blob that it cannot look up.
    integers: Option<Rig<'a, 2>>,
    fixed: [FixedPixel; 2],
    rays: RefCell<[Ray; ROW_LEN]>,
}

/// A piece of work; whether it came to a result.
pub type Work = fn(&Task<'_>) -> bool;

/// What counting needs of a machine.
pub trait Machine {
    /// Sets the counter to its start.
    fn restart();
    /// What the counter says.
    fn ticks() -> u32;
    /// Whether the counter has gone round since it was set to its start.
    fn has_wrapped() -> bool;
    /// Bytes of stack that the work writes to below its caller's frame.
    fn stack_bytes_of(work: Work, task: &Task<'_>) -> u32;
    /// A hundred instructions and no other.
    fn hundred_nops();
    /// Hands a record to the host; `None` if that fails.
    fn send(&mut self, record: &[u8]) -> Option<()>;
}

/// Runs all work on the blob and the job at the start of `flash`; `None` if they are not there.
pub fn run<M: Machine>(machine: &mut M, flash: &[u8]) -> Option<()> {
    let blob_len = RayBlob::stated_len(flash).ok()? as usize;
    let bytes = flash.get(..blob_len)?;
    let numbers = bytemuck::try_cast_slice(flash.get(job_start(blob_len)..)?).ok()?;
    let job = Job::read(numbers)?;
    let blob = RayBlob::open(bytes).ok()?;
    let mut task = Task {
        bytes,
        integers: Rig::prepare(&blob).ok(),
        blob,
        job,
        cameras: job.cameras,
        pixels: [PixelPoint::new(0.0, 0.0); 2],
        fixed: [FixedPixel { u: 0, v: 0 }; 2],
        rays: RefCell::new([Ray::OUTSIDE; ROW_LEN]),
    };
    for (match_idx, [u1, v1, u2, v2]) in job.matches.iter().enumerate() {
        task.pixels = [PixelPoint::new(*u1, *v1), PixelPoint::new(*u2, *v2)];
        task.fixed = task.pixels.map(fixed);
        for probe in Probe::ALL {
            if match_idx > 0 && !probe.is_per_match() {
                continue;
            }
            let (ticks, answered) = ticks_of::<M>(work::<M>(probe), &task);
            let is_row = matches!(probe, Probe::RowFirst | Probe::RowSecond);
            let answered = answered && !(is_row && has_outside(&task));
            let stack_bytes = M::stack_bytes_of(work::<M>(probe), &task);
            let record = Record {
                probe: probe as u32,
                match_idx: match_idx as u32,
                answered: answered.into(),
                ticks,
                stack_bytes,
            };
            machine.send(&record.to_bytes())?;
        }
    }
    Some(())
}

/// Whether a pixel of the row that was looked up last is not calibrated.
fn has_outside(task: &Task<'_>) -> bool {
    let rays = task.rays.try_borrow();
    rays.is_ok_and(|rays| rays.iter().any(Ray::is_outside))
}

/// Ticks between the look at the counter before a call and the one behind it.
#[inline(never)]
fn ticks_of<M: Machine>(work: Work, task: &Task<'_>) -> (u32, bool) {
    M::restart();
    let before = M::ticks();
    let answered = work(task);
    let ticks = M::ticks().wrapping_sub(before);
    (if M::has_wrapped() { WRAPPED } else { ticks }, answered)
}

/// What a probe does. The compiler does not see which function comes back, so it can neither inline
/// it nor move any of it past the looks at the counter.
fn work<M: Machine>(probe: Probe) -> Work {
    black_box(match probe {
        Probe::Nothing => nothing,
        Probe::Known => known::<M>,
        Probe::Open => open,
        Probe::Checksum => checksum,
        Probe::LookupFirst => lookup_first,
        Probe::LookupSecond => lookup_second,
        Probe::Triangulate => triangulate,
        Probe::Covariance => triangulate_with_covariance,
        Probe::BilinearLookup => bilinear_lookup,
        Probe::BilinearTriangulate => bilinear_triangulate,
        Probe::BrownUndistortion => brown_undistortion,
        Probe::BrownTriangulate => brown_triangulate,
        Probe::RowFirst => row_first,
        Probe::RowSecond => row_second,
        Probe::IntegerPrepare => integer_prepare,
        Probe::IntegerLookupFixedFirst => integer_lookup_fixed_first,
        Probe::IntegerLookupFixedSecond => integer_lookup_fixed_second,
        Probe::IntegerLookupFirst => integer_lookup_first,
        Probe::IntegerLookupSecond => integer_lookup_second,
        Probe::IntegerTriangulateFixed => integer_triangulate_fixed,
        Probe::IntegerTriangulate => integer_triangulate,
    })
}

fn nothing(_: &Task<'_>) -> bool {
    true
}

fn known<M: Machine>(_: &Task<'_>) -> bool {
    M::hundred_nops();
    true
}

fn open(task: &Task<'_>) -> bool {
    written(&RayBlob::open(task.bytes)).is_ok()
}

fn checksum(task: &Task<'_>) -> bool {
    written(&format::checksum(task.bytes)).is_some()
}

fn lookup_first(task: &Task<'_>) -> bool {
    written(&task.blob.lookup(task.cameras[0], task.pixels[0])).is_ok()
}

fn lookup_second(task: &Task<'_>) -> bool {
    written(&task.blob.lookup(task.cameras[1], task.pixels[1])).is_ok()
}

fn triangulate(task: &Task<'_>) -> bool {
    let [a, b] = sightings(task);
    written(&task.blob.triangulate(a, b)).is_ok()
}

fn triangulate_with_covariance(task: &Task<'_>) -> bool {
    let [a, b] = sightings(task);
    let measured = task.blob.triangulate_with_covariance(a, b);
    written(&measured).is_ok_and(|measured| measured.covariance.is_some())
}

fn bilinear_lookup(task: &Task<'_>) -> bool {
    written(&task.job.tables[0].at(task.pixels[0])).is_some()
}

fn bilinear_triangulate(task: &Task<'_>) -> bool {
    let [first, second] = &task.job.tables;
    let (Some(first), Some(second)) = (first.ray(task.pixels[0]), second.ray(task.pixels[1]))
    else {
        return false;
    };
    written(&triangulate_pair(&first, &second)).is_ok()
}

fn brown_undistortion(task: &Task<'_>) -> bool {
    written(&task.job.browns[0].undistorted(task.pixels[0]));
    true
}

fn brown_triangulate(task: &Task<'_>) -> bool {
    let [first, second] = &task.job.browns;
    let rays = (first.ray(task.pixels[0]), second.ray(task.pixels[1]));
    written(&triangulate_pair(&rays.0, &rays.1)).is_ok()
}

fn row_first(task: &Task<'_>) -> bool {
    row(task, 0)
}

fn row_second(task: &Task<'_>) -> bool {
    row(task, 1)
}

/// The rays of a row that has the pixel of the match among its own.
// A call would count into what is measured.
#[allow(clippy::inline_always)]
#[inline(always)]
fn row(task: &Task<'_>, camera: usize) -> bool {
    let pixel = task.pixels[camera];
    let first_u = (pixel.u as u32 & !(ROW_LEN as u32 - 1)) as f32;
    let row = Row {
        first: PixelPoint::new(first_u, pixel.v as u32 as f32),
        step_px: 1,
    };
    let Ok(mut rays) = task.rays.try_borrow_mut() else {
        return false;
    };
    let found = task.blob.lookup_row(task.cameras[camera], &row, &mut *rays);
    written(&*rays);
    found.is_ok()
}

fn integer_prepare(task: &Task<'_>) -> bool {
    written(&Rig::<2>::prepare(&task.blob)).is_ok()
}

fn integer_lookup_fixed_first(task: &Task<'_>) -> bool {
    integer_lookup_fixed(task, 0)
}

fn integer_lookup_fixed_second(task: &Task<'_>) -> bool {
    integer_lookup_fixed(task, 1)
}

// As with rows.
#[allow(clippy::inline_always)]
#[inline(always)]
fn integer_lookup_fixed(task: &Task<'_>, camera: usize) -> bool {
    let Some(rig) = &task.integers else {
        return false;
    };
    written(&rig.lookup_fixed(task.cameras[camera], task.fixed[camera])).is_ok()
}

fn integer_lookup_first(task: &Task<'_>) -> bool {
    integer_lookup(task, 0)
}

fn integer_lookup_second(task: &Task<'_>) -> bool {
    integer_lookup(task, 1)
}

// As with rows.
#[allow(clippy::inline_always)]
#[inline(always)]
fn integer_lookup(task: &Task<'_>, camera: usize) -> bool {
    let Some(rig) = &task.integers else {
        return false;
    };
    written(&rig.lookup(task.cameras[camera], task.pixels[camera])).is_ok()
}

fn integer_triangulate_fixed(task: &Task<'_>) -> bool {
    let Some(rig) = &task.integers else {
        return false;
    };
    let [a, b] = task.fixed;
    let [first, second] = task.cameras;
    written(&rig.triangulate_fixed((first, a), (second, b))).is_ok()
}

fn integer_triangulate(task: &Task<'_>) -> bool {
    let Some(rig) = &task.integers else {
        return false;
    };
    let [a, b] = sightings(task);
    written(&rig.triangulate(a, b)).is_ok()
}

/// Rounded down; only pixels of sensors are asked.
fn fixed(pixel: PixelPoint) -> FixedPixel {
    let [u, v] = [pixel.u, pixel.v].map(|px| (px * 65536.0) as i32);
    FixedPixel { u, v }
}

fn sightings(task: &Task<'_>) -> [(usize, PixelPoint); 2] {
    [
        (task.cameras[0], task.pixels[0]),
        (task.cameras[1], task.pixels[1]),
    ]
}

/// The same, once all of it stands in memory, as a caller elsewhere would find it.
fn written<T>(result: &T) -> &T {
    black_box(result)
}
