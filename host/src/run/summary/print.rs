//! The summary for people, one line for each subject.

use super::{DeviceSummary, EnergySummary, HeldBackSummary, PlaceSummary, RunSummary};
use crate::record::Distribution;
use std::fmt;

/// Most events that are printed; `--json` writes all of them.
const SHOWN_EVENTS: usize = 8;

impl fmt::Display for RunSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{}: {} clock, scheme {}, seed {}",
            self.scene, self.clock, self.scheme, self.seed
        )?;
        writeln!(f, "  machine    {}", self.machine)?;
        self.print_tick(f)?;
        self.print_host(f)?;
        for device in &self.devices {
            device.print(f)?;
        }
        for held_back in &self.held_back {
            held_back.print(f)?;
        }
        for energy in &self.energy {
            energy.print(f)?;
        }
        for tool in &self.tools {
            tool.print(f)?;
        }
        for tears in &self.tears {
            tears.print(f)?;
        }
        if let Some(contact) = &self.contact {
            contact.print(f)?;
        }
        self.print_dropped(f)?;
        self.print_events(f)
    }
}

impl RunSummary {
    /// Prints the ticks of the loop: their number, core, lateness and duration.
    fn print_tick(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let t = &self.tick;
        writeln!(
            f,
            "  ticks      {} at {} Hz, {} missed deadlines (longest run {})",
            t.count, t.rate, t.missed_deadlines, t.longest_miss
        )?;
        if t.stopped {
            writeln!(f, "  stopped    a signal ended the run before its end")?;
        }
        if let Some(place) = &t.place {
            let locked = t.locked_bytes as f64 / f64::from(1 << 20);
            let allocations = match t.allocator_calls {
                Some(0) => ", no allocation",
                Some(_) => ", with allocations",
                None => "",
            };
            writeln!(
                f,
                "  ran on     {place}, {locked:.1} MiB locked{allocations}"
            )?;
            writeln!(f, "             {}", self.machine.surroundings())?;
        }
        if let Some(lateness) = &t.lateness {
            writeln!(f, "  woke late  {}", Times(lateness))?;
        }
        if let Some(duration) = &t.duration {
            writeln!(f, "  tick took  {}", Times(duration))?;
        }
        // A body that nobody holds publishes no model.
        let ages = t.model_age.iter().zip(&self.energy);
        for (age, body) in ages.filter(|(age, _)| age.count > 0) {
            // One body needs no name.
            let of = match t.model_age.len() {
                1 => String::new(),
                _ => format!("{}: ", body.body),
            };
            writeln!(f, "  model age  {of}{}", Times(age))?;
        }
        Ok(())
    }

    /// Prints the steps of the host and the times of its stages.
    fn print_host(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let h = &self.host;
        writeln!(
            f,
            "  host       {} steps ({:.0} Hz), {} skipped, {} models published; {} elements",
            h.steps, h.step_rate, h.skipped_steps, h.publications, h.elements
        )?;
        writeln!(
            f,
            "  stages     solve {} ({} iterations, at most {}), condense {} (medians){}",
            Time(h.solve.p50),
            h.iterations[0],
            h.iterations[2],
            Time(h.condense.p50),
            match h.factors {
                0 => String::new(),
                1 => "; 1 background refactorization".to_owned(),
                n => format!("; {n} background refactorizations"),
            }
        )?;
        for solver in &h.solvers {
            writeln!(f, "  solver     {solver}")?;
        }
        for stiff in &h.stiff {
            writeln!(f, "  stiff      {stiff}")?;
        }
        for damped in &h.damped {
            writeln!(f, "  damped     {damped}")?;
        }
        if h.unconverged_steps > 0 {
            writeln!(
                f,
                "  !          {} steps stopped at the iteration limit, residual up to {:.1e}",
                h.unconverged_steps, h.worst_residual
            )?;
        }
        if h.clipped > 0 {
            writeln!(
                f,
                "  !          {} local models were clipped to positive semidefinite, by up to {:.1e} of the largest \
                 eigenvalue",
                h.clipped, h.worst_clip
            )?;
        }
        Ok(())
    }

    /// Prints the messages that were refused or not used.
    fn print_dropped(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let d = &self.dropped;
        write!(
            f,
            "  dropped    {} tick records, {} telemetry, {} models, {} wrenches; {} models superseded, {} refused",
            d.tick_records,
            d.telemetry,
            d.models,
            d.wrenches,
            d.superseded_models,
            self.tick.refused_models
        )?;
        if !self.tools.is_empty() {
            let (lost, superseded) = (d.patches, d.superseded_patches);
            write!(f, "; {lost} patches, {superseded} superseded")?;
        }
        writeln!(f)
    }

    /// Prints events, refusals, degradations and failures.
    fn print_events(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for event in self.events.iter().take(SHOWN_EVENTS) {
            writeln!(
                f,
                "  event      {:.3} to {:.3} s: {}",
                event.from, event.to, event.description
            )?;
        }
        if self.events.len() > SHOWN_EVENTS {
            writeln!(
                f,
                "  event      and {} more (see --json)",
                self.events.len() - SHOWN_EVENTS
            )?;
        }
        for what in &self.refusals {
            writeln!(f, "  refused    {what}")?;
        }
        for what in &self.degradations {
            writeln!(f, "  note       {what}")?;
        }
        for what in &self.failures {
            writeln!(f, "  FAILED     {what}")?;
        }
        Ok(())
    }
}

