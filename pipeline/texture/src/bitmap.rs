//! One bit per cell of a raster.

use std::ops::Range;

/// Bits in the order in which they were pushed.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Bitmap {
    words: Vec<u64>,
    len: usize,
}

impl Bitmap {
    /// Room for `len` bits.
    pub fn with_capacity(len: usize) -> Self {
        Self { words: Vec::with_capacity(len.div_ceil(64)), len: 0 }
    }

    /// Adds a bit.
    pub fn push(&mut self, bit: bool) {
        if self.len.is_multiple_of(64) {
            self.words.push(0);
        }
        // Either pushed just above, or the last word so far.
        if let Some(word) = self.words.last_mut() {
            *word |= u64::from(bit) << (self.len % 64);
        }
        self.len += 1;
    }

    /// Adds bits.
    pub fn extend(&mut self, bits: impl Iterator<Item = bool>) {
        bits.for_each(|bit| self.push(bit));
    }

    /// Positions of the unset bits within `range`.
    pub fn unset(&self, range: Range<usize>) -> impl Iterator<Item = usize> {
        let words = range.start / 64..range.end.div_ceil(64);
        let missing = words.flat_map(|w| set(!self.words.get(w).copied().unwrap_or(0)).map(move |bit| 64 * w + bit));
        let (from, to) = (range.start, range.end);
        missing.skip_while(move |&k| k < from).take_while(move |&k| k < to)
    }

    /// Bit `k`; false beyond the end.
    pub fn get(&self, k: usize) -> bool {
        self.words.get(k / 64).is_some_and(|word| word >> (k % 64) & 1 == 1)
    }

    /// Number of set bits.
    pub fn count(&self) -> usize {
        self.words.iter().map(|w| w.count_ones() as usize).sum()
    }

    /// Positions of the set bits with the given ranks (ascending, from 0).
    pub fn select(&self, ranks: &[usize]) -> Vec<usize> {
        let mut before = 0;
        let mut wanted = ranks.iter().copied().peekable();
        let mut found = Vec::with_capacity(ranks.len());
        for (k, &word) in self.words.iter().enumerate() {
            let here = word.count_ones() as usize;
            while let Some(rank) = wanted.next_if(|rank| *rank < before + here) {
                found.push(64 * k + nth_set(word, rank - before));
            }
            before += here;
        }
        found
    }
}

/// Position of the `n`-th set bit of a word, counted from 0; the word must have that many.
fn nth_set(mut word: u64, n: usize) -> usize {
    (0..n).for_each(|_| word &= word - 1);
    word.trailing_zeros() as usize
}

/// Positions of the set bits of a word.
fn set(word: u64) -> impl Iterator<Item = usize> {
    let rest = |word: &u64| Some(word & (word - 1)).filter(|w| *w != 0);
    std::iter::successors(Some(word).filter(|w| *w != 0), rest).map(|w| w.trailing_zeros() as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_bits_match_brute_force() {
        let set = |k: usize| k % 7 == 3 || k % 64 == 63;
        let mut bits = Bitmap::with_capacity(1000);
        (0..1000).for_each(|k| bits.push(set(k)));
        let places: Vec<usize> = (0..1000).filter(|&k| set(k)).collect();
        assert!((0..1100).all(|k| bits.get(k) == (k < 1000 && set(k))));
        assert_eq!(bits.count(), places.len());
        for range in [0..1000, 3..700, 64..128, 100..101, 5..5, 990..1100] {
            let missing: Vec<usize> = range.clone().filter(|&k| k >= 1000 || !set(k)).collect();
            assert_eq!(bits.unset(range).collect::<Vec<_>>(), missing);
        }
        let ranks: Vec<usize> = (0..places.len()).step_by(3).chain([places.len() - 1, places.len() - 1]).collect();
        assert_eq!(bits.select(&ranks), ranks.iter().map(|&r| places[r]).collect::<Vec<_>>());
    }
}
