//! An adversary: it searches for the motion of a hand that gets most energy out of a controller.
//!
//! The controller is a black box ([`Rendering`]): a position in each tick, a force out, and a way back to the
//! start, so that yours can be put here as well. The hand is perfectly stiff and imposes the motion. Between two
//! ticks a straight line is the cheapest way, so the work done on the hand over a step `D` under the held force
//! `F` is `F D - b D^2 / T - f_c |D|` exactly, whatever the device's mass: a hand that stops has given back what
//! kinetic energy it took. That is the **port's** account ([`Port::play`]); the controller's own is not asked.
//!
//! The search ([`Adversary::search`]) has a budget in ticks and goes from coarse to fine: a sweep of
//! frequencies, seeded draws from families of motions ([`Family`]: sinusoids, chirps, cycles of steps, strokes and taps, strokes along the edges of encoder
//! counts), evolution of their parameters, then of the bare samples. Where the force is a function of the place
//! alone, dynamic programming ([`best_among`]) finds the best motion outright; it can be handed to the search to
//! begin with.

mod places;
mod port;
mod search;
mod shapes;
#[cfg(test)]
mod tests;

pub use places::best_among;
pub use port::{Outcome, Port, Rendering};
pub use search::{Adversary, Found, Goal, Start};
pub use shapes::{Family, Limits};
