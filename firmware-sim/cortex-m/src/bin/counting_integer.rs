//! Counts the instructions of the arithmetic of integers on any core with SysTick: run by QEMU with `-icount shift=10`, so that
//! an instruction takes 1024 ns and nothing else takes any, on a board whose SysTick counts 25 MHz.
//!
//! A line for each blob: a lookup, a stereo point from pixels to a point in fixed point, the same from f32 to f32, and the preparation;
//! the means of as many matches as have a point, less an empty call.

#![no_std]
#![no_main]

use core::hint::black_box;

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::entry;
use cortex_m_semihosting::hprintln;
use firmware_cortex_m::machine;
use ray_runtime::integer::{FixedPixel, Rig};
use ray_runtime::{Aligned, PixelPoint, RayBlob};

static BLOBS: [(&str, &Aligned<[u8]>); 4] = [
    (
        "central-v3-fast",
        &Aligned(*include_bytes!("../../../../data/golden/central-v3-fast.rays")),
    ),
    (
        "non-central-v3-fast",
        &Aligned(*include_bytes!("../../../../data/golden/non-central-v3-fast.rays")),
    ),
    (
        "non-central-v3-cubic",
        &Aligned(*include_bytes!("../../../../data/golden/non-central-v3-cubic.rays")),
    ),
    (
        "non-central-v3-small",
        &Aligned(*include_bytes!("../../../../data/golden/non-central-v3-small.rays")),
    ),
];

/// What is asked: two pixels, both ways.
struct Task<'a> {
    blob: &'a RayBlob<'a>,
    rig: &'a Rig<'a, 2>,
    fixed: [FixedPixel; 2],
    pixels: [PixelPoint; 2],
}

/// A piece of work.
type Work = fn(&Task<'_>);

const WORK: [Work; 5] = [
    |_| (),
    |task| {
        black_box(&task.rig.lookup_fixed(0, task.fixed[0]));
    },
    |task| {
        let [a, b] = task.fixed;
        black_box(&task.rig.triangulate_fixed((0, a), (1, b)));
    },
    |task| {
        let [a, b] = task.pixels;
        black_box(&task.rig.triangulate((0, a), (1, b)));
    },
    |task| {
        black_box(&Rig::<2>::prepare(task.blob));
    },
];

#[entry]
fn main() -> ! {
    let Some(mut peripherals) = cortex_m::Peripherals::take() else {
        machine::end(false)
    };
    let timer = &mut peripherals.SYST;
    timer.set_reload(0x00ff_ffff);
    timer.clear_current();
    timer.set_clock_source(SystClkSource::Core);
    timer.enable_counter();
    for (name, bytes) in BLOBS {
        let Ok(blob) = RayBlob::open(&bytes.0) else {
            machine::end(false)
        };
        let Ok(rig) = Rig::<2>::prepare(&blob) else {
            machine::end(false)
        };
        let (mut sums, mut count) = ([0; WORK.len()], 0);
        for k in 0..64 {
            // All over both sensors, in quarter pixels.
            let quarters = [10 + 31 * k % 200, 7 + 43 * k % 170, 22 + 31 * k % 200, 9 + 43 * k % 170];
            let [u, v, u_b, v_b] = quarters;
            let task = Task {
                blob: &blob,
                rig: &rig,
                fixed: [(u, v), (u_b, v_b)].map(|(u, v)| FixedPixel {
                    u: u << 14,
                    v: v << 14,
                }),
                pixels: [(u, v), (u_b, v_b)]
                    .map(|(u, v)| PixelPoint::new(u as f32 * 0.25, v as f32 * 0.25)),
            };
            let [a, b] = task.fixed;
            if rig.triangulate_fixed((0, a), (1, b)).is_err() {
                continue;
            }
            count += 1;
            for (sum, work) in sums.iter_mut().zip(WORK) {
                *sum += instructions(work, &task);
            }
        }
        let [empty, lookup, point, point_f32, prepare] = sums;
        let mean = |sum: u32| (sum - empty).checked_div(count).unwrap_or(0);
        hprintln!(
            "{} {} {} {} {} {}",
            name,
            count,
            mean(lookup),
            mean(point),
            mean(point_f32),
            mean(prepare)
        );
    }
    machine::end(true)
}

/// Instructions between two looks at the timer.
#[inline(never)]
fn instructions(work: Work, task: &Task<'_>) -> u32 {
    let work = black_box(work);
    let before = SYST::get_current();
    work(task);
    let ticks = before.wrapping_sub(SYST::get_current()) & 0x00ff_ffff;
    // 25.6 ticks an instruction.
    ticks * 10 / 256
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    machine::end(false)
}
