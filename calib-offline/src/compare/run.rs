//! A method on a dataset, before it is held against the others.

use super::answer::Answer;
use super::record::MethodFigures;
use crate::methods::{Given, Method, MethodError, fit_folds};
use calib_judge::Folds;
use calib_rays::progress::{Progress, Silent};
use std::time::{Duration, Instant};

/// A method and what came of it.
pub(super) struct Run<'a> {
    method: &'a dyn Method,
    /// Its answer from all views.
    pub answer: Result<Answer, MethodError>,
    /// Its answers without the poses of each fold.
    pub folds: Folds,
    time: Duration,
}

impl<'a> Run<'a> {
    /// Fits all views, and those of so many folds if there is an answer.
    pub fn new(
        method: &'a dyn Method,
        given: &Given,
        folds: usize,
        progress: &dyn Progress,
    ) -> Self {
        let began = Instant::now();
        let solution = method.fit(given, &Silent);
        let folds = if solution.is_ok() { folds } else { 0 };
        Self {
            method,
            answer: solution.map(|solution| Answer::new(solution, given.observations)),
            folds: fit_folds(method, given, given.observations, folds, None, progress),
            time: began.elapsed(),
        }
    }

    /// The method's row without any figures yet.
    pub fn empty_row(&self) -> MethodFigures {
        let answer = self.answer.as_ref();
        MethodFigures {
            method: self.method.name(),
            title: self.method.title(),
            failure: answer.err().map(MethodError::reason),
            training: None,
            conversion_error_px: answer.ok().map(|answer| answer.conversion_error_px),
            failed_folds: self.folds.failed.clone(),
            held_out: None,
            against_first: None,
            truth: Vec::new(),
            time: self.time,
        }
    }
}
