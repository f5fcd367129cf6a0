//! From a finished run to its summary and its plot.

use super::collect::Collected;
use super::ended::{Ended, HostSide};
use super::summary::{
    ContactSummary, DeviceSummary, DroppedSummary, EnergySummary, EventSummary, HeldBackSummary,
    HostSummary, PlaceSummary, RunSummary, SCHEMA, TearSummary, TickSummary, ToolSummary,
    TripSummary,
};
use super::{Clock, RunOptions, held_back, instructions, slow_host};
use crate::engine::plan::publishes_energy;
use crate::engine::unrendered::{DampedSummary, StiffSummary};
use crate::machine::Machine;
use crate::plot::{Component, DeviceSeries, PlotData};
use crate::record::Distribution;
use crate::scene::{LoadedScene, Scene};
use crate::world::{World, scheme};
use firmware_proto::report::fault;
use rt_core::EnergyAccount;
use rt_core::coupling::CouplingCounters;
use rt_core::safety::{SafetyState, Trip};
use runner::TickReport;
use runner::latency::{DeviceTimes, LatencyHistogram};

/// `size`: elements and vertices of all bodies.
pub(super) fn summarize(
    world: &World<'_>,
    options: &RunOptions,
    seed: u64,
    size: (usize, usize),
    ended: &Ended,
) -> RunSummary {
    let loaded = world.loaded;
    let scene = &loaded.scene;
    let side = &ended.tick;
    let couplings: Vec<_> = side.controller.coupling_counters().collect();
    let elapsed = (side.ticks + side.missed_deadlines) as f64 / scene.realtime.rate;
    RunSummary {
        schema: SCHEMA,
        scene: scene.name.clone(),
        clock: options.clock.name(),
        machine: Machine::here(
            options.commit,
            instructions(options.instructions),
            side.core,
        ),
        scheme: scheme(scene).name(),
        seed,
        warnings: world.warnings.iter().map(ToString::to_string).collect(),
        tick: tick(scene, options.clock, ended, &couplings),
        host: host_summary(scene, ended, elapsed, size),
        devices: devices(loaded, ended),
        held_back: held_back(scene, ended),
        energy: energy(scene, side.controller.energy()),
        tools: ToolSummary::all(
            scene,
            side.controller.tools(),
            &ended.observed.collected.touched,
        ),
        tears: tears(ended),
        contact: (ended.host.engine.contact()).map(|contact| ContactSummary::new(scene, contact)),
        dropped: dropped(ended),
        events: events(options, ended),
        refusals: refusals(scene, &couplings),
        degradations: degradations(scene, options.clock, ended),
        failures: device_faults(scene, side)
            .chain(ended.observed.failures.iter().cloned())
            .collect(),
        unwritten: Vec::new(),
    }
}

fn tick(scene: &Scene, clock: Clock, ended: &Ended, couplings: &[CouplingCounters]) -> TickSummary {
    let side = &ended.tick;
    let measured =
        |h: &LatencyHistogram| (clock == Clock::Real).then(|| Distribution::from(h.summary()));
    TickSummary {
        rate: scene.realtime.rate,
        count: side.ticks,
        missed_deadlines: side.missed_deadlines,
        longest_miss: side.longest_miss,
        slots: side.slots,
        records: ended.observed.collected.records,
        stopped: ended.stopped,
        place: (clock == Clock::Real).then_some(PlaceSummary {
            core: side.core,
            isolated: side.isolated,
            priority: side.priority,
            kept_awake: side.kept_awake,
        }),
        lateness: measured(&side.latencies.lateness),
        duration: measured(&side.latencies.tick_time),
        compute: measured(&side.latencies.compute),
        model_age: side
            .latencies
            .model_age
            .iter()
            .map(|h| h.summary().into())
            .collect(),
        locked_bytes: side.locked_bytes as u64,
        allocator_calls: side.allocator_calls,
        refused_models: couplings
            .iter()
            .map(|c| c.not_finite + c.wrong_handles + c.outdated + c.to_come)
            .sum(),
        faded: couplings.iter().map(|c| c.faded).sum(),
    }
}

