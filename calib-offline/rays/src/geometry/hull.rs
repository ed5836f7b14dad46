//! The convex hull of pixels.

use super::PixelPoint;

/// Convex hull, counterclockwise in (u, v) taken as a right-handed plane (Andrew's chain). Fewer
/// than three points, or points on one line, give a hull without area.
pub fn convex_hull(mut points: Vec<PixelPoint>) -> Vec<PixelPoint> {
    points.sort_by(|a, b| a.u.total_cmp(&b.u).then(a.v.total_cmp(&b.v)));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let chain = |points: &mut dyn Iterator<Item = PixelPoint>| {
        let mut hull: Vec<PixelPoint> = Vec::new();
        for p in points {
            while let [.., a, b] = hull[..]
                && turn(a, b, p) <= 0.0
            {
                hull.pop();
            }
            hull.push(p);
        }
        hull.pop();
        hull
    };
    let mut hull = chain(&mut points.iter().copied());
    hull.extend(chain(&mut points.iter().rev().copied()));
    hull
}

/// Whether a hull of [`convex_hull`] contains a point, its border included; one without area
/// contains none.
pub fn hull_contains(hull: &[PixelPoint], point: PixelPoint) -> bool {
    hull.len() >= 3
        && (0..hull.len()).all(|i| turn(hull[i], hull[(i + 1) % hull.len()], point) >= 0.0)
}

/// Twice the signed area of a triangle.
fn turn(a: PixelPoint, b: PixelPoint, c: PixelPoint) -> f64 {
    (b.u - a.u) * (c.v - a.v) - (b.v - a.v) * (c.u - a.u)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hull_of_a_square_with_inner_points_is_the_square() {
        let mut points = vec![];
        for u in 0..5 {
            for v in 0..5 {
                points.push(PixelPoint::new(f64::from(u), f64::from(v)));
            }
        }
        let hull = convex_hull(points);
        assert_eq!(
            hull,
            [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)].map(|(u, v)| PixelPoint::new(u, v))
        );
        assert!(hull_contains(&hull, PixelPoint::new(4.0, 2.0)));
        assert!(!hull_contains(&hull, PixelPoint::new(4.001, 2.0)));
        assert!(!hull_contains(&hull[..2], PixelPoint::new(0.0, 0.0)));
    }
}
