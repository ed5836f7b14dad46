//! Polynomials of two variables for two channels, in fixed point: the coefficients as they stand in the
//! blob, in the order of their use, or prepared.

use super::float::Digits;
use super::product::product;

/// Coefficients of a cubic.
pub const CUBIC: usize = crate::format::coefficient_count(3);

/// Numbers from the first coefficient of a cubic's channel to its last: those of the other channel lie between them.
const STRIDED: usize = 2 * CUBIC - 1;

/// A cubic over the whole region, of prepared coefficients; x and y in 2^-31.
#[inline(always)]
pub fn prepared_cubic(coefficients: &[[i32; 2]; CUBIC], x: i32, y: i32) -> Option<[i32; 2]> {
    let [first, second] = channels(coefficients)?;
    Some([
        prepared_channel(first, x, y),
        prepared_channel(second, x, y),
    ])
}

/// The two channels, each with the other's numbers in between.
#[inline(always)]
fn channels<T>(coefficients: &[[T; 2]; CUBIC]) -> Option<[&[T; STRIDED]; 2]> {
    let flat = coefficients.as_flattened();
    Some([flat.first_chunk()?, flat.get(1..)?.first_chunk()?])
}

#[inline(never)]
fn prepared_channel(c: &[i32; STRIDED], x: i32, y: i32) -> i32 {
    let [
        y3,
        _,
        y2x,
        _,
        y2,
        _,
        yx2,
        _,
        yx,
        _,
        y1,
        _,
        x3,
        _,
        x2,
        _,
        x1,
        _,
        one,
    ] = *c;
    let step = |a: i32, by: i32, b: i32| product::<1>(a, by).wrapping_add(b);
    let of_y2 = step(y3, y, step(y2x, x, y2));
    let of_y = step(of_y2, y, step(step(yx2, x, yx), x, y1));
    step(of_y, y, step(step(step(x3, x, x2), x, x1), x, one))
}

/// A place in a cell.
pub struct Shares {
    /// The shares of the cell before it along u and v, in 2^-30.
    x: i32,
    y: i32,
    /// `y3, y2 x, y2, y x2, y x, x3, x2` of them, in 2^-15.
    powers: [u32; 7],
}

impl Shares {
    /// From the shares, in 2^-30, at most 1.25.
    #[inline(always)]
    pub fn new(x: i32, y: i32) -> Self {
        let half = |share: i32| share.wrapping_add(1 << 14).cast_unsigned() >> 15;
        let (half_x, half_y) = (half(x), half(y));
        let times = |a: u32, b: u32| a.wrapping_mul(b) >> 15;
        let (xx, xy, yy) = (
            times(half_x, half_x),
            times(half_x, half_y),
            times(half_y, half_y),
        );
        Self {
            x,
            y,
            powers: [
                times(yy, half_y),
                times(yy, half_x),
                yy,
                times(xx, half_y),
                xy,
                times(xx, half_x),
                xx,
            ],
        }
    }
}

/// The cubic of a cell.
///
/// Within a cell it is all but straight: what is not takes 16 binary digits of a coefficient and 15 of a power, in
/// one multiplication.
#[inline(always)]
pub fn patch(
    coefficients: &[[f32; 2]; CUBIC],
    digits: Digits,
    shares: &Shares,
) -> Option<[i32; 2]> {
    let [first, second] = channels(coefficients)?;
    Some([
        patch_channel(first, digits, shares),
        patch_channel(second, digits, shares),
    ])
}

#[inline(never)]
fn patch_channel(c: &[f32; STRIDED], digits: Digits, shares: &Shares) -> i32 {
    let short = digits.for_short_products();
    let bent = |number: f32, power: u32| short.short_product(number, power);
    let straight = |number: f32, share: i32| product::<2>(digits.fixed(number), share);
    let [
        y3,
        _,
        y2x,
        _,
        y2,
        _,
        yx2,
        _,
        yx,
        _,
        y1,
        _,
        x3,
        _,
        x2,
        _,
        x1,
        _,
        one,
    ] = c;
    let mut sum = digits.fixed(*one);
    let mut add = |part: i32| sum = sum.wrapping_add(part);
    add(straight(*x1, shares.x));
    add(straight(*y1, shares.y));
    let of = &shares.powers;
    for (number, power) in [y3, y2x, y2, yx2, yx, x3, x2].into_iter().zip(of) {
        add(bent(*number, *power));
    }
    sum
}

/// Any polynomial over the whole region; x and y in 2^-31.
#[inline(never)]
pub fn any(coefficients: &[[f32; 2]], digits: Digits, x: i32, y: i32) -> [i32; 2] {
    let mut sums = [0; 2];
    let mut rest = coefficients;
    let mut length = 1;
    while let Some((row, after)) = rest.split_at_checked(length).filter(|_| !rest.is_empty()) {
        for (k, sum) in sums.iter_mut().enumerate() {
            let along_x = row.iter().fold(0, |along_x, pair| {
                let next = digits.fixed(if k == 0 { pair[0] } else { pair[1] });
                product::<1>(along_x, x).wrapping_add(next)
            });
            *sum = product::<1>(*sum, y).wrapping_add(along_x);
        }
        rest = after;
        length += 1;
    }
    sums
}
