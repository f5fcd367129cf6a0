//! Solutions of scenes that are given as text, for the tests of the library and those of the program.

use host::scene::{LoadedScene, Scene};
use host::solve::{BodySolution, Frame, Solution, solve};
use host::world::World;
use std::collections::BTreeMap;
use std::convert::Infallible;

/// The scene of this text.
pub fn load(text: &str) -> LoadedScene {
    match Scene::load_texts("x.toml", text, &BTreeMap::new()) {
        Ok(loaded) => loaded,
        Err(error) => panic!("{error}"),
    }
}

/// The solution of the scene of this text.
pub fn solved(text: &str) -> Solution {
    let mut keep = |_: Frame<'_>| Ok::<(), Infallible>(());
    match solve(
        &World::new(&load(text)).unwrap(),
        false,
        &mut |_| {},
        &mut keep,
    ) {
        Ok(solution) => solution,
        Err(error) => panic!("{error}"),
    }
}

/// The solution of the one body of the scene of this text.
pub fn body(text: &str) -> BodySolution {
    let solution = solved(text);
    assert!(solution.failures.is_empty(), "{:?}", solution.failures);
    solution.bodies.into_iter().next().unwrap()
}

/// The force of the support, the handle or the joint of this name (N).
pub fn force(body: &BodySolution, name: &str) -> [f64; 3] {
    body.reactions
        .iter()
        .find(|reaction| reaction.name == name)
        .unwrap()
        .force
}

/// A cube of 10 cm, 20 kPa, compressed by 10 % between its plates.
pub fn cube(law: &str, axes: &str) -> String {
    format!(
        r#"
name = "cube"
gravity = [0, 0, 0]
[solve]
load_steps = 2
[[body]]
name = "cube"
mesh.box = {{ size = [0.1, 0.1, 0.1], cells = [6, 6, 6] }}
material = {{ law = "{law}", young = 20e3, poisson = 0.3, density = 1000 }}
[[body.support]]
name = "bottom"
group = "bottom"
axes = {axes}
[[body.support]]
name = "top"
group = "top"
axes = {axes}
displacement = [0, 0, -0.01]
[[body.support]]
name = "centre line x"
box = [[-0.001, -1, -1], [0.001, 1, 1]]
axes = ["x"]
[[body.support]]
name = "centre line y"
box = [[-1, -0.001, -1], [1, 0.001, 1]]
axes = ["y"]
"#
    )
}
