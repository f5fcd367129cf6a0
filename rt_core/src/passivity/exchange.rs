//! The credit that passes between bodies which touch each other.
//!
//! A hand that presses its body on another body supplies the energy of both, but only the account of its own body sees
//! this work. The other body stores energy that its own hands have not supplied, so its cap would withhold their force.
//! The host knows the work of the contacts on each body and states its sum in the models. When a model shows that contacts
//! took energy from a body, the body gives credit to a pool; when contacts gave it energy, it takes credit from the pool.
//!
//! The pool holds no more than the bodies have given. The sum of all credits and of the pool therefore never grows by an
//! exchange, and the certificate holds for the hands of all bodies together, whatever the models claim. A body gives no
//! credit that backs its own springs. The pool also keeps the energy of bodies without hands for the hands that pressed them.

use super::{FORGET, Passivity};

/// Credit (J) that counts as none: a force of a newton does this work in a picometre.
const LEAST: f64 = 1e-12;

/// The exchange of one body.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Exchange {
    /// The work of contacts with other bodies on this body, as the last model claims (J); `None` before the first model.
    claimed: Option<f64>,
    /// The part of this work that has not changed the credit yet (J): below zero, the body has to give.
    due: f64,
}

impl Passivity {
    /// Takes the work that contacts with other bodies have done on the body so far, as its model claims (J).
    pub(crate) fn claim(&mut self, received: f64) {
        let before = self.exchange.claimed.replace(received);
        self.exchange.due += before.map_or(0.0, |before| received - before);
    }

    /// Whether credit is due.
    #[inline]
    pub(crate) fn is_due(&self) -> bool {
        self.exchange.due != 0.0
    }

    /// The credit that the body gives to the pool in this tick (J), if any is due. Each piece gives in proportion to the
    /// credit that its springs do not need.
    pub(crate) fn give(&mut self) -> f64 {
        let pieces = self.pieces.iter_mut().take(self.piece_count);
        let free = pieces.map(|piece| piece.free()).sum::<f64>();
        let given = (-self.exchange.due).min(free).max(0.0);
        if given > 0.0 {
            for piece in self.pieces.iter_mut().take(self.piece_count) {
                piece.credit -= given * (piece.free() / free);
            }
            self.exchanged(-given);
        }
        given
    }

    /// The credit that the body takes from a pool of the size `pool` (J), if any is due. A part of it goes to each piece, in
    /// proportion to the credit that its springs need.
    pub(crate) fn take(&mut self, pool: f64) -> f64 {
        let taken = self.exchange.due.min(pool).max(0.0);
        if taken > 0.0 {
            let pieces = self.pieces.iter_mut().take(self.piece_count);
            let needed = pieces.map(|piece| piece.balance.needed).sum::<f64>();
            let even = 1.0 / self.piece_count as f64;
            for piece in self.pieces.iter_mut().take(self.piece_count) {
                let share = if needed > 0.0 {
                    piece.balance.needed / needed
                } else {
                    even
                };
                piece.credit += taken * share;
            }
            self.exchanged(taken);
        }
        // Credit that no body could give in time is forgotten.
        self.exchange.due -= self.exchange.due * (self.config.period / FORGET);
        if self.exchange.due.abs() < LEAST {
            self.exchange.due = 0.0;
        }
        taken
    }

    /// Notes that the body took this credit (J).
    fn exchanged(&mut self, taken: f64) {
        self.exchange.due -= taken;
        self.account.received += taken;
        self.total();
    }
}
