//! The C interface of `ray-runtime`; `rays.h` is its documentation and its other half. `rays_device.h` is that of
//! [`health`], [`storage`] and [`driver`].
//!
//! All `unsafe` of the interface stands in these four files. What C must promise is what `rays.h` says: a
//! pointer is null or points to an object of its type, a rig is used only after [`rays_open`], and the
//! blob stays where it is, unchanged, for as long as its rig is used.
//!
//! No panic is reachable in the library: [`panic`] calls a function that exists nowhere, so one that
//! the compiler could not rule out ends the link of any program with an undefined symbol.

#![no_std]

pub mod driver;
pub mod health;
pub mod storage;
mod types;

use core::ffi::c_int;
use core::mem::MaybeUninit;
use ray_runtime::{
    MatchNoise, MeasureError, OpenError, PixelPoint, ProjectError, RayBlob, Readout, SensorWindow,
};

pub use types::{
    Camera, CameraReadout, CurvePoint, Info, Measurement, Pixel, Point, Ray, Sighting,
};

/// Done.
pub const OK: c_int = 0;
/// A null pointer, or a length that no object has.
pub const BAD_ARGUMENT: c_int = 128;
/// The rig was never opened, or opening it failed.
pub const NOT_OPEN: c_int = 129;
/// A self-test gives other bits.
pub const SELF_TEST_FAILED: c_int = 130;

/// Memory for a rig, owned by the caller.
#[repr(C)]
pub struct Rig {
    opaque: [MaybeUninit<*const ()>; 32],
}

/// What lies in a [`Rig`].
struct Opened {
    /// [`OPEN`] or 0.
    state: u32,
    blob: MaybeUninit<RayBlob<'static>>,
}

/// "RAYS".
const OPEN: u32 = 0x5359_4152;

const _: () = assert!(
    size_of::<Opened>() <= size_of::<Rig>() && align_of::<Opened>() <= align_of::<Rig>(),
    "an opened blob does not fit into a rays_rig: enlarge it here and in rays.h"
);

/// How long the blob at the start of `bytes` says it is.
///
/// # Safety
/// As `rays.h` says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rays_stated_len(
    bytes: *const u8,
    length: usize,
    stated_len: *mut u32,
) -> c_int {
    // SAFETY: null or as many bytes as stated, says the caller.
    let (Some(bytes), false) = (unsafe { slice(bytes, length) }, stated_len.is_null()) else {
        return BAD_ARGUMENT;
    };
    match RayBlob::stated_len(bytes) {
        Ok(stated) => {
            // SAFETY: not null, hence a u32.
            unsafe { stated_len.write(stated) };
            OK
        }
        Err(error) => error.code().into(),
    }
}

/// Checks a blob and opens it in place.
///
/// # Safety
/// As `rays.h` says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rays_open(rig: *mut Rig, blob: *const u8, length: usize) -> c_int {
    if rig.is_null() {
        return BAD_ARGUMENT;
    }
    // SAFETY: not null, hence memory for a rig, which an `Opened` fits into (asserted above).
    // Nobody else uses it meanwhile.
    let opened = unsafe { &mut *rig.cast::<MaybeUninit<Opened>>() };
    let opened = opened.write(Opened {
        state: 0,
        blob: MaybeUninit::uninit(),
    });
    // SAFETY: null or as many bytes as stated, says the caller; they live for as long as the rig is
    // used, which is all that 'static stands for here.
    let Some(bytes) = (unsafe { slice(blob, length) }) else {
        return BAD_ARGUMENT;
    };
    match RayBlob::open(bytes) {
        Ok(blob) => {
            opened.blob.write(blob);
            opened.state = OPEN;
            OK
        }
        Err(error) => OpenError::code(error).into(),
    }
}

/// The version of this library: `RAYS_VERSION` of the header it was built with.
#[unsafe(no_mangle)]
pub extern "C" fn rays_version() -> u32 {
    VERSION
}

/// 10000 major + 100 minor + patch.
const VERSION: u32 = 10_000 * number(env!("CARGO_PKG_VERSION_MAJOR"))
    + 100 * number(env!("CARGO_PKG_VERSION_MINOR"))
    + number(env!("CARGO_PKG_VERSION_PATCH"));

