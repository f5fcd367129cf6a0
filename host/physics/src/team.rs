//! Cores that work together: the interface through which a caller lends threads to the physics.
//!
//! The physics has no threads. Where work divides into parts, it passes the parts to a [`Team`] in pairs, and the team
//! may do the two parts of a pair at once. The division depends on the data alone, never on the team, and sums of
//! parts have a fixed order. Every team therefore gives the same bytes.
//!
//! Parts are halved until they are single (fork and join: R. D. Blumofe and C. E. Leiserson, "Scheduling multithreaded
//! computations by work stealing", 1999). No list of work is made, so a division allocates no memory.

use core::fmt;

/// A piece of work that runs once.
pub type Work<'a> = dyn FnMut() + Send + 'a;

/// Does work in pairs.
pub trait Team: fmt::Debug + Sync {
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

/// [`each`], with the last items first where one thread does all of them.
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
