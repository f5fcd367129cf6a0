//! The force schemes, by name.
//!
//! Each is a way to read a published model, and each comes out as a linear model again, so that one
//! coupling blends, ages and limits all of them:
//!
//! | scheme | wrench between publications | source |
//! |---|---|---|
//! | `hold` | the published one, held | the usual baseline |
//! | `thesis` | held, plus a spring from handle to proxy and damping | thesis, equation 4.5 |
//! | `linear` | the body's own tangent, with damping, cross terms and drift | [`crate::local_model`] |
//! | `proxy` | the same, of a body that the host has put a spring before | the host's virtual coupling |
//! | `classic` | as `linear`, damped once the hands have got more than they gave | [`crate::passivity`] |
//! | `capped` | as `linear`, held to the energy that the hands have put in | [`crate::passivity`] |
//!
//! Equation 4.5 as printed equates the two parts; as meant, they add: `F_tear + k (x_handle - x_proxy)
//! - k_v v`. `linear` carries no second spring: it would count the same displacement twice.

use crate::MAX_HANDLES;
use crate::geometry::{Mat6, Twist, Wrench};
use crate::local_model::LocalModel;

/// How the tick reads a local model between publications.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scheme {
    /// The published wrench, held.
    Hold,
    /// The published wrench, held, plus a spring from the handle to the proxy, and damping.
    Thesis {
        /// Spring from handle to proxy (N/m), `k_position` of equation 4.5.
        stiffness: f64,
        /// Damping of the proxy's velocity (N s/m), `k_velocity` of equation 4.5.
        damping: f64,
    },
    /// The local model's own extrapolation.
    Linear,
    /// The same, of models that the host has coupled devices to by springs and dampers.
    Proxy,
    /// As [`Scheme::Linear`], damped once the hands have got more than they gave ([`crate::passivity`]).
    Classic,
    /// As [`Scheme::Linear`], held to the energy that the hands have put in ([`crate::passivity`]).
    Capped,
}

impl Scheme {
    /// The name by which scenes and logs call it.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Hold => "hold",
            Self::Thesis { .. } => "thesis",
            Self::Linear => "linear",
            Self::Proxy => "proxy",
            Self::Classic => "classic",
            Self::Capped => "capped",
        }
    }

    /// Turns a published model into the linear model that this scheme renders.
    pub fn shape(&self, model: &mut LocalModel) {
        let (stiffness, damping) = match *self {
            Self::Linear | Self::Proxy | Self::Classic | Self::Capped => return,
            Self::Hold => (0.0, 0.0),
            Self::Thesis { stiffness, damping } => (stiffness, damping),
        };
        let own = |value: f64| {
            let mut block = Mat6::zeros();
            block.fixed_view_mut::<3, 3>(0, 0).fill_diagonal(value);
            block
        };
        model.stiffness = diagonal(&own(stiffness));
        model.damping = diagonal(&own(damping));
        for handle in &mut model.handles {
            // The damping acts on the proxy's whole velocity, not on what changed since publication.
            handle.twist = Twist::zero();
            // These schemes hold the wrench that was published.
            handle.drift = Wrench::zero();
        }
    }
}

fn diagonal(block: &Mat6) -> [[Mat6; MAX_HANDLES]; MAX_HANDLES] {
    let mut blocks = [[Mat6::zeros(); MAX_HANDLES]; MAX_HANDLES];
    for (i, row) in blocks.iter_mut().enumerate() {
        if let Some(own) = row.get_mut(i) {
            *own = *block;
        }
    }
    blocks
}
