//! The coupling of a tool: from the newest patch of the surface near it to a force on the hand of its device.
//!
//! **Energy.** The work of the hand is accounted for, and the force is limited by that account, as for a body under `capped`
//! ([`crate::passivity`]). The account knows nothing of patches, so a patch that lies gives no energy to the hand beyond the
//! allowance. Only the rendered force is limited: place, contacts and stretch of the tool stay as its law has them.
//!
//! **Age.** The force of a patch that is too old fades to the safe hold, as for a body ([`crate::coupling`]). The law goes on, so
//! the force returns without a jump. Before the first patch the hand is free.

use super::{PatchFault, PatchHead, Tool, ToolConfig, patch};
use crate::coupling::HostState;
use crate::geometry::{Pose, Twist, Vec3, Vec6, Wrench};
use crate::held_back::HeldBackByBody;
use crate::passivity::{EnergyAccount, Motion, Passivity, PassivityConfig, Withheld};
use crate::publication::Publication;
use crate::trust::{Aging, Trust};
use crate::{MAX_DEVICES, MAX_HANDLES, count_one};

/// Configuration of a tool's coupling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolCouplingConfig {
    /// The tool.
    pub tool: ToolConfig,
    /// Age beyond which a patch is no longer trusted (s).
    pub age_limit: f64,
    /// Time in which the force fades once the patch is too old (s).
    pub decay: f64,
    /// Time in which the force comes back (s).
    pub recovery: f64,
    /// Damping of the safe hold (N s/m).
    pub hold_damping: f64,
    /// The buttons of the device with which the hand takes hold of what the tool touches, as a mask.
    pub take_buttons: u32,
    /// Configuration of the energy account.
    pub passivity: PassivityConfig,
}

/// Counts of the events in a tool's coupling. The counts only grow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ToolCounters {
    /// Patches taken into use.
    pub accepted: u64,
    /// Patches refused because a number was not finite.
    pub not_finite: u64,
    /// Patches refused because their sites or triangles do not fit.
    pub wrong_sites: u64,
    /// Patches refused because they were not newer than the one in use.
    pub outdated: u64,
    /// Patches refused because their time lies in the future.
    pub to_come: u64,
    /// Times that the patch grew too old.
    pub faded: u64,
}

/// The coupling of a tool to its device.
///
/// ```
/// use rt_core::geometry::Twist;
/// use rt_core::hull::Hull;
/// use rt_core::tool::{Patch, ToolConfig, ToolCoupling, ToolCouplingConfig, Triangle};
/// use rt_core::{PassivityConfig, Pose, Vec3};
///
/// let period = 1e-3;
/// let config = ToolCouplingConfig {
///     tool: ToolConfig {
///         hull: Hull::POINT,
///         turns: false,
///         radius: 5e-3,
///         period,
///         stiffest: 1e3,
///         most_damping: 10.0,
///         parting: 0.02,
///     },
///     age_limit: 1.0,
///     decay: 0.1,
///     recovery: 0.01,
///     hold_damping: 1.0,
///     take_buttons: 0,
///     passivity: PassivityConfig::new(period),
/// };
/// let mut ball = ToolCoupling::new(0, config);
///
/// // A floor that nothing moves, and a device that renders at most 1 kN/m.
/// let mut floor = Patch::empty();
/// floor.head.sequence = 1;
/// (floor.head.site_count, floor.head.triangle_count) = (3, 1);
/// floor.head.triangles[0].corners = [0, 1, 2];
/// floor.head.floor.fill_diagonal(1e-3);
/// for (site, place) in floor.sites.iter_mut().zip([[-0.1, -0.1], [0.1, -0.1], [0.0, 0.1]]) {
///     site.place = Vec3::new(place[0], place[1], 0.0);
/// }
/// ball.accept(&floor).unwrap();
///
/// // The hand goes down to 2 mm below the place where the ball touches.
/// let mut force = Vec3::zeros();
/// for tick in 0..=100 {
///     let hand = Pose::at(Vec3::new(0.0, 0.0, 8e-3 - 0.05e-3 * tick as f64));
///     let wrench = ball.tick(tick * 1_000_000, &[(hand, Twist::zero())]);
///     // The device renders the whole wrench.
///     ball.hold(&wrench);
///     force = wrench.force;
/// }
/// assert!((force - Vec3::z() * 2.0).norm() < 1e-9);
/// // The hand has supplied about `K d^2 / 2`.
/// assert!((ball.energy().supplied - 2e-3).abs() < 1e-4);
/// ```
#[derive(Clone, Debug)]
pub struct ToolCoupling {
    device: usize,
    config: ToolCouplingConfig,
    tool: Tool,
    /// Time of the newest patch (ns); `None` before the first.
    patched_ns: Option<u64>,
    /// When the hand took hold (ns); `None` while it does not.
    holds_since_ns: Option<u64>,
    trust: Trust,
    counters: ToolCounters,
    held_back: HeldBackByBody,
    passivity: Passivity,
}

