//! Random numbers that depend on a seed, a cell and a name alone. No draw depends on the number of draws before it.

/// SplitMix64 (Steele, Lea and Flood, "Fast splittable pseudorandom number generators", 2014).
fn mix(mut z: u64) -> u64 {
    z = z.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// A sequence of random numbers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Chance {
    key: u64,
}

impl Chance {
    /// The sequence of a cell of a study.
    pub(crate) fn new(seed: u64, cell: u64) -> Self {
        Self {
            key: mix(mix(seed) ^ cell),
        }
    }

    /// The sequence named `name`, in the same cell.
    pub(crate) fn of(self, name: &str) -> Self {
        let each = name.bytes();
        Self {
            key: each.fold(self.key, |key, byte| mix(key ^ u64::from(byte))),
        }
    }

    /// The `n`-th number, uniform from 0 up to 1.
    pub(crate) fn unit(self, n: u64) -> f64 {
        // The upper 53 bits are all that a number below one can represent.
        (mix(self.key ^ mix(n)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// The `n`-th number, uniform from `low` to `high`.
    pub(crate) fn between(self, n: u64, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit(n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_uniform_and_sequences_independent() {
        let (a, b) = (Chance::new(1, 7).of("a"), Chance::new(1, 7).of("b"));
        let n = 20_000;
        let mean = |f: &dyn Fn(u64) -> f64| (0..n).map(f).sum::<f64>() / n as f64;
        // Four standard errors of a mean of n: of a uniform number, of its square, of a product of two.
        let tolerance = |deviation: f64| 4.0 * deviation / (n as f64).sqrt();
        assert!((mean(&|k| a.unit(k)) - 0.5).abs() < tolerance(0.289));
        assert!((mean(&|k| a.unit(k).powi(2)) - 1.0 / 3.0).abs() < tolerance(0.298));
        let product = mean(&|k| (a.unit(k) - 0.5) * (b.unit(k) - 0.5));
        assert!(product.abs() < tolerance(1.0 / 12.0));
        let next = mean(&|k| (a.unit(k) - 0.5) * (a.unit(k + 1) - 0.5));
        assert!(next.abs() < tolerance(1.0 / 12.0));
    }
}
