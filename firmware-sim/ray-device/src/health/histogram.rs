//! How sizes are distributed, in a few bytes: bins of a quarter of a binary order.

/// Smallest size told apart is `2^LOWEST`, the largest `2^(LOWEST + ORDERS)`.
const LOWEST: i32 = -14;
const ORDERS: usize = 20;
const BINS: usize = 4 * ORDERS;

/// Counts of sizes from 6e-5 to 64, in any unit; smaller and larger ones count into the outer bins.
#[derive(Debug, Clone)]
pub(super) struct Histogram([u32; BINS]);

impl Histogram {
    pub(super) const fn new() -> Self {
        Self([0; BINS])
    }

    /// Counts a size, not negative and finite.
    pub(super) fn count(&mut self, size: f32) {
        // Exponent and two digits of an f32: the number of its bin, up to an offset.
        let quarter = (size.to_bits() >> 21).cast_signed();
        let bin = (quarter - 4 * (LOWEST + 127)).clamp(0, BINS as i32 - 1);
        if let Some(count) = self.0.get_mut(bin.cast_unsigned() as usize) {
            *count = count.saturating_add(1);
        }
    }

    pub(super) fn halve(&mut self) {
        for count in &mut self.0 {
            *count /= 2;
        }
    }

    /// What so many percent of the sizes are below, linear within a bin; 0 if nothing was counted.
    pub(super) fn quantile(&self, percent: u32) -> f32 {
        let total: u32 = self.0.iter().sum();
        let wanted = total as f32 * (percent as f32 * 0.01);
        let mut below = 0.0;
        for (bin, &count) in self.0.iter().enumerate() {
            let count = count as f32;
            if count > 0.0 && below + count >= wanted {
                let (low, high) = (edge(bin), edge(bin + 1));
                return low + (high - low) * ((wanted - below) / count);
            }
            below += count;
        }
        0.0
    }
}

/// Where a bin begins.
fn edge(bin: usize) -> f32 {
    f32::from_bits((bin as u32 + 4 * (LOWEST + 127).cast_unsigned()) << 21)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_are_quarters_of_a_binary_order() {
        assert_eq!(edge(0), 2.0f32.powi(LOWEST));
        assert_eq!(edge(4), 2.0 * edge(0));
        assert_eq!(edge(1), 1.25 * edge(0));
        assert_eq!(edge(BINS), 64.0);
    }

    #[test]
    fn quantiles_are_those_of_what_was_counted() {
        let mut histogram = Histogram::new();
        assert_eq!(histogram.quantile(95), 0.0);
        for k in 0..10_000 {
            histogram.count(k as f32 * 1e-3);
        }
        // Even within bins: exact but for round-off.
        for (percent, expected) in [(5, 0.5), (50, 5.0), (95, 9.5)] {
            let found = histogram.quantile(percent);
            assert!((found - expected).abs() < 0.01, "{percent}: {found}");
        }
        histogram.halve();
        // Half a count is lost in every second bin: 0.4 % of 5000 at most.
        assert!((histogram.quantile(50) - 5.0).abs() < 0.02);
    }

    #[test]
    fn sizes_out_of_range_count_into_the_outer_bins() {
        let mut histogram = Histogram::new();
        histogram.count(0.0);
        assert!(histogram.quantile(95) <= edge(1));
        for size in [1e9, f32::MAX, f32::INFINITY] {
            histogram.count(size);
        }
        assert!(histogram.quantile(95) > edge(BINS - 1));
    }
}