impl ToolCoupling {
    /// The coupling of the tool on the device of this index, before its first patch.
    pub fn new(device: usize, config: ToolCouplingConfig) -> Self {
        Self {
            device,
            config,
            tool: Tool::new(config.tool),
            patched_ns: None,
            holds_since_ns: None,
            trust: Trust::new(Aging {
                period: config.tool.period,
                age_limit: config.age_limit,
                decay: config.decay,
                recovery: config.recovery,
            }),
            counters: ToolCounters::default(),
            held_back: HeldBackByBody::default(),
            passivity: Passivity::new(config.passivity),
        }
    }

    /// Hands over a patch. The next tick takes it into use if it is sound.
    ///
    /// # Errors
    /// The [`PatchFault`] for which the patch was refused. Refusals are counted.
    pub fn accept(&mut self, patch: &impl Publication<Head = PatchHead>) -> Result<(), PatchFault> {
        let time_ns = patch.head().time_ns;
        // After a clock was set back, the patch in use lies in the future. It must not block the patches that follow.
        let is_later = self
            .patched_ns
            .is_none_or(|last| time_ns > last || self.trust.is_to_come(last));
        let accepted = if self.trust.is_to_come(time_ns) {
            Err(PatchFault::ToCome)
        } else if is_later {
            self.tool.accept(patch)
        } else {
            patch::check(patch).and(Err(PatchFault::Outdated))
        };
        match accepted {
            Ok(()) => {
                self.patched_ns = Some(time_ns);
                if self.is_hold_known(time_ns, patch.head().period) {
                    self.tool.expect_hold();
                }
                count_one(&mut self.counters.accepted);
            }
            Err(PatchFault::NotFinite) => count_one(&mut self.counters.not_finite),
            Err(PatchFault::Sites) => count_one(&mut self.counters.wrong_sites),
            Err(PatchFault::Outdated) => count_one(&mut self.counters.outdated),
            Err(PatchFault::ToCome) => count_one(&mut self.counters.to_come),
            // Told by the controller alone.
            Err(PatchFault::NoTool) => {}
        }
        accepted
    }

    /// Takes the buttons of the device in this tick.
    pub fn see(&mut self, now_ns: u64, buttons: u32) {
        let holds = buttons & self.config.take_buttons != 0;
        if !holds {
            self.holds_since_ns = None;
        } else if self.holds_since_ns.is_none() {
            self.holds_since_ns = Some(now_ns);
        }
        self.tool.take_hold(holds);
    }

    /// Whether the host knew of the hold in a step that ended at this time (ns): a whole step came after it.
    fn is_hold_known(&self, time_ns: u64, period: f64) -> bool {
        let step_ns = (period * 1e9) as u64;
        let since = self.holds_since_ns;
        since.is_some_and(|since| time_ns.saturating_sub(since) > step_ns)
    }

    /// One tick: returns the wrench on the proxy of the tool's device. `devices` are the poses and twists of the proxies, by
    /// device index.
    pub fn tick(&mut self, now_ns: u64, devices: &[(Pose, Twist)]) -> Wrench {
        self.tick_slipped(now_ns, devices, devices)
    }

