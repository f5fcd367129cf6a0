//! Plates with a round hole in the middle: the whole plate, and the quarter of it that its two symmetries permit.
//!
//! Rays run from the hole to the border. The lengths of the cells along a ray grow by a constant ratio, so that
//! cells are smallest at the hole, where the gradient of the stress is largest. The square plate whose half side
//! is 5 radii, with a ratio of 1.15, is the usual model of Kirsch's problem.

use super::generate::MAX_VERTICES;
use super::{Group, MeshError, TriMesh};
use crate::Vec3;
use core::f64::consts::FRAC_PI_2;
use thiserror::Error;

/// At which angles the rays leave the hole.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rays {
    /// A ray meets each corner of the plate. On either side of that ray the angles are equally spaced.
    #[default]
    ThroughCorners,
    /// All angles are equally spaced. A corner that no ray meets is cut off. On a square plate a ray meets the
    /// corner if the number of cells along a quarter is even.
    Equal,
}

/// A rectangular plate with a round hole.
///
/// ```
/// use physics::mesh::generate_plate::{
///     HoledPlate, PlateError, Rays, plate_with_hole, quarter_plate_with_hole,
/// };
///
/// let plate = HoledPlate {
///     width: 0.1,
///     height: 0.1,
///     radius: 0.01,
///     around: 8,
///     outward: 10,
///     growth: 1.15,
///     rays: Rays::ThroughCorners,
/// };
/// assert_eq!(plate_with_hole(&plate)?.triangles.len(), 8 * 8 * 10);
/// let quarter = quarter_plate_with_hole(&plate)?;
/// assert_eq!(quarter.triangles.len(), 2 * 8 * 10);
/// assert_eq!(quarter.group("symmetry_x").map(|group| group.members.len()), Some(11));
/// # Ok::<(), PlateError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HoledPlate {
    /// Extent of the whole plate along x (m).
    pub width: f64,
    /// Extent of the whole plate along y (m).
    pub height: f64,
    /// Radius of the hole (m), less than half of the smaller extent.
    pub radius: f64,
    /// Cells along a quarter of the hole.
    pub around: u32,
    /// Cells from the hole to the border.
    pub outward: u32,
    /// Ratio of the length of a cell to that of its neighbour nearer the hole. 1 is uniform.
    pub growth: f64,
    /// At which angles the rays leave the hole.
    pub rays: Rays,
}

/// Why a plate cannot be made.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum PlateError {
    /// A size is zero, negative or not a number.
    #[error("plate: its {dimension} is {found:?} m, and must be positive and finite")]
    Size {
        /// "width", "height" or "radius".
        dimension: &'static str,
        /// The size (m).
        found: f64,
    },
    /// The hole reaches the border.
    #[error(
        "plate: its hole has a radius of {found:?} m, and the radius must be below {limit:?} m"
    )]
    Hole {
        /// The radius (m).
        found: f64,
        /// Half of the smaller side (m).
        limit: f64,
    },
    /// There are too few cells around the hole or from the hole to the border.
    #[error("plate: it has {found} cells {along}; at least {least} are needed")]
    Cells {
        /// "around a quarter of its hole" or "outward".
        along: &'static str,
        /// The number found.
        found: u32,
        /// The number that is needed.
        least: u32,
    },
    /// The growth is zero, negative or not a number.
    #[error(
        "plate: its cells grow by the factor {found:?}, which must be positive and finite; 1 makes uniform cells"
    )]
    Growth {
        /// The growth.
        found: f64,
    },
    /// There would be too many vertices.
    #[error(
        "plate: {around} x {outward} cells a quarter make {vertices} vertices, at most {MAX_VERTICES} are \
         allowed"
    )]
    TooMany {
        /// Cells along a quarter of the hole.
        around: u32,
        /// Cells from the hole to the border.
        outward: u32,
        /// The vertices that they would make.
        vertices: u64,
    },
    /// The result is no valid mesh: cells are far too narrow or too small.
    #[error("plate: {0}")]
    Mesh(#[from] MeshError),
}

