//! `palpate plan`: prints the stages that a scene needs, and why.

use super::outputs::{Declared, Format};
use super::{CommandError, SceneArgument, load};
use host::atomic_file::write_json;
use host::bodies;
use host::engine::build;
use host::engine::plan::{BodyPlan, Stage, stages};
use host::scene::SceneError;
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
}

/// The JSON that `--json` writes.
#[derive(Serialize)]
struct PlanJson<'a> {
    schema: &'static str,
    scene: &'a str,
    /// Values of the scene that few scenes mean.
    warnings: Vec<String>,
    stages: &'a [Stage],
    /// The data from which the engine is built, by body.
    bodies: &'a [BodyPlan],
}

pub(super) fn run(arguments: &PlanArguments) -> Result<(), CommandError> {
    let scene = arguments.scene.scene.as_deref();
    let loaded = load(scene)?;
    let _held = Declared::default()
        .scene(scene, &loaded)
        .file("--json", arguments.json.as_ref(), Format::Json)
        .check()?;
    // A scene that cannot run gets no plan. This check also reports faults of its meshes.
    build::check(&loaded)?;
    let plans = (0..loaded.scene.bodies.len()).map(|index| {
        let built = bodies::build(&loaded, index)?;
        Ok(BodyPlan::new(&loaded, index, &built))
    });
    let plans = plans.collect::<Result<Vec<_>, SceneError>>()?;
    let stages = stages(&loaded.scene, &plans);
    outln!("{}: stages of a host step", loaded.scene.name);
    for stage in &stages {
        let sign = if stage.needed { "run " } else { "skip" };
        outln!("  {sign}  {:<10} {}", stage.name, stage.why);
    }
    if let Some(path) = &arguments.json {
        let json = PlanJson {
            schema: "palpate.plan/2",
            scene: &loaded.scene.name,
            warnings: bodies::warnings(&loaded)
                .iter()
                .map(ToString::to_string)
                .collect(),
            stages: &stages,
            bodies: &plans,
        };
        write_json(path, &json)?;
    }
    Ok(())
}