    /// As [`Self::tick`], if the `hands` would lead their proxies to other poses than those of `devices`: proxies have slipped.
    pub(crate) fn tick_slipped(
        &mut self,
        now_ns: u64,
        hands: &[(Pose, Twist)],
        devices: &[(Pose, Twist)],
    ) -> Wrench {
        self.trust.begin(now_ns);
        let holder = core::iter::once(self.device as u8);
        (self.passivity).observe(hands.iter().map(|(pose, _)| *pose), holder);
        let Some((pose, twist)) = devices.get(self.device) else {
            return Wrench::zero();
        };
        self.tool.see_age(self.age_ns(now_ns) as f64 * 1e-9);
        self.tool.tick(pose);
        let wrench = self.capped(twist);
        if self.patched_ns.is_some() {
            self.trust.grow_old(self.age_ns(now_ns));
        }
        let (trust, is_aged) = (self.trust.part(), self.trust.faded() > 0);
        let withheld = self.passivity.withheld();
        let wrenches = core::iter::once(&wrench);
        (self.held_back).note(now_ns, &withheld, trust, is_aged, wrenches);
        let mut rendered = wrench.scaled(trust);
        if is_aged {
            // Nothing is held before the first fade: a tool far from everything is not felt.
            rendered.force -= twist.linear * (self.config.hold_damping * (1.0 - trust));
        }
        rendered
    }

    /// The wrench of the tool under the energy cap.
    fn capped(&mut self, twist: &Twist) -> Wrench {
        let mut motions = [Motion::none(); MAX_HANDLES];
        let [motion, ..] = &mut motions;
        motion.velocity = twist.stacked();
        if let Some(hand) = self.passivity.hand(self.device) {
            (motion.step, motion.heading) = (hand.step, hand.heading);
        }
        let (mut elastic, mut viscous) =
            ([Vec6::zeros(); MAX_HANDLES], [Vec6::zeros(); MAX_HANDLES]);
        let [first, ..] = &mut elastic;
        *first = self.tool.wrench().stacked();
        let stored = self.tool.stored();
        // An energy that overflowed exceeds any energy that the hand can have supplied.
        let stored = if stored.is_finite() { stored } else { f64::MAX };
        self.passivity.note_stored(stored);
        let holder = core::iter::once(self.device as u8);
        (self.passivity).cap(holder, &motions, stored, &mut elastic, &mut viscous);
        let ([elastic, ..], [viscous, ..]) = (elastic, viscous);
        Wrench::from_stacked(&(elastic + viscous))
    }

    /// Takes the wrench that the device was finally commanded to hold for this tool (scene axes).
    pub fn hold(&mut self, wrench: &Wrench) {
        let mut wrenches = [Wrench::zero(); MAX_DEVICES];
        if let Some(place) = wrenches.get_mut(self.device) {
            *place = *wrench;
        }
        (self.passivity).hold(&wrenches, &[[Vec3::zeros(); 2]; MAX_DEVICES]);
    }

    /// The index of the device.
    pub fn device(&self) -> usize {
        self.device
    }

    /// The tool.
    pub fn tool(&self) -> &Tool {
        &self.tool
    }

    /// Age of the newest patch (ns); zero before the first.
    pub fn age_ns(&self, now_ns: u64) -> u64 {
        self.patched_ns
            .map_or(0, |patched| now_ns.saturating_sub(patched))
    }

    /// Trust in the patch, from zero (safe hold) to one.
    pub fn trust(&self) -> f64 {
        self.trust.value()
    }

    /// The state of the coupling.
    pub fn state(&self) -> HostState {
        self.trust.state()
    }

    /// The energy account of the hand.
    pub fn energy(&self) -> &EnergyAccount {
        self.passivity.account()
    }

    /// The force that the cap withholds in this tick.
    pub fn withheld(&self) -> Withheld {
        self.passivity.withheld()
    }

    /// The force that the cap and the age of the patch held back so far.
    pub fn held_back(&self) -> HeldBackByBody {
        self.held_back
    }

    /// The counts so far.
    pub fn counters(&self) -> ToolCounters {
        ToolCounters {
            faded: self.trust.faded(),
            ..self.counters
        }
    }
}
