//! The meshes of a motion, and the pairs that were found, as files of numbers for other programs.
//!
//! | file | type | content |
//! |---|---|---|
//! | `NAME.x` | f64 | positions (m): steps, vertices, coordinates |
//! | `NAME.triangles`, `NAME.edges` | u32 | vertices of each |
//! | `NAME.parts` | u32 | by part: first vertex, vertex after the last, 1 if it touches itself |
//! | `NAME.pairs` | u32 | by pair: step, 0 for a vertex and a triangle or 1 for two edges, the two numbers |
//! | `NAME.times` | f64 | processor times of the steps (s) |
//!
//! All numbers are little-endian.

use super::Scene;
use physics::Vec3;
use physics::contact::Pair;
use std::fs;
use std::path::{Path, PathBuf};

/// What is written of a scene.
#[derive(Default)]
pub(crate) struct Dump {
    x: Vec<u8>,
    pairs: Vec<u8>,
    times: Vec<u8>,
    steps: u32,
}

impl Dump {
    /// Adds a step: positions (m), pairs, and the time that the pairs took (s).
    pub(crate) fn step(&mut self, x: &[Vec3], pairs: &[Pair], time: f64) {
        let numbers = x.iter().flat_map(|x| x.iter().copied());
        self.x.extend(numbers.flat_map(f64::to_le_bytes));
        for pair in pairs {
            let row = match *pair {
                Pair::VertexTriangle(a, b) => [self.steps, 0, a, b],
                Pair::EdgeEdge(a, b) => [self.steps, 1, a, b],
            };
            self.pairs
                .extend(row.into_iter().flat_map(u32::to_le_bytes));
        }
        self.times.extend(time.to_le_bytes());
        self.steps += 1;
    }

    /// Writes the files of a scene to a folder.
    pub(crate) fn write(&self, scene: &Scene, folder: &Path) -> std::io::Result<()> {
        let surfaces = &scene.surfaces;
        let file = |kind: &str| -> PathBuf {
            folder.join(format!("{}.{kind}", scene.name.replace(' ', "_")))
        };
        let bytes = |numbers: &mut dyn Iterator<Item = u32>| -> Vec<u8> {
            numbers.flat_map(u32::to_le_bytes).collect()
        };
        let parts = surfaces.parts.iter().flat_map(|part| {
            [
                part.vertices.start,
                part.vertices.end,
                u32::from(part.touches_itself),
            ]
        });
        fs::create_dir_all(folder)?;
        fs::write(file("x"), &self.x)?;
        fs::write(file("pairs"), &self.pairs)?;
        fs::write(file("times"), &self.times)?;
        fs::write(file("parts"), bytes(&mut parts.into_iter()))?;
        let corners = surfaces.triangles.iter().flatten().copied();
        fs::write(file("triangles"), bytes(&mut corners.into_iter()))?;
        fs::write(
            file("edges"),
            bytes(&mut surfaces.edges.iter().flatten().copied()),
        )
    }
}