/// The whole plate in the xy-plane, centred at the origin, of `8 around outward` triangles. The mesh is exactly
/// symmetric about both axes. Its triangles are wound counter-clockwise as seen from +z.
///
/// The vertex groups are "hole", "left" and "right" (x = ∓width/2), "bottom" and "top" (y = ∓height/2). A corner
/// is in two groups.
///
/// # Errors
/// [`PlateError`].
pub fn plate_with_hole(plate: &HoledPlate) -> Result<TriMesh, PlateError> {
    build(plate, 4)
}

/// The quarter of the plate with x >= 0 and y >= 0, of `2 around outward` triangles.
///
/// The vertex groups are "hole", "right" (x = width/2), "top" (y = height/2), and the planes of symmetry
/// "symmetry_x" (x = 0) and "symmetry_y" (y = 0).
///
/// # Errors
/// [`PlateError`].
pub fn quarter_plate_with_hole(plate: &HoledPlate) -> Result<TriMesh, PlateError> {
    build(plate, 1)
}

fn check(plate: &HoledPlate, quarters: u32) -> Result<(), PlateError> {
    let sizes = [
        ("width", plate.width),
        ("height", plate.height),
        ("radius", plate.radius),
    ];
    for (dimension, found) in sizes {
        if !(found > 0.0 && found.is_finite()) {
            return Err(PlateError::Size { dimension, found });
        }
    }
    let limit = 0.5 * plate.width.min(plate.height);
    if plate.radius >= limit {
        let found = plate.radius;
        return Err(PlateError::Hole { found, limit });
    }
    // A corner needs a cell on either side of it, and so does the edge that cuts it off.
    for (along, found, least) in [
        ("around a quarter of its hole", plate.around, 2),
        ("outward", plate.outward, 1),
    ] {
        if found < least {
            return Err(PlateError::Cells {
                along,
                found,
                least,
            });
        }
    }
    if !(plate.growth > 0.0 && plate.growth.is_finite()) {
        return Err(PlateError::Growth {
            found: plate.growth,
        });
    }
    let rays = (u64::from(plate.around) * u64::from(quarters)).saturating_add(1);
    let vertices = rays.saturating_mul(u64::from(plate.outward) + 1);
    if vertices > MAX_VERTICES {
        return Err(PlateError::TooMany {
            around: plate.around,
            outward: plate.outward,
            vertices,
        });
    }
    Ok(())
}

fn build(plate: &HoledPlate, quarters: u32) -> Result<TriMesh, PlateError> {
    check(plate, quarters)?;
    let (na, nr) = (plate.around, plate.outward);
    // The whole plate's last ray is its first.
    let columns = if quarters == 4 { 4 * na } else { na + 1 };
    let vertex = |i: u32, j: u32| (i % columns) * (nr + 1) + j;

    let first: Vec<[Vec3; 2]> = (0..=na).map(|i| ray(plate, i)).collect();
    let positions = (0..columns)
        .flat_map(|i| (0..=nr).map(move |j| (i, j)))
        .map(|(i, j)| {
            let (of_first, sign) = mirrored(i, na);
            let [from, to] = first[of_first as usize];
            // Exact at both ends.
            let fraction = fraction(plate, j);
            (from * (1.0 - fraction) + to * fraction).component_mul(&sign)
        })
        .collect();
    let triangles = (0..quarters * na)
        .flat_map(|i| (0..nr).map(move |j| (i, j)))
        .flat_map(|(i, j)| {
            let [a, b] = [vertex(i, j), vertex(i, j + 1)];
            let [d, c] = [vertex(i + 1, j), vertex(i + 1, j + 1)];
            // Every second quarter is mirrored: the order of its cells is reversed, and so are their diagonals.
            let (quarter, own) = (i / na, i % na);
            let forward = quarter.is_multiple_of(2);
            let of_first = if forward { own } else { na - 1 - own };
            if (of_first + j).is_multiple_of(2) == forward {
                [[a, b, c], [a, c, d]]
            } else {
                [[a, b, d], [b, c, d]]
            }
        })
        .collect();

    let mut mesh = TriMesh::new(positions, triangles)?;
    let on_hole = (0..columns).map(|i| vertex(i, 0)).collect();
    mesh.vertex_groups.push(Group {
        name: "hole".to_owned(),
        members: on_hole,
    });
    let half = [0.5 * plate.width, 0.5 * plate.height];
    let planes: &[(&str, usize, f64)] = if quarters == 4 {
        &[
            ("left", 0, -half[0]),
            ("right", 0, half[0]),
            ("bottom", 1, -half[1]),
            ("top", 1, half[1]),
        ]
    } else {
        &[
            ("right", 0, half[0]),
            ("top", 1, half[1]),
            ("symmetry_x", 0, 0.0),
            ("symmetry_y", 1, 0.0),
        ]
    };
    for &(name, axis, at) in planes {
        let members = (0_u32..)
            .zip(&mesh.positions)
            .filter(|(_, x)| x[axis] == at)
            .map(|(vertex, _)| vertex)
            .collect();
        mesh.vertex_groups.push(Group {
            name: name.to_owned(),
            members,
        });
    }
    Ok(mesh)
}

