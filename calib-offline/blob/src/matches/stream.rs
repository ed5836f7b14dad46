//! A whole file of matches in blocks: read in order, computed in parallel or asked for elsewhere,
//! written in order.

use super::blob_source::BlobSource;
use super::error::{HeaderProblem, MatchesError, RowProblem, shortened};
use super::header::Columns;
use super::row::{self, POINTS_HEADER};
use calib_rays::measure::{BatchSource, Number, Point, PointSource, RigSource, Sighting, Status};
use rayon::prelude::*;
use serde::Serialize;
use std::convert::Infallible;
use std::io::{self, Read, Write};
use std::path::Path;

/// Bytes read at a time. The sums below are taken piece by piece in this grid, so that they do
/// not depend on the number of threads.
const BLOCK_LEN: usize = 1 << 22;
/// Bytes computed by one thread at a time.
const PIECE_LEN: usize = 1 << 17;

/// What became of the matches.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct MeasureSummary {
    /// Rows read, and written.
    pub matches: usize,
    /// With a point.
    pub ok: usize,
    /// With a pixel outside the calibrated area.
    pub outside: usize,
    /// With parallel rays.
    pub parallel: usize,
    /// With rays that meet behind a camera.
    pub behind: usize,
    /// RMS gap of the points, mm; `None` without points.
    pub gap_rms_mm: Option<f64>,
}

/// Why a stream of matches was not measured to its end; `E` is why the source gave no answer.
#[derive(Debug)]
pub enum StreamError<E = Infallible> {
    /// The matches.
    Matches(MatchesError),
    /// The points could not be written.
    Write(io::Error),
    /// The source.
    Source(E),
}

impl<E> From<MatchesError> for StreamError<E> {
    fn from(error: MatchesError) -> Self {
        Self::Matches(error)
    }
}

/// Measures every match of `input` with a blob and writes one row per match to `output`. `file` is
/// for messages only.
///
/// Not generic, like [`measure_with_calibration`]: it is compiled as this crate is, not as its caller.
///
/// # Errors
/// [`StreamError`]; what was written until then is to be thrown away.
pub fn measure_with_blob(
    source: &BlobSource<'_>,
    file: &Path,
    mut input: &mut dyn Read,
    mut output: &mut dyn Write,
) -> Result<MeasureSummary, StreamError> {
    measure_stream(source, file, &mut input, &mut output)
}

/// The same with a calibration, in double precision.
///
/// # Errors
/// [`StreamError`]; what was written until then is to be thrown away.
pub fn measure_with_calibration(
    source: &RigSource<'_>,
    file: &Path,
    mut input: &mut dyn Read,
    mut output: &mut dyn Write,
) -> Result<MeasureSummary, StreamError> {
    measure_stream(source, file, &mut input, &mut output)
}

fn measure_stream<S: PointSource>(
    source: &S,
    file: &Path,
    input: &mut impl Read,
    output: &mut impl Write,
) -> Result<MeasureSummary, StreamError> {
    let cameras = source.cameras();
    let table = Table::of_matches(&cameras);
    in_blocks(&table, file, input, output, |columns, block| {
        let pieces = pieces(block).into_par_iter();
        Ok(pieces
            .map(|piece| measure_piece(source, columns, piece))
            .collect())
    })
    .map(|total| total.summary())
}

/// The same with a source that answers many matches of two cameras at once, block by block.
///
/// # Errors
/// [`StreamError`]; what was written until then is to be thrown away.
pub fn measure_batches<S: BatchSource>(
    source: &mut S,
    file: &Path,
    input: &mut impl Read,
    output: &mut impl Write,
) -> Result<MeasureSummary, StreamError<S::Error>> {
    let cameras = source.cameras();
    let table = Table::of_matches(&cameras);
    in_blocks(&table, file, input, output, |columns, block| {
        Ok(vec![ask_piece(source, columns, block)?])
    })
    .map(|total| total.summary())
}

/// Hands on the sightings of every match of `input`; `file` is for messages only.
///
/// # Errors
/// [`MatchesError`].
pub(super) fn each_match<N: Number>(
    cameras: &[String],
    file: &Path,
    input: &mut impl Read,
    mut take: impl FnMut(&[Sighting<N>]),
) -> Result<(), MatchesError> {
    let read = |columns: &Columns, block: &[u8]| {
        let (lines, problem) = each_row(columns, block, |_, sightings| {
            take(sightings);
            Ok(())
        });
        Ok::<_, Infallible>(vec![Piece {
            lines,
            problem,
            ..Piece::default()
        }])
    };
    let table = Table::of_matches(cameras);
    match in_blocks(&table, file, input, &mut io::sink(), read) {
        Ok(_) => Ok(()),
        Err(StreamError::Matches(error)) => Err(error),
        Err(StreamError::Write(source)) => Err(MatchesError::Read {
            file: file.to_owned(),
            source,
        }),
    }
}

/// What a header says, or what is wrong with it.
type ReadHeader<'a> = Box<dyn Fn(&str) -> Result<Columns, HeaderProblem> + 'a>;

