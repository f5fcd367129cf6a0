//! Merges vertices at one place, as the files of textures, of games and of STL double them.

use physics::Vec3;
use std::collections::HashMap;

/// No vertex.
const NONE: u32 = u32::MAX;

/// For each vertex, the first vertex within `distance` of it that is not merged itself; most are their own. A distance of
/// zero merges equal coordinates only.
///
/// The vertices that are kept lie more than the distance apart, so a cell of the grid has few of them, and the time is
/// proportional to the number of vertices.
pub(crate) fn firsts(positions: &[Vec3], distance: f64) -> Vec<u32> {
    // The last vertex kept in each cell, and the vertex kept there before each.
    let mut last: HashMap<[u64; 3], u32> = HashMap::new();
    let mut before = vec![NONE; positions.len()];
    let mut firsts = Vec::with_capacity(positions.len());
    for (vertex, position) in (0_u32..).zip(positions) {
        let cells = cells(position, distance);
        let near = cells.iter().find_map(|cell| {
            let mut other = last.get(cell).copied().unwrap_or(NONE);
            while let Some(place) = positions.get(other as usize) {
                if (place - position).norm() <= distance {
                    return Some(other);
                }
                other = before.get(other as usize).copied().unwrap_or(NONE);
            }
            None
        });
        firsts.push(near.unwrap_or(vertex));
        if near.is_none() {
            let own = cells.first().copied().unwrap_or_default();
            let earlier = last.insert(own, vertex).unwrap_or(NONE);
            if let Some(slot) = before.get_mut(vertex as usize) {
                *slot = earlier;
            }
        }
    }
    firsts
}

/// The cell of a position in a grid of the width `distance`, then the cells around it. Without a distance, or if the
/// numbers of cells have no fractions left, each position has a cell of its own.
fn cells(position: &Vec3, distance: f64) -> Vec<[u64; 3]> {
    // Minus zero becomes zero.
    let key = |number: f64| (number + 0.0).to_bits();
    let number = position.map(|x| (x / distance).floor());
    if distance <= 0.0 || !number.iter().all(|x| x.abs() < 1e15) {
        return vec![[position.x, position.y, position.z].map(key)];
    }
    let around = [0.0, -1.0, 1.0];
    let mut cells = Vec::with_capacity(27);
    for x in around {
        for y in around {
            for z in around {
                cells.push([number.x + x, number.y + y, number.z + z].map(key));
            }
        }
    }
    cells
}
