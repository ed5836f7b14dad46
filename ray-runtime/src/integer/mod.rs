//! Rays and points in fixed point, for cores without a floating-point unit: the same questions, a tenth of the
//! instructions.
//!
//! Nothing here calls a floating-point library. Numbers of f32 are taken apart and put together by operations of
//! integers, and products are made of those of 16 by 16 binary digits, which the smallest cores have. `FORMAT.md`
//! states each formula, so that every implementation comes to the same bits; they are not those of the f32 path, but
//! within 0.003 px of its rays on usual sensors (`FORMAT.md` has the round-off), and a blob may say what the packer
//! has proven for all pixels ([`RayBlob::arithmetic`](crate::RayBlob::arithmetic)).
//!
//! ```
//! use ray_runtime::integer::{FixedPixel, Rig};
//! use ray_runtime::{Aligned, PixelPoint, RayBlob};
//!
//! static RIG: &Aligned<[u8]> = &Aligned(*include_bytes!(concat!(
//!     env!("CARGO_MANIFEST_DIR"),
//!     "/../data/golden/stereo-v3-small.rays"
//! )));
//!
//! let blob = RayBlob::open(&RIG.0).unwrap();
//! // Prepared once: two cameras take some 700 bytes.
//! let rig = Rig::<2>::prepare(&blob).unwrap();
//! let (left, right) = (PixelPoint::new(30.0, 20.5), PixelPoint::new(33.0, 21.0));
//! let point = rig.triangulate((0, left), (1, right)).unwrap();
//! let same = blob.triangulate((0, left), (1, right)).unwrap();
//! assert!((point.point_mm[2] - same.point_mm[2]).abs() < 0.01);
//!
//! // All in fixed point: pixels in 65536ths, points in steps of a power of two of a millimeter.
//! let pixel = |u: i32, v: i32| FixedPixel { u, v };
//! let fixed = rig
//!     .triangulate_fixed((0, pixel(30 << 16, 41 << 15)), (1, pixel(33 << 16, 21 << 16)))
//!     .unwrap();
//! assert_eq!(fixed.to_triangulation(), point);
//! let [_, _, z] = fixed.point_in(-10).unwrap();
//! assert_eq!(z >> 10, 48);
//! ```

mod axis;
mod bounds;
mod camera;
mod float;
mod knots;
mod midpoint;
mod polynomial;
mod product;
mod ray;
mod rig;
mod self_test;
mod spline;

pub use midpoint::FixedPoint;
pub use ray::{FixedPixel, FixedRay};
pub use rig::{Rig, Unsuited};
pub use self_test::{Answer, expected as expected_answers};