/// The heads of what is read and of what is written.
pub(super) struct Table<'a> {
    /// A header that would be right.
    pub expected: String,
    /// Reads one.
    pub columns: ReadHeader<'a>,
    /// The header written.
    pub output_header: &'static str,
}

/// Has every block of the input answered and writes what comes of it.
pub(super) fn in_blocks<E>(
    table: &Table<'_>,
    file: &Path,
    input: &mut impl Read,
    output: &mut impl Write,
    mut answer: impl FnMut(&Columns, &[u8]) -> Result<Vec<Piece>, E>,
) -> Result<Tally, StreamError<E>> {
    let mut blocks = Blocks {
        input,
        file,
        buffer: Vec::with_capacity(2 * BLOCK_LEN),
        taken: 0,
        ended: false,
    };
    let mut line = 1;
    let mut columns = None;
    let mut total = Tally::default();
    output
        .write_all(table.output_header.as_bytes())
        .and_then(|()| output.write_all(b"\n"))
        .map_err(StreamError::Write)?;
    while let Some(mut block) = blocks.next()? {
        let columns = if let Some(columns) = &columns {
            columns
        } else {
            let (header, rest) = first_line(block);
            block = rest;
            line += 1;
            columns.insert(table.read(file, header)?)
        };
        for piece in answer(columns, block).map_err(StreamError::Source)? {
            if let Some(problem) = piece.problem {
                return Err(StreamError::Matches(MatchesError::Row {
                    file: file.to_owned(),
                    line: line + piece.lines,
                    problem,
                }));
            }
            output.write_all(&piece.out).map_err(StreamError::Write)?;
            line += piece.lines;
            total.add(&piece.tally);
        }
    }
    if columns.is_none() {
        return Err(StreamError::Matches(MatchesError::Empty {
            file: file.to_owned(),
            expected: table.expected.clone(),
        }));
    }
    Ok(total)
}

/// The input in blocks that end with a line.
struct Blocks<'a, R> {
    input: &'a mut R,
    file: &'a Path,
    buffer: Vec<u8>,
    /// Bytes at the front of the buffer that the last block took.
    taken: usize,
    ended: bool,
}

impl<R: Read> Blocks<'_, R> {
    /// The next block; none at the end. The last block may lack its line end.
    fn next(&mut self) -> Result<Option<&[u8]>, MatchesError> {
        self.buffer.drain(..self.taken);
        self.taken = 0;
        let mut end = None;
        while end.is_none() && !self.ended {
            let before = self.buffer.len();
            let read = (&mut *self.input)
                .take(BLOCK_LEN as u64)
                .read_to_end(&mut self.buffer)
                .map_err(|source| MatchesError::Read {
                    file: self.file.to_owned(),
                    source,
                })?;
            self.ended = read < BLOCK_LEN;
            end = self.buffer[before..]
                .iter()
                .rposition(|b| *b == b'\n')
                .map(|k| before + k + 1);
        }
        self.taken = if self.ended {
            self.buffer.len()
        } else {
            end.unwrap_or(self.buffer.len())
        };
        Ok((self.taken > 0).then_some(&self.buffer[..self.taken]))
    }
}

/// Line without its end, and the rest.
fn first_line(bytes: &[u8]) -> (&[u8], &[u8]) {
    let end = bytes.iter().position(|b| *b == b'\n');
    let (line, rest) = match end {
        Some(end) => (&bytes[..end], &bytes[end + 1..]),
        None => (bytes, &bytes[bytes.len()..]),
    };
    (line.strip_suffix(b"\r").unwrap_or(line), rest)
}

/// Reads the header of a list of matches.
pub(super) fn parse_header(
    file: &Path,
    header: &[u8],
    cameras: &[String],
) -> Result<Columns, MatchesError> {
    Table::of_matches(cameras).read(file, header)
}

impl<'a> Table<'a> {
    fn of_matches(cameras: &'a [String]) -> Self {
        Self {
            expected: Columns::header_for(cameras),
            columns: Box::new(move |header| Columns::parse(header, cameras)),
            output_header: POINTS_HEADER,
        }
    }

    fn read(&self, file: &Path, header: &[u8]) -> Result<Columns, MatchesError> {
        let text = String::from_utf8_lossy(header);
        let text = text.strip_prefix('\u{feff}').unwrap_or(&text).trim();
        if text.is_empty() {
            return Err(MatchesError::Empty {
                file: file.to_owned(),
                expected: self.expected.clone(),
            });
        }
        (self.columns)(text).map_err(|problem| MatchesError::Header {
            file: file.to_owned(),
            found: shortened(text),
            problem,
            expected: self.expected.clone(),
        })
    }
}

/// Cuts a block into pieces that end with a line.
pub(super) fn pieces(mut block: &[u8]) -> Vec<&[u8]> {
    let mut pieces = Vec::with_capacity(block.len() / PIECE_LEN + 1);
    while !block.is_empty() {
        let from = PIECE_LEN.min(block.len());
        let end = block[from..]
            .iter()
            .position(|b| *b == b'\n')
            .map_or(block.len(), |k| from + k + 1);
        let (piece, rest) = block.split_at(end);
        pieces.push(piece);
        block = rest;
    }
    pieces
}