fn devices(loaded: &LoadedScene, ended: &Ended) -> Vec<DeviceSummary> {
    let scene = &loaded.scene;
    let side = &ended.tick;
    // Only the real clock measures the devices.
    let measured = |index: usize, pick: fn(&DeviceTimes) -> &LatencyHistogram| {
        let times = side.latencies.devices.get(index);
        let histogram = times.map(pick).filter(|histogram| histogram.count() > 0);
        histogram.map(|histogram| Distribution::from(histogram.summary()))
    };
    let devices = scene
        .devices
        .iter()
        .zip(&side.devices)
        .zip(&ended.observed.collected.totals);
    devices
        .zip(side.controller.safety_counters())
        .zip(side.controller.first_trips())
        .enumerate()
        .map(
            |(index, ((((spec, device), totals), safety), trip))| DeviceSummary {
                name: spec.name.clone(),
                peak_force: totals.peak_force,
                peak_time: totals.peak_time,
                work: totals.work,
                motor_work: device.probe().map(|probe| probe.motor_work),
                port_work: device.probe().map(|probe| probe.on_hand),
                reach: totals.reach,
                slip: totals.slip,
                limited_ticks: safety.limited,
                not_a_number_ticks: safety.not_a_number,
                slewed_ticks: safety.slewed,
                missed_reads: safety.missed_reads,
                states_rate: ended.observed.collected.states_rate(index),
                profile_rate: f64::from(loaded.models[index].rate_hz),
                refused_wrenches: device.refused_wrenches(),
                too_fast: safety.too_fast,
                out_of_reach: safety.out_of_reach,
                hot_ticks: safety.hot,
                engaged: safety.engaged,
                hands_off: safety.hands_off,
                stopped: safety.stopped,
                let_go: safety.let_go,
                device_faults: safety.device_faults,
                read: measured(index, |times| &times.read),
                write: measured(index, |times| &times.write),
                motion_to_force: measured(index, |times| &times.motion_to_force),
                first_trip: trip.map(|trip| {
                    let most = device.capabilities().max_moment;
                    trip_summary(&trip, most, scene.realtime.rate)
                }),
            },
        )
        .collect()
}

/// The first fault that each device reported, in words.
fn device_faults(scene: &Scene, side: &TickReport) -> impl Iterator<Item = String> {
    let devices = scene.devices.iter();
    let reported = devices.zip(side.controller.first_device_faults());
    reported.filter_map(|(device, fault)| {
        let (tick, number) = fault?;
        let time = tick as f64 / scene.realtime.rate;
        // A plug-in has numbers of its own.
        let name = fault::name(number).filter(|_| device.connect.driver != "plugin");
        let name = name.map_or_else(String::new, |name| format!(" ({name})"));
        Some(format!(
            "the device {} reported the fault {number}{name} at {time:.3} s and rendered no force",
            device.name
        ))
    })
}

fn held_back(scene: &Scene, ended: &Ended) -> Vec<HeldBackSummary> {
    let (controller, devices) = (&ended.tick.controller, &ended.tick.devices);
    let capabilities: Vec<_> = devices.iter().map(|device| device.capabilities()).collect();
    held_back::summaries(
        scene,
        &capabilities,
        controller.held_back_by_bodies(),
        controller
            .tools()
            .map(|tool| (tool.device(), tool.held_back())),
        controller.held_back_by_devices(),
    )
}

/// The faults and orders on purpose and what the observers saw, by the time at which they began.
fn events(options: &RunOptions, ended: &Ended) -> Vec<EventSummary> {
    let injected = options.faults.iter().map(|fault| EventSummary {
        from: fault.at,
        to: fault.at + fault.duration,
        description: format!("fault on purpose: {}", fault.name()),
    });
    let ordered = options.orders.iter().map(|order| EventSummary {
        from: order.at,
        to: order.at,
        description: format!("order on purpose: {}", order.order.name()),
    });
    let met = ended
        .observed
        .collected
        .spans
        .iter()
        .map(|span| EventSummary {
            from: span.from,
            to: span.to,
            description: span.description.clone(),
        });
    let mut all: Vec<_> = injected.chain(ordered).chain(met).collect();
    all.sort_by(|a, b| a.from.total_cmp(&b.from));
    all
}

