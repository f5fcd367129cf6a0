//! The result of a measurement of latency, for people: a table on a terminal, and the paragraph and the tables that the
//! methods section of a paper needs.

use super::percentile::{PERCENTILES, Percentile};
use super::result::{Counts, Latency, Load, Time, Worst};
use std::fmt;

/// Number of the worst ticks that are printed.
const PRINTED: usize = 3;

/// A time in microseconds, with three digits or all whole ones.
fn us(seconds: f64) -> String {
    let us = 1e6 * seconds;
    let digits = match us {
        us if us >= 99.95 => 0,
        us if us >= 9.995 => 1,
        _ => 2,
    };
    format!("{us:.digits$}")
}

/// A number with a comma between thousands.
fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let groups = digits.as_bytes().rchunks(3).rev();
    let groups: Vec<_> = groups.map(|group| String::from_utf8_lossy(group)).collect();
    groups.join(",")
}

fn percentile(time: &Time, percent: f64) -> Option<&Percentile> {
    time.percentiles
        .iter()
        .find(|found| found.percent == percent)
}

/// The counts in words; empty if nothing was counted.
fn counted(counts: &Counts) -> String {
    let parts = [
        (counts.major_faults, "page faults from the disk"),
        (counts.minor_faults, "page faults"),
        (counts.involuntary_switches, "involuntary switches"),
    ];
    let parts = parts.iter().filter(|(count, _)| *count > 0);
    let parts: Vec<_> = parts
        .map(|(count, name)| format!("{count} {name}"))
        .collect();
    parts.join(", ")
}

/// Prints the ends of the intervals of a time, below its percentiles.
fn print_intervals(f: &mut fmt::Formatter<'_>, time: &Time) -> fmt::Result {
    for (name, end) in [
        ("  from", (|found| found.low) as fn(&Percentile) -> f64),
        ("  to", |found| found.high),
    ] {
        write!(f, "  {name:<34}")?;
        for found in &time.percentiles {
            write!(f, "{:>10}", us(end(found)))?;
        }
        writeln!(f)?;
    }
    Ok(())
}

impl fmt::Display for Latency {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "latency with {}: {} Hz, {}",
            self.scene,
            self.rate,
            self.placed()
        )?;
        for load in &self.loads {
            load.print(f)?;
        }
        let shortest = self.loads.iter().flat_map(|load| &load.times);
        if shortest
            .clone()
            .any(|time| time.percentiles.len() < PERCENTILES.len())
        {
            writeln!(
                f,
                "\n  A dash is a percentile for which the run is too short: 99.999 % takes 300,000 deadlines or more.\n  \
                 Nothing is extrapolated, and the longest time is no bound on later ones."
            )?;
        }
        Ok(())
    }
}

impl Latency {
    fn placed(&self) -> String {
        let Some(place) = self.place else {
            return "no thread".to_owned();
        };
        let core = match place.core {
            Some(core) if place.isolated => format!("core {core} (isolated)"),
            Some(core) => format!("core {core}"),
            None => "any core".to_owned(),
        };
        match place.priority {
            Some(priority) => format!("{core}, SCHED_FIFO {priority}"),
            None => format!("{core}, no realtime priority"),
        }
    }

    /// The paragraph and the tables that the methods section of a paper needs, in Markdown.
    pub fn report(&self) -> String {
        let machine = &self.machine;
        let known = |fact: &Option<String>| fact.clone().unwrap_or_else(|| "unknown".to_owned());
        let kept_awake = self.place.is_some_and(|place| place.kept_awake);
        let mut text = String::from("# Latency\n\n");
        put!(
            text,
            "The latency of the haptic loop was measured with {machine}, {} cores{}, {}, {}. The kernel's command line was `{}`. \
             The frequency governor was {}, and deep sleep states were {}. The loop ran at {} Hz on {}{}, with the scene {:?}. \
             Each deadline counts: a deadline that the loop skipped is as late as the next tick that woke. Intervals contain \
             the percentile of the machine with a probability of {:.0} %. They assume no distribution, and allow for \
             correlation by blocks of a fiftieth of the measurement (Kish's design effect, Clopper and Pearson's interval). \
             Nothing is extrapolated. The longest time is that of the measurement, and no bound.",
            machine.cores,
            match machine.shared_cores {
                Some(true) => " (hardware threads included)",
                _ => "",
            },
            known(&machine.kernel),
            known(&machine.system),
            known(&machine.command_line),
            known(&machine.governor),
            if kept_awake { "off" } else { "allowed" },
            self.rate,
            self.placed(),
            if machine.virtual_machine {
                " of a virtual machine, whose hypervisor may stop it at any time"
            } else {
                ""
            },
            self.scene,
            100.0 * self.confidence,
        );
        for load in &self.loads {
            load.report(&mut text);
        }
        text
    }
}