/// A number in decimal; does not compile for anything else.
const fn number(text: &str) -> u32 {
    match u32::from_str_radix(text, 10) {
        Ok(number) => number,
        Err(_) => panic!("not a number"),
    }
}

/// What the blob says of itself.
///
/// # Safety
/// As `rays.h` says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rays_info_of(rig: *const Rig, info: *mut Info) -> c_int {
    // SAFETY: both are null or what they should be, says the caller.
    unsafe { answer(rig, info, |blob| Ok(Info::of_rust(blob))) }
}

/// How many cameras there are; 0 if the rig is not open.
///
/// # Safety
/// As `rays.h` says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rays_camera_count(rig: *const Rig) -> usize {
    // SAFETY: null or a rig that went through `rays_open`, says the caller.
    unsafe { blob(rig) }.map_or(0, |blob| blob.camera_count())
}

/// A camera's name and size.
///
/// # Safety
/// As `rays.h` says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rays_camera_of(
    rig: *const Rig,
    camera: usize,
    info: *mut Camera,
) -> c_int {
    let ask = |blob: &RayBlob<'_>| {
        let found = blob.camera(camera).ok_or_else(|| no_camera(blob, camera))?;
        Ok(Camera {
            name: found.name.as_ptr().cast(),
            name_len: found.name.len(),
            sensor_width_px: found.sensor_width,
            sensor_height_px: found.sensor_height,
        })
    };
    // SAFETY: both are null or what they should be, says the caller.
    unsafe { answer(rig, info, ask) }
}

/// The ray of a pixel.
///
/// # Safety
/// As `rays.h` says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rays_lookup(rig: *const Rig, sighting: Sighting, ray: *mut Ray) -> c_int {
    let ask = |blob: &RayBlob<'_>| {
        let found = blob.lookup(sighting.camera, sighting.pixel());
        found.map_err(|error| error.code()).map(|found| Ray {
            origin_mm: found.origin_mm,
            direction: found.direction,
        })
    };
    // SAFETY: both are null or what they should be, says the caller.
    unsafe { answer(rig, ray, ask) }
}

/// The point of a match.
///
/// # Safety
/// As `rays.h` says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rays_triangulate(
    rig: *const Rig,
    first: Sighting,
    second: Sighting,
    point: *mut Point,
) -> c_int {
    let ask = |blob: &RayBlob<'_>| {
        let found = blob.triangulate(first.of_rust(), second.of_rust());
        found.map_err(MeasureError::code).map(Point::of_rust)
    };
    // SAFETY: both are null or what they should be, says the caller.
    unsafe { answer(rig, point, ask) }
}

/// The point nearest to the rays of any number of cameras.
///
/// # Safety
/// As `rays.h` says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rays_triangulate_many(
    rig: *const Rig,
    sightings: *const Sighting,
    count: usize,
    point: *mut Point,
) -> c_int {
    // SAFETY: null or as many sightings as stated, says the caller.
    let Some(sightings) = (unsafe { slice(sightings, count) }) else {
        return BAD_ARGUMENT;
    };
    let ask = |blob: &RayBlob<'_>| {
        let found = blob.triangulate_many(sightings);
        found.map_err(MeasureError::code).map(Point::of_rust)
    };
    // SAFETY: both are null or what they should be, says the caller.
    unsafe { answer(rig, point, ask) }
}

/// The point of a match and its standard deviations.
///
/// # Safety
/// As `rays.h` says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rays_triangulate_with_covariance(
    rig: *const Rig,
    first: Sighting,
    second: Sighting,
    measurement: *mut Measurement,
) -> c_int {
    let ask = |blob: &RayBlob<'_>| {
        let measured = blob.triangulate_with_covariance(first.of_rust(), second.of_rust());
        measured
            .map_err(MeasureError::code)
            .map(Measurement::of_rust)
    };
    // SAFETY: both are null or what they should be, says the caller.
    unsafe { answer(rig, measurement, ask) }
}

/// The same with the noise of the pixels.
///
/// # Safety
/// As `rays.h` says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rays_triangulate_with_noise(
    rig: *const Rig,
    first: Sighting,
    second: Sighting,
    noise_px: f32,
    measurement: *mut Measurement,
) -> c_int {
    let Some(noise) = MatchNoise::from_px(noise_px) else {
        return BAD_ARGUMENT;
    };
    let ask = |blob: &RayBlob<'_>| {
        let measured = blob.triangulate_with_noise(first.of_rust(), second.of_rust(), noise);
        measured
            .map_err(MeasureError::code)
            .map(Measurement::of_rust)
    };
    // SAFETY: both are null or what they should be, says the caller.
    unsafe { answer(rig, measurement, ask) }
}

