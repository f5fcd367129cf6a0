//! `palpate plan`: prints the stages that a scene needs, and why.

use super::outputs::{Declared, Format};
use super::{CommandError, SceneArgument, build, progress_bar};
use host::atomic_file::write_json;
use host::engine::plan::{BodyPlan, ContactPlan, Stage, ToolPlan, stages};
use host::engine::rehearsal::Rehearsal;
use host::engine::unrendered::{DampedSummary, StiffSummary};
use host::preparation::Preparation;
use host::run::prepare;
use host::run::slow_host::{StepTime, cores};
use host::scene::connections;
use serde::Serialize;
use std::path::PathBuf;

/// Arguments of `palpate plan`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct PlanArguments {
    #[command(flatten)]
    scene: SceneArgument,
    /// Write the plan as JSON as well
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Do not time steps. One step at rest is made nevertheless: it shows what the devices cannot render
    #[arg(long)]
    no_timing: bool,
}

/// The JSON that `--json` writes.
#[derive(Serialize)]
struct PlanJson<'a> {
    /// Version of this layout.
    schema: &'static str,
    /// Name of the scene.
    scene: &'a str,
    /// Values of the scene that few scenes mean.
    warnings: Vec<String>,
    /// The stages of a host step, in their order.
    stages: &'a [Stage],
    /// Typical processor time of a host step on this machine (s), with its share of the publications, as measured: that of
    /// the threads that lead its stages; `None` with `--no-timing`.
    step_time: Option<f64>,
    /// The directions in which the bodies at rest are stiffer than their devices can render, by body, stiffest first.
    stiff: &'a [StiffSummary],
    /// For each body of whose damping the devices render less than the whole at rest: where they render the least part of it.
    damped: &'a [DampedSummary],
    /// The pairs that may touch; missing if nothing may.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    contacts: &'a [ContactPlan],
    /// The tools; missing if there are none.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    tools: &'a [ToolPlan],
    /// The data from which the engine is built, by body.
    bodies: &'a [BodyPlan],
}

pub(super) fn run(arguments: &PlanArguments) -> Result<(), CommandError> {
    let scene = arguments.scene.scene.as_deref();
    let loaded = arguments.scene.load()?;
    let _held = Declared::default()
        .scene(scene, &loaded)
        .file("--json", arguments.json.as_ref(), Format::Json)
        .check()?;
    connections::check(&loaded)?;
    let bar = progress_bar();
    // A scene that cannot run gets no plan. This also reports faults of its meshes.
    let world = build(&loaded, &bar)?;
    prepare::check(&world)?;
    bar.preparing(Preparation::Settling);
    world.settle();
    let plans: Vec<_> = (0..world.bodies.len())
        .map(|index| BodyPlan::new(&world, index))
        .collect();
    let stages = stages(&loaded.scene, &plans);
    bar.preparing(Preparation::Factorizing);
    let mut rehearsal = Rehearsal::new(&world)?;
    bar.preparing(Preparation::Timing);
    let stiff = rehearsal.stiff();
    let damped = rehearsal.damped();
    let step_time = (!arguments.no_timing).then(|| rehearsal.step_time());
    bar.finish_and_clear();
    outln!("{}: stages of a host step", loaded.scene.name);
    for stage in &stages {
        let sign = if stage.needed { "run " } else { "skip" };
        outln!("  {sign}  {:<10} {}", stage.name, stage.why);
    }
    let contacts = ContactPlan::all(&world);
    for pair in &contacts {
        outln!("  touch      {pair}");
    }
    let tools = ToolPlan::all(&world);
    for tool in &tools {
        outln!("  tool       {tool}");
    }
    for direction in &stiff {
        outln!("  stiff      {direction}");
    }
    for damped in &damped {
        outln!("  damped     {damped}");
    }
    let time = step_time.map(|took| StepTime::new(&loaded.scene, took));
    if let Some(time) = time {
        outln!(
            "  time       on this machine, by processor time, {}",
            time.in_words()
        );
    }
    let mut warnings: Vec<_> = world.warnings.iter().map(ToString::to_string).collect();
    if let Some(time) = time.filter(StepTime::is_too_slow) {
        let warning = time.warning(&loaded.scene, None, loaded.scene.duration, cores());
        errln!("warning: {warning}");
        warnings.push(warning);
    }
    if let Some(path) = &arguments.json {
        let json = PlanJson {
            schema: "palpate.plan/2",
            scene: &loaded.scene.name,
            warnings,
            stages: &stages,
            step_time,
            stiff: &stiff,
            damped: &damped,
            contacts: &contacts,
            tools: &tools,
            bodies: &plans,
        };
        write_json(path, &json)?;
    }
    Ok(())
}