fn dropped(ended: &Ended) -> DroppedSummary {
    let side = &ended.tick;
    let end = &ended.host.end;
    DroppedSummary {
        tick_records: side.link.refused_records,
        telemetry: side.link.refused_telemetry,
        models: end.refused_models(),
        logged_models: end.refused_copies(),
        superseded_models: side.link.superseded_models,
        patches: end.refused_patches(),
        superseded_patches: side.link.superseded_patches,
        wrenches: side.refused_wrenches,
    }
}

/// The tears of the bodies that can tear.
fn tears(ended: &Ended) -> Vec<TearSummary> {
    let host = &ended.host;
    let stats = host.engine.stats();
    let forces = &ended.observed.collected.tear_forces;
    let bodies = host.engine.bodies().iter().enumerate();
    let torn = bodies.filter_map(|(index, body)| {
        let tears = body.tears()?;
        let time = stats.tear.summary().into();
        let force = forces.get(index).cloned().flatten();
        let summary = TearSummary::new(body.name(), tears, force, time, stats.renewed);
        Some(TearSummary {
            asleep: body.pieces_asleep(),
            ..summary
        })
    });
    torn.collect()
}

fn energy(scene: &Scene, accounts: impl Iterator<Item = EnergyAccount>) -> Vec<EnergySummary> {
    let publishes = publishes_energy(scene);
    let bodies = scene.bodies.iter().zip(accounts);
    let summaries = bodies.map(|(body, account)| EnergySummary {
        body: body.name.clone(),
        supplied: account.supplied,
        initial: account.initial,
        received: account.received,
        raised: account.raised,
        stored: publishes.then_some(account.stored),
        dissipated: publishes.then(|| account.dissipated()),
        most_out: (-(account.least + account.initial)).max(0.0),
        credited: account.credited,
        capped_ticks: account.capped,
    });
    summaries.collect()
}

/// The trip of a device whose largest moment is `max_moment` (N m), in words.
fn trip_summary(trip: &Trip, max_moment: f64, rate: f64) -> TripSummary {
    // A trip holds the limit itself.
    let by_moment =
        trip.state == SafetyState::Limited && trip.limit.to_bits() == max_moment.to_bits();
    let (event, unit) = match trip.state {
        _ if by_moment => ("moment limited", "N m"),
        state => (state.cause().unwrap_or("nothing"), unit(state)),
    };
    TripSummary {
        event,
        time: trip.tick as f64 / rate,
        found: trip.found,
        limit: trip.limit,
        unit,
    }
}

/// The unit of the limit of a trip.
fn unit(state: SafetyState) -> &'static str {
    match state {
        SafetyState::Limited | SafetyState::Hot | SafetyState::NotANumber => "N",
        SafetyState::Slewed => "N/s",
        SafetyState::TooFast => "m/s",
        SafetyState::OutOfReach => "m",
        SafetyState::Silent => "ticks",
        SafetyState::DeviceFault => "(number of the fault)",
        // These states are no trips.
        _ => "",
    }
}

/// The notes about missing privileges and about steps that a slow host left out.
fn degradations(scene: &Scene, clock: Clock, ended: &Ended) -> Vec<String> {
    let refused = ended.tick.degradations.iter().map(ToString::to_string);
    let mut found: Vec<_> = refused
        .chain(ended.observed.degradations.iter().cloned())
        .collect();
    if clock == Clock::Real {
        let (stats, skipped) = (ended.host.engine.stats(), ended.host.pacer.skipped());
        found.extend(slow_host::skipped(
            scene,
            stats,
            skipped,
            slow_host::cores(),
        ));
    }
    found
}