/// How noisy the blob says that matches are.
///
/// # Safety
/// As `rays.h` says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rays_match_noise(rig: *const Rig, noise_px: *mut f32) -> c_int {
    let ask = |blob: &RayBlob<'_>| Ok(blob.match_noise().map_or(-1.0, MatchNoise::px));
    // SAFETY: both are null or what they should be, says the caller.
    unsafe { answer(rig, noise_px, ask) }
}

/// The pixel that sees a point.
///
/// # Safety
/// As `rays.h` says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rays_project(
    rig: *const Rig,
    camera: usize,
    point_mm: *const [f32; 3],
    pixel: *mut Pixel,
) -> c_int {
    // SAFETY: null or what they should be, says the caller.
    unsafe {
        project(rig, point_mm, pixel, |blob, point_mm| {
            blob.project(camera, point_mm)
        })
    }
}

/// The pixel that sees a point, sought from one nearby.
///
/// # Safety
/// As `rays.h` says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rays_project_near(
    rig: *const Rig,
    camera: usize,
    point_mm: *const [f32; 3],
    start: Pixel,
    pixel: *mut Pixel,
) -> c_int {
    // SAFETY: null or what they should be, says the caller.
    unsafe {
        project(rig, point_mm, pixel, |blob, point_mm| {
            blob.project_near(camera, point_mm, start.into())
        })
    }
}

/// Where the ray of a pixel appears in another camera.
///
/// # Safety
/// As `rays.h` says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rays_epipolar_curve(
    rig: *const Rig,
    sighting: Sighting,
    other: usize,
    near_mm: f32,
    far_mm: f32,
    points: *mut CurvePoint,
    count: usize,
    found: *mut usize,
) -> c_int {
    let Ok(count) = u16::try_from(count) else {
        return BAD_ARGUMENT;
    };
    if points.is_null() {
        return BAD_ARGUMENT;
    }
    // SAFETY: not null, hence room for `count` points, says the caller. Nothing is read.
    let points = unsafe {
        core::slice::from_raw_parts_mut(points.cast::<MaybeUninit<CurvePoint>>(), count.into())
    };
    let ask = |blob: &RayBlob<'_>| {
        let range_mm = [near_mm, far_mm];
        let curve = blob
            .epipolar_curve(sighting.of_rust(), other, range_mm, count)
            .map_err(MeasureError::code)?;
        let mut number = 0;
        for (place, point) in points.iter_mut().zip(curve) {
            place.write(CurvePoint {
                pixel: point.pixel.into(),
                point_mm: point.point_mm,
            });
            number += 1;
        }
        Ok(number)
    };
    // SAFETY: both are null or what they should be, says the caller.
    unsafe { answer(rig, found, ask) }
}

/// The map of a camera's readout.
///
/// # Safety
/// As `rays.h` says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rays_window_of(
    rig: *const Rig,
    camera: usize,
    readout: *const CameraReadout,
    window: *mut SensorWindow,
) -> c_int {
    // SAFETY: null or a readout, says the caller.
    let Some(readout) = (unsafe { readout.as_ref() }) else {
        return BAD_ARGUMENT;
    };
    let readout = Readout {
        sensor: readout.sensor_px,
        first: readout.first_px,
        image: readout.image_px,
        binning: readout.binning,
    };
    let ask = |blob: &RayBlob<'_>| {
        let camera = blob.camera(camera).ok_or_else(|| no_camera(blob, camera))?;
        SensorWindow::new(&camera, &readout).map_err(|error| error.code())
    };
    // SAFETY: both are null or what they should be, says the caller.
    unsafe { answer(rig, window, ask) }
}

/// The sensor's pixel at a pixel of the image.
#[unsafe(no_mangle)]
pub extern "C" fn rays_to_sensor(window: SensorWindow, image: Pixel) -> Pixel {
    window.to_sensor(image.into()).into()
}

/// The image's pixel at a pixel of the sensor.
#[unsafe(no_mangle)]
pub extern "C" fn rays_from_sensor(window: SensorWindow, sensor: Pixel) -> Pixel {
    window.from_sensor(sensor.into()).into()
}

