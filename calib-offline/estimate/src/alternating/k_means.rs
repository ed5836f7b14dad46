//! Cluster centers of pixels: where the neurons of a network sit.

use nalgebra::Vector2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Passes over the points, at most; on the corners of a board about ten change anything.
const PASSES: usize = 50;

/// Centers of `count` clusters (Lloyd's iteration from k-means++ seeds; Arthur and Vassilvitskii
/// 2007). The same seed gives the same centers. Fewer come back if there are fewer points.
pub fn k_means(points: &[Vector2<f64>], count: usize, seed: u64) -> Vec<Vector2<f64>> {
    let mut centers = seeds(points, count, seed);
    for _ in 0..PASSES {
        let mut sums = vec![(Vector2::zeros(), 0.0); centers.len()];
        for point in points {
            if let Some((sum, members)) = nearest(&centers, point).and_then(|k| sums.get_mut(k)) {
                *sum += point;
                *members += 1.0;
            }
        }
        let moved: Vec<Vector2<f64>> = sums
            .iter()
            .zip(&centers)
            .map(|((sum, members), old)| if *members > 0.0 { sum / *members } else { *old })
            .collect();
        let settled = moved == centers;
        centers = moved;
        if settled {
            break;
        }
    }
    centers
}

/// Points far from each other: each next one is drawn with a probability proportional to its squared
/// distance from those there are.
fn seeds(points: &[Vector2<f64>], count: usize, seed: u64) -> Vec<Vector2<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut centers: Vec<Vector2<f64>> = points.first().copied().into_iter().collect();
    while centers.len() < count {
        let gaps: Vec<f64> = points
            .iter()
            .map(|point| {
                centers
                    .iter()
                    .map(|center| (point - center).norm_squared())
                    .fold(f64::INFINITY, f64::min)
            })
            .collect();
        let mut left = rng.random::<f64>() * gaps.iter().sum::<f64>();
        let drawn = gaps.iter().position(|gap| {
            left -= gap;
            left < 0.0
        });
        // None is left if all points are taken.
        let Some(point) = drawn.and_then(|k| points.get(k)) else {
            break;
        };
        centers.push(*point);
    }
    centers
}

fn nearest(centers: &[Vector2<f64>], point: &Vector2<f64>) -> Option<usize> {
    (0..centers.len()).min_by(|a, b| {
        let gap = |k: &usize| (centers[*k] - point).norm_squared();
        gap(a).total_cmp(&gap(b))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_clouds_have_their_means_as_centers() {
        let offsets = [[-1.0, 0.0], [1.0, 0.0], [0.0, 2.0], [0.0, -2.0]].map(Vector2::from);
        let means = [[0.0, 0.0], [100.0, 10.0], [30.0, 200.0]].map(Vector2::from);
        let points: Vec<_> = means
            .iter()
            .flat_map(|mean| offsets.iter().map(move |offset| mean + offset))
            .collect();
        let centers = k_means(&points, 3, 1);
        for mean in means {
            let gap = centers
                .iter()
                .map(|c| (c - mean).norm())
                .fold(f64::MAX, f64::min);
            assert!(gap < 1e-12, "{mean} is {gap} away");
        }
        assert_eq!(centers, k_means(&points, 3, 1));
    }

    #[test]
    fn there_are_no_more_centers_than_places() {
        let points = vec![Vector2::new(1.0, 2.0); 5];
        assert_eq!(k_means(&points, 3, 1), [Vector2::new(1.0, 2.0)]);
        assert!(k_means(&[], 3, 1).is_empty());
    }
}
