//! Edits of a surface that can be torn: they keep the area, stay manifold, and end where they must.

use std::f64::consts::{FRAC_PI_2, PI};

use alloc_count::calls::count;
use physics::topology::{
    AdvanceOptions, Edit, EditError, Growth, NONE, Notch, Origin, Pieces, Reserve, Shape, Surface,
    SurfaceError,
};

const CUTTING: AdvanceOptions = AdvanceOptions {
    snapping: 0.0,
    opening: 0.0,
};
const SNAPPING: AdvanceOptions = AdvanceOptions {
    snapping: 0.35,
    opening: 0.0,
};
const AMPLE: Reserve = Reserve {
    vertices: 4000,
    triangles: 4000,
};

struct Random(u64);

impl Random {
    /// A number from 0 to 1.
    fn unit(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn below(&mut self, count: usize) -> usize {
        ((self.unit() * count as f64) as usize).min(count - 1)
    }
}

/// The unit square in n x n cells with alternating diagonals. Its inner vertices move by up to `jitter` of a cell.
fn square(n: u32, jitter: f64, random: &mut Random) -> (Vec<[f64; 2]>, Vec<[u32; 3]>) {
    let mut places = Vec::new();
    for j in 0..=n {
        for i in 0..=n {
            let inner = i > 0 && i < n && j > 0 && j < n;
            let size = if inner { 2.0 * jitter } else { 0.0 };
            let mut place = |k: u32| (f64::from(k) + size * (random.unit() - 0.5)) / f64::from(n);
            places.push([place(i), place(j)]);
        }
    }
    let mut triangles = Vec::new();
    for j in 0..n {
        for i in 0..n {
            let a = j * (n + 1) + i;
            let (b, c, d) = (a + 1, a + n + 2, a + n + 1);
            if (i + j) % 2 == 0 {
                triangles.extend([[a, b, c], [a, c, d]]);
            } else {
                triangles.extend([[a, b, d], [b, c, d]]);
            }
        }
    }
    (places, triangles)
}

fn shapes(places: &[[f64; 2]], triangles: &[[u32; 3]]) -> Vec<Shape> {
    let shape = |corners: &[u32; 3]| corners.map(|vertex| places[vertex as usize]);
    triangles.iter().map(shape).collect()
}

fn flat(places: &[[f64; 2]], triangles: &[[u32; 3]], reserve: Reserve) -> Surface {
    Surface::new(places.len(), triangles, &shapes(places, triangles), reserve).unwrap()
}

fn regular(n: u32) -> Surface {
    let (places, triangles) = square(n, 0.0, &mut Random(1));
    flat(&places, &triangles, AMPLE)
}

fn area(surface: &Surface) -> f64 {
    (0..surface.triangle_count() as u32)
        .map(|triangle| surface.area(triangle))
        .sum()
}

/// Twice the signed area of a triangle.
fn signed(surface: &Surface, triangle: u32) -> f64 {
    let [a, b, c] = surface.shape(triangle);
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Vertices minus edges plus triangles. Edges on two faces of a tear count twice.
fn euler(surface: &Surface) -> i64 {
    let open = surface.neighbours().iter().flatten();
    let border = open.filter(|&&neighbour| neighbour == NONE).count();
    let sides = 3 * surface.triangle_count() + border;
    let edges = sides / 2;
    surface.vertex_count() as i64 - edges as i64 + surface.triangle_count() as i64
}

/// The place of a vertex in the frame of its first triangle.
fn place(surface: &Surface, vertex: u32) -> [f64; 2] {
    let corner = surface.fan(vertex).next().unwrap();
    surface.shape(corner.triangle)[corner.corner]
}

/// The fan angle from `tip` to a point in the common frame.
fn towards(surface: &Surface, tip: u32, point: [f64; 2]) -> Option<f64> {
    let triangle = surface.fan(tip).next()?.triangle;
    let at = place(surface, tip);
    surface.fan_angle(tip, triangle, [point[0] - at[0], point[1] - at[1]])
}

#[test]
fn a_fan_goes_counterclockwise_and_begins_at_the_border() {
    let surface = regular(2);
    let fan: Vec<_> = surface.fan(4).map(|corner| corner.triangle).collect();
    assert_eq!(fan.len(), 4 + 4);
    assert!(!surface.on_border(4));
    assert!((surface.total_angle(4) - 2.0 * PI).abs() < 1e-14);
    // The lower left corner: from the edge along x to the edge along y.
    let corners: Vec<_> = surface.fan(0).collect();
    assert_eq!([corners[0].from, corners[1].to], [1, 3]);
    assert!((surface.total_angle(0) - FRAC_PI_2).abs() < 1e-15);
    assert!((surface.angle_of_edge(0, 4).unwrap() - 0.25 * PI).abs() < 1e-15);
    assert_eq!(surface.fan(99).count(), 0);
    let [left, right] = surface.edge_between(0, 4);
    assert_eq!([left, right], [corners[1].triangle, corners[0].triangle]);
}

#[test]
fn faulty_surfaces_are_refused() {
    let [a, b, c, d] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let refused = |vertices, triangles: &[[u32; 3]], shapes: &[Shape]| {
        Surface::new(vertices, triangles, shapes, AMPLE).unwrap_err()
    };
    let two = [[a, b, c], [a, c, d]];
    assert!(matches!(
        refused(4, &[[0, 1, 2], [0, 3, 2]], &two),
        SurfaceError::Winding {
            first: 0,
            second: 1
        }
    ));
    assert!(matches!(
        refused(5, &[[0, 1, 2], [0, 3, 4]], &two),
        SurfaceError::Fans { vertex: 0 }
    ));
    assert!(matches!(
        refused(3, &[[0, 1, 2], [0, 2, 3]], &two),
        SurfaceError::Corners { triangle: 1, .. }
    ));
    assert!(matches!(
        refused(4, &[[0, 1, 2], [0, 2, 3]], &two[..1]),
        SurfaceError::Shapes { .. }
    ));
    let thin = [[a, b, c], [a, c, [2.0, 2.0]]];
    assert!(matches!(
        refused(4, &[[0, 1, 2], [0, 2, 3]], &thin),
        SurfaceError::Flat { triangle: 1 }
    ));
    let crowded = [[a, b, c], [a, b, c], [a, b, c]];
    assert!(matches!(
        refused(5, &[[0, 1, 2], [1, 0, 3], [0, 1, 4]], &crowded),
        SurfaceError::Edge { a: 0, b: 1 }
    ));
}

#[test]
fn a_tear_from_the_border_doubles_its_root_and_not_its_tip() {
    let mut surface = regular(4);
    // Vertex 10 is in the middle of the left side; 11 and 12 follow to the right.
    let done = surface
        .edit(&Edit::grow(10, Growth::Open { to: 11 }))
        .unwrap();
    assert_eq!((done.tips, done.vertices.clone()), ([11, NONE], 25..26));
    assert_eq!(surface.origin(25), Origin::Twin { of: 10 });
    let opened = done.opened[0].unwrap();
    assert_eq!((opened.right, opened.left), ([10, 11], [25, 11]));
    assert!((opened.length - 0.25).abs() < 1e-15);
    // The left of one who walks to the right is above.
    assert!(
        surface
            .fan(25)
            .all(|corner| (0..3).all(|k| surface.shape(corner.triangle)[k][1] >= 0.5))
    );
    assert!((surface.total_angle(11) - 2.0 * PI).abs() < 1e-14);
    assert!((surface.straight_ahead(11) - PI).abs() < 1e-14);
    surface.check().unwrap();
    let done = surface
        .edit(&Edit::grow(11, Growth::Open { to: 12 }))
        .unwrap();
    assert_eq!((done.tips[0], done.opened[0].unwrap().left), (12, [26, 12]));
    assert!(!done.parted);
    surface.check().unwrap();
    assert_eq!(euler(&surface), 1);
}

#[test]
fn a_slit_doubles_its_middle_only() {
    let mut surface = regular(4);
    let before = euler(&surface);
    let edit = Edit {
        tip: 12,
        ahead: Growth::Open { to: 13 },
        behind: Some(Growth::Open { to: 11 }),
    };
    let done = surface.edit(&edit).unwrap();
    assert_eq!((done.tips, done.vertices.clone()), ([13, 11], 25..26));
    surface.check().unwrap();
    // A slit is a hole.
    assert_eq!(euler(&surface), before - 1);
    let [ahead, behind] = done.opened.map(Option::unwrap);
    for opened in [ahead, behind] {
        let [left, right] = [opened.left, opened.right].map(|ends| {
            let [one, other] = surface.edge_between(ends[0], ends[1]);
            if one == NONE { other } else { one }
        });
        assert!(signed(&surface, left) > 0.0 && signed(&surface, right) > 0.0);
        let middle =
            |triangle: u32| surface.shape(triangle).map(|at| at[1]).iter().sum::<f64>() / 3.0;
        assert!(middle(left) > 0.5 && middle(right) < 0.5);
    }
    let alone = surface.edit(&Edit::grow(6, Growth::Open { to: 7 }));
    assert_eq!(alone, Err(EditError::Inside { a: 6, b: 7 }));
}

#[test]
fn a_tear_across_parts_the_surface() {
    let mut surface = regular(4);
    let mut pieces = Pieces::new(&surface);
    assert_eq!(pieces.count(), 1);
    let mut tip = 10;
    for to in 11..=14 {
        let done = surface.edit(&Edit::grow(tip, Growth::Open { to })).unwrap();
        surface.check().unwrap();
        assert_eq!(done.parted, to == 14);
        tip = to;
    }
    pieces.find(&surface);
    assert_eq!(pieces.count(), 2);
    assert_eq!(euler(&surface), 2);
    assert_eq!(pieces.of_vertex(0), 0);
    assert_eq!(pieces.of_vertex(24), 1);
    assert_eq!(pieces.of_vertex(14), 0);
    let halves: Vec<f64> = (0..2)
        .map(|piece| {
            (0..surface.triangle_count() as u32)
                .filter(|&triangle| pieces.of_triangle(triangle) == piece)
                .map(|triangle| surface.area(triangle))
                .sum()
        })
        .collect();
    assert!(halves.iter().all(|half| (half - 0.5).abs() < 1e-15));
}

#[test]
fn an_edit_parts_the_surface_only_where_it_leads_from_border_to_border() {
    let slit = |tip, ahead, behind| Edit {
        tip,
        ahead: Growth::Open { to: ahead },
        behind: Some(Growth::Open { to: behind }),
    };
    // A square of 4 x 4 cells: vertices 5 and 9 are the ends of the row of vertex 6, which is inside.
    let cases = [
        // The first growth alone reaches a border, then the second alone, then a single growth from inside.
        (4, slit(6, 5, 7), [NONE, 7]),
        (4, slit(6, 7, 5), [7, NONE]),
        (4, Edit::grow(6, Growth::Open { to: 5 }), [NONE; 2]),
        (4, slit(12, 13, 11), [13, 11]),
        // In a square of 2 x 2 cells, both growths from the middle reach a border.
        (2, slit(4, 5, 3), [NONE; 2]),
    ];
    for (n, edit, tips) in cases {
        let mut surface = regular(n);
        let done = surface.edit(&edit).unwrap();
        surface.check().unwrap();
        assert_eq!(done.tips, tips, "{edit:?}");
        let pieces = Pieces::new(&surface).count();
        assert_eq!(done.parted, pieces == 2, "{edit:?}: {pieces} pieces");
    }
}

/// What an edit must not change when it is refused.
fn all(surface: &Surface) -> impl PartialEq + use<> {
    let fans: Vec<Vec<u32>> = (0..surface.vertex_count() as u32)
        .map(|vertex| surface.fan(vertex).map(|corner| corner.triangle).collect())
        .collect();
    (
        surface.triangles().to_vec(),
        surface.neighbours().to_vec(),
        surface.shapes().to_vec(),
        surface.parents().to_vec(),
        surface.origins().to_vec(),
        fans,
    )
}

/// The edge opposite to vertex 10 in the triangle above the edge from 10 to 11.
fn beside(surface: &Surface) -> [u32; 2] {
    let corner = surface.fan(10).find(|corner| corner.from == 11).unwrap();
    [corner.from, corner.to]
}

#[test]
fn a_cut_divides_the_triangles_at_an_edge() {
    let mut surface = regular(4);
    let edge = beside(&surface);
    let before = surface.clone();
    let done = surface
        .edit(&Edit::grow(10, Growth::Cut { edge, at: 0.25 }))
        .unwrap();
    surface.check().unwrap();
    assert_eq!((done.vertices, done.triangles), (25..27, 32..34));
    let between = Origin::Between {
        ends: edge,
        weight: 0.25,
    };
    assert_eq!(surface.origin(25), between);
    assert_eq!(surface.origin(26), Origin::Twin { of: 10 });
    assert_eq!(done.tips, [25, NONE]);
    assert_eq!(surface.divided().len(), 2);
    for &[old, new] in surface.divided() {
        assert_eq!(surface.parent(new), old);
        let whole = before.area(old);
        // Rounding alone.
        assert!((surface.area(old) - 0.25 * whole).abs() < 1e-15);
        assert!((surface.area(new) - 0.75 * whole).abs() < 1e-15);
        assert!(surface.triangles()[old as usize].contains(&edge[0]));
        assert!(surface.triangles()[new as usize].contains(&edge[1]));
    }
    // Exactly the changed triangles are named.
    let changed: Vec<u32> = (0..surface.triangle_count())
        .filter(|&t| {
            t >= before.triangle_count()
                || surface.triangles()[t] != before.triangles()[t]
                || surface.neighbours()[t] != before.neighbours()[t]
                || surface.shapes()[t] != before.shapes()[t]
        })
        .map(|t| t as u32)
        .collect();
    assert_eq!(surface.touched(), changed);
}

#[test]
fn a_snapped_vertex_moves_onto_the_path_and_keeps_the_area() {
    let mut surface = regular(4);
    let before = surface.clone();
    // The path is turned by 0.2 to the right of the edge from 10 to 11.
    let direction = surface.angle_of_edge(10, 11).unwrap() - 0.2;
    let edit = surface.advance(10, direction, SNAPPING, |_| true).unwrap();
    let Growth::Snap { vertex: 11, .. } = edit.ahead else {
        panic!("{edit:?}")
    };
    let done = surface.edit(&edit).unwrap();
    surface.check().unwrap();
    let at = place(&surface, 11);
    // The projection onto the path of the end of an edge of length 0.25, from (0, 0.5).
    let (sine, cosine) = 0.2_f64.sin_cos();
    assert!((at[0] - 0.25 * cosine * cosine).abs() < 1e-15, "{at:?}");
    assert!((at[1] - 0.5 + 0.25 * cosine * sine).abs() < 1e-15, "{at:?}");
    assert!((area(&surface) - 1.0).abs() < 1e-14);
    // The triangles about the vertex and its twins keep one frame, to the last bit.
    for corner in surface.fan(11) {
        assert_eq!(surface.shape(corner.triangle)[corner.corner], at);
    }
    // The weights lead to the new place in the old triangle.
    let moved = done.moved[0].unwrap();
    for k in 0..2 {
        let places = moved.corners.map(|vertex| place(&before, vertex)[k]);
        let sum: f64 = places.iter().zip(moved.weights).map(|(x, w)| x * w).sum();
        assert!((sum - at[k]).abs() < 1e-15);
    }
    assert!(moved.weights.iter().all(|weight| *weight > -1e-12));
    // A vertex that the caller holds stays.
    let held = before
        .advance(10, direction, SNAPPING, |vertex| vertex != 11)
        .unwrap();
    assert!(!matches!(held.ahead, Growth::Snap { vertex: 11, .. }));
}

#[test]
fn shapes_in_their_own_frames_tear_like_shapes_in_one_frame() {
    let mut random = Random(5);
    let (places, triangles) = square(6, 0.25, &mut random);
    let mut one = flat(&places, &triangles, AMPLE);
    let turned: Vec<Shape> = shapes(&places, &triangles)
        .iter()
        .map(|shape| {
            let (sine, cosine) = (7.0 * random.unit()).sin_cos();
            let mirror = if random.unit() < 0.5 { -1.0 } else { 1.0 };
            shape.map(|[x, y]| {
                [
                    cosine * x - sine * y + 3.0,
                    mirror * (sine * x + cosine * y),
                ]
            })
        })
        .collect();
    let mut other = Surface::new(places.len(), &triangles, &turned, AMPLE).unwrap();
    let (mut tip, mut snaps) = (21, 0);
    while tip != NONE {
        let straight = one.straight_ahead(tip) + 0.1;
        let edit = one.advance(tip, straight, SNAPPING, |_| true).unwrap();
        let straight = other.straight_ahead(tip) + 0.1;
        let same = other.advance(tip, straight, SNAPPING, |_| true).unwrap();
        snaps += usize::from(matches!(edit.ahead, Growth::Snap { .. }));
        let done = one.edit(&edit).unwrap();
        other.edit(&same).unwrap();
        assert_eq!(one.triangles(), other.triangles());
        tip = done.tips[0];
    }
    assert!(snaps > 0);
    for t in 0..one.triangle_count() as u32 {
        assert!((one.area(t) - other.area(t)).abs() < 1e-14);
    }
    other.check().unwrap();
}

#[test]
fn refused_edits_change_nothing() {
    let (places, triangles) = square(4, 0.0, &mut Random(1));
    let scarce = |vertices, triangles| Reserve {
        vertices,
        triangles,
    };
    let mut surface = flat(&places, &triangles, scarce(1, 1));
    let before = all(&surface);
    let edge = beside(&surface);
    let (inf, still) = (f64::INFINITY, [0.0; 2]);
    let opposite = EditError::Opposite {
        tip: 10,
        a: 10,
        b: 11,
    };
    let cases = [
        (
            Growth::Cut { edge, at: 0.5 },
            EditError::Full { what: "triangles" },
        ),
        (Growth::Cut { edge, at: inf }, EditError::At { found: inf }),
        (Growth::Cut { edge, at: 1.0 }, EditError::At { found: 1.0 }),
        (
            Growth::Cut {
                edge: [10, 11],
                at: 0.5,
            },
            opposite,
        ),
        (Growth::Open { to: 24 }, EditError::NoEdge { a: 10, b: 24 }),
        (Growth::Open { to: 5 }, EditError::Border { a: 10, b: 5 }),
        (
            Growth::Snap {
                vertex: 5,
                shift: still,
            },
            EditError::Fixed { vertex: 5 },
        ),
        (
            Growth::Snap {
                vertex: 24,
                shift: still,
            },
            EditError::NoEdge { a: 10, b: 24 },
        ),
    ];
    for (growth, error) in cases {
        assert_eq!(surface.edit(&Edit::grow(10, growth)), Err(error));
        assert!(all(&surface) == before);
        assert!(surface.touched().is_empty() && surface.divided().is_empty());
    }
    for shift in [[0.3, 0.0], [f64::NAN, 0.0], [-0.4, 0.1]] {
        let edit = Edit::grow(10, Growth::Snap { vertex: 11, shift });
        assert!(matches!(surface.edit(&edit), Err(EditError::Thin { .. })));
        assert!(all(&surface) == before);
    }
    // The cut succeeds, and the twin that it needs finds no room.
    let mut surface = flat(&places, &triangles, scarce(1, 2));
    let refused = surface.edit(&Edit::grow(10, Growth::Cut { edge, at: 0.5 }));
    assert_eq!(refused, Err(EditError::Full { what: "vertices" }));
    assert!(all(&surface) == before);
    for vertex in [10, 77, NONE] {
        let to = 11;
        let edit = Edit {
            behind: Some(Growth::Open { to }),
            ..Edit::grow(vertex, Growth::Open { to })
        };
        assert!(surface.edit(&edit).is_err());
    }
    assert!(all(&surface) == before);
    surface.check().unwrap();
}

#[test]
fn tears_that_meet_leave_no_vertex_with_two_fans() {
    let mut surface = regular(4);
    for (tip, to) in [(10, 11), (11, 12), (14, 13), (22, 17)] {
        surface.edit(&Edit::grow(tip, Growth::Open { to })).unwrap();
        surface.check().unwrap();
    }
    // The tear from the left, with its tip at 12, reaches the tip of the tear from the right at 13.
    let done = surface
        .edit(&Edit::grow(12, Growth::Open { to: 13 }))
        .unwrap();
    assert_eq!(
        (done.tips, done.met, done.parted),
        ([NONE; 2], [13, NONE], true)
    );
    surface.check().unwrap();
    let mut pieces = Pieces::new(&surface);
    assert_eq!(pieces.count(), 2);
    // The tear from above, with its tip at 17, reaches the face of that tear.
    let near = surface.fan(17).flat_map(|corner| [corner.from, corner.to]);
    let to = near
        .filter(|&vertex| place(&surface, vertex) == [0.5, 0.5])
        .min()
        .unwrap();
    assert!(surface.on_border(to));
    let done = surface.edit(&Edit::grow(17, Growth::Open { to })).unwrap();
    assert_eq!((done.met, done.parted), ([to, NONE], true));
    surface.check().unwrap();
    pieces.find(&surface);
    assert_eq!(pieces.count(), 3);
    assert_eq!(euler(&surface), 3);
}

/// What random tears of many surfaces came to.
#[derive(Debug, Default)]
struct Tally {
    edits: usize,
    opened: usize,
    cut: usize,
    snapped: usize,
    triangles: usize,
    ended: usize,
    resting: usize,
    refused: usize,
    allocations: usize,
    /// Degrees.
    smallest: f64,
}

/// Tears `count` times at random, and checks the surface after each edit.
fn tear_at_random(count: usize, options: AdvanceOptions, reserve: Reserve, seed: u64) -> Tally {
    let mut random = Random(seed);
    let mut tally = Tally {
        smallest: 180.0,
        ..Tally::default()
    };
    while tally.edits < count {
        let n = 5 + random.below(6) as u32;
        let jitter = [0.0, 0.15, 0.25][random.below(3)];
        let (places, triangles) = square(n, jitter, &mut random);
        let mut surface = flat(&places, &triangles, reserve);
        // The tips, and by how much each tear winds.
        let mut tips: Vec<(u32, f64)> = Vec::new();
        for _ in 0..3 * n {
            let begins = tips.is_empty() || random.unit() < 0.1;
            let (tip, direction) = if begins {
                let vertex = random.below(surface.vertex_count()) as u32;
                (vertex, random.unit() * surface.total_angle(vertex))
            } else {
                let (tip, winding) = tips[random.below(tips.len())];
                let turn = winding * (2.0 * random.unit() - 1.0);
                (tip, surface.straight_ahead(tip) + turn)
            };
            let edit = if surface.on_border(tip) {
                surface.advance(tip, direction, options, |_| true)
            } else {
                surface.begin_slit(tip, direction, options, |_| true)
            };
            let Some(edit) = edit else {
                tally.resting += 1;
                tips.retain(|&(other, _)| other != tip);
                continue;
            };
            let (whole, before) = (area(&surface), all(&surface));
            let mut result = None;
            tally.allocations += count_of(|| result = Some(surface.edit(&edit)));
            let done = match result.unwrap() {
                Ok(done) => done,
                Err(error) => {
                    // The two growths of a slit may exclude each other.
                    let full = matches!(error, EditError::Full { .. });
                    assert!(full || edit.behind.is_some(), "{edit:?}: {error}");
                    assert!(all(&surface) == before);
                    tally.refused += 1;
                    continue;
                }
            };
            for growth in [Some(edit.ahead), edit.behind].into_iter().flatten() {
                match growth {
                    Growth::Open { .. } => tally.opened += 1,
                    Growth::Cut { .. } => tally.cut += 1,
                    Growth::Snap { .. } => tally.snapped += 1,
                }
            }
            tally.edits += 1;
            tally.triangles += done.triangles.len();
            tally.ended += usize::from(done.tips[0] == NONE);
            surface.check().unwrap();
            for triangle in 0..surface.triangle_count() as u32 {
                assert!(signed(&surface, triangle) > 0.0);
            }
            // Rounding of some hundred areas.
            assert!((area(&surface) - whole).abs() < 1e-12);
            tips.retain(|&(other, _)| other != tip && !done.met.contains(&other));
            let winding = [0.0, 0.5, 2.5][random.below(3)];
            let new = done.tips.into_iter().filter(|&tip| tip != NONE);
            tips.extend(new.map(|tip| (tip, winding)));
        }
        assert!((area(&surface) - 1.0).abs() < 1e-12);
        let smallest = surface.smallest_angle().to_degrees();
        tally.smallest = tally.smallest.min(smallest);
        // Each piece of the sheet has one outline, and each slit makes a hole.
        assert!(euler(&surface) <= Pieces::new(&surface).count() as i64);
    }
    tally
}

fn count_of(call: impl FnOnce()) -> usize {
    count(call) as usize
}

#[test]
fn ten_thousand_random_tears_stay_manifold() {
    for (options, seed) in [(CUTTING, 3), (SNAPPING, 4)] {
        let tally = tear_at_random(5000, options, AMPLE, seed);
        println!("{options:?}: {tally:?}");
        assert!(tally.opened > 400 && tally.cut > 500 && tally.ended > 100);
        assert_eq!(tally.snapped > 500, options.snapping > 0.0);
        assert_eq!(tally.allocations, 0);
        // Cuts refuse angles below 3 degrees, and snapping makes none below 10.
        assert!(tally.smallest > 2.999);
    }
    // With a reserve that is used up again and again, each refused edit leaves the surface as it was.
    let scarce = Reserve {
        vertices: 12,
        triangles: 12,
    };
    let tally = tear_at_random(500, SNAPPING, scarce, 5);
    println!("{scarce:?}: {tally:?}");
    assert!(tally.refused > 100 && tally.allocations == 0);
    // The allocator counts.
    assert!(count_of(|| drop(std::hint::black_box(Box::new(7)))) > 0);
}

#[test]
fn a_straight_tear_follows_its_path() {
    let loose = |options| AdvanceOptions {
        opening: 0.15,
        ..options
    };
    for (options, seed) in [
        (CUTTING, 1),
        (SNAPPING, 2),
        (loose(CUTTING), 3),
        (loose(SNAPPING), 4),
    ] {
        let mut random = Random(seed);
        let n = 40;
        for jitter in [0.0, 0.25] {
            let (places, triangles) = square(n, jitter, &mut random);
            let mut surface = flat(&places, &triangles, AMPLE);
            let before = surface.triangle_count();
            // From the middle of the left side, 11 degrees upwards.
            let (mut tip, slope) = (20 * (n + 1), 0.2);
            let (mut farthest, mut aside, mut steps) = (0.0_f64, 0.0, 0);
            while tip != NONE {
                let at = place(&surface, tip);
                let mut direction = towards(&surface, tip, [at[0] + 1.0, at[1] + slope]).unwrap();
                // Cuts that keep clear of vertices leave the line. The tear turns back by its distance from the line.
                direction -= (aside * f64::from(n)).atan();
                let edit = surface.advance(tip, direction, options, |_| true).unwrap();
                let (angle, length) = surface.edge_of(tip, &edit.ahead).unwrap();
                let straight = towards(&surface, tip, [at[0] + 1.0, at[1] + slope]).unwrap();
                aside += length * (angle - straight).sin();
                tip = surface.edit(&edit).unwrap().tips[0];
                farthest = farthest.max((at[1] - 0.5 - slope * at[0]).abs() * f64::from(n));
                steps += 1;
            }
            surface.check().unwrap();
            println!(
                "{options:?}, jitter {jitter}: {farthest:.2} of an edge aside in {steps} edits, {} triangles added, \
                 smallest angle {:.1} degrees",
                surface.triangle_count() - before,
                surface.smallest_angle().to_degrees()
            );
            // Half an element (the bound for a straight tear over 40 elements).
            assert!(farthest < 0.5);
        }
    }
}

#[test]
fn the_edge_of_an_edit_is_the_edge_that_opens() {
    let mut random = Random(9);
    let (places, triangles) = square(8, 0.25, &mut random);
    for options in [CUTTING, SNAPPING] {
        for _ in 0..200 {
            let mut surface = flat(&places, &triangles, AMPLE);
            let tip = random.below(surface.vertex_count()) as u32;
            if !surface.on_border(tip) {
                continue;
            }
            let direction = random.unit() * surface.total_angle(tip);
            let edit = surface.advance(tip, direction, options, |_| true).unwrap();
            let (angle, size) = surface.edge_of(tip, &edit.ahead).unwrap();
            if matches!(edit.ahead, Growth::Snap { .. }) {
                assert!((angle - direction).abs() < 1e-12);
            }
            let (triangle, way) = surface.direction_at(tip, angle).unwrap();
            let round = surface.fan_angle(tip, triangle, way).unwrap();
            assert!((round - angle).abs() < 1e-12);
            let from = place(&surface, tip);
            let done = surface.edit(&edit).unwrap();
            let opened = done.opened[0].unwrap();
            assert!((opened.length - size).abs() < 1e-12);
            let to = place(&surface, opened.right[1]);
            for k in 0..2 {
                assert!((from[k] + size * way[k] - to[k]).abs() < 1e-12);
            }
        }
    }
}

#[test]
fn notches_and_slits_end_where_they_should() {
    let mut random = Random(11);
    for jitter in [0.0, 0.2] {
        let (places, triangles) = square(12, jitter, &mut random);
        let mut surface = flat(&places, &triangles, AMPLE);
        // A notch from the middle of a border edge, and a slit.
        let notch = Notch {
            from: [0.0, 0.54],
            to: [0.37, 0.61],
        };
        let slit = Notch {
            from: [0.55, 0.2],
            to: [0.8, 0.35],
        };
        let mut edits = 0;
        let [tip, none] = surface
            .notch(&notch, SNAPPING, |_| true, |_, _| edits += 1)
            .unwrap();
        assert_eq!(none, NONE);
        let tips = surface
            .notch(&slit, SNAPPING, |_| true, |_, _| edits += 1)
            .unwrap();
        surface.check().unwrap();
        assert!(edits > 8);
        for (tip, end) in [(tip, notch.to), (tips[0], slit.to), (tips[1], slit.from)] {
            let at = place(&surface, tip);
            let far = (at[0] - end[0]).hypot(at[1] - end[1]);
            // In these meshes a vertex can move there.
            assert!(far < 1e-12, "jitter {jitter}: {far} m from the end");
        }
        assert_eq!(Pieces::new(&surface).count(), 1);
        // A slit is a hole, a notch is none.
        assert_eq!(euler(&surface), 0);
    }
    let mut surface = regular(4);
    let across = Notch {
        from: [-1.0, 0.4],
        to: [2.0, 0.4],
    };
    let tips = surface
        .notch(&across, CUTTING, |_| true, |_, _| ())
        .unwrap();
    assert_eq!(tips, [NONE; 2]);
    assert_eq!(Pieces::new(&surface).count(), 2);
}

#[test]
fn a_notch_begins_at_the_nearer_end_of_the_border_edge_or_between_the_ends() {
    // From the lower left corner, counterclockwise around the unit square of 4 x 4 cells.
    let around = |far: f64| -> [f64; 2] {
        let along = far.fract();
        match far as u32 {
            0 => [along, 0.0],
            1 => [1.0, along],
            2 => [1.0 - along, 1.0],
            _ => [0.0, 1.0 - along],
        }
    };
    let edge = 0.25;
    for side in 0..4_u32 {
        // The second and the third edge of the side.
        for begin in [1.0, 2.0] {
            for at in [0.05, 0.5, 0.95] {
                let mut surface = regular(4);
                let vertices = surface.vertex_count() as u32;
                let from = around(f64::from(side) + (begin + at) * edge);
                let to = [0.5 * (from[0] + 0.5), 0.5 * (from[1] + 0.5)];
                let mut root = None;
                surface
                    .notch(
                        &Notch { from, to },
                        SNAPPING,
                        |_| true,
                        |surface, done| {
                            if let Some(opened) = done.opened[0] {
                                root.get_or_insert((
                                    opened.right[0],
                                    place(surface, opened.right[0]),
                                ));
                            }
                        },
                    )
                    .unwrap();
                let (root, found) = root.expect("an opened edge");
                let expected = around(f64::from(side) + (begin + at.round_ties_even()) * edge);
                let expected = if at == 0.5 { from } else { expected };
                let far = (found[0] - expected[0]).hypot(found[1] - expected[1]);
                assert!(far < 1e-12, "from {from:?}: {found:?}, not {expected:?}");
                // Only in the middle of the edge a new vertex is made.
                assert_eq!(root >= vertices, at == 0.5, "from {from:?}: {root}");
            }
        }
    }
}

#[test]
fn snapping_adds_two_triangles_where_cutting_adds_eight() {
    // The figures of the thesis (its figure 4.5), here on a grid of 5 x 5 cells that tears from the left side upwards.
    let tear = |options: AdvanceOptions| {
        let mut surface = regular(5);
        let before = surface.triangle_count();
        let mut tip = 18;
        while tip != NONE {
            let direction = towards(&surface, tip, [1.01, 0.6 + 0.5 * 1.01]).unwrap();
            let edit = surface.advance(tip, direction, options, |_| true).unwrap();
            tip = surface.edit(&edit).unwrap().tips[0];
        }
        surface.check().unwrap();
        let added = surface.triangle_count() - before;
        (added, surface.smallest_angle().to_degrees())
    };
    let (cut, snapped) = (
        tear(CUTTING),
        tear(AdvanceOptions {
            snapping: 0.45,
            opening: 0.0,
        }),
    );
    println!("triangles added and smallest angle: {cut:?} by cutting, {snapped:?} by snapping");
    assert_eq!((cut.0, snapped.0), (8, 2));
    assert!(snapped.1 > 18.0);
}

#[test]
fn darts_and_gathers_are_torn_but_not_snapped() {
    // A cone of seven triangles: the angles about its apex exceed a full turn.
    let count = 7;
    let triangles: Vec<[u32; 3]> = (0..count)
        .map(|k| [0, 1 + k, 1 + (k + 1) % count])
        .collect();
    let equilateral = [[0.0, 0.0], [1.0, 0.0], [0.5, 0.75_f64.sqrt()]];
    let mut surface = Surface::new(8, &triangles, &vec![equilateral; 7], AMPLE).unwrap();
    assert!((surface.total_angle(0) - 7.0 * PI / 3.0).abs() < 1e-14);
    let shift = [0.05, 0.0];
    let refused = surface.edit(&Edit::grow(1, Growth::Snap { vertex: 0, shift }));
    assert_eq!(refused, Err(EditError::Fixed { vertex: 0 }));
    let direction = surface.angle_of_edge(1, 0).unwrap() + 0.1;
    let edit = surface.advance(1, direction, SNAPPING, |_| true).unwrap();
    surface.edit(&edit).unwrap();
    surface.check().unwrap();
}

#[test]
fn copies_of_a_surface_tear_alike_and_without_allocating() {
    let (places, triangles) = square(8, 0.2, &mut Random(2));
    let mut one = flat(&places, &triangles, AMPLE);
    let mut copy = one.clone();
    let mut pieces = Pieces::new(&one);
    let mut tip = 36;
    while tip != NONE {
        let mut next = NONE;
        let allocations = count_of(|| {
            let direction = one.straight_ahead(tip) - 0.05;
            if let Some(edit) = one.advance(tip, direction, SNAPPING, |_| true) {
                next = one.edit(&edit).map_or(NONE, |done| done.tips[0]);
                copy.edit(&edit).unwrap();
            }
            pieces.find(&one);
        });
        assert_eq!(allocations, 0);
        assert!(all(&one) == all(&copy));
        assert_eq!(one.touched(), copy.touched());
        tip = next;
    }
    assert_eq!(pieces.count(), 2);
    // The smaller numbers first: the piece with triangle 0 is piece 0.
    assert_eq!(pieces.of_triangle(0), 0);
    assert_eq!(pieces.of_triangle(99_999), NONE);
}

#[test]
fn an_inclined_slit_is_straight_and_ends_exactly() {
    let mut random = Random(21);
    let mut farthest = 0.0_f64;
    for (degrees, jitter) in [15.0, 30.0, 45.0, 60.0, 75.0_f64]
        .into_iter()
        .flat_map(|degrees| [0.0, 0.1, 0.25].map(|jitter| (degrees, jitter)))
    {
        let n = 40;
        let (places, triangles) = square(n, jitter, &mut random);
        let mut surface = flat(&places, &triangles, AMPLE);
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let end = |far: f64| [0.51 + far * cosine, 0.49 + far * sine];
        let (from, to) = (end(-0.15), end(0.15));
        let mut vertices = Vec::new();
        let tips = surface
            .notch(
                &Notch { from, to },
                SNAPPING,
                |_| true,
                |_, done| {
                    let opened = done.opened.iter().flatten();
                    vertices.extend(opened.flat_map(|opened| opened.right));
                },
            )
            .unwrap();
        surface.check().unwrap();
        for (tip, end) in tips.into_iter().zip([to, from]) {
            let at = place(&surface, tip);
            assert!((at[0] - end[0]).hypot(at[1] - end[1]) < 1e-12);
        }
        // The slit is twelve cells long.
        assert!(vertices.len() > 8);
        for vertex in vertices {
            let at = place(&surface, vertex);
            let aside = (at[1] - 0.49) * cosine - (at[0] - 0.51) * sine;
            farthest = farthest.max(aside.abs() * f64::from(n));
        }
    }
    println!("vertices are up to {farthest:.1e} of an edge beside the line");
    // A cut keeps 0.15 of an edge clear of its ends. The tear then turns back to its end.
    assert!(farthest < 0.25);
}
