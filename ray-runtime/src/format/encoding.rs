//! The forms in which a camera's field can be stored.

/// How a camera's table is stored. Every form gives, for a pixel, the half-angle vector of its ray
/// and, if the camera is not central, the scaled offset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Encoding {
    /// What the table is made of.
    pub form: Form,
    /// Whether all rays start in the camera's reference point: nothing is stored of an offset then.
    pub is_central: bool,
}

/// What a table is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Form {
    /// Knots of a bicubic B-spline, f32. The only form of versions 1 and 2; no longer written.
    Spline,
    /// A cubic polynomial for each cell, f32: the fastest. Neighboring cells agree within twice the
    /// blob's error bound.
    Patches,
    /// A polynomial over the whole region and the knots of a bicubic B-spline of what it leaves, in
    /// steps of one size, i8 or i16: the smallest.
    Quantized,
}

impl Encoding {
    /// The number that stands in the record; `None` if it is not known.
    pub const fn from_number(number: u32) -> Option<Self> {
        let form = match number {
            1 | 2 => Form::Spline,
            3 | 4 => Form::Patches,
            5 | 6 => Form::Quantized,
            _ => return None,
        };
        Some(Self {
            form,
            is_central: number % 2 == 1,
        })
    }

    /// The number that stands in the record.
    pub const fn number(self) -> u32 {
        let first = match self.form {
            Form::Spline => 1,
            Form::Patches => 3,
            Form::Quantized => 5,
        };
        if self.is_central { first } else { first + 1 }
    }

    /// Whether this library was built to read it: each form needs a feature, `patches`, `quantized`, or
    /// `old-versions` for splines.
    pub const fn is_read(self) -> bool {
        match self.form {
            Form::Spline => cfg!(feature = "old-versions"),
            Form::Patches => cfg!(feature = "patches"),
            Form::Quantized => cfg!(feature = "quantized"),
        }
    }

    /// The lowest format version that has it.
    pub const fn since_version(self) -> u16 {
        match self.form {
            Form::Spline => 1,
            Form::Patches | Form::Quantized => 3,
        }
    }

    /// Numbers that a lookup takes from the table: 2, or 4 with an offset.
    pub const fn channels(self) -> usize {
        if self.is_central { 2 } else { 4 }
    }

    /// Bytes of the table of a form whose length follows from the cells; `None` for
    /// [`Form::Quantized`], whose header says it.
    pub const fn table_len(self, cells: [u32; 2]) -> Option<usize> {
        let [u, v] = [cells[0] as usize, cells[1] as usize];
        match self.form {
            Form::Spline => Some((u + 3) * (v + 3) * self.channels() * 4),
            Form::Patches => Some(u * v * self.channels() / 2 * PATCH_LEN),
            Form::Quantized => None,
        }
    }
}

/// Bytes of the polynomials of a cell for two channels.
pub const PATCH_LEN: usize = coefficient_count(3) * 8;

/// How many coefficients a polynomial of two variables with this total degree has.
pub const fn coefficient_count(degree: usize) -> usize {
    (degree + 1) * (degree + 2) / 2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_of_the_format_and_come_back() {
        for number in 1..=6 {
            let encoding = Encoding::from_number(number).unwrap();
            assert_eq!(encoding.number(), number);
            assert_eq!(encoding.channels(), if number % 2 == 1 { 2 } else { 4 });
        }
        assert_eq!(Encoding::from_number(0), None);
        assert_eq!(Encoding::from_number(7), None);
        assert_eq!(Encoding::from_number(1).map(|e| e.form), Some(Form::Spline));
    }

    #[test]
    fn tables_have_the_length_of_their_knots_or_patches() {
        let len = |number| Encoding::from_number(number).unwrap().table_len([5, 4]);
        assert_eq!(len(1), Some(8 * 7 * 8));
        assert_eq!(len(2), Some(8 * 7 * 16));
        assert_eq!(len(3), Some(5 * 4 * 80));
        assert_eq!(len(4), Some(5 * 4 * 160));
        assert_eq!(len(5), None);
    }
}
