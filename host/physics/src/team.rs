//! Cores that work together: the interface through which a caller lends threads to the physics.
//!
//! The physics has no threads. If work divides into parts, it passes the parts to a [`Team`] in pairs, and the team
//! may do the two parts of a pair at once. The division depends on the data alone, never on the team, and sums of
//! parts have a fixed order. Every team therefore gives the same bytes.
//!
//! Parts are halved until they are single (fork and join: R. D. Blumofe and C. E. Leiserson, "Scheduling multithreaded
//! computations by work stealing", 1999). No list of work is made, so a division allocates no memory.

use core::fmt;

/// A piece of work that runs once.
pub type Work<'a> = dyn FnMut() + Send + 'a;

/// Does work in pairs.
pub trait Team: fmt::Debug + Send + Sync {
    /// Runs both pieces once, in any order or at once, and returns after both.
    fn join(&self, one: &mut Work<'_>, other: &mut Work<'_>);

    /// Whether the team is the calling thread alone. It may then take a shorter way to the same result.
    fn is_alone(&self) -> bool {
        false
    }
}

/// A team of one: the calling thread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Alone;

impl Team for Alone {
    fn join(&self, one: &mut Work<'_>, other: &mut Work<'_>) {
        one();
        other();
    }

    fn is_alone(&self) -> bool {
        true
    }
}

/// Calls `work` for each of `items`.
pub fn each<T: Send>(team: &dyn Team, items: &mut [T], work: &(impl Fn(&mut T) + Sync)) {
    match items {
        [] => {}
        [item] => work(item),
        items => {
            let (lower, upper) = items.split_at_mut(items.len() / 2);
            team.join(&mut || each(team, lower, work), &mut || {
                each(team, upper, work);
            });
        }
    }
}

/// [`each`], with the last items first if one thread does all of them.
pub fn each_from_last<T: Send>(team: &dyn Team, items: &mut [T], work: &(impl Fn(&mut T) + Sync)) {
    match items {
        [] => {}
        [item] => work(item),
        items => {
            let (lower, upper) = items.split_at_mut(items.len() / 2);
            team.join(&mut || each_from_last(team, upper, work), &mut || {
                each_from_last(team, lower, work);
            });
        }
    }
}

/// Calls `work` for each run of at most `most` of `items`, with the index of its first item.
pub fn each_run<T: Send>(
    team: &dyn Team,
    items: &mut [T],
    most: usize,
    work: &(impl Fn(usize, &mut [T]) + Sync),
) {
    from(team, 0, items, most.max(1), work);
}

fn from<T: Send>(
    team: &dyn Team,
    first: usize,
    items: &mut [T],
    most: usize,
    work: &(impl Fn(usize, &mut [T]) + Sync),
) {
    if items.len() <= most {
        work(first, items);
        return;
    }
    let half = items.len() / 2;
    let (lower, upper) = items.split_at_mut(half);
    team.join(&mut || from(team, first, lower, most, work), &mut || {
        from(team, first + half, upper, most, work);
    });
}

/// Slices that are divided at the same places.
pub trait Slices: Send + Sized {
    /// Number of items of the first slice.
    fn count(&self) -> usize;

    /// The first `middle` items of each slice, and the others.
    fn divide(self, middle: usize) -> (Self, Self);
}

impl<T: Sync> Slices for &[T] {
    fn count(&self) -> usize {
        self.len()
    }

    fn divide(self, middle: usize) -> (Self, Self) {
        self.split_at(middle)
    }
}

impl<T: Send> Slices for &mut [T] {
    fn count(&self) -> usize {
        self.len()
    }

    fn divide(self, middle: usize) -> (Self, Self) {
        self.split_at_mut(middle)
    }
}

/// Implements [`Slices`] for a tuple.
macro_rules! slices {
    ($($name:ident $at:tt),+) => {
        impl<$($name: Slices),+> Slices for ($($name,)+) {
            fn count(&self) -> usize {
                self.0.count()
            }

            fn divide(self, middle: usize) -> (Self, Self) {
                let parts = ($(self.$at.divide(middle),)+);
                (($(parts.$at.0,)+), ($(parts.$at.1,)+))
            }
        }
    };
}

slices!(A 0, B 1);
slices!(A 0, B 1, C 2);
slices!(A 0, B 1, C 2, D 3);
slices!(A 0, B 1, C 2, D 3, E 4);

/// Calls `work` for runs of `most` items of `slices`, the last of which may be shorter. All slices have at least the
/// length of the first. `results` takes the result of each run. Returns the results, in the order of the runs. If
/// `results` is too short, the last of its runs has all other items.
pub fn runs<'a, S: Slices, R: Send>(
    team: &dyn Team,
    slices: S,
    most: usize,
    results: &'a mut [R],
    work: &(impl Fn(S) -> R + Sync),
) -> &'a [R] {
    let most = most.max(1);
    let count = slices.count().div_ceil(most).min(results.len());
    let results = &mut results[..count];
    fill(team, slices, most, results, work);
    results
}

fn fill<S: Slices, R: Send>(
    team: &dyn Team,
    slices: S,
    most: usize,
    results: &mut [R],
    work: &(impl Fn(S) -> R + Sync),
) {
    match results {
        [] => {}
        [result] => *result = work(slices),
        results => {
            let half = results.len() / 2;
            let (low, high) = results.split_at_mut(half);
            let (lower, upper) = slices.divide(half * most);
            let (mut lower, mut upper) = (Some(lower), Some(upper));
            team.join(
                &mut || {
                    if let Some(slices) = lower.take() {
                        fill(team, slices, most, low, work);
                    }
                },
                &mut || {
                    if let Some(slices) = upper.take() {
                        fill(team, slices, most, high, work);
                    }
                },
            );
        }
    }
}

/// [`runs`] without results.
pub fn each_of<S: Slices>(team: &dyn Team, slices: S, most: usize, work: &(impl Fn(S) + Sync)) {
    if slices.count() <= most.max(1) {
        work(slices);
        return;
    }
    let half = slices.count() / 2;
    let (lower, upper) = slices.divide(half);
    let (mut lower, mut upper) = (Some(lower), Some(upper));
    team.join(
        &mut || {
            if let Some(slices) = lower.take() {
                each_of(team, slices, most, work);
            }
        },
        &mut || {
            if let Some(slices) = upper.take() {
                each_of(team, slices, most, work);
            }
        },
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_of_one_length_and_in_order() {
        let (numbers, mut copies) = ([1, 2, 3, 4, 5, 6, 7, 8, 9, 10_u32], [0; 10]);
        let mut results = [0; 5];
        let copy = |(numbers, copies): (&[u32], &mut [u32])| {
            copies.copy_from_slice(numbers);
            numbers.iter().sum::<u32>()
        };
        let slices = (&numbers[..], &mut copies[..]);
        assert_eq!(runs(&Alone, slices, 4, &mut results, &copy), [10, 26, 19]);
        assert_eq!(copies, numbers);
        // With room for two results, the second run has all other items.
        let slices = (&numbers[..], &mut copies[..]);
        let two = &mut results[..2];
        assert_eq!(runs(&Alone, slices, 4, two, &copy), [10, 45]);
        let none = (&numbers[..0], &mut copies[..0]);
        assert!(runs(&Alone, none, 4, &mut results, &copy).is_empty());
    }
}
