//! The largest scenes that the tick serves: eight devices on eight bodies.

use host::run::{Clock, RunOptions, run};
use host::scene::{LoadedScene, Scene, SceneError};
use host::world::World;
use std::collections::BTreeMap;
use std::error::Error;
use std::fmt::Write;

/// A scene of `count` blocks in a row, each pressed by a hand of its own.
fn blocks(count: usize) -> Result<LoadedScene, SceneError> {
    let mut text = "name = 'row'\ngravity = [0, 0, 0]\n".to_owned();
    for number in 0..count {
        let at = 0.2 * number as f64;
        let _ = write!(
            text,
            "[[body]]\nname = 'block {number}'\nposition = [{at}, 0, 0]\n\
             damping = {{ mass = 0.1, stiffness = 0.02 }}\n\
             mesh.box = {{ size = [0.1, 0.1, 0.06], cells = [2, 2, 1] }}\n\
             material = {{ young = 8e3, poisson = 0.3, density = 1000 }}\n\
             [[body.support]]\nname = 'table'\ngroup = 'bottom'\n\
             [[body.handle]]\nname = 'top'\ngroup = 'top'\ndevice = 'device {number}'\n"
        );
    }
    for number in 0..count {
        // Each hand has a depth of its own, so that a force of another hand would be noticed.
        let depth = 1e-3 * (number + 1) as f64;
        let _ = write!(
            text,
            "[[device]]\nname = 'device {number}'\nmodel = 'falcon'\n\
             hand = {{ grip = 'rigid', waypoints = [[0, 0, 0, 0], [0.3, 0, 0, {}]] }}\n",
            -depth
        );
    }
    Scene::load_texts("row.toml", &text, &BTreeMap::new())
}

#[test]
fn eight_hands_feel_eight_bodies() -> Result<(), Box<dyn Error>> {
    let of = |count| -> Result<_, Box<dyn Error>> {
        let options = RunOptions {
            duration: Some(0.4),
            ..RunOptions::new(Clock::Virtual)
        };
        Ok(run(
            &World::new(&blocks(count)?).unwrap(),
            &options,
            &mut |_| {},
        )?)
    };
    let (all, alone) = (of(8)?, of(1)?);
    let peaks: Vec<f64> = all.devices.iter().map(|device| device.peak_force).collect();
    assert!(peaks.is_sorted() && peaks.len() == 8, "{peaks:?}");
    // The deepest press is eight times that of the first hand. The blocks stiffen a little under compression.
    let ratio = peaks[7] / peaks[0];
    assert!((6.0..10.0).contains(&ratio), "{peaks:?}");
    // A body does not depend on the bodies beside it. The hands differ in their noise, which the number of the device
    // seeds; the first hand has the same number in both runs.
    assert_eq!(peaks[0], alone.devices[0].peak_force);
    let text = all.to_string();
    for number in 0..8 {
        assert!(
            text.contains(&format!("\n  model age  block {number}: ")),
            "{text}"
        );
    }
    assert!(alone.to_string().contains("\n  model age  median "));
    Ok(())
}

#[test]
fn a_ninth_body_is_refused() {
    let error = blocks(9).map(|_| ()).unwrap_err().to_string();
    assert!(
        error.contains("body: found 9 entries, allowed: up to 8 entries"),
        "{error}"
    );
}
