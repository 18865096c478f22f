//! Decoder for the times of points in LASzip's item `GPSTIME11`, version 2.
//!
//! Source: Isenburg, "LASzip: lossless compression of LiDAR data", Photogrammetric Engineering and Remote Sensing 79(2), 2013, and
//! the LASzip sources.
//!
//! A time continues one of four sequences; a code may switch to another sequence before it. A writer switches at most once, to the
//! sequence of the time. `laz` decodes switches recursively, so that a damaged file with millions of them overflows the stack, which
//! cannot be caught. Here a second switch in a row is an error.

use laz::decoders::ArithmeticDecoder;
use laz::decompressors::{IntegerDecompressor, IntegerDecompressorBuilder};
use laz::models::{ArithmeticModel, ArithmeticModelBuilder};
use laz::record::FieldDecompressor;
use std::io::{self, Read};

/// Largest and smallest multiple of the last step that a code can represent.
const MULTIPLE_MAX: i32 = 500;
const MULTIPLE_MIN: i32 = -10;
/// Codes after those of the multiples: same time, full time, and switches.
const SAME: i32 = MULTIPLE_MAX - MULTIPLE_MIN + 1;
const FULL: i32 = SAME + 1;
const CODES: u32 = FULL as u32 + 4;
/// Codes after a step of zero: same time, a step, full time, and switches.
const CODES_STANDING: u32 = 6;
const SEQUENCES: usize = 4;
/// After more than this many deviating steps in a row, the expected step changes.
const UNLIKE_MAX: u32 = 3;

/// Contexts of the integers.
mod context {
    pub const FIRST_STEP: u32 = 0;
    pub const ONCE: u32 = 1;
    pub const FEW: u32 = 2;
    pub const MANY: u32 = 3;
    pub const MOST: u32 = 4;
    pub const BACK: u32 = 5;
    pub const FARTHEST_BACK: u32 = 6;
    pub const UNLIKE: u32 = 7;
    pub const HIGH_WORD: u32 = 8;
    pub const COUNT: u32 = 9;
}

#[derive(Clone, Copy, Debug, Default)]
struct Sequence {
    /// Bits of the last time.
    time: i64,
    /// The expected step.
    step: i32,
    /// Deviating steps in a row.
    unlike: u32,
}

/// Meaning of a code.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Code {
    Same,
    /// A step from zero.
    FirstStep,
    /// Approximate multiple of the expected step.
    Multiple(i32),
    Full,
    /// Number of sequences to advance.
    Switch(usize),
}

/// Decodes the times of points.
pub(super) struct GpsTimes {
    moving: ArithmeticModel,
    standing: ArithmeticModel,
    integers: IntegerDecompressor,
    sequences: [Sequence; SEQUENCES],
    /// The sequence of the last time.
    last: usize,
    /// The sequence started last.
    newest: usize,
}

impl Default for GpsTimes {
    fn default() -> Self {
        Self {
            moving: ArithmeticModelBuilder::new(CODES).build(),
            standing: ArithmeticModelBuilder::new(CODES_STANDING).build(),
            integers: IntegerDecompressorBuilder::new().bits(32).contexts(context::COUNT).build_initialized(),
            sequences: [Sequence::default(); SEQUENCES],
            last: 0,
            newest: 0,
        }
    }
}

impl GpsTimes {
    fn code<R: Read>(&mut self, decoder: &mut ArithmeticDecoder<R>) -> io::Result<Code> {
        if self.sequences[self.last].step == 0 {
            return Ok(match decoder.decode_symbol(&mut self.standing)? {
                0 => Code::Same,
                1 => Code::FirstStep,
                2 => Code::Full,
                switch => Code::Switch(switch as usize - 2),
            });
        }
        Ok(match decoder.decode_symbol(&mut self.moving)? as i32 {
            multiple @ 0..=MULTIPLE_MAX => Code::Multiple(multiple),
            back if back < SAME => Code::Multiple(MULTIPLE_MAX - back),
            SAME => Code::Same,
            FULL => Code::Full,
            switch => Code::Switch((switch - FULL) as usize),
        })
    }

    /// The next time, as the bits of a double.
    fn next<R: Read>(&mut self, decoder: &mut ArithmeticDecoder<R>) -> io::Result<i64> {
        let mut code = self.code(decoder)?;
        if let Code::Switch(on) = code {
            self.last = (self.last + on) % SEQUENCES;
            code = self.code(decoder)?;
        }
        match code {
            Code::Same => {}
            Code::FirstStep => self.first_step(decoder)?,
            Code::Multiple(multiple) => self.step(decoder, multiple)?,
            Code::Full => self.full(decoder)?,
            Code::Switch(_) => {
                return Err(io::Error::new(io::ErrorKind::InvalidData, "times switch sequences twice in a row"));
            }
        }
        Ok(self.sequences[self.last].time)
    }

    fn first_step<R: Read>(&mut self, decoder: &mut ArithmeticDecoder<R>) -> io::Result<()> {
        let step = self.integers.decompress(decoder, 0, context::FIRST_STEP)?;
        let sequence = &mut self.sequences[self.last];
        *sequence = Sequence { time: sequence.time.wrapping_add(i64::from(step)), step, unlike: 0 };
        Ok(())
    }

