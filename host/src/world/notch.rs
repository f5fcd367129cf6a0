//! Cuts the notches of a scene into the mesh of a sheet, before anything is built from the mesh. The body, the logs and
//! the viewers then have the notched mesh.
//!
//! The two faces of a notch have vertices at equal places. A vertex that a notch adds joins the groups of the vertices
//! from which it comes, and a triangle that a notch adds joins the groups of its parent.

use crate::scene::plausible::Warning;
use crate::scene::spec::Tear;
use crate::scene::{LoadedScene, SceneError};
use physics::Vec3;
use physics::mesh::{Bounds, Field, Group, TriMesh};
use physics::topology::{self, AdvanceOptions, NONE, Origin, Reserve, Shape, Surface};

/// Distance from the plane of a sheet, as a fraction of the sheet's diagonal, up to which a point lies in the plane.
/// Mesh files give coordinates to seven digits at least.
const FLAT: f64 = 1e-6;

/// How far the end of a notch may be outside a triangle, as a fraction of the triangle's height. The border of a mesh file
/// is not exactly where a scene says.
const OUTSIDE: f64 = 0.1;

/// How far a notch may end from the place that the scene gives, as a fraction of the notch's length, before it is told. The
/// force that tears a sheet changes by about as much.
const TOLD: f64 = 0.02;

/// The notches that can be cut.
const INSIDE: &str = "a notch from the border into the sheet, or with both ends inside";

/// A mesh with its notches.
#[derive(Clone, Debug, Default)]
pub(super) struct Cuts {
    /// The vertices at which notches end inside the sheet, ascending.
    pub(super) tips: Vec<u32>,
    /// The vertices along notches, tips included, each with the number of its notch in the scene; ascending.
    pub(super) along: Vec<(u32, usize)>,
    /// For each notch of the scene with an end at another position than in the scene: the end that is farthest off.
    moved: Vec<Moved>,
}

/// An end of a notch that the mesh has moved.
#[derive(Clone, Copy, Debug)]
struct Moved {
    /// The number of the notch in the scene.
    number: usize,
    /// Where the scene says that the notch ends (m), and where it ends.
    ends: [Vec3; 2],
}

impl Moved {
    fn distance(&self) -> f64 {
        (self.ends[1] - self.ends[0]).norm()
    }
}

impl Cuts {
    /// The number of ends inside the sheet of the notch of this number.
    pub(super) fn tips_of(&self, number: usize) -> usize {
        let of = |tip: &&u32| self.along.binary_search(&(**tip, number)).is_ok();
        self.tips.iter().filter(of).count()
    }

    /// Notes that a cut of the notch of this number ends at its `tips`. The scene gives the length `length` (m) and the ends
    /// `wanted`.
    fn note(&mut self, number: usize, length: f64, wanted: [Vec3; 2], tips: [Option<Vec3>; 2]) {
        for (wanted, tip) in wanted.into_iter().zip(tips) {
            let Some(tip) = tip else { continue };
            let ends = [wanted, tip];
            let moved = Moved { number, ends };
            if moved.distance() <= TOLD * length {
                continue;
            }
            match self.moved.last_mut().filter(|last| last.number == number) {
                Some(last) if last.distance() >= moved.distance() => {}
                Some(last) => *last = moved,
                None => self.moved.push(moved),
            }
        }
    }

    /// Adds the notch of this number, whose vertices are those from `before`.
    fn add(&mut self, number: usize, surface: &Surface, before: u32, tips: [u32; 2]) {
        for vertex in before..surface.vertex_count() as u32 {
            self.along.push((vertex, number));
            if let Origin::Twin { of } = surface.origin(vertex) {
                self.along.push((of, number));
                // An earlier notch ended there: the new notch continues from its tip.
                self.tips.retain(|&tip| tip != of);
            }
        }
        for tip in tips.into_iter().filter(|&tip| tip != NONE) {
            self.tips.push(tip);
            self.along.push((tip, number));
        }
    }
}

/// The plane of a flat sheet: two axes in it, its normal, and its distance from the origin.
#[derive(Clone, Copy, Debug)]
struct Plane {
    axes: [Vec3; 2],
    normal: Vec3,
    height: f64,
}

