//! Gathering node vectors into arrays over elements, and scattering them back.
//!
//! Elements are grouped in blocks of [`LANES`]. The data of a block are stored by component: the same component of
//! all its elements side by side. The work on a block is a loop over its lanes whose body is plain arithmetic on one
//! element. The compiler turns the loop into vector instructions of the width that the machine has. It may neither
//! reorder sums nor contract a product and a sum, so every width gives the same bytes.

use super::{Node, Real};

/// Elements in a block. The values of a block fill two (f32) or four (f64) of the widest vector registers.
pub const LANES: usize = 32;

/// One number for each element of a block.
pub type Lanes<T> = [T; LANES];

/// Number of elements among which the next one is chosen.
const WINDOW: usize = 128;
/// Number of preceding elements with which the next one should have no node in common.
const APART: usize = 8;

/// Three vectors for each element of a block, padded like nodes. Component `i` of vector `a` of element `lane` is
/// `[a][lane][i]`.
pub type Vectors<T> = [[Node<T>; LANES]; 3];

/// Sets `differences` to the vectors `of` at each element's last three nodes minus the vector at its first node.
#[inline(always)]
pub fn gather<T: Real>(nodes: &[[u32; 4]; LANES], of: &[Node<T>], differences: &mut Vectors<T>) {
    for lane in 0..LANES {
        let [n0, n1, n2, n3] = nodes[lane];
        let first = of[n0 as usize];
        differences[0][lane] = less(of[n1 as usize], first);
        differences[1][lane] = less(of[n2 as usize], first);
        differences[2][lane] = less(of[n3 as usize], first);
    }
}

/// Adds `vectors` to the vectors `to` at each element's last three nodes, and subtracts their sum from the vector at
/// its first node.
#[inline(always)]
pub fn scatter<T: Real>(nodes: &[[u32; 4]; LANES], vectors: &Vectors<T>, to: &mut [Node<T>]) {
    for lane in 0..LANES {
        let [n0, n1, n2, n3] = nodes[lane].map(|node| node as usize);
        let [v1, v2, v3] = [vectors[0][lane], vectors[1][lane], vectors[2][lane]];
        to[n1] = plus(to[n1], v1);
        to[n2] = plus(to[n2], v2);
        to[n3] = plus(to[n3], v3);
        to[n0] = less(to[n0], plus(plus(v1, v2), v3));
    }
}

#[inline(always)]
pub(crate) fn plus<T: Real>(a: Node<T>, b: Node<T>) -> Node<T> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]]
}

#[inline(always)]
pub(crate) fn less<T: Real>(a: Node<T>, b: Node<T>) -> Node<T> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3]]
}

/// An order of `count` elements in which nearby elements have none of their `nodes` in common, as far as possible.
/// Sums into nodes then need not wait for each other. The order stays near the given one.
pub(crate) fn apart<'a, const N: usize>(
    count: usize,
    nodes: impl Fn(usize) -> &'a [u32; N],
) -> Vec<usize> {
    let mut order = Vec::with_capacity(count);
    let mut window: Vec<usize> = (0..count.min(WINDOW)).collect();
    let mut next = window.len();
    while !window.is_empty() {
        let recent = &order[order.len().saturating_sub(APART)..];
        let apart = |&element: &usize| {
            let touches = |&other: &usize| nodes(element).iter().any(|n| nodes(other).contains(n));
            !recent.iter().any(touches)
        };
        let chosen = window.iter().position(apart).unwrap_or(0);
        order.push(window.remove(chosen));
        if next < count {
            window.push(next);
            next += 1;
        }
    }
    order
}
