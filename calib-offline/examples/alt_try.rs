use calib_offline::adjust::Observations;
use calib_offline::alternating::{AlternatingSettings, estimate};
use calib_offline::evaluate::truth::{PointWithTruth, compare_with_truth};
use calib_offline::geometry::triangulate_rays;
use calib_offline::init::rig::start_rig;
use calib_offline::simulate::*;

fn main() {
    let args: Vec<String> = std::env::args().collect();
    for kind in OpticsKind::ALL {
        if args.len() > 1 && !args[1..].iter().any(|a| a == kind.name()) {
            continue;
        }
        let scene = Scene::new(SceneSettings::standard_noisy(kind, 1)).unwrap();
        let views = scene.observe_corners();
        let sensors = scene.cameras.iter().map(CameraOptics::sensor).collect();
        let obs = Observations::new(scene.settings.board, sensors, &views);
        let Ok(start) = start_rig(&obs) else { continue };
        let mut s = AlternatingSettings::default();
        if let Ok(x) = std::env::var("SPREAD") {
            s.spread_px = Some(x.parse().unwrap());
        }
        if let Ok(x) = std::env::var("NEURONS") {
            s.neurons = x.parse().unwrap();
        }
        let t = std::time::Instant::now();
        let placement = |p: usize| Some(scene.pose_placements[p]);
        let e = match estimate(&start, &placement, &s) {
            Ok(e) => e,
            Err(e) => {
                println!("{}: {e}", kind.name());
                continue;
            }
        };
        let secs = t.elapsed().as_secs_f64();
        for set in [MatchSet::Points, MatchSet::Holdout] {
            let mut pts = vec![];
            let mut n = 0;
            for m in scene.matches(set, 2000) {
                n += 1;
                let (Some(a), Some(b)) =
                    (e.cameras[0].ray(m.pixels[0]), e.cameras[1].ray(m.pixels[1]))
                else {
                    continue;
                };
                let Ok(p) = triangulate_rays(&[a.ray, b.ray]) else {
                    continue;
                };
                pts.push(PointWithTruth {
                    measured_mm: p.point_mm,
                    true_mm: m.point_in_datum,
                    oracle_mm: m.oracle_in_datum,
                });
            }
            let r = compare_with_truth(&pts);
            let (p, d) = r.map_or((0.0, 0.0), |r| (r.placed_ratio, r.direct_ratio));
            println!(
                "{:9} {p:.3}|{d:.3} ({:.2}) {secs:.1}s spread {:.0} starts {:?} projected {} sweeps {} {:?} step {:.1e} rms {:.5} -> {:.5} falling {:?}",
                kind.name(),
                pts.len() as f64 / n as f64,
                e.spread.spread_px,
                e.starts
                    .iter()
                    .map(|s| (s.kind, s.rms_mm))
                    .collect::<Vec<_>>(),
                e.projected,
                e.alternated.rms_mm.len() - 1,
                e.alternated.stop,
                e.alternated.last_step_mm,
                e.alternated.rms_mm[0],
                e.alternated.rms_mm.last().unwrap(),
                e.alternated.still_falling()
            );
        }
    }
}
