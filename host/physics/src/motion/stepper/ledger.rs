//! The account of a step: where the energy of the body comes from and where it goes.
//!
//! The equation of the step times the displacement is a balance of energies. With velocities `v0`, `v1` and elastic forces
//! `f0`, `f1` at the start and at the end, elastic energies `W0`, `W1`, displacement `u = h v1` and residual `r`:
//!
//! ```text
//! kinetic + elastic + weight + damping + release + integrator + linearization = supplied + guard + solver
//!
//! integrator     |v1 - v0|^2_M / 2  and  W0 - W1 - f1 . u
//! linearization  u . (f1 - f0 + K0 u)
//! damping        h alpha |v1|^2_M  and  h beta v1 . K0 v1
//! supplied       - u . r on held nodes and guided axes, and u . f of joints with other bodies
//! solver         - u . r on the other axes, or guard if the step was shortened or solved again
//! ```
//!
//! Each term is computed by its formula. The sum of all, [`Ledger::missing`], is rounding. The account costs a product
//! with the stiffness in each step.

use super::Stepper;
use crate::Vec3;
use crate::body::Body;
use crate::element::precision::Precision;
use crate::lanes::to_vec;
use core::ops::AddAssign;

/// The account of a step, or of several (J).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ledger {
    /// Work of hands, supports and joints with other bodies on the body.
    pub supplied: f64,
    /// Increase of the kinetic energy in steps.
    pub kinetic: f64,
    /// Increase of the elastic energy in steps.
    pub elastic: f64,
    /// Increase of the potential energy of weight and other loads in steps.
    pub weight: f64,
    /// Loss by damping by mass.
    pub mass_damping: f64,
    /// Loss by damping by stiffness.
    pub stiffness_damping: f64,
    /// Work that pairs of vertices took which let each other go.
    pub release: f64,
    /// Increase of kinetic, elastic and potential energy by edits, before the step.
    pub edits: f64,
    /// Loss of kinetic energy by implicit Euler.
    pub euler_kinetic: f64,
    /// Loss of elastic energy by implicit Euler.
    pub euler_elastic: f64,
    /// Loss by the linearization of the elastic forces.
    pub linearization: f64,
    /// Work of the guard, which shortens or slows steps that would add energy, and of the residual that is left if such a step
    /// is solved again.
    pub guard: f64,
    /// Work of the residual that the solver left.
    pub solver: f64,
}

impl Ledger {
    /// The energy that the account does not explain (J): rounding.
    pub fn missing(&self) -> f64 {
        self.supplied + self.guard + self.solver
            - (self.kinetic + self.elastic + self.weight)
            - (self.mass_damping + self.stiffness_damping + self.release)
            - (self.euler_kinetic + self.euler_elastic + self.linearization)
    }

    /// The sum of the magnitudes of all terms (J), to which rounding is relative.
    pub fn turnover(&self) -> f64 {
        self.terms().iter().map(|term| term.abs()).sum()
    }

    fn terms(&self) -> [f64; 13] {
        [
            self.supplied,
            self.kinetic,
            self.elastic,
            self.weight,
            self.mass_damping,
            self.stiffness_damping,
            self.release,
            self.edits,
            self.euler_kinetic,
            self.euler_elastic,
            self.linearization,
            self.guard,
            self.solver,
        ]
    }
}

impl AddAssign for Ledger {
    fn add_assign(&mut self, other: Self) {
        self.supplied += other.supplied;
        self.kinetic += other.kinetic;
        self.elastic += other.elastic;
        self.weight += other.weight;
        self.mass_damping += other.mass_damping;
        self.stiffness_damping += other.stiffness_damping;
        self.release += other.release;
        self.edits += other.edits;
        self.euler_kinetic += other.euler_kinetic;
        self.euler_elastic += other.euler_elastic;
        self.linearization += other.linearization;
        self.guard += other.guard;
        self.solver += other.solver;
    }
}

/// The account while a step is under way.
#[derive(Debug, Default)]
pub(super) struct Account {
    last: Ledger,
    /// Energy after the last step (J); not a number before the first.
    total: f64,
    /// Change of the energy by edits since the last step (J).
    edits: f64,
    /// Energies at the start of the step (J): kinetic, elastic, and that of the loads.
    start: [f64; 3],
    /// Work of the elastic forces at the start over the step, and `u . K0 u` (J).
    force: f64,
    stiffness: f64,
}

impl Account {
    /// Notes that edits have changed the energy of the body to `total` (J).
    pub(super) fn note_edit(&mut self, total: f64) {
        if self.total.is_finite() {
            self.edits += total - self.total;
            self.total = total;
        }
    }
}

