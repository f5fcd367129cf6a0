//! Generated solids with linear and with quadratic cells.

use physics::mesh::Cells;
use physics::mesh::generate_box::{BoxError, solid_box};
use physics::mesh::tet::MIDSIDE_ENDS;
use std::collections::BTreeMap;

#[test]
fn a_box_is_filled_once_and_conforms() {
    let mesh = solid_box([0.3, 0.2, 0.1], [3, 2, 4]).unwrap();
    let Cells::Linear(cells) = &mesh.cells else {
        panic!()
    };
    assert_eq!(
        (mesh.positions.len(), cells.len()),
        (4 * 3 * 5, 3 * 2 * 4 * 6)
    );
    let mut volume = 0.0;
    let mut faces = BTreeMap::new();
    for cell in cells {
        let [a, b, c, d] = cell.map(|v| mesh.positions[v as usize]);
        let own = (b - a).cross(&(c - a)).dot(&(d - a)) / 6.0;
        assert!(own > 0.0);
        volume += own;
        for out in 0..4 {
            let mut face: Vec<u32> = (0..4).filter(|k| *k != out).map(|k| cell[k]).collect();
            face.sort_unstable();
            *faces.entry(face).or_insert(0) += 1;
        }
    }
    // The tolerance is a few hundred roundings.
    assert!((volume - 0.006).abs() < 1e-15);
    assert!(faces.values().all(|&cells| cells <= 2));
    let surface = faces.values().filter(|&&cells| cells == 1).count();
    assert_eq!(surface, 2 * 2 * (3 * 2 + 2 * 4 + 3 * 4));
    let top = mesh.group("top").unwrap();
    assert_eq!(top.members.len(), 4 * 3);
    assert!(
        top.members
            .iter()
            .all(|&v| mesh.positions[v as usize].z == 0.05)
    );
}

#[test]
fn a_box_without_extent_or_cells_is_refused() {
    let size = |size| solid_box(size, [1, 1, 1]).unwrap_err();
    assert!(matches!(
        size([1.0, 0.0, 1.0]),
        BoxError::Size { axis: "y", .. }
    ));
    assert!(matches!(
        size([1.0, 1.0, f64::NAN]),
        BoxError::Size { axis: "z", .. }
    ));
    let cells = |cells| solid_box([1.0; 3], cells).unwrap_err();
    assert_eq!(cells([0, 1, 1]), BoxError::NoCells { axis: "x" });
    assert!(matches!(cells([u32::MAX; 3]), BoxError::TooMany { .. }));
}

#[test]
fn middles_lie_in_the_middle_and_join_the_faces_of_their_edges() {
    let linear = solid_box([1.0; 3], [2, 1, 1]).unwrap();
    let mesh = linear.quadratic();
    let Cells::Quadratic(cells) = &mesh.cells else {
        panic!()
    };
    for cell in cells {
        for (slot, [a, b]) in MIDSIDE_ENDS.into_iter().enumerate() {
            let [a, b, middle] =
                [cell[a], cell[b], cell[4 + slot]].map(|v| mesh.positions[v as usize]);
            assert!((middle - (a + b) / 2.0).norm() < 1e-16);
        }
    }
    // Each group has every vertex of its face and no other, even if the box is one grid cell thick.
    for (name, axis, at) in [("left", 0, -0.5), ("back", 1, 0.5), ("bottom", 2, -0.5)] {
        let expected: Vec<u32> = (0_u32..)
            .zip(&mesh.positions)
            .filter(|(_, x)| x[axis] == at)
            .map(|(vertex, _)| vertex)
            .collect();
        assert_eq!(mesh.group(name).unwrap().members, expected, "{name}");
    }
    assert_eq!(mesh.quadratic(), mesh);
}
