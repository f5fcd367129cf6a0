//! One run of a cell under one scheme: physics at a fixed step, publications at the drawn rate, late, lost or stalled,
//! the controller at its tick, devices and hands between ticks.
//!
//! The physics takes its steps whatever the publication rate: what differs from the reference is the multirate scheme
//! alone. A host that stalls takes none meanwhile, and goes on from where the hands are then.

use super::StressError;
use super::draw::Span;
use super::measure::Trace;
use super::world::World;
use crate::stress::chance::Chance;
use host::engine::Engine;
use host::engine::body::HostBody;
use host::engine::build::{self, How};
use host::engine::pacer::Due;
use host::engine::stats::Stopwatch;
use host::scene::spec::SchemeName;
use nalgebra::UnitQuaternion;
use rt_core::safety::SafetyState;
use rt_core::{Controller, DeviceError, LocalModel, MAX_DEVICES, Pose, Vec3};

/// Nothing is measured: the run is virtual.
struct NoWatch;

impl Stopwatch for NoWatch {
    fn now_ns(&self) -> u64 {
        0
    }
}

/// Time constant (s) with which a body that is led along a run takes over what the encoder's counts are off.
const SETTLE: f64 = 0.05;

/// Where in the scene a body is led along a run: where the handle truly is, off by as much as the encoder's counts are
/// off on the mean of the last while. No tick knows better than its encoder where a hand that rests is, and on a stiff
/// body a part of a count is a share of the force; but a body that followed the counts themselves would be shaken.
#[derive(Clone)]
struct Wander {
    share: f64,
    off: Vec3,
    turned: Vec3,
}

impl Wander {
    fn new(period: f64) -> Self {
        Self {
            share: period / SETTLE,
            off: Vec3::zeros(),
            turned: Vec3::zeros(),
        }
    }

    /// The pose, where the controller has its proxy at `shown`, the encoder says and the handle truly is as `reading` has
    /// them (device axes; those of the scene are parallel). A device that is gone stays where it was left.
    fn pose(&mut self, shown: &Pose, reading: Option<(&Pose, &Pose)>, scale: f64) -> Pose {
        let Some((counted, truly)) = reading else {
            return *shown;
        };
        let off = counted.position - truly.position;
        let turn = truly.rotation * counted.rotation.inverse();
        self.off += (off - self.off) * self.share;
        self.turned += (-turn.scaled_axis() - self.turned) * self.share;
        Pose {
            position: shown.position + (self.off - off) * scale,
            rotation: UnitQuaternion::from_scaled_axis(self.turned) * turn * shown.rotation,
        }
    }
}

/// The host of a run.
struct Host<'a> {
    world: &'a World,
    engine: Engine,
    chance: Chance,
    /// The next physics step, and publications so far.
    next: u64,
    published: u64,
    records: u64,
    /// When the body softened here (ns), and which bodies the tick has heard of since.
    softened: Option<u64>,
    heard: Vec<bool>,
    /// Models under way: arrival (ns), body, model.
    under_way: Vec<(u64, usize, LocalModel)>,
}

impl Host<'_> {
    /// Takes all steps that are due at `now_ns`.
    fn step(&mut self, now_ns: u64) -> Result<(), StressError> {
        let draw = &self.world.draw;
        let rate = self.world.loaded.scene.host.step_rate;
        loop {
            let time_ns = (self.next as f64 * 1e9 / rate) as u64;
            if time_ns > now_ns {
                return Ok(());
            }
            self.next += 1;
            let time = time_ns as f64 * 1e-9;
            if draw.stalls.iter().any(|stall| stall.holds(time)) {
                continue;
            }
            if let (None, Some(softening), Some(soft)) =
                (self.softened, draw.softening, &self.world.soft)
                && time >= softening.at
            {
                self.softened = Some(time_ns);
                self.engine.exchange(build::bodies(soft, How::default())?)?;
            }
            // At the first step at or after each multiple of the period; a late host does not make up for lost ones.
            let due = (time * draw.rate * (1.0 + 1e-12)) as u64;
            let publishes = due > self.published;
            self.published = due;
            let chance = self.chance;
            let under_way = &mut self.under_way;
            self.engine
                .step(Due { time_ns, publishes }, &NoWatch, |body, model| {
                    let late = draw.jitter * (draw.latency + 1.0 / draw.rate);
                    let delay = draw.latency + late * chance.of("late").unit(due);
                    if chance.of("model").unit(due) >= draw.models_lost {
                        under_way.push((time_ns + (delay * 1e9) as u64, body, *model));
                    }
                });
        }
    }
}

