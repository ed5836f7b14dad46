//! Progress for people: bars on a terminal, plain lines in a log.

use super::settings::{Narration, Settings};
use calib_rays::progress::Progress;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::Write;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// How often a log hears of a long stage.
const LOG_EVERY: Duration = Duration::from_secs(10);

/// Shows the stage that is running.
#[derive(Debug)]
pub struct Bars {
    settings: Settings,
    stage: Mutex<Option<Stage>>,
}

#[derive(Debug)]
struct Stage {
    name: String,
    total: usize,
    done: usize,
    began: Instant,
    last_line: Instant,
    bar: Option<ProgressBar>,
}

impl Bars {
    /// Nothing is running yet.
    pub fn new(settings: Settings) -> Self {
        Self {
            settings,
            stage: Mutex::new(None),
        }
    }

    /// Does something on the terminal without tearing the bar.
    pub fn above(&self, print: impl FnOnce()) {
        match self.lock().as_ref().and_then(|stage| stage.bar.clone()) {
            Some(bar) => bar.suspend(print),
            None => print(),
        }
    }

    fn lock(&self) -> MutexGuard<'_, Option<Stage>> {
        // A thread that died while counting leaves at worst a wrong count.
        self.stage.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn line(text: &str) {
        let _ = writeln!(std::io::stderr().lock(), "{text}");
    }
}

impl Progress for Bars {
    fn begin(&self, stage: &str, total: usize) {
        self.end();
        if self.settings.narration < Narration::Usual {
            return;
        }
        let now = Instant::now();
        *self.lock() = Some(Stage {
            name: stage.to_owned(),
            total,
            done: 0,
            began: now,
            last_line: now,
            bar: self.settings.bars.then(|| bar(stage, total)),
        });
        if !self.settings.bars {
            Self::line(&if total > 0 {
                format!("{stage}: {total} steps")
            } else {
                stage.to_owned()
            });
        }
    }

    fn advance(&self) {
        let mut lock = self.lock();
        let Some(stage) = lock.as_mut() else { return };
        stage.done += 1;
        if let Some(bar) = &stage.bar {
            bar.inc(1);
        } else if stage.last_line.elapsed() >= LOG_EVERY {
            stage.last_line = Instant::now();
            let (name, done, total) = (&stage.name, stage.done, stage.total);
            Self::line(&if total > 0 {
                format!("{name}: {done} of {total}")
            } else {
                format!("{name}: {done} steps")
            });
        }
    }

    fn end(&self) {
        let Some(stage) = self.lock().take() else {
            return;
        };
        if let Some(bar) = stage.bar {
            bar.finish_and_clear();
        }
        let seconds = stage.began.elapsed().as_secs_f64();
        Self::line(&format!("{}: done in {seconds:.1} s", stage.name));
    }
}

fn bar(stage: &str, total: usize) -> ProgressBar {
    let (bar, template) = if total > 0 {
        (
            ProgressBar::new(total as u64),
            "{msg} {wide_bar} {pos}/{len} {eta}",
        )
    } else {
        (
            ProgressBar::new_spinner(),
            "{msg} {spinner} {pos} {elapsed}",
        )
    };
    bar.set_draw_target(ProgressDrawTarget::stderr());
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar.set_message(stage.to_owned());
    bar.enable_steady_tick(Duration::from_millis(120));
    bar
}
