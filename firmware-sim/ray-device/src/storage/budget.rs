//! How often updates may be begun and left behind: each costs an erase of the slot's first blocks, of which
//! a part survives some thousands.

use crate::protocol::Refusal;

/// Updates that may be begun in a row without one being finished.
pub const STARTS: u8 = 32;

/// Time after which one more may be begun, ms: an hour, so that whoever begins as many as are allowed takes more than a
/// year for 10,000 erases.
pub const REFILL_MS: u64 = 3_600_000;

/// What is left of them. A restart of the device begins anew.
#[derive(Clone, Copy, Debug)]
pub struct Budget {
    left: u8,
    /// Since when the next one is on its way back.
    since_ms: u64,
}

impl Default for Budget {
    /// All of it.
    fn default() -> Self {
        Self {
            left: STARTS,
            since_ms: 0,
        }
    }
}

impl Budget {
    /// Takes one start.
    ///
    /// # Errors
    /// [`Refusal::TooManyStarts`] if none is left.
    pub fn take(&mut self, now_ms: u64) -> Result<(), Refusal> {
        let back = now_ms.saturating_sub(self.since_ms) / REFILL_MS;
        let left = u64::from(self.left).saturating_add(back);
        if left >= u64::from(STARTS) {
            self.left = STARTS;
            self.since_ms = now_ms;
        } else {
            self.left = left as u8;
            self.since_ms = self.since_ms.saturating_add(back.saturating_mul(REFILL_MS));
        }
        let Some(left) = self.left.checked_sub(1) else {
            let waited_ms = now_ms.saturating_sub(self.since_ms);
            let wait_ms = REFILL_MS.saturating_sub(waited_ms) as u32;
            return Err(Refusal::TooManyStarts { wait_ms });
        };
        self.left = left;
        Ok(())
    }

    /// After an update that was finished: all of it is there again.
    pub fn refund(&mut self) {
        *self = Self {
            left: STARTS,
            ..*self
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn so_many_at_once_then_one_an_hour_and_all_after_one_that_was_finished() {
        let mut budget = Budget::default();
        let mut at = 10_000_000;
        for _ in 0..STARTS {
            assert_eq!(budget.take(at), Ok(()));
        }
        let spent = |wait_ms| Err(Refusal::TooManyStarts { wait_ms });
        assert_eq!(budget.take(at), spent(3_600_000));
        assert_eq!(budget.take(at + 3_599_999), spent(1));
        at += 3_600_000;
        assert_eq!(budget.take(at), Ok(()));
        assert_eq!(budget.take(at + 600_000), spent(3_000_000));
        budget.refund();
        for _ in 0..STARTS {
            assert_eq!(budget.take(at), Ok(()));
        }
        assert!(budget.take(at).is_err());
        // However long it rests, it saves no more than that.
        at += 1000 * REFILL_MS;
        for _ in 0..STARTS {
            assert_eq!(budget.take(at), Ok(()));
        }
        assert!(budget.take(at).is_err());
    }
}
