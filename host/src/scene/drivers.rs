//! The drivers that a scene can name.

use devices::{Hid, Registry};
use sim::{Held, Simulated};

/// The drivers, where `held` holds the simulated devices, by index in the scene. Names need no hands.
pub(crate) fn drivers(held: Vec<Held>) -> Registry {
    Registry::new().with(Simulated::new(held)).with(Hid)
}