/// Which models were refused, and why, in words.
fn refusals(scene: &Scene, couplings: &[CouplingCounters]) -> Vec<String> {
    let bodies = scene.bodies.iter().zip(couplings);
    let counted = bodies.flat_map(|(body, c)| {
        [
            (c.not_finite, "a number is not finite"),
            (c.wrong_handles, "wrong handles"),
            (c.outdated, "not newer than the model in use"),
            (c.to_come, "timestamped in the future"),
        ]
        .map(|(count, why)| (&body.name, count, why))
    });
    counted
        .filter(|(_, count, _)| *count > 0)
        .map(|(name, count, why)| format!("{name}: {count} models, {why}"))
        .collect()
}

fn host_summary(
    scene: &Scene,
    ended: &Ended,
    elapsed: f64,
    (elements, vertices): (usize, usize),
) -> HostSummary {
    let host = &ended.host;
    let (stats, skipped_steps) = (host.engine.stats(), host.pacer.skipped());
    let iterations = stats.iterations.summary();
    let bodies = host.engine.bodies().iter();
    let solvers = bodies
        .map(|body| format!("{}: {}", body.name(), body.solved()))
        .collect();
    HostSummary {
        steps: stats.steps,
        skipped_steps,
        step_rate: stats.steps as f64 / elapsed.max(f64::MIN_POSITIVE),
        publications: stats.publications,
        elements,
        vertices,
        solvers,
        factors: stats.factors,
        solve: stats.solve.summary().into(),
        condense: stats.condense.summary().into(),
        iterations: [iterations.p50, iterations.p99, iterations.max],
        unconverged_steps: stats.unconverged,
        worst_residual: stats.worst_residual,
        clipped: stats.clipped,
        worst_clip: stats.worst_clip,
        faults: stats.faults,
        stiff: stiff(scene, host),
        damped: DampedSummary::all(scene, host.engine.bodies()),
    }
}

/// The stiffest direction of each body that its devices could not render.
fn stiff(scene: &Scene, host: &HostSide) -> Vec<StiffSummary> {
    let bodies = host.engine.bodies().iter().enumerate();
    let found = bodies.filter_map(|(number, body)| {
        let stiffest = body.publisher().stiffest()?;
        Some(StiffSummary::new(scene, number, &stiffest))
    });
    found.collect()
}

/// What the picture of a run shows: the `component` of its forces.
pub(super) fn plot_data(
    loaded: &LoadedScene,
    collected: &Collected,
    component: Component,
) -> PlotData {
    let scene = &loaded.scene;
    let series = scene.devices.iter().enumerate().map(|(index, device)| {
        let of = |pick: fn(&(rt_core::Vec3, rt_core::Vec3)) -> rt_core::Vec3| {
            let samples = collected.samples.iter();
            samples
                .filter_map(|s| s.devices.get(index).map(|d| pick(d).into()))
                .collect()
        };
        DeviceSeries {
            name: device.name.clone(),
            force: of(|d| d.0),
            position: of(|d| d.1),
        }
    });
    PlotData {
        title: scene.name.clone(),
        subtitle: format!(
            "scheme {}, tick {} Hz, host {} Hz",
            scheme(scene).name(),
            scene.realtime.rate,
            scene.host.step_rate
        ),
        time: collected.samples.iter().map(|sample| sample.time).collect(),
        devices: series.collect(),
        marks: collected.marks.clone(),
        component,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trip_at_a_limit_has_the_unit_of_that_limit() {
        let trip = |limit| Trip {
            state: SafetyState::Limited,
            tick: 500,
            found: 1.5 * limit,
            limit,
        };
        let said = |limit| {
            let summary = trip_summary(&trip(limit), 0.5, 1000.0);
            (summary.event, summary.unit)
        };
        assert_eq!(said(5.0), ("force limited", "N"));
        assert_eq!(said(0.5), ("moment limited", "N m"));
    }
}