/// The ray of the first quarter of which ray `i` is the mirror image, and the signs of the coordinates of ray `i`.
fn mirrored(i: u32, na: u32) -> (u32, Vec3) {
    let own = i % na;
    match i / na {
        0 => (own, Vec3::new(1.0, 1.0, 1.0)),
        1 => (na - own, Vec3::new(-1.0, 1.0, 1.0)),
        2 => (own, Vec3::new(-1.0, -1.0, 1.0)),
        _ => (na - own, Vec3::new(1.0, -1.0, 1.0)),
    }
}

/// The ends (m) of ray `i` of the first quarter: on the hole, and on the border.
fn ray(plate: &HoledPlate, i: u32) -> [Vec3; 2] {
    let (half_x, half_y) = (0.5 * plate.width, 0.5 * plate.height);
    let na = plate.around;
    // Exact on the axes, so that the vertices on the planes of symmetry lie there exactly.
    if i == 0 {
        return [plate.radius, half_x].map(|x| Vec3::new(x, 0.0, 0.0));
    }
    if i == na {
        return [plate.radius, half_y].map(|y| Vec3::new(0.0, y, 0.0));
    }
    let to_corner = libm::atan2(half_y, half_x);
    let angle = match plate.rays {
        Rays::Equal => FRAC_PI_2 * f64::from(i) / f64::from(na),
        Rays::ThroughCorners => {
            let nearest = libm::round(f64::from(na) * to_corner / FRAC_PI_2);
            let below = nearest.clamp(1.0, f64::from(na - 1));
            let i = f64::from(i);
            if i <= below {
                to_corner * i / below
            } else {
                let rest = (i - below) / (f64::from(na) - below);
                to_corner + (FRAC_PI_2 - to_corner) * rest
            }
        }
    };
    let (c, s) = (libm::cos(angle), libm::sin(angle));
    let (x, y) = (half_y * c / s, half_x * s / c);
    let near = |a: f64, b: f64| (a - b).abs() < 1e-12 * b;
    let border = if near(x, half_x) || near(y, half_y) {
        Vec3::new(half_x, half_y, 0.0)
    } else if y < half_y {
        Vec3::new(half_x, y, 0.0)
    } else {
        Vec3::new(x, half_y, 0.0)
    };
    [Vec3::new(plate.radius * c, plate.radius * s, 0.0), border]
}

/// The fraction of a ray between the hole and vertex `j` of the ray, exactly 0 and 1 at the ends.
fn fraction(plate: &HoledPlate, j: u32) -> f64 {
    let (j, n) = (f64::from(j), f64::from(plate.outward));
    let log = libm::log(plate.growth);
    if log == 0.0 {
        j / n
    } else {
        libm::expm1(log * j) / libm::expm1(log * n)
    }
}
