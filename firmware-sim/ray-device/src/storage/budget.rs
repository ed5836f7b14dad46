//! How often updates may be begun and left behind: each costs an erase of the slot's first blocks, of which
//! a part survives some thousands.
//!
//! What the owner signed anew needs none of it: otherwise a peer with two old manifests could use all of it up and
//! keep the owner's next version out. Each version is let through once, and only an owner makes more of them.

use crate::protocol::{Claims, Refusal};

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
    /// Of the newest manifest of the owner for which one was begun since the device started.
    newest: Claims,
}

impl Default for Budget {
    /// All of it.
    fn default() -> Self {
        Self {
            left: STARTS,
            since_ms: 0,
            newest: Claims::default(),
        }
    }
}

impl Budget {
    /// Takes one start, unless it is the first one of what the owner has verifiably signed, newer than all begun before.
    ///
    /// # Errors
    /// [`Refusal::TooManyStarts`] if none is left.
    pub fn take(&mut self, signed: Option<Claims>, now_ms: u64) -> Result<(), Refusal> {
        if let Some(signed) = signed
            && signed.is_newer_than(self.newest)
        {
            self.newest = signed;
            return Ok(());
        }
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
            assert_eq!(budget.take(None, at), Ok(()));
        }
        let spent = |wait_ms| Err(Refusal::TooManyStarts { wait_ms });
        assert_eq!(budget.take(None, at), spent(3_600_000));
        assert_eq!(budget.take(None, at + 3_599_999), spent(1));
        at += 3_600_000;
        assert_eq!(budget.take(None, at), Ok(()));
        assert_eq!(budget.take(None, at + 600_000), spent(3_000_000));
        budget.refund();
        for _ in 0..STARTS {
            assert_eq!(budget.take(None, at), Ok(()));
        }
        assert!(budget.take(None, at).is_err());
        // However long it rests, it saves no more than that.
        at += 1000 * REFILL_MS;
        for _ in 0..STARTS {
            assert_eq!(budget.take(None, at), Ok(()));
        }
        assert!(budget.take(None, at).is_err());
    }

    #[test]
    fn each_newer_version_is_let_through_once() {
        let of = |newest_version, least_key| {
            Some(Claims {
                newest_version,
                least_version: 0,
                least_key,
            })
        };
        let mut budget = Budget::default();
        assert_eq!(budget.take(of(8, 0), 0), Ok(()));
        for _ in 0..STARTS / 2 {
            assert_eq!(budget.take(of(7, 0), 0), Ok(()));
            assert_eq!(budget.take(of(8, 0), 0), Ok(()));
        }
        assert!(budget.take(of(8, 0), 0).is_err());
        assert!(budget.take(None, 0).is_err());
        // A newer one, then one of a later key, whose versions begin anew.
        for newer in [of(9, 0), of(1, 1)] {
            assert_eq!(budget.take(newer, 0), Ok(()));
            assert!(budget.take(newer, 0).is_err());
        }
        assert!(budget.take(of(10, 0), 0).is_err());
        budget.refund();
        for _ in 0..STARTS {
            assert_eq!(budget.take(of(1, 1), 0), Ok(()));
        }
        assert!(budget.take(of(1, 1), 0).is_err());
    }
}
