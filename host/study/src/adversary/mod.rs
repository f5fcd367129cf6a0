//! An adversary: a search for the motion of a hand that gets the most energy out of a controller.
//!
//! The controller is a black box ([`Rendering`]): it takes a position in each tick, returns a force, and can be reset
//! to its start. A user can put another controller in its place. The hand is perfectly stiff and imposes the motion.
//! Between two ticks, a straight line costs the least energy. The work done on the hand over a step `D` under the held
//! force `F` is therefore exactly `F D - b D^2 / T - f_c |D|`. The device's mass has no effect: a hand that stops has
//! given back the kinetic energy that it took. This is the account of the **port** ([`Mechanism::play`]). The controller's
//! own account is not used.
//!
//! The search ([`Adversary::search`]) has a budget in ticks and goes from coarse to fine. It sweeps frequencies, draws
//! seeded motions from families ([`Family`]: sinusoids, chirps, cycles of steps, strokes and taps, strokes along the
//! edges of encoder counts), evolves their parameters, and then evolves the bare samples. If the force depends on
//! the position alone, dynamic programming ([`best_among`]) finds the best motion directly; the search can start from
//! that motion.
//!
//! ```
//! use study::adversary::{Adversary, Goal, Limits, Mechanism, Rendering};
//!
//! /// A sampled spring that pushes out of negative positions: replace it by your controller.
//! struct Spring(f64);
//!
//! impl Rendering for Spring {
//!     fn reset(&mut self) {}
//!     fn tick(&mut self, position: f64) -> f64 {
//!         (-self.0 * position).max(0.0)
//!     }
//! }
//!
//! let adversary = Adversary {
//!     port: Mechanism { period: 1e-3, damping: 0.5, friction: 0.0, delay: 0 },
//!     limits: Limits {
//!         period: 1e-3,
//!         deepest: 5e-3,
//!         speed: 0.5,
//!         acceleration: f64::INFINITY,
//!         longest: 2000,
//!         count: 0.0,
//!     },
//!     budget: 100_000,
//!     seed: 1,
//! };
//! // Colgate and Schenkel: passive up to 2 b / T = 1000 N/m.
//! let soft = adversary.search(&mut Spring(980.0), Goal::MoreThan(0.0), &[]);
//! assert!(soft.outcome.energy < 1e-15);
//! let stiff = adversary.search(&mut Spring(1020.0), Goal::MoreThan(0.0), &[]);
//! assert!(stiff.outcome.energy > 0.0);
//! ```

mod mechanism;
mod places;
mod search;
mod shapes;
#[cfg(test)]
mod tests;

pub use mechanism::{Mechanism, Outcome, Rendering};
pub use places::best_among;
pub use search::{Adversary, Found, Goal, Start};
pub use shapes::{Family, Limits};
