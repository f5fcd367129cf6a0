//! The first message of a stream: the facts that a viewer needs, from the scene and its bodies.

use super::frame::{BodyInfo, DeviceInfo, HandleInfo, Hello, PROTOCOL, Source, ToolInfo};
use super::{clusters, obstacle};
use crate::scene::spec::ModelName;
use crate::world::{Kind, World, grasps, scheme};
use std::collections::BTreeMap;

impl Hello {
    /// The facts of a world. `facts` are those of the log's header ([`crate::run::facts`]); the clock
    /// is one of them. The duration is the scene's.
    pub fn new(source: Source, world: &World<'_>, facts: BTreeMap<String, String>) -> Self {
        let loaded = world.loaded;
        let scene = &loaded.scene;
        let age_limit = scene.realtime.age_limit();
        let devices = scene.devices.iter().zip(&loaded.models);
        let devices = devices.map(|(spec, model)| DeviceInfo {
            name: spec.name.clone(),
            model: match &spec.model {
                ModelName::BuiltIn(name) => (*name).to_owned(),
                ModelName::File(file) => file.clone(),
            },
            max_force: spec
                .max_force
                .map_or(model.max_force, |most| most.min(model.max_force)),
            age_limit,
        });
        let bodies = scene.bodies.iter().zip(&world.bodies);
        let bodies = bodies.zip(clusters::clusters(world));
        let bodies = bodies.map(|((spec, built), clusters)| {
            // The handles of the devices come first, in the order of the grasps.
            let grasps = grasps(scene, spec);
            let handles = grasps.iter().zip(&built.handles);
            BodyInfo {
                name: spec.name.clone(),
                kind: kind_name(built.kind).to_owned(),
                vertices: built.body.vertex_count() as u32,
                elements: built.body.element_count() as u32,
                handles: handles
                    .map(|(grasp, handle)| HandleInfo {
                        device: grasp.device as u32,
                        origin: handle.origin.into(),
                    })
                    .collect(),
                clusters,
            }
        });
        Self {
            protocol: PROTOCOL.to_owned(),
            source,
            file: String::new(),
            run: 0,
            scene: scene.name.clone(),
            clock: facts.get("clock").cloned().unwrap_or_default(),
            scheme: scheme(scene).name().to_owned(),
            tick_rate: scene.realtime.rate,
            step_rate: scene.host.step_rate,
            publish_rate: scene.host.publish_rate,
            duration: scene.duration,
            devices: devices.collect(),
            bodies: bodies.collect(),
            obstacles: obstacle::infos(world),
            touches: scene.has_contact(),
            tools: (scene.numbered_tools())
                .map(|(_, device, obstacle)| ToolInfo {
                    device: device as u32,
                    obstacle: obstacle as u32,
                })
                .collect(),
            facts,
            scene_text: loaded.source.text.clone(),
            files: loaded.files.clone(),
        }
    }
}

impl Hello {
    /// The number of the obstacle that is the tool of a device.
    pub fn obstacle_of(&self, device: u32) -> Option<usize> {
        let mut tools = self.tools.iter();
        let tool = tools.find(|tool| tool.device == device)?;
        Some(tool.obstacle as usize)
    }
}

/// The name of a kind of bodies in messages.
fn kind_name(kind: Kind) -> &'static str {
    match kind {
        Kind::Sheet => "sheet",
        Kind::Woven => "woven",
        Kind::Solid => "solid",
        Kind::Thread => "thread",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live::Message;
    use crate::scene::Scene;

    #[test]
    fn a_viewer_is_told_the_obstacles_and_other_scenes_have_no_field_of_them()
    -> Result<(), Box<dyn std::error::Error>> {
        let told = |file: &str| {
            let path = format!("{}/{file}", env!("CARGO_MANIFEST_DIR"));
            let loaded = Scene::load(path.as_ref())?;
            let hello = Hello::new(Source::Run, &World::new(&loaded)?, BTreeMap::new());
            let text = serde_json::to_string(&hello)?;
            let clusters = hello.bodies[0].clusters.iter().copied();
            let sizes = clusters.fold(BTreeMap::new(), |mut sizes, cluster| {
                *sizes.entry(cluster).or_insert(0) += 1;
                sizes
            });
            Ok::<_, Box<dyn std::error::Error>>((text, hello.obstacles, sizes))
        };
        let (text, obstacles, sizes) = told("scenes/sheet_on_sphere.toml")?;
        assert!(text.contains("\"obstacles\"") && text.contains("\"touches\":true"));
        let [ball] = &obstacles[..] else {
            return Err("one obstacle".into());
        };
        assert_eq!((&*ball.name, &*ball.shape), ("ball", "sphere"));
        let radius = |p: &[f32; 3]| p.iter().map(|x| x * x).sum::<f32>().sqrt();
        let (points, _) = ball.positions.as_chunks();
        assert!(points.iter().all(|p| (radius(p) - 0.05).abs() < 1e-7));
        // 1,152 triangles are halved five times until no part has more than 64; a part of 36 triangles has some 28 vertices.
        assert!(
            sizes.len() == 32 && sizes.values().all(|size| *size < 40),
            "{sizes:?}"
        );
        let (text, obstacles, sizes) = told("scenes/press.toml")?;
        assert!(obstacles.is_empty() && !text.contains("obstacles\":"));
        assert!(!text.contains("touches") && sizes.is_empty());
        Ok(())
    }

    #[test]
    fn a_viewer_can_build_the_bodies_from_what_it_is_told() -> Result<(), Box<dyn std::error::Error>>
    {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cloth.toml");
        let loaded = Scene::load(path.as_ref())?;
        let world = World::new(&loaded)?;
        let facts = [("clock", "real"), ("seed", "7")];
        let facts = facts.map(|(name, fact)| (name.to_owned(), fact.to_owned()));
        let hello = Hello::new(Source::Run, &world, facts.into());
        let names = hello.devices.iter().map(|device| device.name.as_str());
        assert_eq!(names.collect::<Vec<_>>(), ["left", "right"]);
        // The right device is an omega3, which the scene limits.
        assert_eq!(
            (&*hello.devices[1].model, hello.devices[1].max_force),
            ("omega3", 8.0)
        );
        assert_eq!(
            (&*hello.clock, &*hello.scheme, hello.tick_rate),
            ("real", "capped", 1000.0)
        );
        assert_eq!(
            (&*hello.bodies[0].kind, &*hello.facts["seed"]),
            ("sheet", "7")
        );
        // The handles are the edges of the cloth, which is 0.2 m long.
        let handles = &hello.bodies[0].handles;
        let held: Vec<_> = handles
            .iter()
            .map(|handle| (handle.device, handle.origin[0]))
            .collect();
        assert!(
            held.len() == 2 && held[0].0 == 0 && held[1].0 == 1,
            "{held:?}"
        );
        assert!(
            (held[0].1 + 0.1).abs() < 1e-9 && (held[1].1 - 0.1).abs() < 1e-9,
            "{held:?}"
        );

        let mut bytes = Vec::new();
        Message::Hello(Box::new(hello.clone())).encode(&mut bytes);
        let Message::Hello(told) = Message::decode(&bytes)? else {
            return Err("another message".into());
        };
        assert_eq!(*told, hello);
        let theirs = Scene::load_texts(&told.scene, &told.scene_text, &told.files)?;
        let theirs = World::new(&theirs)?.bodies;
        assert_eq!(
            told.bodies[0].vertices as usize,
            theirs[0].body.vertex_count()
        );
        assert!(
            theirs[0]
                .body
                .positions()
                .eq(world.bodies[0].body.positions())
        );
        Ok(())
    }
}
