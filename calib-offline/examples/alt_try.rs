use calib_offline::adjust::Observations;
use calib_offline::alternating::{experiment, plane_map::NetworkSettings};
use calib_offline::evaluate::truth::{PointWithTruth, compare_with_truth};
use calib_offline::geometry::triangulate_rays;
use calib_offline::init::rig::start_rig;
use calib_offline::simulate::*;

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let spread: f64 = args[1].parse().unwrap();
    let neurons: usize = args[2].parse().unwrap();
    for kind in [OpticsKind::Brown, OpticsKind::Paper, OpticsKind::Bumps, OpticsKind::Window, OpticsKind::Port, OpticsKind::Fisheye] {
        if args.len() > 3 && !args[3..].iter().any(|a| a == kind.name()) { continue; }
        let scene = Scene::new(SceneSettings::standard_noisy(kind, 1)).unwrap();
        let views = scene.observe_corners();
        let sensors = scene.cameras.iter().map(CameraOptics::sensor).collect();
        let obs = Observations::new(scene.settings.board, sensors, &views);
        let start = start_rig(&obs).unwrap();
        let mut fields = start.fields.clone();
        if std::env::var("JOINT").is_ok() {
            let est = calib_offline::joint::estimate(&start.observations, &start).unwrap();
            fields = est.model.cameras.iter().map(|c| c.field.clone()).collect();
        }
        let network = NetworkSettings { spread_px: spread, neurons, seed: 1 };
        for order in [0, 3, 4, 1, 2] {
            print!("{:8} order {order}:", kind.name());
            for sweeps in [0, 10, 30, 60, 100, 200, 400] {
                let t = std::time::Instant::now();
                let e = experiment(&start.observations, &fields, &network, sweeps, order);
                let mut pts = vec![];
                let mut n = 0;
                for m in scene.matches(MatchSet::Points, 1500) {
                    n += 1;
                    let (Some(a), Some(b)) = (e.ray(0, m.pixels[0]), e.ray(1, m.pixels[1])) else { continue };
                    let Ok(p) = triangulate_rays(&[a, b]) else { continue };
                    pts.push(PointWithTruth { measured_mm: p.point_mm, true_mm: m.point_in_datum, oracle_mm: m.oracle_in_datum });
                }
                let r = compare_with_truth(&pts);
                let (p, d) = r.map_or((0.0, 0.0), |r| (r.placed_ratio, r.direct_ratio));
                print!("  {sweeps}: {p:.3}|{d:.3} ({:.2}) {:.1}s", pts.len() as f64 / n as f64, t.elapsed().as_secs_f64());
            }
            println!();
        }
    }
}
