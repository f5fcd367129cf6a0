//! Sound inputs, changed at random: what reaches the readers behind their first checks.

/// Changes bytes at random, from a seed: the same seed makes the same inputs on every machine.
#[derive(Clone, Debug)]
pub struct Mutator(u64);

/// Numbers at which sizes and counts go wrong.
const EDGES: [u64; 8] = [0, 1, 0x7f, 0xff, 0xffff, u32::MAX as u64, 1 << 40, u64::MAX];

impl Mutator {
    /// A mutator with this seed.
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(2).wrapping_add(1))
    }

    /// A number below `most`, which is above zero (xorshift*, Vigna 2016).
    pub fn below(&mut self, most: usize) -> usize {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        let number = self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 32;
        number as usize % most.max(1)
    }

    /// Makes one to four changes to `bytes`, none of which begins in the range `keep`.
    pub fn change(&mut self, bytes: &mut Vec<u8>, keep: &std::ops::Range<usize>) {
        for _ in 0..=self.below(4) {
            let at = self.below(bytes.len());
            if keep.contains(&at) {
                continue;
            }
            self.change_at(at, bytes);
        }
    }

    fn change_at(&mut self, at: usize, bytes: &mut Vec<u8>) {
        let kind = self.below(8);
        let (bit, value) = (self.below(8), self.below(256) as u8);
        let length = (1 + self.below(16)).min(bytes.len().saturating_sub(at));
        match kind {
            0 | 1 => {
                if let Some(byte) = bytes.get_mut(at) {
                    *byte ^= 1 << bit;
                }
            }
            2 => {
                if let Some(byte) = bytes.get_mut(at) {
                    *byte = value;
                }
            }
            3 | 4 => {
                let edge = EDGES.get(self.below(EDGES.len())).copied().unwrap_or(0);
                let width = [1, 2, 4, 8].get(self.below(4)).copied().unwrap_or(8);
                let places = bytes.iter_mut().skip(at).take(width);
                for (place, byte) in places.zip(edge.to_le_bytes()) {
                    *place = byte;
                }
            }
            5 => {
                let from = self.below(bytes.len());
                let copy: Vec<u8> = bytes.iter().skip(from).take(length).copied().collect();
                for (place, byte) in bytes.iter_mut().skip(at).zip(copy) {
                    *place = byte;
                }
            }
            6 => {
                bytes.drain(at..at + length);
            }
            _ => bytes.truncate(at),
        }
    }
}
