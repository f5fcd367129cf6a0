//! Reads of numbers that a later step needs: the caches of the present core hold the numbers from then on.

/// Bytes of a cache line.
const LINE: usize = 64;

/// One of several equal parts of an array.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Share {
    /// The number of the part, from zero.
    pub(crate) part: usize,
    /// The number of parts.
    pub(crate) parts: usize,
}

/// Reads one value of each cache line in the share of `values`. `number` takes a number from a value.
pub(crate) fn read<T>(values: &[T], Share { part, parts }: Share, number: impl Fn(&T) -> f32) {
    let every = (LINE / size_of::<T>()).max(1);
    let lines = values.len().div_ceil(every);
    let (first, end) = (lines * part / parts, lines * (part + 1) / parts);
    let lines = values.iter().step_by(every).skip(first).take(end - first);
    let all = lines.fold(0, |all, value| all ^ number(value).to_bits());
    // Without this, the compiler would leave the reads out.
    core::hint::black_box(all);
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::cell::Cell;

    #[test]
    fn all_parts_together_read_every_cache_line() {
        for count in [0, 1, 5, 16, 17, 1000] {
            for parts in 1..4 {
                let values: Vec<f32> = (0..count).map(|i| i as f32).collect();
                let seen = vec![Cell::new(0); count / 16 + 1];
                for part in 0..parts {
                    read(&values, Share { part, parts }, |&value| {
                        let line = &seen[value as usize / 16];
                        line.set(line.get() + 1);
                        value
                    });
                }
                assert!(
                    seen[..count.div_ceil(16)]
                        .iter()
                        .all(|seen| seen.get() == 1)
                );
            }
        }
    }
}
