//! Bytes are equal where the instructions are; the portable ones can be asked for.

use host::log::Log;
use host::run::{Clock, RunOptions, run};
use host::scene::Scene;
use physics::Kernels;
use std::error::Error;
use std::fs;

fn logged(instructions: Kernels) -> Result<Vec<u8>, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("run.mcap");
    let options = RunOptions {
        duration: Some(1.0),
        log: Some(path.clone()),
        instructions,
        ..RunOptions::new(Clock::Virtual)
    };
    run(&Scene::embedded_default()?, &options, |_| {})?;
    Ok(fs::read(path)?)
}

#[test]
fn each_choice_repeats_its_bytes_and_they_differ_from_each_other_by_rounding()
-> Result<(), Box<dyn Error>> {
    let (fastest, portable) = (logged(Kernels::Fastest)?, logged(Kernels::Portable)?);
    assert!(fastest == logged(Kernels::Fastest)?, "two runs differ");
    assert!(
        portable == logged(Kernels::Portable)?,
        "two portable runs differ"
    );

    let (fastest, portable) = (Log::parse(&fastest)?, Log::parse(&portable)?);
    let named = portable.facts.get("instructions").map(String::as_str);
    assert_eq!(
        named,
        Some(&*format!("{} portable", std::env::consts::ARCH))
    );
    assert_ne!(named, fastest.facts.get("instructions").map(String::as_str));
    // The first models are of one and the same state: the hands have felt nothing of either yet.
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
    // From there on each run goes its own way: a hand that is one rounding off may be read one encoder
    // count off. A count of 38 um moves the force by some 0.05 N: stiffness, and damping of the velocity
    // that the count seems to be.
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
