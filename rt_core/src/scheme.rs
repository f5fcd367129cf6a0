//! The force schemes, by name.
//!
//! Each scheme reads a published model as another linear model, so that one coupling blends, ages and limits all of
//! them:
//!
//! | scheme | wrench between publications | source |
//! |---|---|---|
//! | `hold` | the published wrench, held | the usual baseline |
//! | `thesis` | the published wrench, held, plus a spring from handle to proxy and damping | thesis, equation 4.5 |
//! | `linear` | the body's own tangent, with damping, cross terms and drift | [`crate::local_model`] |
//! | `proxy` | as `linear`, for a body that the host couples through a spring | the host's virtual coupling |
//! | `classic` | as `linear`, damped once the hands have got more energy than they supplied | [`crate::passivity`] |
//! | `capped` | as `linear`, limited to the energy that the hands have supplied | [`crate::passivity`] |
//!
//! Equation 4.5 as printed equates its two parts. The thesis means the sum of the parts: `F_tear + k (x_handle -
//! x_proxy) - k_v v`. `linear` has no second spring, which would count the same displacement twice.

use crate::geometry::{Mat6, Twist, Wrench};
use crate::local_model::{LocalModel, PairBlocks, TearLimit};

/// How the tick reads a local model between publications.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scheme {
    /// Holds the published wrench.
    Hold,
    /// Holds the published wrench, and adds a spring from the handle to the proxy and damping.
    Thesis {
        /// Spring from handle to proxy (N/m), `k_position` of equation 4.5.
        stiffness: f64,
        /// Damping of the proxy's velocity (N s/m), `k_velocity` of equation 4.5.
        damping: f64,
    },
    /// Extrapolates by the local model.
    Linear,
    /// As [`Scheme::Linear`], for models to which the host has coupled the devices by springs and dampers.
    Proxy,
    /// As [`Scheme::Linear`], damped once the hands have got more energy than they supplied ([`crate::passivity`]).
    Classic,
    /// As [`Scheme::Linear`], limited to the energy that the hands have supplied ([`crate::passivity`]).
    Capped,
}

impl Scheme {
    /// The name of the scheme in scenes and logs.
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
        let n = usize::from(model.head.handle_count);
        // The limit belongs to the stiffness of the body.
        model.head.tear_limit = TearLimit::none();
        own_translation(&mut model.stiffness, stiffness, n);
        own_translation(&mut model.damping, damping, n);
        for handle in model.handles.iter_mut().take(n) {
            // The damping acts on the whole velocity of the proxy, not on its change since the publication.
            handle.twist = Twist::zero();
            // These schemes hold the published wrench.
            handle.drift = Wrench::zero();
        }
    }
}

/// Leaves `value` on the translations of each of the first `n` handles alone.
fn own_translation(blocks: &mut PairBlocks, value: f64, n: usize) {
    for (i, row) in blocks.iter_mut().enumerate().take(n) {
        row.iter_mut()
            .take(n)
            .for_each(|block| *block = Mat6::zeros());
        if let Some(own) = row.get_mut(i) {
            own.fixed_view_mut::<3, 3>(0, 0).fill_diagonal(value);
        }
    }
}
