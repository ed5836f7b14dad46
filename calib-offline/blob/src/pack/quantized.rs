//! A polynomial over the sensor and the quantized knots of what it leaves: the smallest form.

use super::PackError;
use super::monomials::{self, Equation};
use super::residual_spline::{Knots, ResidualSpline};
use super::table::{Table, Target};
use calib_rays::field::CalibratedCamera;
use calib_rays::geometry::PixelPoint;
use ray_runtime::format::{
    Encoding, Form, MAX_DEGREE, QuantizedHeader, QuantizedMap, UNITS_PER_STEP,
};

/// Bytes of a knot's number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Number {
    /// No knots: the polynomial alone.
    None,
    /// i8.
    One,
    /// i16.
    Two,
}

impl Number {
    const fn len(self) -> u8 {
        match self {
            Self::None => 0,
            Self::One => 1,
            Self::Two => 2,
        }
    }

    const fn largest(self) -> f64 {
        match self {
            Self::None => 0.0,
            Self::One => i8::MAX as f64,
            Self::Two => i16::MAX as f64,
        }
    }
}

/// Points along the longer side at which polynomials are fitted.
const POINTS_ALONG_LONGER_SIDE: u32 = 64;

/// The share of the bound that the polynomial of the offset may use; if none of its degrees does
/// with that, the offset gets knots too.
const OFFSET_SHARE: f64 = 0.2;

/// The polynomials of a camera's field, and what quantized tables are made from.
pub struct Predictors<'a> {
    camera: &'a CalibratedCamera,
    target: Target<'a>,
    equations: Vec<Equation>,
    offset: Option<OffsetPredictor>,
    /// Largest misfit of the offset's polynomial of each degree that was asked for so far, mm.
    offset_errors_mm: Vec<f64>,
}

/// The polynomial of an offset field.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct OffsetPredictor {
    degree: usize,
    /// Whether it does without knots.
    is_enough: bool,
}

impl<'a> Predictors<'a> {
    /// Samples a camera's field. Before tables are asked for, [`set_bound`](Self::set_bound).
    ///
    /// # Errors
    /// [`PackError::Field`].
    pub fn new(camera: &'a CalibratedCamera) -> Result<Self, PackError> {
        let sensor = camera.field.sensor;
        let target = Target::new(camera);
        let spacing_px = f64::from(sensor.width.max(sensor.height) - 1).max(1.0)
            / f64::from(POINTS_ALONG_LONGER_SIDE);
        let places = |extent: u32| {
            let steps = (f64::from(extent - 1) / spacing_px).ceil().max(1.0);
            (0..=steps as u32).map(move |k| f64::from(k) * f64::from(extent - 1) / steps)
        };
        let mut equations = Vec::new();
        for v in places(sensor.height) {
            for u in places(sensor.width) {
                let pixel = PixelPoint::new(u, v);
                if camera.coverage.contains(pixel) {
                    let value = target.required(pixel, &camera.field.sample(pixel))?;
                    equations.push(Equation {
                        at: variables(camera, pixel),
                        value,
                        weight: 1.0,
                    });
                }
            }
        }
        Ok(Self {
            camera,
            target,
            equations,
            offset: None,
            offset_errors_mm: Vec::new(),
        })
    }

    /// Chooses the polynomial of the offset for a bound in mm: the lowest degree that stays within its
    /// share of it everywhere, or else the cubic and knots.
    pub fn set_bound(&mut self, max_error_mm: f64) {
        if self.camera.field.is_central() {
            return;
        }
        let limit_mm = OFFSET_SHARE * max_error_mm;
        let enough =
            (0..=MAX_DEGREE.into()).find(|degree| self.offset_error_mm(*degree) <= limit_mm);
        self.offset = Some(OffsetPredictor {
            degree: enough.unwrap_or(DEFAULT_OFFSET_DEGREE),
            is_enough: enough.is_some(),
        });
    }

    /// What tables depend on besides their plan; `None` for a central camera.
    pub fn offset(&self) -> Option<OffsetPredictor> {
        self.offset
    }

    /// Largest misfit of the offset's polynomial of a degree; infinite if there is none.
    fn offset_error_mm(&mut self, degree: usize) -> f64 {
        for next in self.offset_errors_mm.len()..=degree {
            let worst = monomials::fit(&self.equations, next, 0.0).map_or(f64::INFINITY, |found| {
                let errors = self.equations.iter().map(|equation| {
                    let found = evaluate(&found, next, equation.at);
                    let error = [2, 3].map(|c| found[c] - equation.value[c]);
                    error[0].hypot(error[1])
                });
                errors.fold(0.0, |worst, error| {
                    if error.is_nan() {
                        f64::INFINITY
                    } else {
                        error.max(worst)
                    }
                })
            });
            self.offset_errors_mm.push(worst);
        }
        self.offset_errors_mm[degree]
    }

    /// Bytes of the table with a direction polynomial of this degree and these knots.
    pub fn byte_count(&self, degree: u8, number: Number, cells: [u32; 2]) -> usize {
        let header = self.header(degree, number, [0.0; 2], cells, self.offset);
        header.layout(cells).offset_knots_end
    }