/// Counts of one piece or of all.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Tally {
    pub ok: usize,
    pub outside: usize,
    parallel: usize,
    behind: usize,
    gap_squared_sum_mm2: f64,
}

impl Tally {
    pub fn count(&mut self, result: Result<f64, Status>) {
        match result {
            Ok(gap_mm) => {
                self.ok += 1;
                self.gap_squared_sum_mm2 += gap_mm * gap_mm;
            }
            Err(Status::Outside) => self.outside += 1,
            Err(Status::Parallel) => self.parallel += 1,
            Err(Status::Behind) => self.behind += 1,
        }
    }

    fn add(&mut self, other: &Self) {
        self.ok += other.ok;
        self.outside += other.outside;
        self.parallel += other.parallel;
        self.behind += other.behind;
        self.gap_squared_sum_mm2 += other.gap_squared_sum_mm2;
    }

    fn summary(&self) -> MeasureSummary {
        MeasureSummary {
            matches: self.ok + self.outside + self.parallel + self.behind,
            ok: self.ok,
            outside: self.outside,
            parallel: self.parallel,
            behind: self.behind,
            gap_rms_mm: (self.ok > 0).then(|| (self.gap_squared_sum_mm2 / self.ok as f64).sqrt()),
        }
    }
}

/// What came of one piece: all its rows, or the rows before the first that is wrong.
#[derive(Default)]
pub(super) struct Piece {
    pub out: Vec<u8>,
    pub lines: usize,
    pub tally: Tally,
    pub problem: Option<RowProblem>,
}

impl Piece {
    /// Writes and counts a match.
    fn add<N: Number>(&mut self, id: &str, result: &Result<Point<N>, Status>) {
        row::write(id, result, &mut self.out);
        self.tally.count(result.map(|found| found.gap_mm.into()));
    }
}

fn measure_piece<S: PointSource>(source: &S, columns: &Columns, bytes: &[u8]) -> Piece {
    let mut piece = Piece {
        out: Vec::with_capacity(2 * bytes.len()),
        ..Piece::default()
    };
    let (lines, problem) = each_row(columns, bytes, |id, sightings| {
        piece.add(id, &source.point(sightings));
        Ok(())
    });
    (piece.lines, piece.problem) = (lines, problem);
    piece
}

/// The same of a source that is asked for all rows at once, those before a wrong one included.
fn ask_piece<S: BatchSource>(
    source: &mut S,
    columns: &Columns,
    bytes: &[u8],
) -> Result<Piece, S::Error> {
    let (mut ids, mut matches) = (Vec::new(), Vec::new());
    let (lines, problem) = each_row(columns, bytes, |id, sightings| {
        let &[first, second] = sightings else {
            return Err(RowProblem::TooManyPixels {
                have: sightings.len(),
            });
        };
        ids.push(id);
        matches.push([first, second]);
        Ok(())
    });
    let mut piece = Piece {
        lines,
        problem,
        ..Piece::default()
    };
    // Of a file that is wrong nothing is kept: nobody need be asked.
    if piece.problem.is_none() {
        for (id, result) in ids.iter().zip(source.points(&matches)?) {
            piece.add(id, &result);
        }
    }
    Ok(piece)
}

/// Hands every row on, up to the first that is wrong; how many lines that were, and what is wrong.
pub(super) fn each_row<'a, N: Number>(
    columns: &Columns,
    bytes: &'a [u8],
    mut take: impl FnMut(&'a str, &[Sighting<N>]) -> Result<(), RowProblem>,
) -> (usize, Option<RowProblem>) {
    let (text, broken) = match str::from_utf8(bytes) {
        Ok(text) => (text, false),
        // The rows before the broken one are still checked: the first wrong line is what counts.
        Err(error) => {
            let valid = &bytes[..error.valid_up_to()];
            let whole_lines = valid.iter().rposition(|b| *b == b'\n').map_or(0, |k| k + 1);
            (str::from_utf8(&valid[..whole_lines]).unwrap_or(""), true)
        }
    };
    let mut sightings = Vec::with_capacity(columns.camera_idx.len());
    let mut lines = 0;
    let mut rest = text;
    while !rest.is_empty() {
        let id = if let Some((id, behind)) = row::parse_plain(rest, columns, &mut sightings) {
            rest = behind;
            Ok(Some(id))
        } else {
            let line = rest.lines().next().unwrap_or("");
            rest = rest.split_once('\n').map_or("", |(_, behind)| behind);
            let is_row = !line.is_empty();
            is_row
                .then(|| row::parse(line, columns, &mut sightings))
                .transpose()
        };
        let taken = id.and_then(|id| id.map_or(Ok(()), |id| take(id, &sightings)));
        if let Err(problem) = taken {
            return (lines, Some(problem));
        }
        lines += 1;
    }
    (lines, broken.then_some(RowProblem::NotText))
}

#[cfg(test)]
mod tests;
