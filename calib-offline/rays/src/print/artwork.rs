//! Print as shapes: rectangles and disks, black or white, each over those before it.

/// A shape, mm, in the frame of its target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// A rectangle with sides along x and y.
    Rect {
        /// Left and upper end.
        from: [f64; 2],
        /// Right and lower end.
        to: [f64; 2],
        /// Black or white.
        black: bool,
    },
    /// A disk.
    Disk {
        /// Its middle.
        at: [f64; 2],
        /// Its radius.
        radius: f64,
        /// Black or white.
        black: bool,
    },
}

impl Shape {
    /// A square by its upper left corner and side.
    pub fn square(x: f64, y: f64, side: f64, black: bool) -> Self {
        Self::Rect {
            from: [x, y],
            to: [x + side, y + side],
            black,
        }
    }

    fn is_black(&self) -> bool {
        match self {
            Self::Rect { black, .. } | Self::Disk { black, .. } => *black,
        }
    }

    /// Distance of the outline, positive inside, and the outline's nearest point.
    fn depth(&self, [x, y]: [f64; 2]) -> (f64, [f64; 2]) {
        match self {
            Self::Rect { from, to, .. } => {
                let nearest = [x.clamp(from[0], to[0]), y.clamp(from[1], to[1])];
                if nearest != [x, y] {
                    return (-(nearest[0] - x).hypot(nearest[1] - y), nearest);
                }
                [
                    (x - from[0], [from[0], y]),
                    (to[0] - x, [to[0], y]),
                    (y - from[1], [x, from[1]]),
                    (to[1] - y, [x, to[1]]),
                ]
                .into_iter()
                .fold((f64::INFINITY, [x, y]), |best, side| {
                    if side.0 < best.0 { side } else { best }
                })
            }
            Self::Disk { at, radius, .. } => {
                let (dx, dy) = (x - at[0], y - at[1]);
                let away = dx.hypot(dy).max(1e-12);
                let scale = radius / away;
                (radius - away, [at[0] + dx * scale, at[1] + dy * scale])
            }
        }
    }

    /// Left, right, upper and lower end.
    fn ends(&self) -> [f64; 4] {
        match self {
            Self::Rect { from, to, .. } => [from[0], to[0], from[1], to[1]],
            Self::Disk { at, radius, .. } => [
                at[0] - radius,
                at[0] + radius,
                at[1] - radius,
                at[1] + radius,
            ],
        }
    }
}

/// What a point of the print shows, and what lies beyond the nearest edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shade {
    /// Whether it is black here.
    pub black: bool,
    /// Whether it is black across the nearest edge.
    pub black_beyond: bool,
    /// Distance of that edge, mm: no other is nearer.
    pub edge_mm: f64,
}

/// Bins along the longer side of a plate.
const BINS: f64 = 160.0;

/// A white plate with shapes on it.
#[derive(Debug, Clone, PartialEq)]
pub struct Artwork {
    /// Left, right, upper and lower end of the plate, mm.
    pub plate_mm: [f64; 4],
    /// What is printed, from the bottom up.
    pub shapes: Vec<Shape>,
    bin_mm: f64,
    columns: usize,
    /// By bin: the shapes that come as near as half a bin, in their order.
    bins: Vec<Vec<u32>>,
}

impl Artwork {
    /// Shapes on a plate that ends at `plate_mm` (left, right, upper, lower).
    pub fn new(plate_mm: [f64; 4], shapes: Vec<Shape>) -> Self {
        let [left, right, upper, lower] = plate_mm;
        let bin_mm = (right - left).max(lower - upper).max(1e-9) / BINS;
        let count = |length: f64| (length / bin_mm).ceil().clamp(1.0, BINS + 1.0) as usize;
        let (columns, rows) = (count(right - left), count(lower - upper));
        let mut bins = vec![Vec::new(); columns * rows];
        for (shape, k) in shapes.iter().zip(0u32..) {
            let ends = shape.ends();
            let range = |low: f64, high: f64, start: f64, count: usize| {
                let bin =
                    |at: f64| (((at - start) / bin_mm).floor().max(0.0) as usize).min(count - 1);
                bin(low - bin_mm / 2.0)..=bin(high + bin_mm / 2.0)
            };
            for row in range(ends[2], ends[3], upper, rows) {
                for column in range(ends[0], ends[1], left, columns) {
                    bins[row * columns + column].push(k);
                }
            }
        }
        Self {
            plate_mm,
            shapes,
            bin_mm,
            columns,
            bins,
        }
    }

    /// What a point of the plate shows.
    pub fn shade(&self, x: f64, y: f64) -> Shade {
        let near = self.near(x, y);
        let mut shade = Shade {
            black: false,
            black_beyond: false,
            // Shapes farther away than this are not looked at.
            edge_mm: self.bin_mm / 2.0,
        };
        let mut across = None;
        for &k in near {
            let shape = &self.shapes[k as usize];
            let (depth, nearest) = shape.depth([x, y]);
            if depth >= 0.0 {
                shade.black = shape.is_black();
            }
            if depth.abs() < shade.edge_mm {
                shade.edge_mm = depth.abs();
                across = Some(nearest);
            }
        }
        shade.black_beyond = match across {
            None => shade.black,
            Some(nearest) => {
                let (dx, dy) = (nearest[0] - x, nearest[1] - y);
                let scale = 1.0 + 1e-6 * self.bin_mm / dx.hypot(dy).max(1e-12);
                self.is_black(near, [x + dx * scale, y + dy * scale])
            }
        };
        shade
    }

    fn near(&self, x: f64, y: f64) -> &[u32] {
        let bin = |at: f64, start: f64| ((at - start) / self.bin_mm).floor().max(0.0) as usize;
        let (column, row) = (bin(x, self.plate_mm[0]), bin(y, self.plate_mm[2]));
        let index = row * self.columns + column.min(self.columns - 1);
        self.bins.get(index).map_or(&[], Vec::as_slice)
    }

    fn is_black(&self, near: &[u32], at: [f64; 2]) -> bool {
        let shapes = near.iter().rev().map(|&k| &self.shapes[k as usize]);
        shapes
            .into_iter()
            .find(|shape| shape.depth(at).0 >= 0.0)
            .is_some_and(Shape::is_black)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_edge_and_what_lies_beyond() {
        let art = Artwork::new(
            [-20.0, 20.0, -20.0, 20.0],
            vec![
                Shape::square(0.0, 0.0, 10.0, true),
                Shape::Disk {
                    at: [5.0, 5.0],
                    radius: 3.0,
                    black: false,
                },
            ],
        );
        let shade = art.shade(5.0, 7.95);
        assert!(!shade.black && shade.black_beyond);
        assert!((shade.edge_mm - 0.05).abs() < 1e-12);
        let shade = art.shade(-0.02, 4.0);
        assert!(!shade.black && shade.black_beyond);
        assert!((shade.edge_mm - 0.02).abs() < 1e-12);
        let shade = art.shade(1.0, 1.0);
        assert!(shade.black && shade.black_beyond);
        assert!(!art.shade(-15.0, 19.0).black);
    }
}