    fn header(
        &self,
        degree: u8,
        number: Number,
        [step, offset_step]: [f64; 2],
        cells: [u32; 2],
        offset: Option<OffsetPredictor>,
    ) -> QuantizedHeader {
        let sensor = self.camera.field.sensor;
        let map = |degree, number: Number, step: f64| QuantizedMap {
            degree,
            number_len: number.len(),
            unit: (step / f64::from(UNITS_PER_STEP)) as f32,
        };
        let direction = map(degree, number, step);
        let offset = offset.map(|offset| {
            let number = offset_number(Some(offset), number);
            map(offset.degree as u8, number, offset_step)
        });
        QuantizedHeader::new(direction, offset, [sensor.width, sensor.height], cells)
    }

    /// The table with a direction polynomial of this degree, these knots, and this polynomial of the offset.
    ///
    /// # Errors
    /// [`PackError::Fit`].
    pub fn table(
        &self,
        degree: u8,
        number: Number,
        cells: [u32; 2],
        offset_predictor: Option<OffsetPredictor>,
    ) -> Result<Table, PackError> {
        let not_fitted = || PackError::Fit {
            camera: self.camera.name.clone(),
            cells,
        };
        let direction =
            monomials::fit(&self.equations, degree.into(), 0.0).ok_or_else(not_fitted)?;
        let offset_degree = offset_predictor.map(|offset| offset.degree);
        let offset = match offset_degree {
            Some(degree) => monomials::fit(&self.equations, degree, 0.0).ok_or_else(not_fitted)?,
            None => Vec::new(),
        };
        // As they are stored.
        let [direction, offset] = [direction, offset].map(rounded);

        let knots = if number == Number::None {
            None
        } else {
            let spline = ResidualSpline::new(self.camera, &self.target, cells);
            let predicted = |pixel: PixelPoint| {
                let at = variables(self.camera, pixel);
                let [s1, s2, ..] = evaluate(&direction, degree.into(), at);
                let [.., n1, n2] =
                    offset_degree.map_or([0.0; 4], |degree| evaluate(&offset, degree, at));
                [s1, s2, n1, n2]
            };
            Some(spline.fit(predicted)?)
        };
        let offset_number = offset_number(offset_predictor, number);
        let step = |channels: [usize; 2], number: Number| match &knots {
            Some(knots) if number != Number::None => knots.largest(channels) / number.largest(),
            _ => 0.0,
        };
        let steps = [step([0, 1], number), step([2, 3], offset_number)];
        let header = self.header(degree, number, steps, cells, offset_predictor);
        let layout = header.layout(cells);

        let mut bytes = header.to_bytes().to_vec();
        push_coefficients(&mut bytes, &direction, [0, 1]);
        push_coefficients(&mut bytes, &offset, [2, 3]);
        if let Some(knots) = &knots {
            push_knots(&mut bytes, knots, [0, 1], header.direction);
            bytes.resize(layout.offset_knots, 0);
            push_knots(&mut bytes, knots, [2, 3], header.offset);
        }
        debug_assert_eq!(bytes.len(), layout.offset_knots_end);
        Ok(Table {
            encoding: Encoding {
                form: Form::Quantized,
                is_central: offset_predictor.is_none(),
            },
            cells,
            bytes,
        })
    }
}

/// The knots of the offset, beside those of the direction.
fn offset_number(offset: Option<OffsetPredictor>, number: Number) -> Number {
    match offset {
        Some(offset) if !offset.is_enough && number != Number::None => Number::Two,
        _ => Number::None,
    }
}

/// Degree of the offset's polynomial where knots hold the rest.
const DEFAULT_OFFSET_DEGREE: usize = 3;

/// The polynomials' variables at a pixel, as the runtime has them.
fn variables(camera: &CalibratedCamera, pixel: PixelPoint) -> [f64; 2] {
    let sensor = camera.field.sensor;
    let along = |x: f64, extent: u32| (x + 0.5) * f64::from(2.0 / extent as f32) - 1.0;
    [along(pixel.u, sensor.width), along(pixel.v, sensor.height)]
}

fn evaluate(coefficients: &[[f64; 4]], degree: usize, [x, y]: [f64; 2]) -> [f64; 4] {
    let mut sum = [0.0; 4];
    for (coefficient, term) in coefficients.iter().zip(monomials::terms(degree, x, y)) {
        for (sum, c) in sum.iter_mut().zip(coefficient) {
            *sum += c * term;
        }
    }
    sum
}

fn rounded(coefficients: Vec<[f64; 4]>) -> Vec<[f64; 4]> {
    coefficients
        .into_iter()
        .map(|c| c.map(|x| f64::from(x as f32)))
        .collect()
}

fn push_coefficients(bytes: &mut Vec<u8>, coefficients: &[[f64; 4]], channels: [usize; 2]) {
    for coefficient in coefficients {
        let pair = channels.map(|c| (coefficient[c] as f32).to_le_bytes());
        bytes.extend(pair.as_flattened());
    }
}

fn push_knots(bytes: &mut Vec<u8>, knots: &Knots, channels: [usize; 2], map: QuantizedMap) {
    if map.number_len == 0 {
        return;
    }
    let step = f64::from(map.unit) * f64::from(UNITS_PER_STEP);
    for knot in &knots.knots {
        for c in channels {
            // A step of zero is that of knots of zero; casts saturate, and what is no number is 0.
            let number = (knot[c] / step).round();
            match map.number_len {
                1 => bytes.push((number as i8).cast_unsigned()),
                _ => bytes.extend((number as i16).to_le_bytes()),
            }
        }
    }
}
