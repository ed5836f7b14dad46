//! scratch
use calib_offline::adjust::Observations;
use calib_offline::board::BoardSpec;
use calib_offline::dataset::{Corner, View};
use calib_offline::evaluate::held_out;
use calib_offline::geometry::{PixelPoint, SensorSize};
use std::collections::BTreeMap;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let (rows, cols, sq, w, h): (usize, usize, f64, u32, u32) = (
        a[2].parse().unwrap(),
        a[3].parse().unwrap(),
        a[4].parse().unwrap(),
        a[5].parse().unwrap(),
        a[6].parse().unwrap(),
    );
    let text = std::fs::read_to_string(&a[1]).unwrap();
    let mut names: Vec<String> = vec![];
    let mut views: BTreeMap<(usize, usize), Vec<Corner>> = BTreeMap::new();
    for line in text.lines().skip(1) {
        let f: Vec<&str> = line.split(',').collect();
        let c = names.iter().position(|n| n == f[0]).unwrap_or_else(|| {
            names.push(f[0].into());
            names.len() - 1
        });
        views
            .entry((c, f[1].parse().unwrap()))
            .or_default()
            .push(Corner {
                row: f[2].parse().unwrap(),
                col: f[3].parse().unwrap(),
                pixel: PixelPoint::new(f[4].parse().unwrap(), f[5].parse().unwrap()),
                sigma_px: None,
            });
    }
    let views: Vec<View> = views
        .into_iter()
        .map(|((camera_idx, pose), corners)| View {
            camera_idx,
            pose,
            corners,
        })
        .collect();
    let board = BoardSpec {
        rows,
        cols,
        square_mm: sq,
    };
    let obs = Observations::new(board, vec![SensorSize::new(w, h); names.len()], &views);
    let t = std::time::Instant::now();
    let start = calib_offline::init::rig::start_rig(&obs).unwrap();
    for (f, m) in start.fields.iter().zip(&start.median_px) {
        println!("{:?} {m}", f.base);
    }
    println!("start {:?}", t.elapsed());
    let e = calib_offline::joint::estimate(&obs, &start).unwrap();
    println!(
        "estimate {:?} sigma {} nu {} rho {} stop {}",
        t.elapsed(),
        e.noise.variance_px2.sqrt(),
        e.noise.freedom,
        e.neighbor_correlation,
        e.stop
    );
    println!("shape {:?}", e.model.board_shape);
    for s in &e.smoothness {
        println!("{s:?}");
    }
    for c in &e.choices {
        println!("{c:?}");
    }
    let h = held_out(&obs, 5, &calib_offline::progress::Silent);
    let rms = |v: &[f64]| (v.iter().map(|x| x * x).sum::<f64>() / v.len() as f64).sqrt();
    let med = |v: &[f64]| {
        let mut v: Vec<f64> = v.iter().map(|x| x.abs()).collect();
        v.sort_by(f64::total_cmp);
        v.get(v.len() / 2).copied().unwrap_or(0.0)
    };
    println!(
        "heldout {:?}: reproj rms {:.4} median {:.4} | nn rms {:.4} % median {:.4} % n {} | rigid {:.4} mm | outside {} failed {}",
        t.elapsed(),
        rms(&h.residuals_px),
        med(&h.residuals_px),
        100.0 * rms(&h.neighbor_errors),
        100.0 * med(&h.neighbor_errors),
        h.neighbor_errors.len(),
        rms(&h.rigid_errors_mm),
        h.outside_count,
        h.failed_folds
    );
}