impl Plane {
    /// The plane through the vertices of a mesh, with the normal of its triangles; `None` for a mesh that is not flat.
    fn of(mesh: &TriMesh) -> Option<Self> {
        let corners = (0..mesh.triangles.len() as u32).filter_map(|t| mesh.corners(t));
        let areas: Vec3 = corners.map(|[a, b, c]| (b - a).cross(&(c - a))).sum();
        let normal = areas.try_normalize(0.0)?;
        // The axis of the mesh that is farthest from the normal gives the first axis: x for a sheet in the xy-plane.
        let along = [Vec3::x(), Vec3::y()];
        let along = if normal.x.abs() <= normal.y.abs().max(0.5) {
            along[0]
        } else {
            along[1]
        };
        let first = (along - normal * normal.dot(&along)).normalize();
        let height = normal.dot(mesh.positions.first()?);
        let plane = Self {
            axes: [first, normal.cross(&first)],
            normal,
            height,
        };
        let near = tolerance(mesh);
        let flat = mesh.positions.iter().all(|p| plane.distance(p) <= near);
        flat.then_some(plane)
    }

    fn distance(&self, point: &Vec3) -> f64 {
        (self.normal.dot(point) - self.height).abs()
    }

    fn to_plane(self, point: &Vec3) -> [f64; 2] {
        self.axes.map(|axis| axis.dot(point))
    }

    fn to_space(self, [x, y]: [f64; 2]) -> Vec3 {
        self.axes[0] * x + self.axes[1] * y + self.normal * self.height
    }
}

/// The distance up to which a point counts as in the plane of the mesh (m).
fn tolerance(mesh: &TriMesh) -> f64 {
    mesh.bounds()
        .map_or(0.0, |bounds: Bounds| FLAT * bounds.size().norm())
}

/// Cuts the notches of the body number `index` into its mesh, which is in its own axes.
///
/// # Errors
/// [`SceneError`], naming the notch that cannot be cut, and why.
pub(super) fn cut(
    loaded: &LoadedScene,
    index: usize,
    tear: &Tear,
    mesh: &TriMesh,
) -> Result<(TriMesh, Cuts), SceneError> {
    let refuse = |field: &str, found: String, allowed: &str| {
        let field = format!("body[{index}].{field}");
        Err(loaded.source.error(&field, found, allowed))
    };
    if mesh.flat_pattern.is_some() {
        return refuse(
            "tear.notch",
            "a notch in a sheet with a flat pattern".into(),
            "no notch: cut the notch into the mesh and into its pattern",
        );
    }
    let Some(plane) = Plane::of(mesh) else {
        let found = "a notch in a sheet that is not flat".into();
        return refuse("tear.notch", found, "a notch in a flat sheet");
    };
    let flat: Vec<[f64; 2]> = mesh.positions.iter().map(|p| plane.to_plane(p)).collect();
    let shape = |corners: &[u32; 3]| corners.map(|vertex| flat[vertex as usize]);
    let shapes: Vec<Shape> = mesh.triangles.iter().map(shape).collect();
    let count = mesh.positions.len();
    // A notch adds three vertices an edge at most. No cut leads through more than every edge.
    let reserve = Reserve {
        vertices: 3 * mesh.triangles.len(),
        triangles: 3 * mesh.triangles.len(),
    };
    let mut surface = match Surface::new(count, &mesh.triangles, &shapes, reserve) {
        Ok(surface) => surface,
        Err(fault) => {
            let allowed = "triangles that form one surface, so that it can tear";
            return refuse("mesh", fault.to_string(), allowed);
        }
    };
    // Borders keep their shape, and so do the parts that the scene selects by name.
    let mut fixed: Vec<bool> = (0..count as u32).map(|v| surface.on_border(v)).collect();
    for &vertex in mesh.vertex_groups.iter().flat_map(|group| &group.members) {
        fixed[vertex as usize] = true;
    }
    let may_move = |vertex: u32| fixed.get(vertex as usize) == Some(&false);
    let options = AdvanceOptions {
        snapping: tear.snapping,
        // A notch is as straight as the scene says.
        opening: 0.0,
    };
    let mut cuts = Cuts::default();
    for (number, notch) in tear.notches.iter().enumerate() {
        for (copy, ends) in notch.cuts().enumerate() {
            let ends = ends.map(Vec3::from);
            let refuse = |found: &str, allowed: &str| {
                let field = format!("tear.notch[{number}]");
                let which = match notch.count {
                    1 => "a notch".to_owned(),
                    count => format!("cut {} of {count}", copy + 1),
                };
                let [from, to] = ends.map(|p| format!("[{}, {}, {}]", p.x, p.y, p.z));
                refuse(
                    &field,
                    format!("{which} from {from} to {to}, {found}"),
                    allowed,
                )
            };
            if let Some(far) = ends
                .iter()
                .map(|p| plane.distance(p))
                .find(|&d| d > tolerance(mesh))
            {
                let found = format!("{far:.2e} m off the plane of the sheet");
                return refuse(&found, "a notch in the plane of the sheet");
            }
            let in_plane = ends.map(|p| plane.to_plane(&p));
            let inside = |end| shapes.iter().any(|shape| contains(shape, end));
            if !in_plane.iter().all(|&end| inside(end)) {
                return refuse("out of the sheet", INSIDE);
            }
            let before = surface.vertex_count() as u32;
            let [from, to] = in_plane;
            let line = topology::Notch { from, to };
            let made = surface.notch(&line, options, may_move, |_, _| {});
            match made {
                Ok([NONE, NONE]) => {
                    let allowed = "a notch that ends inside the sheet";
                    return refuse("from border to border", allowed);
                }
                Ok(tips) => {
                    cuts.add(number, &surface, before, tips);
                    let [from, to] = ends;
                    let at = |tip: u32| {
                        let place = (tip != NONE).then(|| surface.place(tip)).flatten();
                        place.map(|place| plane.to_space(place))
                    };
                    cuts.note(number, (to - from).norm(), [to, from], tips.map(at));
                }
                Err(fault) => return refuse(&fault.to_string(), INSIDE),
            }
        }
    }
    cuts.tips.sort_unstable();
    cuts.tips.dedup();
    cuts.along.sort_unstable();
    cuts.along.dedup();
    Ok((notched(mesh, &surface, plane), cuts))
}