impl Load {
    fn print(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "\n{}: {}", self.load, self.counts())?;
        write!(f, "  {:<34}", "(µs)")?;
        for percent in PERCENTILES {
            write!(f, "{:>10}", format!("{percent} %"))?;
        }
        writeln!(f, "{:>10}", "longest")?;
        for (index, time) in self.times.iter().enumerate() {
            write!(f, "  {:<34}", time.name)?;
            for percent in PERCENTILES {
                let cell = percentile(time, percent).map_or("-".into(), |found| us(found.value));
                write!(f, "{cell:>10}")?;
            }
            writeln!(f, "{:>10}  at {:.3} s", us(time.max), time.max_time)?;
            if index == 0 {
                print_intervals(f, time)?;
            }
        }
        for tick in self.worst.iter().take(PRINTED) {
            writeln!(f, "  worst      {}", tick.told())?;
        }
        match &self.kernel {
            None => writeln!(
                f,
                "  kernel     no page faults and switches are known: this system does not tell them"
            )?,
            Some(counts) => {
                let counted = counted(counts);
                let counted = if counted.is_empty() {
                    "no page faults and no involuntary switches"
                } else {
                    &counted
                };
                writeln!(f, "  kernel     {counted} of the tick's thread")?;
            }
        }
        if self.edges_without_motion > 0 {
            writeln!(
                f,
                "  edges      {} edges of the square wave without a motion",
                self.edges_without_motion
            )?;
        }
        for line in self.degradations.iter().chain(&self.failures) {
            writeln!(f, "  ! {line}")?;
        }
        Ok(())
    }

    /// How many deadlines there were, and what became of them.
    fn counts(&self) -> String {
        let all = self.met + self.skipped + self.unknown;
        let mut text = format!(
            "{} deadlines in {:.0} s, {} skipped",
            grouped(all),
            self.duration,
            grouped(self.skipped)
        );
        if self.unknown > 0 {
            put_part!(
                text,
                ", {} unknown because their records were lost",
                grouped(self.unknown)
            );
        }
        text
    }

    fn report(&self, text: &mut String) {
        put!(text, "\n## {}\n\n{}.\n", self.load, self.counts());
        put_part!(text, "| time (µs) |");
        for percent in PERCENTILES {
            put_part!(text, " {percent} % |");
        }
        put!(
            text,
            " longest |\n|---|{}---|",
            "---|".repeat(PERCENTILES.len())
        );
        for time in &self.times {
            put_part!(text, "| {} |", time.name);
            for percent in PERCENTILES {
                let cell = percentile(time, percent).map_or("-".into(), |found| {
                    format!(
                        "{} ({} to {})",
                        us(found.value),
                        us(found.low),
                        us(found.high)
                    )
                });
                put_part!(text, " {cell} |");
            }
            put!(text, " {} |", us(time.max));
        }
        let solve = &self.host_solve;
        put!(
            text,
            "\nA step of the host took {} µs (median) and {} µs (99 %) to solve.",
            us(solve.p50),
            us(solve.p99)
        );
        if let Some(worst) = self.worst.first() {
            put!(text, "The worst tick was {}.", worst.told());
        }
    }
}

impl Worst {
    /// The tick in a line.
    fn told(&self) -> String {
        let mut text = format!(
            "at {:.3} s: {} µs after its deadline",
            self.time,
            us(self.whole)
        );
        let cause = self.stages.iter().find(|stage| stage.stage == self.cause);
        if let Some(stage) = cause {
            put_part!(text, ", {} µs of it {}", us(stage.time), stage.stage);
        }
        if self.skipped > 0 {
            put_part!(text, ", then {} deadlines skipped", self.skipped);
        }
        let counted = counted(&self.kernel);
        if !counted.is_empty() {
            put_part!(text, "; in its {:.0} ms: {counted}", 1e3 * self.window);
        }
        text
    }
}
