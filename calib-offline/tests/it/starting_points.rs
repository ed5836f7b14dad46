//! Initialization over all simulated optics; `benches/init_sweep.rs` goes over more rigs.

use crate::common::against_truth::{observations, scene};
use calib_estimate::init::InitError;
use calib_estimate::init::rig::start_rig;
use calib_simulate::OpticsKind;

#[test]
fn every_kind_of_optics_starts_with_outliers_in_the_corners() {
    for optics in OpticsKind::ALL {
        let scene = scene(optics, |s| {
            s.outlier_share = 0.05;
            s.missing_share = 0.1;
        });
        let result = start_rig(&observations(&scene, &scene.observe_corners()));
        if optics == OpticsKind::Telecentric {
            let error = result.unwrap_err();
            assert!(matches!(error, InitError::ParallelRays { .. }), "{error:?}");
            continue;
        }
        let start = result.unwrap();
        // What a cubic field leaves: strong bumps of 2 to 5 px are the most.
        assert!(
            start.median_px.iter().all(|median_px| *median_px < 1.5),
            "{optics:?}: {:?}",
            start.median_px
        );
        assert_eq!(start.findings, [], "{optics:?}");
    }
}
