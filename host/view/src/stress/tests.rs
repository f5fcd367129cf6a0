use super::*;
use host::live::{BodyState, Source};
use host::run::frames::FrameOptions;
use host::run::{Clock, RunOptions, run};
use host::scene::LoadedScene;
use host::world::World;
use std::path::Path;

type Outcome = Result<(), Box<dyn std::error::Error>>;

fn hello(loaded: &LoadedScene) -> Result<Hello, Box<dyn std::error::Error>> {
    let world = World::new(loaded)?;
    Ok(Hello::new(Source::Run, &world, BTreeMap::new()))
}

fn vertices(positions: &[Vec3]) -> Vertices {
    Vertices {
        count: positions.len() as u32,
        positions: positions
            .iter()
            .flat_map(|p| [p.x as f32, p.y as f32, p.z as f32])
            .collect(),
        ..Vertices::default()
    }
}

fn frame(vertices: Vertices) -> Frame {
    Frame {
        bodies: vec![BodyState {
            vertices: Some(vertices),
            ..BodyState::default()
        }],
        ..Frame::default()
    }
}

/// A frame has the stresses that `run --vtu` writes for the same positions, for a sheet and for a solid.
#[test]
fn the_stresses_are_those_of_the_frames_for_paraview() -> Outcome {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    for (name, body) in [("stretch.toml", "sheet"), ("press.toml", "block")] {
        let loaded = Scene::load(&scenes.join(name))?;
        let folder = tempfile::tempdir()?;
        let mut options = RunOptions::new(Clock::Virtual);
        options.duration = Some(1.01);
        options.frames = Some(FrameOptions {
            folder: folder.path().to_owned(),
            rate: 2.0,
        });
        run(&World::new(&loaded).unwrap(), &options, &mut |_| {})?;
        let file = folder.path().join(format!("{body}_0002.vtu"));
        let mesh = meshio::read_mesh("frame.vtu", &std::fs::read(file)?)?;
        let fields = mesh.fields().iter();
        let written = fields.into_iter().find(|field| field.name == "von_mises");
        let written = &written.ok_or("no stresses")?.values;

        let mut stresses = Stresses::new(&hello(&loaded)?);
        let mut frame = frame(vertices(mesh.positions()));
        stresses.add(&mut frame)?;
        let found = frame.bodies[0].vertices.as_ref().ok_or("no vertices")?;
        assert!(found.stressed);
        let mut around: Vec<Vec<f64>> = vec![Vec::new(); mesh.positions().len()];
        for_each_corner(&mesh, |element, vertex| {
            around[vertex].push(written[element]);
        });
        let most = written
            .iter()
            .fold(0.0, |most: f64, stress| most.max(*stress));
        assert!(most > 10.0, "{name}: nothing is deformed");
        // Elements are 5 mm long and longer, and f32 gives positions to 4e-9 m: strains to 1e-6. Young's moduli are
        // 1e6 Pa and less, of which the loads make 1e-6.
        for (stress, around) in found.stress.iter().zip(&around) {
            let mean = around.iter().sum::<f64>() / around.len() as f64;
            assert!(
                (f64::from(*stress) - mean).abs() < 2.0 + 1e-6 * mean,
                "{name}: {stress} instead of {mean}, of at most {most}"
            );
        }
    }
    Ok(())
}

#[test]
fn a_body_at_rest_has_no_stress_and_changed_topology_gives_a_reason() -> Outcome {
    let loaded = Scene::embedded_default()?;
    let rest = World::new(&loaded)?.bodies[0].mesh.positions().to_vec();
    let mut stresses = Stresses::new(&hello(&loaded)?);
    let at_rest = stresses.at_vertices(0, &vertices(&rest))?;
    assert_eq!(at_rest.len(), rest.len());
    assert!(at_rest.iter().all(|stress| *stress < 2.0));

    let mut cut = frame(vertices(&rest[1..]));
    let error = stresses.add(&mut cut).expect_err("a vertex is missing");
    let expected = StressError::Topology {
        body: 0,
        found: rest.len() - 1,
        expected: rest.len(),
    };
    assert_eq!(error, expected);
    assert!(!cut.bodies[0].vertices.as_ref().ok_or("vertices")?.stressed);

    let mut broken = vertices(&rest);
    broken.positions[5] = f32::NAN;
    let error = stresses.at_vertices(0, &broken);
    assert!(matches!(error, Err(StressError::Positions { body: 0, .. })));
    let error = stresses.at_vertices(3, &vertices(&rest));
    assert_eq!(error, Err(StressError::Body { body: 3, bodies: 1 }));
    Ok(())
}

#[test]
fn a_stream_without_a_scene_gives_a_reason() {
    let mut stresses = Stresses::new(&Hello::default());
    let error = stresses.at_vertices(0, &Vertices::default());
    assert!(matches!(error, Err(StressError::Scene(_))), "{error:?}");
}