impl<T: Precision> Stepper<T> {
    /// Keeps an account of each step from now on, or no longer.
    pub fn keep_ledger(&mut self, keep: bool) {
        self.ledger = keep.then(|| {
            Box::new(Account {
                total: f64::NAN,
                ..Account::default()
            })
        });
    }

    /// The account of the last step; `None` if no account is kept. A step of a sleeping body has an empty account, and
    /// so has a step in which elements were inverted and that was linearized several times.
    pub fn ledger(&self) -> Option<&Ledger> {
        self.ledger.as_ref().map(|account| &account.last)
    }

    /// Makes the account of a step in which the body sleeps.
    pub(super) fn rest_account(&mut self) {
        if let Some(account) = &mut self.ledger {
            account.last = Ledger::default();
        }
    }

    /// Notes the start of the step, before the elements are linearized at its end.
    pub(super) fn begin_account(&mut self, body: &Body) {
        let Some(mut account) = self.ledger.take() else {
            return;
        };
        let elastic = self.elements.energy;
        account.start = [body.kinetic_energy(), elastic, body.load_potential()];
        (account.force, account.stiffness) =
            self.sum_forces(|place, stepper| to_vec(&stepper.cg.u[place]));
        self.ledger = Some(account);
    }

    /// The work of the elastic forces over the displacements `u` by place, which `self.cg.u` has, and `u . K u` (J).
    fn sum_forces(&mut self, u: impl Fn(usize, &Self) -> Vec3) -> (f64, f64) {
        let cg = &mut self.cg;
        cg.q.fill([T::ZERO; 4]);
        self.elements
            .product(&*self.team, T::of(1.0), &cg.u, &mut cg.q);
        let (mut force, mut stiffness) = (0.0, 0.0);
        for place in self.places.taken() {
            let u = u(place, self);
            force += to_vec(&self.elements.force[place]).dot(&u);
            stiffness += to_vec(&self.cg.q[place]).dot(&u);
        }
        (force, stiffness)
    }

    /// Ends the account of a step of `h` seconds, before the body takes its velocities: pairs took the work `release`
    /// (J). A step that was corrected has no account.
    pub(super) fn end_account(&mut self, body: &Body, h: f64, release: f64, report: (bool, bool)) {
        let Some(mut account) = self.ledger.take() else {
            return;
        };
        let (is_corrected, is_linear) = report;
        let u = &body.state.displacement;
        let kinetic = body.kinetic_energy_of(|node| self.velocity(body, h, node));
        let loads = body.load_potential_at(&self.elements.at);
        account.total = kinetic + self.elements.energy + loads;
        account.last = Ledger::default();
        if is_corrected {
            account.last.edits = account.edits;
            account.edits = 0.0;
            self.ledger = Some(account);
            return;
        }
        if !is_linear {
            // The damping of the shortened step is that at its end, as are its elastic forces.
            account.stiffness = self
                .sum_forces(|place, stepper| to_vec(&stepper.cg.u[place]))
                .1;
        }
        let mut ledger = Ledger {
            kinetic: kinetic - account.start[0],
            elastic: self.elements.energy - account.start[1],
            weight: loads - account.start[2],
            supplied: self.joint_work(body),
            release,
            edits: account.edits,
            stiffness_damping: body.model.config.stiffness_damping / h * account.stiffness,
            ..Ledger::default()
        };
        let (mut force, mut left) = (0.0, 0.0);
        for place in self.places.taken() {
            let node = self.places.node[place] as usize;
            let (u, mass) = (u[node], self.places.mass[place]);
            let change = u / h - body.state.v[node];
            ledger.euler_kinetic += 0.5 * mass * change.norm_squared();
            ledger.mass_damping += mass * u.norm_squared();
            force += to_vec(&self.elements.force[place]).dot(&u);
            let residual = to_vec(&self.cg.residual[place]);
            if place >= self.places.held {
                ledger.supplied -= residual.dot(&u);
            } else if let Some(mask) = self.places.mask.get(place) {
                let mask = to_vec(mask);
                left -= residual.component_mul(&mask).dot(&u);
                ledger.supplied -= residual.component_mul(&(Vec3::repeat(1.0) - mask)).dot(&u);
            } else {
                left -= residual.dot(&u);
            }
        }
        ledger.mass_damping *= body.model.config.mass_damping / h;
        ledger.euler_elastic = -ledger.elastic - force;
        if is_linear {
            ledger.solver = left;
            ledger.linearization = force - account.force + account.stiffness;
        } else {
            let whole = body.kinetic_energy_of(|node| u[node] / h);
            ledger.guard = left + (kinetic - whole);
        }
        account.edits = 0.0;
        account.last = ledger;
        self.ledger = Some(account);
    }
}
