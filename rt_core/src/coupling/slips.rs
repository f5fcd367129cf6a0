//! The slips of the proxies that hold a body ([`crate::slip`]): when the body asks for them, and along which motion.
//!
//! If the cap reduces the force of a piece, the proxies on it yield to the forces `F_i` of the springs. With the
//! stiffness `K` between the handles, the energy `V` and the part `V_p` of it that the hands have paid for, each tick moves
//! the proxies by
//!
//! ```text
//! D_i = W F_i min((V - V_p) / sum(F_i . W F_i), sum(F_i . W F_i) / (W F . K W F)) T / 0.1 s
//! ```
//!
//! where `W` weighs rotations against translations. The first term lets the missing energy decay within 0.1 s. The second is
//! the steepest descent to the pose without force, for a body that stores energy which its proxies cannot take out. The
//! slip `o_i` goes back if that releases energy, or if the hands have paid for the energy that it takes:
//!
//! ```text
//! D_i = -o_i T / 0.5 s     if  sum(F_i . D_i) >= 0  or  V - sum(F_i . D_i) <= 0.8 H
//! ```
//!
//! Slips act only while the host is live: a force that fades is not that of the body.

use super::{Coupling, HostState};
use crate::geometry::Vec6;
use crate::local_model::{Deviation, HandleReference};
use crate::slip::{Asked, LEVER};
use crate::{MAX_DEVICES, MAX_HANDLES};

/// Time constant (s) with which slips take out the energy that no hand has paid for.
const YIELD: f64 = 0.1;

/// Fraction of the spendable energy that a body may store while slips go back. The rest keeps the slips from coming and
/// going.
const AFFORDED: f64 = 0.8;

/// The slips of the proxies on one body.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slips {
    /// The requests of the body, by device.
    asked: [Asked; MAX_DEVICES],
    /// Whether the body asks anything.
    asks: bool,
    /// The next step of each slip that goes back (m, rad), by device.
    way_back: [Vec6; MAX_DEVICES],
    /// Whether a proxy has slipped.
    any: bool,
}

impl Slips {
    /// Whether a body may have to ask for slips, or to end an earlier request. A tick without slips pays for this
    /// question alone.
    #[inline]
    pub(super) fn matter(&self) -> bool {
        self.any || self.asks
    }

    /// No slip.
    pub(super) fn none() -> Self {
        Self {
            asked: [Asked::Nothing; MAX_DEVICES],
            asks: false,
            way_back: [Vec6::zeros(); MAX_DEVICES],
            any: false,
        }
    }
}

impl Coupling {
    /// Whether the body asks for slips.
    pub(crate) fn asks_for_slips(&self) -> bool {
        self.slips.asks && self.state() == HostState::Live && self.trust() >= 1.0
    }

    /// The request of the body to the slip of a device's proxy.
    pub(crate) fn asked(&self, device: usize) -> Asked {
        let asked = self
            .slips
            .asked
            .get(device)
            .filter(|_| self.asks_for_slips());
        asked.copied().unwrap_or_default()
    }

    /// Takes note that the proxy of a device has slipped, and that its slip would next go back by `way_back` (m, rad; axes of
    /// the scene).
    pub(crate) fn slipped(&mut self, device: usize, way_back: &Vec6) {
        if let Some(next) = self.slips.way_back.get_mut(device) {
            *next = *way_back;
        }
        let mut each = self.slips.way_back.iter();
        self.slips.any = each.any(|next| *next != Vec6::zeros());
    }

    /// Decides which slips to ask for. `elastic` are the wrenches of the springs before the cap, and `stored` (J) is the
    /// energy that hands could get back: of each piece of a body that is `torn`, of the whole body otherwise.
    #[cold]
    #[inline(never)]
    pub(super) fn ask_for_slips(
        &mut self,
        elastic: &[Vec6; MAX_HANDLES],
        stored: &[f64; MAX_HANDLES],
        torn: bool,
    ) {
        self.slips.asked = [Asked::Nothing; MAX_DEVICES];
        self.slips.asks = false;
        let count = if torn {
            usize::from(self.to.piece_count())
        } else {
            1
        };
        for (piece, stored) in (0..MAX_HANDLES).zip(stored).take(count) {
            let balance = self.passivity.balance(piece);
            let on_piece = |handle: &HandleReference| !torn || usize::from(handle.piece) == piece;
            if balance.unpaid > 0.0 {
                self.yield_along(elastic, balance.unpaid, on_piece);
            } else if self.slips.any {
                self.go_back(elastic, *stored, balance.budget, on_piece);
            }
        }
    }

    /// Asks the proxies on a piece to yield along `elastic`, so that the energy `unpaid` (J) decays.
    fn yield_along(
        &mut self,
        elastic: &[Vec6; MAX_HANDLES],
        unpaid: f64,
        on_piece: impl Fn(&HandleReference) -> bool,
    ) {
        let mut along = [Deviation::zero(); MAX_HANDLES];
        let each = along.iter_mut().zip(elastic).zip(self.to.handles());
        let turned = 1.0 / (LEVER * LEVER);
        let weights = Vec6::new(1.0, 1.0, 1.0, turned, turned, turned);
        let mut work = 0.0;
        for ((along, force), _) in each.filter(|(_, handle)| on_piece(handle)) {
            along.displacement = force.component_mul(&weights);
            work += along.displacement.dot(force);
        }
        let resistance = self.to.response(&along);
        let each = resistance.iter().zip(&along);
        let resists: f64 = each
            .map(|(fall, along)| fall.dot(&along.displacement))
            .sum();
        let mut factor = unpaid / work;
        if resists > 0.0 {
            factor = factor.min(work / resists);
        }
        factor *= self.config.period / YIELD;
        // False for a number that is not finite.
        let moves = factor > 0.0 && factor < f64::INFINITY;
        if moves {
            let each = self.to.handles().zip(&along);
            for (handle, along) in each.filter(|(handle, _)| on_piece(handle)) {
                let asked = self.slips.asked.get_mut(usize::from(handle.device));
                if let Some(asked) = asked {
                    *asked = asked.and(Asked::Away(along.displacement * factor));
                    self.slips.asks = true;
                }
            }
        }
    }

    /// Asks the slips of the proxies on a piece to go back, or to stay if the hands have not paid for the energy that
    /// this takes. The piece stores `stored` (J), and its springs may spend `budget` (J).
    fn go_back(
        &mut self,
        elastic: &[Vec6; MAX_HANDLES],
        stored: f64,
        budget: f64,
        on_piece: impl Fn(&HandleReference) -> bool,
    ) {
        let slips = &mut self.slips;
        let next = |handle: &HandleReference| {
            let next = slips.way_back.get(usize::from(handle.device));
            next.copied().unwrap_or(Vec6::zeros())
        };
        let each = self.to.handles().zip(elastic);
        let each = each.filter(|(handle, _)| on_piece(handle));
        let released: f64 = each.map(|(handle, force)| force.dot(&next(handle))).sum();
        let affords = released >= 0.0 || stored - released <= AFFORDED * budget;
        for handle in self.to.handles().filter(|handle| on_piece(handle)) {
            if let Some(asked) = slips.asked.get_mut(usize::from(handle.device)) {
                *asked = asked.and(if affords { Asked::Back } else { Asked::Stay });
                slips.asks = true;
            }
        }
    }
}
