//! What two cameras' views agree on when some of them are read otherwise than they are written.

use super::look::{Look, ViewPair};
use calib_estimate::init::board_pose::ViewFit;
use calib_estimate::init::pair_consensus::{COARSE_LIMIT_SIGMA, Consensus, Pair, consensus};
use calib_rays::numerics::median;

/// The views of a pair, as they are to be read.
#[derive(Debug, Clone)]
pub struct ReadPair {
    /// By the camera of lower number.
    pub first: ViewFit,
    /// By the other.
    pub second: ViewFit,
}

impl ReadPair {
    /// As recorded; `None` where a view places no board.
    pub fn as_recorded(look: &Look<'_>, pair: &ViewPair) -> Option<Self> {
        Some(Self {
            first: look.fits[pair.first].clone()?,
            second: look.fits[pair.second].clone()?,
        })
    }
}

/// The place of one camera to the other that most pairs agree on; `None` with fewer than two pairs.
pub fn agreement(look: &Look<'_>, pairs: &[ReadPair]) -> Option<Consensus> {
    if pairs.len() < 2 {
        return None;
    }
    let pairs: Vec<Pair> = pairs
        .iter()
        .map(|pair| Pair {
            first: &pair.first,
            second: &pair.second,
        })
        .collect();
    consensus(&look.dataset.board, &pairs, COARSE_LIMIT_SIGMA)
}

/// Variance per axis that the views' own residuals explain, px^2.
pub fn own_variance_px2(pairs: &[ReadPair]) -> f64 {
    let larger = |pair: &ReadPair| f64::max(pair.first.variance_px2(), pair.second.variance_px2());
    median(pairs.iter().map(larger)).unwrap_or(0.0)
}
