//! Runs with the same instructions give the same bytes; the portable instructions can be selected.

use host::log::Log;
use host::run::{Clock, RunOptions, run};
use host::scene::Scene;
use host::world::World;
use physics::FactorCode;
use std::error::Error;
use std::fs;

fn logged(instructions: FactorCode) -> Result<Vec<u8>, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("run.mcap");
    let options = RunOptions {
        duration: Some(1.0),
        log: Some(path.clone()),
        instructions,
        ..RunOptions::new(Clock::Virtual)
    };
    run(
        &World::new(&Scene::embedded_default()?).unwrap(),
        &options,
        &mut |_| {},
    )?;
    Ok(fs::read(path)?)
}

#[test]
fn each_choice_of_instructions_repeats_its_bytes_and_the_choices_differ_by_rounding()
-> Result<(), Box<dyn Error>> {
    let (fastest, portable) = (logged(FactorCode::Fastest)?, logged(FactorCode::Portable)?);
    assert!(fastest == logged(FactorCode::Fastest)?, "two runs differ");
    assert!(
        portable == logged(FactorCode::Portable)?,
        "two portable runs differ"
    );

    let (fastest, portable) = (Log::parse(&fastest)?, Log::parse(&portable)?);
    let named = portable.facts.get("instructions").map(String::as_str);
    assert_eq!(
        named,
        Some(&*format!("{} portable", std::env::consts::ARCH))
    );
    assert_ne!(named, fastest.facts.get("instructions").map(String::as_str));
    // The first models describe the same state, because no force has acted on the hands yet.
    let (a, b) = (fastest.models[0].model(), portable.models[0].model());
    assert_eq!(a.handles, b.handles);
    let pairs = a
        .stiffness
        .iter()
        .flatten()
        .zip(b.stiffness.iter().flatten());
    for (k, other) in pairs {
        assert!((k - other).amax() < 1e-12 * a.stiffness[0][0].amax());
    }
    // From then on the runs diverge: a hand that differs by one rounding may be read one encoder count apart. A count
    // of 38 um changes the force by some 0.05 N, by stiffness, and by damping of the apparent velocity of the count.
    let apart = fastest
        .rows
        .iter()
        .zip(&portable.rows)
        .map(|(a, b)| (a.devices[0].wrench.force - b.devices[0].wrench.force).norm());
    let most = apart.fold(0.0, f64::max);
    println!("forces differ by at most {most:e} N");
    assert!(most < 0.1, "{most}");
    Ok(())
}
