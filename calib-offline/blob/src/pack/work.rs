//! What packing a camera may cost, counted and not clocked, so that every machine ends with the same bytes.

/// Steps of fits that one camera may take, each some 0.1 ns: a dozen of the largest tables.
pub const MOST_FIT_STEPS: u64 = 100_000_000_000;
/// Every calibrated pixel may be compared this often by proofs of whole tables,
const MOST_PROOFS: u64 = 3;
/// and besides this many pixels, which is more proofs of a small sensor.
const MORE_PROVEN_PX: u64 = 20_000_000;

/// Most pixels that the proofs of a camera with so many calibrated ones may compare.
pub fn most_proven_px(calibrated_px: u64) -> u64 {
    MOST_PROOFS * calibrated_px + MORE_PROVEN_PX
}

/// What packing a camera, or a rig, has cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Work {
    /// Tables fitted; none is fitted twice to be tried.
    pub tables: u64,
    /// Steps of those fits, each some 0.1 ns.
    pub fit_steps: u64,
    /// Tables of which every calibrated pixel was compared.
    pub proofs: u64,
    /// Pixels compared by proofs, those included that a coarse one has refused.
    pub proven_px: u64,
    /// Whether something was left out because there was no more to spend: a smaller table, or one with
    /// a smaller error, may exist.
    pub is_spent: bool,
}

impl Work {
    /// Both together.
    pub fn with(self, other: Self) -> Self {
        Self {
            tables: self.tables + other.tables,
            fit_steps: self.fit_steps + other.fit_steps,
            proofs: self.proofs + other.proofs,
            proven_px: self.proven_px + other.proven_px,
            is_spent: self.is_spent || other.is_spent,
        }
    }

    /// Whether a fit of so many steps is still to be had; it is counted, or else the work is spent.
    pub fn afford_fit(&mut self, steps: u64) -> bool {
        if self.fit_steps + steps > MOST_FIT_STEPS {
            self.is_spent = true;
            return false;
        }
        self.tables += 1;
        self.fit_steps += steps;
        true
    }

    /// Whether so many pixels may still be compared, of a camera with `calibrated_px` of them; they are
    /// counted, or else the work is spent.
    pub fn afford_proof(&mut self, pixels: u64, calibrated_px: u64) -> bool {
        if self.proven_px + pixels > most_proven_px(calibrated_px) {
            self.is_spent = true;
            return false;
        }
        self.proven_px += pixels;
        true
    }

    /// As [`afford_proof`](Self::afford_proof), of every calibrated pixel. The first is never refused: whatever
    /// else was spent, something must be proven.
    pub fn afford_full_proof(&mut self, calibrated_px: u64) -> bool {
        if self.proofs == 0 {
            self.proven_px += calibrated_px;
        } else if !self.afford_proof(calibrated_px, calibrated_px) {
            return false;
        }
        self.proofs += 1;
        true
    }
}