/// Runs the cell of `world` under `scheme`.
pub(in crate::stress) fn run(
    world: &World,
    scheme: SchemeName,
    chance: Chance,
) -> Result<Trace, StressError> {
    let mut world = world.clone();
    let draw = world.draw.clone();
    for loaded in [Some(&mut world.loaded), world.soft.as_mut()]
        .into_iter()
        .flatten()
    {
        let realtime = &mut loaded.scene.realtime;
        realtime.scheme = scheme;
        // Whoever sets a scene up for a late host lets the tick believe it as long as it is no later than usual.
        let usual = 2.0 * (1.0 + draw.jitter) * (draw.latency + 1.0 / draw.rate);
        realtime.age_limit = Some(realtime.age_limit().max(usual));
    }
    let world = &world;
    let engine = Engine::new(build::bodies(&world.loaded, How::default())?);
    let stored: f64 = engine
        .bodies()
        .iter()
        .map(|body| body.body().total_energy())
        .sum();
    let (config, mut devices) = world.devices(stored)?;
    let mut controller = Controller::new(&config);
    let mut host = Host {
        world,
        engine,
        chance,
        next: 1,
        published: 0,
        records: 0,
        softened: None,
        heard: vec![false; world.loaded.scene.bodies.len()],
        under_way: Vec::new(),
    };
    let period = world.period();
    let mut wanders = vec![Wander::new(period); world.loaded.scene.devices.len()];
    let softens = draw.softening.map(|softening| softening.at);
    let mut unaware = Span::default();
    for k in 0..world.ticks() {
        let now = k * world.period_ns();
        host.step(now)?;
        let (softened, heard) = (host.softened, &mut host.heard);
        host.under_way.retain(|(arrival, body, model)| {
            if *arrival <= now {
                // One that was overtaken is refused, as it is to be.
                let _ = controller.accept(*body, model);
                heard[*body] |= softened.is_some_and(|at| model.time_ns >= at);
            }
            *arrival > now
        });
        let time = now as f64 * 1e-9;
        if let Some(at) = softens.filter(|at| time >= *at && heard.contains(&false)) {
            unaware = Span {
                at,
                duration: time + period - at,
            };
        }

        let mut readings = [const { Err(DeviceError::NoReport) }; MAX_DEVICES];
        let mut truly = [Pose::identity(); MAX_DEVICES];
        devices.read(now, |device, state, pose| {
            readings[device] = state.ok_or(DeviceError::NoReport);
            truly[device] = pose;
        });
        let (commands, telemetry) = controller.tick(now, &readings);
        for (device, wander) in wanders.iter_mut().enumerate() {
            let shown = telemetry.devices[device].pose;
            let scale = world.loaded.scene.devices[device].motion_scale;
            let reading = readings[device].as_ref().ok();
            let pose = wander.pose(&shown, reading.map(|r| (&r.pose, &truly[device])), scale);
            devices.keep_proxy(device, pose);
        }
        devices.write(now, &commands, |device| {
            telemetry.devices[device].safety == SafetyState::Limited
        });
        host.records += 1;
        let lost = world.draw.records_lost;
        if host.chance.of("record").unit(host.records) >= lost {
            host.engine.follow(&telemetry.tick_record());
        }

        let bodies = host.engine.bodies().iter().map(HostBody::body);
        let (wrenches, weight) = devices.exerted_by(bodies);
        let account = controller.energy().fold([0.0; 2], |sum, account| {
            [sum[0] + account.available, sum[1] + account.stored]
        });
        devices.keep(&wrenches, weight, account);
    }
    let capped = controller.energy().map(|account| account.capped).sum();
    Ok(Trace {
        unaware,
        ..devices.finish(capped)
    })
}