    fn step<R: Read>(&mut self, decoder: &mut ArithmeticDecoder<R>, multiple: i32) -> io::Result<()> {
        let context = match multiple {
            0 => context::UNLIKE,
            1 => context::ONCE,
            2..10 => context::FEW,
            10..MULTIPLE_MAX => context::MANY,
            MULTIPLE_MAX => context::MOST,
            MULTIPLE_MIN => context::FARTHEST_BACK,
            _ => context::BACK,
        };
        let sequence = &mut self.sequences[self.last];
        let step = self.integers.decompress(decoder, multiple.wrapping_mul(sequence.step), context)?;
        sequence.time = sequence.time.wrapping_add(i64::from(step));
        match multiple {
            1 => sequence.unlike = 0,
            0 | MULTIPLE_MAX | MULTIPLE_MIN => {
                sequence.unlike += 1;
                if sequence.unlike > UNLIKE_MAX {
                    (sequence.step, sequence.unlike) = (step, 0);
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// Starts a sequence.
    fn full<R: Read>(&mut self, decoder: &mut ArithmeticDecoder<R>) -> io::Result<()> {
        let expected = (self.sequences[self.last].time >> 32) as i32;
        let high = self.integers.decompress(decoder, expected, context::HIGH_WORD)?;
        let time = (i64::from(high) << 32) | i64::from(decoder.read_int()?);
        self.newest = (self.newest + 1) % SEQUENCES;
        self.last = self.newest;
        self.sequences[self.last] = Sequence { time, step: 0, unlike: 0 };
        Ok(())
    }
}

impl<R: Read> FieldDecompressor<R> for GpsTimes {
    fn size_of_field(&self) -> usize {
        size_of::<f64>()
    }

    fn decompress_first(&mut self, source: &mut R, first: &mut [u8]) -> io::Result<()> {
        let mut time = [0; size_of::<f64>()];
        source.read_exact(&mut time)?;
        first.copy_from_slice(&time);
        self.sequences[0].time = i64::from_le_bytes(time);
        Ok(())
    }

    fn decompress_with(&mut self, decoder: &mut ArithmeticDecoder<R>, field: &mut [u8]) -> io::Result<()> {
        field.copy_from_slice(&self.next(decoder)?.to_le_bytes());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use laz::las::v2::{GpsTimeCompressor, GpsTimeDecompressor};
    use laz::record::{
        RecordCompressor, RecordDecompressor, SequentialPointRecordCompressor, SequentialPointRecordDecompressor,
    };
    use proptest::prelude::*;

    fn packed(times: &[f64]) -> Vec<u8> {
        let mut compressor = SequentialPointRecordCompressor::new(Vec::new());
        compressor.add_field_compressor(GpsTimeCompressor::default());
        times.iter().for_each(|time| compressor.compress_next(&time.to_le_bytes()).unwrap());
        compressor.done().unwrap();
        compressor.into_inner()
    }

    fn unpacked(
        bytes: &[u8],
        count: usize,
        field: impl FieldDecompressor<io::Cursor<Vec<u8>>> + Send + Sync + 'static,
    ) -> io::Result<Vec<f64>> {
        let mut decompressor = SequentialPointRecordDecompressor::new(io::Cursor::new(bytes.to_vec()));
        decompressor.add_field_decompressor(field);
        let mut time = [0; 8];
        (0..count).map(|_| decompressor.decompress_next(&mut time).map(|()| f64::from_le_bytes(time))).collect()
    }

    /// Steps of interleaved flight lines: equal, repeated, several times longer, backwards, and jumps.
    fn times() -> impl Strategy<Value = Vec<f64>> {
        let step = prop_oneof![
            Just(0.0),
            Just(1e-5),
            Just(2e-5),
            Just(-3e-5),
            Just(4e-3),
            Just(-1e-3),
            -1.0..1.0f64,
            -1e9..1e9f64
        ];
        prop::collection::vec((0usize..6, step, any::<bool>()), 1..400).prop_map(|steps| {
            let mut lines = [1e8, 1.5e8, 2e8, 2.5e8, 3e8, -1.0];
            let mut line = 0;
            steps
                .into_iter()
                .map(|(other, step, switches)| {
                    line = if switches { other } else { line };
                    lines[line] += step;
                    lines[line]
                })
                .collect()
        })
    }

    proptest! {
        /// Times are read back as written, here and by `laz`.
        #[test]
        fn prop_times_are_read_back(times in times()) {
            let bytes = packed(&times);
            prop_assert_eq!(&unpacked(&bytes, times.len(), GpsTimes::default()).unwrap(), &times);
            prop_assert_eq!(&unpacked(&bytes, times.len(), GpsTimeDecompressor::default()).unwrap(), &times);
        }

        /// Decoding any bytes ends with times or an error.
        #[test]
        fn prop_decoding_any_bytes_ends(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
            let _ = std::panic::catch_unwind(|| unpacked(&bytes, 5000, GpsTimes::default()));
        }
    }
}
