//! Dictionaries of coded markers: square patterns of black and white cells within a black border of
//! one cell.
//!
//! The codes are those of `OpenCV`'s predefined dictionaries, `AprilTag` families included.

use calib_targets_aruco::{Dictionary, builtins, rotate_code_u64};

/// A dictionary.
#[derive(Debug, Clone, Copy)]
pub struct Codes {
    dictionary: Dictionary,
}

impl PartialEq for Codes {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

/// A marker as it was read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Code {
    /// Its number in the dictionary.
    pub id: usize,
    /// Quarter turns that take the printed marker to what was read, clockwise as seen on the face.
    pub quarter_turns: u8,
    /// Cells that were read wrongly.
    pub wrong_cells: u32,
}

impl Codes {
    /// The dictionary of `OpenCV`'s name, such as `DICT_4X4_100`; `None` if there is none.
    pub fn named(name: &str) -> Option<Self> {
        builtins::builtin_dictionary(name).map(|dictionary| Self { dictionary })
    }

    /// The names of all dictionaries.
    pub fn names() -> &'static [&'static str] {
        builtins::BUILTIN_DICTIONARY_NAMES
    }

    /// `OpenCV`'s name.
    pub fn name(&self) -> &'static str {
        self.dictionary.name()
    }

    /// Cells along a side, without the border.
    pub fn side(&self) -> usize {
        self.dictionary.marker_size()
    }

    /// How many markers there are.
    pub fn count(&self) -> usize {
        self.dictionary.codes().len()
    }

    /// Whether a cell of an upright marker is black; the border lies at -1 and at [`Self::side`].
    /// Of a marker that is not in the dictionary, every cell is.
    pub fn is_black(&self, id: usize, row: i64, col: i64) -> bool {
        let side = self.side() as i64;
        if !(0..side).contains(&row) || !(0..side).contains(&col) {
            return true;
        }
        let code = self.dictionary.codes().get(id);
        code.is_none_or(|code| code >> (row * side + col) & 1 == 1)
    }

    /// The marker among `ids` nearest to cells that were read (row by row, black is 1, the first cell
    /// is the lowest bit), if it differs in at most `max_wrong` of them.
    pub fn nearest(
        &self,
        read: u64,
        ids: impl Iterator<Item = usize>,
        max_wrong: u32,
    ) -> Option<Code> {
        // Turned back, so that each code is compared as it is printed.
        let turned: [u64; 4] = std::array::from_fn(|k| self.turned_back(read, k as u8));
        let codes = self.dictionary.codes();
        ids.filter_map(|id| Some((id, *codes.get(id)?)))
            .flat_map(|(id, code)| {
                turned
                    .iter()
                    .zip(0u8..)
                    .map(move |(cells, quarter_turns)| Code {
                        id,
                        quarter_turns,
                        wrong_cells: (cells ^ code).count_ones(),
                    })
            })
            .filter(|code| code.wrong_cells <= max_wrong)
            .min_by_key(|code| code.wrong_cells)
    }

    /// Cells that a marker of the dictionary may differ in and still be nearer to it than to any
    /// other, as `OpenCV` states it; 1 where it states none, which is less than each family corrects.
    pub fn correctable(&self) -> u32 {
        u32::from(self.dictionary.max_correction_bits()).max(1)
    }

    fn turned_back(&self, read: u64, quarter_turns: u8) -> u64 {
        rotate_code_u64(read, self.side(), (4 - quarter_turns) % 4)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cells row by row, black is 1, of a marker turned clockwise.
    fn read(codes: &Codes, id: usize, quarter_turns: u8) -> u64 {
        let side = codes.side() as i64;
        let mut cells = 0;
        for row in 0..side {
            for col in 0..side {
                // Turned clockwise, what was at (row, col) stands at (col, side - 1 - row).
                let (mut r, mut c) = (row, col);
                for _ in 0..quarter_turns {
                    (r, c) = (c, side - 1 - r);
                }
                cells |= u64::from(codes.is_black(id, row, col)) << (r * side + c);
            }
        }
        cells
    }

    #[test]
    fn a_turned_marker_is_read_with_its_turn() {
        let codes = Codes::named("DICT_5X5_100").unwrap();
        for quarter_turns in 0..4 {
            let found = codes.nearest(read(&codes, 17, quarter_turns), 0..100, 0);
            let expected = Code {
                id: 17,
                quarter_turns,
                wrong_cells: 0,
            };
            assert_eq!(found, Some(expected));
        }
        let one_wrong = read(&codes, 17, 1) ^ 4;
        assert_eq!(codes.nearest(one_wrong, 0..100, 0), None);
        assert_eq!(codes.nearest(one_wrong, 0..100, 1).map(|c| c.id), Some(17));
        assert_eq!(codes.nearest(one_wrong, 0..17, 1), None);
    }

    #[test]
    fn every_name_is_known() {
        assert!(Codes::names().contains(&"DICT_APRILTAG_36h11"));
        for name in Codes::names() {
            assert!(Codes::named(name).is_some_and(|codes| codes.count() > 0));
        }
        assert!(Codes::named("DICT_8X8_50").is_none());
    }

    #[test]
    fn the_first_marker_of_4x4_is_as_opencv_draws_it() {
        // Rows from the top, 1 is white.
        let drawn = ["1011", "0101", "0011", "0010"];
        let codes = Codes::named("DICT_4X4_50").unwrap();
        for (row, line) in drawn.iter().enumerate() {
            for (col, cell) in line.chars().enumerate() {
                let is_black = codes.is_black(0, row as i64, col as i64);
                assert_eq!(is_black, cell == '0', "{row} {col}");
            }
        }
    }
}