/// Warnings about notches of the body number `index` whose ends are not those of the scene.
pub(super) fn moved(loaded: &LoadedScene, index: usize, cuts: &Cuts) -> Vec<Warning> {
    let warning = |moved: &Moved| {
        let words = |p: Vec3| format!("[{:.4}, {:.4}, {:.4}]", p.x, p.y, p.z);
        let [wanted, tip] = moved.ends.map(words);
        let number = moved.number;
        Warning {
            location: loaded
                .source
                .location(&format!("body[{index}].tear.notch[{number}]")),
            found: format!(
                "a notch that ends at {tip}, {:.4} m from {wanted}: no vertex of the mesh can move there",
                moved.distance()
            ),
            usual: format!("an end within {} % of the notch's length", 100.0 * TOLD),
            advice: "make the mesh finer, or let the notch end at a vertex of the mesh".to_owned(),
        }
    };
    cuts.moved.iter().map(warning).collect()
}

/// Whether a point is in a triangle, or beside it.
fn contains(&[a, b, c]: &Shape, p: [f64; 2]) -> bool {
    let area = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    let whole = area(a, b, c);
    let parts = [area(p, b, c), area(a, p, c), area(a, b, p)];
    parts.iter().all(|part| part / whole >= -OUTSIDE)
}

/// The mesh of a surface that was made of `mesh` and cut.
fn notched(mesh: &TriMesh, surface: &Surface, plane: Plane) -> TriMesh {
    let count = surface.vertex_count();
    let mut positions = mesh.positions.clone();
    positions.resize(count, Vec3::zeros());
    // A vertex that no notch moved keeps its coordinates to the last bit.
    for (corners, shape) in surface.triangles().iter().zip(surface.shapes()) {
        for (&vertex, &place) in corners.iter().zip(shape) {
            let old = mesh.positions.get(vertex as usize);
            if old.is_none_or(|old| plane.to_plane(old) != place) {
                positions[vertex as usize] = plane.to_space(place);
            }
        }
    }
    for vertex in mesh.positions.len()..count {
        if let Origin::Twin { of } = surface.origin(vertex as u32) {
            positions[vertex] = positions[of as usize];
        }
    }
    let joins = |members: &[u32]| {
        let mut inside = vec![false; count];
        for &member in members {
            inside[member as usize] = true;
        }
        for vertex in mesh.positions.len()..count {
            inside[vertex] = match surface.origin(vertex as u32) {
                Origin::Original => false,
                Origin::Twin { of } => inside[of as usize],
                Origin::Between { ends, .. } => ends.iter().all(|&end| inside[end as usize]),
            };
        }
        (0..count as u32).filter(|&v| inside[v as usize]).collect()
    };
    let parents = surface.parents();
    let parts = |members: &[u32]| {
        let part = |&t: &u32| members.binary_search(&parents[t as usize]).is_ok();
        (0..parents.len() as u32).filter(part).collect()
    };
    let renewed = |groups: &[Group], members: &dyn Fn(&[u32]) -> Vec<u32>| {
        let each = groups.iter().map(|group| Group {
            name: group.name.clone(),
            members: members(&group.members),
        });
        each.collect()
    };
    let fields = mesh.triangle_fields.iter().map(|field| Field {
        name: field.name.clone(),
        values: parents.iter().map(|&t| field.values[t as usize]).collect(),
    });
    TriMesh {
        positions,
        triangles: surface.triangles().to_vec(),
        flat_pattern: None,
        vertex_groups: renewed(&mesh.vertex_groups, &joins),
        triangle_groups: renewed(&mesh.triangle_groups, &parts),
        triangle_fields: fields.collect(),
    }
}
