//! Stresses at the vertices of a frame, computed in the viewer from the scene.
//!
//! A run sends positions only. The viewer builds the bodies of the scene, sets their positions to those of the frame, and
//! computes the von Mises stress of each element with the code that `run --vtu` uses. The stress at a vertex is the mean
//! over the elements around the vertex. The positions are rounded to `f32`, so a stress is known to about a millionth of
//! Young's modulus.

use host::live::{Frame, Hello, Vertices};
use host::scene::{Scene, SceneError};
use host::solve::grid::von_mises;
use host::world::{Built, World};
use physics::Vec3;
use physics::mesh::Mesh;
use std::collections::BTreeMap;

/// Why a body has no stresses.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StressError {
    /// The bodies cannot be built from the scene of the stream.
    #[error("stresses cannot be computed, because the scene cannot be built: {0}")]
    Scene(String),
    /// The scene has no such body.
    #[error("a frame has a body of index {body}, and the scene has {bodies} bodies")]
    Body {
        /// Index of the body.
        body: usize,
        /// Number of bodies of the scene.
        bodies: usize,
    },
    /// The topology of the body has changed since the run began, so its elements are not those of the scene.
    // The text is the same for every number of vertices, so that a sheet that tears on is reported once.
    #[error(
        "body {body} has torn or was changed: it has more vertices or fewer than in the scene, and so no stresses"
    )]
    Topology {
        /// Index of the body.
        body: usize,
        /// Number of vertices in the frame.
        found: usize,
        /// Number of vertices in the scene.
        expected: usize,
    },
    /// A position is not finite.
    #[error("the positions of body {body} cannot be used: {reason}")]
    Positions {
        /// Index of the body.
        body: usize,
        /// The reason in words.
        reason: String,
    },
}

/// Computes the stresses of the frames of one stream. The bodies are built when the first frame needs them.
#[derive(Debug)]
pub struct Stresses {
    scene: String,
    text: String,
    files: BTreeMap<String, Vec<u8>>,
    bodies: Option<Result<Vec<Stressed>, StressError>>,
}

/// A body whose stresses are computed.
#[derive(Debug)]
struct Stressed {
    built: Built,
    positions: Vec<Vec3>,
    /// By vertex: one over the number of elements around the vertex; zero for a vertex without an element.
    shares: Vec<f64>,
}

impl Stresses {
    /// The stresses of a stream that begins with `hello`. Nothing is built yet.
    pub fn new(hello: &Hello) -> Self {
        Self {
            scene: hello.scene.clone(),
            text: hello.scene_text.clone(),
            files: hello.files.clone(),
            bodies: None,
        }
    }

    /// Adds stresses to the vertices of a frame. Vertices without stresses stay as they are.
    ///
    /// # Errors
    /// The first reason why a body has no stresses. The other bodies have theirs.
    pub fn add(&mut self, frame: &mut Frame) -> Result<(), StressError> {
        let mut outcome = Ok(());
        let bodies = frame.bodies.iter_mut().enumerate();
        for (index, vertices) in
            bodies.filter_map(|(index, body)| Some((index, body.vertices.as_mut()?)))
        {
            match self.at_vertices(index, vertices) {
                Ok(stress) => {
                    vertices.stress = stress;
                    vertices.stressed = true;
                }
                Err(error) => outcome = outcome.and(Err(error)),
            }
        }
        outcome
    }

    /// The von Mises stress (Pa) at each of the `vertices` of the body of this index.
    ///
    /// # Errors
    /// [`StressError`] if the body has no stresses.
    pub fn at_vertices(
        &mut self,
        body: usize,
        vertices: &Vertices,
    ) -> Result<Vec<f32>, StressError> {
        let (scene, text, files) = (&self.scene, &self.text, &self.files);
        let bodies = self
            .bodies
            .get_or_insert_with(|| build(scene, text, files))
            .as_mut()
            .map_err(|error| error.clone())?;
        let count = bodies.len();
        let missing = StressError::Body {
            body,
            bodies: count,
        };
        bodies
            .get_mut(body)
            .ok_or(missing)?
            .at_vertices(body, &vertices.positions)
    }
}

fn build(
    name: &str,
    text: &str,
    files: &BTreeMap<String, Vec<u8>>,
) -> Result<Vec<Stressed>, StressError> {
    let refused = |error: SceneError| StressError::Scene(error.to_string());
    let loaded = Scene::load_texts(name, text, files).map_err(refused)?;
    let world = World::new(&loaded).map_err(refused)?;
    Ok(world.bodies.into_iter().map(Stressed::new).collect())
}

impl Stressed {
    fn new(built: Built) -> Self {
        let mut shares = vec![0.0; built.body.vertex_count()];
        for_each_corner(&built.mesh, |_, vertex| {
            if let Some(share) = shares.get_mut(vertex) {
                *share += 1.0;
            }
        });
        for share in &mut shares {
            *share = if *share > 0.0 { 1.0 / *share } else { 0.0 };
        }
        Self {
            built,
            positions: Vec::new(),
            shares,
        }
    }

    fn at_vertices(&mut self, body: usize, positions: &[f32]) -> Result<Vec<f32>, StressError> {
        let expected = self.built.body.vertex_count();
        if positions.len() != 3 * expected {
            return Err(StressError::Topology {
                body,
                found: positions.len() / 3,
                expected,
            });
        }
        let (points, _) = positions.as_chunks();
        self.positions.clear();
        self.positions.extend(
            points
                .iter()
                .map(|p: &[f32; 3]| Vec3::from(p.map(f64::from))),
        );
        let set = self.built.body.set_positions(&self.positions);
        set.map_err(|error| StressError::Positions {
            body,
            reason: error.to_string(),
        })?;
        let stresses = von_mises(&self.built);
        let mut sums = vec![0.0; expected];
        for_each_corner(&self.built.mesh, |element, vertex| {
            if let (Some(sum), Some(stress)) = (sums.get_mut(vertex), stresses.get(element)) {
                *sum += stress;
            }
        });
        let shared = sums.iter().zip(&self.shares);
        Ok(shared.map(|(sum, share)| (sum * share) as f32).collect())
    }
}

/// Calls `take` with the index of each element and the index of each of its vertices.
fn for_each_corner(mesh: &Mesh, mut take: impl FnMut(usize, usize)) {
    let mut element = |index: usize, vertices: &[u32]| {
        for vertex in vertices {
            take(index, *vertex as usize);
        }
    };
    match mesh {
        Mesh::Thread(mesh) => (mesh.lines.iter().enumerate()).for_each(|(i, v)| element(i, v)),
        Mesh::Sheet(mesh) => (mesh.triangles.iter().enumerate()).for_each(|(i, v)| element(i, v)),
        Mesh::Solid(mesh) => (mesh.cells.vertices().enumerate()).for_each(|(i, v)| element(i, v)),
    }
}

#[cfg(test)]
mod tests;