/// Runs the blob's self-tests.
///
/// # Safety
/// As `rays.h` says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rays_self_test(rig: *const Rig, number: *mut usize) -> c_int {
    // SAFETY: null or a rig that went through `rays_open`, says the caller.
    let Some(blob) = (unsafe { blob(rig) }) else {
        return if rig.is_null() {
            BAD_ARGUMENT
        } else {
            NOT_OPEN
        };
    };
    let (count, code) = match blob.run_self_tests() {
        Ok(count) => (count, OK),
        Err(failure) => (failure.test, SELF_TEST_FAILED),
    };
    if !number.is_null() {
        // SAFETY: not null, hence a size_t.
        unsafe { number.write(count) };
    }
    code
}

/// The code of a camera that is none.
fn no_camera(blob: &RayBlob<'_>, camera: usize) -> u8 {
    let count = blob.camera_count();
    ProjectError::NoSuchCamera { camera, count }.code()
}

/// The bytes or items, unless the pointer is null or no object has that many.
///
/// # Safety
/// `start` is null or points to `length` items that nobody changes during `'a`.
unsafe fn slice<'a, T>(start: *const T, length: usize) -> Option<&'a [T]> {
    let bytes = length.checked_mul(size_of::<T>())?;
    if start.is_null() || isize::try_from(bytes).is_err() {
        return None;
    }
    // SAFETY: not null, not too long, and the rest is the caller's word.
    Some(unsafe { core::slice::from_raw_parts(start, length) })
}

/// The blob of a rig, if it is open.
///
/// # Safety
/// `rig` is null or went through [`rays_open`], and its blob is unchanged.
unsafe fn blob<'a>(rig: *const Rig) -> Option<&'a RayBlob<'static>> {
    // SAFETY: null or an `Opened`, which is what `rays_open` leaves in every rig.
    let opened = unsafe { rig.cast::<Opened>().as_ref() }?;
    if opened.state != OPEN {
        return None;
    }
    // SAFETY: the state says so only once the blob is written.
    Some(unsafe { opened.blob.assume_init_ref() })
}

/// Asks for the pixel of a point.
///
/// # Safety
/// As for [`answer`], and `point_mm` is null or three numbers.
unsafe fn project(
    rig: *const Rig,
    point_mm: *const [f32; 3],
    pixel: *mut Pixel,
    ask: impl FnOnce(&RayBlob<'_>, [f32; 3]) -> Result<PixelPoint, ProjectError>,
) -> c_int {
    // SAFETY: null or three numbers, says the caller.
    let Some(point_mm) = (unsafe { point_mm.as_ref() }) else {
        return BAD_ARGUMENT;
    };
    let ask = |blob: &RayBlob<'_>| {
        let found = ask(blob, *point_mm);
        found.map(Pixel::from).map_err(ProjectError::code)
    };
    // SAFETY: the caller's word.
    unsafe { answer(rig, pixel, ask) }
}

/// Asks the rig's blob and writes the answer, or leaves its place as it is; the code.
///
/// # Safety
/// As for [`blob`], and `place` is null or memory for a `T`.
unsafe fn answer<T>(
    rig: *const Rig,
    place: *mut T,
    ask: impl FnOnce(&RayBlob<'_>) -> Result<T, u8>,
) -> c_int {
    if rig.is_null() || place.is_null() {
        return BAD_ARGUMENT;
    }
    // SAFETY: the caller's word.
    let Some(blob) = (unsafe { blob(rig) }) else {
        return NOT_OPEN;
    };
    match ask(blob) {
        Ok(answer) => {
            // SAFETY: not null, hence memory for a `T`.
            unsafe { place.write(answer) };
            OK
        }
        Err(code) => code.into(),
    }
}

/// Something that panics, to show that it does not link.
#[cfg(feature = "panics")]
#[unsafe(no_mangle)]
pub extern "C" fn rays_panic(index: usize) -> u32 {
    static NUMBERS: [u32; 3] = [3, 1, 4];
    NUMBERS[index]
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    unsafe extern "C" {
        fn a_panic_is_reachable_in_this_library() -> !;
    }
    // SAFETY: never linked, hence never called.
    unsafe { a_panic_is_reachable_in_this_library() }
}