impl DeviceSummary {
    fn print(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "  {:<10} peak {:.2} N at {:.2} s, work {:+.1} mJ",
            self.name,
            self.peak_force,
            self.peak_time,
            self.work * 1e3
        )?;
        if let Some(port_work) = self.port_work {
            write!(f, " ({:+.1} at the port)", port_work * 1e3)?;
        }
        write!(f, ", reach {:.1} mm", self.reach * 1e3)?;
        if self.slip > 0.0 {
            write!(f, ", slipped by {:.2} mm", self.slip * 1e3)?;
        }
        if self.limited_ticks > 0 {
            write!(f, ", force limited in {} ticks", self.limited_ticks)?;
        }
        if self.hot_ticks > 0 {
            write!(f, ", motors hot in {} ticks", self.hot_ticks)?;
        }
        if self.missed_reads > 0 {
            write!(f, ", no reading in {} ticks", self.missed_reads)?;
        }
        if self.not_a_number_ticks > 0 {
            write!(
                f,
                ", force not a number in {} ticks",
                self.not_a_number_ticks
            )?;
        }
        for (count, what) in [
            (self.too_fast, "too fast"),
            (self.out_of_reach, "out of reach"),
            (self.engaged, "engaged"),
            (self.hands_off, "let go of"),
            (self.stopped, "stopped"),
            (self.let_go, "let go by itself"),
            (self.device_faults, "in a fault of its own"),
        ] {
            if count > 0 {
                let plural = if count == 1 { "" } else { "s" };
                write!(f, ", {what} {count} time{plural}")?;
            }
        }
        if self.slewed_ticks > 0 {
            write!(
                f,
                ", force at its slew limit in {} ticks",
                self.slewed_ticks
            )?;
        }
        writeln!(f)?;
        if let Some(refused) = self.refused_wrenches.filter(|refused| *refused > 0) {
            writeln!(f, "             the device refused {refused} wrenches")?;
        }
        // The calls of a simulated device compute its physics, which says nothing of a transport.
        let real = self.motor_work.is_none();
        if real {
            writeln!(
                f,
                "             {:.0} states a second, {:.0} by its profile",
                self.states_rate, self.profile_rate
            )?;
        }
        for (what, times) in [
            ("read took", &self.read),
            ("write took", &self.write),
            ("motion to force", &self.motion_to_force),
        ] {
            if let Some(times) = times.as_ref().filter(|_| real) {
                writeln!(f, "             {what} {}", Times(times))?;
            }
        }
        if let Some(trip) = &self.first_trip {
            let (found, limit, unit) = (trip.found, trip.limit, trip.unit);
            writeln!(
                f,
                "             first trip at {:.3} s: {}, {found:.3} {unit} over the limit of {limit} {unit}",
                trip.time, trip.event
            )?;
        }
        Ok(())
    }
}

impl HeldBackSummary {
    fn print(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "  held back  {}: for {:.3} s in all between {:.3} and {:.3} s, by {:.2} N on average and at most {:.2} N of {:.2} \
             N (at {:.3} s): {}",
            self.of,
            self.duration,
            self.from,
            self.to,
            self.mean,
            self.most,
            self.most_of,
            self.most_time,
            self.why
        )
    }
}

impl EnergySummary {
    /// Prints the balance `supplied + initial + received = raised + stored + dissipated`, and below it what came out of nothing.
    fn print(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mj = |joules: f64| joules * 1e3;
        write!(
            f,
            "  energy     {}: {:+.1} mJ supplied by the hands",
            self.body,
            mj(self.supplied)
        )?;
        if let (Some(stored), Some(dissipated)) = (self.stored, self.dissipated) {
            let parts = [self.initial, self.raised, stored, dissipated];
            let [initial, raised, stored, dissipated] = parts.map(mj);
            write!(f, ", {initial:+.1} stored at the start")?;
            if self.received != 0.0 {
                write!(f, ", {:+.1} through contacts", mj(self.received))?;
            }
            write!(
                f,
                " = {raised:+.1} raised, {stored:+.1} stored, {dissipated:+.1} \
                 dissipated"
            )?;
        }
        writeln!(f)?;
        write!(
            f,
            "             peak net output {:.1} mJ, with {:.1} mJ of the devices' own losses credited",
            mj(self.most_out),
            mj(self.credited)
        )?;
        if self.capped_ticks > 0 {
            write!(f, "; capped in {} ticks", self.capped_ticks)?;
        }
        writeln!(f)
    }
}

impl fmt::Display for PlaceSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.core, self.isolated) {
            (Some(core), true) => write!(f, "core {core} (isolated)")?,
            (Some(core), false) => write!(f, "core {core} (not isolated)")?,
            (None, _) => write!(f, "no core of its own")?,
        }
        match self.priority {
            Some(priority) => write!(f, ", SCHED_FIFO {priority}")?,
            None => write!(f, ", no realtime priority")?,
        }
        let awake = if self.kept_awake { "off" } else { "allowed" };
        write!(f, ", deep sleep {awake}")
    }
}

/// A time with a readable unit.
struct Time(f64);

impl fmt::Display for Time {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let s = self.0;
        if s < 1e-6 {
            write!(f, "{:.0} ns", s * 1e9)
        } else if s < 1e-3 {
            write!(f, "{:.1} us", s * 1e6)
        } else if s < 1.0 {
            write!(f, "{:.2} ms", s * 1e3)
        } else {
            write!(f, "{s:.2} s")
        }
    }
}

/// A distribution in one line.
struct Times<'a>(&'a Distribution);

impl fmt::Display for Times<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let d = self.0;
        write!(
            f,
            "median {}, 99 % {}, 99.9 % {}",
            Time(d.p50),
            Time(d.p99),
            Time(d.p99_9)
        )?;
        if let Some(p99_99) = d.p99_99 {
            write!(f, ", 99.99 % {}", Time(p99_99))?;
        }
        write!(f, ", most {}", Time(d.max))?;
        if d.overflow > 0 {
            write!(f, " ({} beyond the histogram)", d.overflow)?;
        }
        Ok(())
    }
}
