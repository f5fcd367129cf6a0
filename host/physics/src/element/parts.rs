//! The elements of a set in parts that several cores compute at once.
//!
//! A large set is cut into parts of neighbouring elements: at the median of the elements' centres along the longest
//! edge of their box, again and again (recursive coordinate bisection: M. J. Berger and S. H. Bokhari, "A partitioning
//! strategy for nonuniform problems on multiprocessors", 1987). Each part is a kernel over its own nodes, numbered from
//! zero. A part copies the displacements of its nodes, computes, and keeps its forces. The forces of a node are then
//! summed over the parts in the order of the parts. The cuts depend on the mesh alone, so the sums are the same for any
//! number of threads.
//!
//! A part is small enough that its nodes stay in the nearest cache.

use super::VectorForm;
use super::kernel::Kernel;
use super::precision::Precision;
use super::torn::TearableKernel;
use crate::Vec3;
use crate::cost::Cost;
use crate::lanes::{Node, Real, add};
use crate::linear::block_matrix::BlockMatrix;
use crate::team::{self, Team};

/// Most nodes that the elements of a part gather: those of 4,096 linear tetrahedra. Below this number, a part is too
/// short to be worth a thread.
const MOST: usize = 16_384;

/// Number of nodes whose forces a thread sums at a time.
const RUN: usize = 512;

/// An element of a list, with its nodes.
pub(super) trait Listed: Clone {
    /// The nodes of the element.
    fn nodes(&self) -> &[u32];

    /// The nodes of the element, to be renumbered.
    fn nodes_mut(&mut self) -> &mut [u32];
}

/// A part of a list of elements whose nodes are numbered from zero.
pub(super) struct Cut<E> {
    /// The elements, in their order in the list.
    elements: Vec<E>,
    /// The place of each node, ascending.
    places: Vec<u32>,
}

impl<E> Cut<E> {
    /// The form of the elements, with the places of their nodes.
    pub(super) fn form(self, form: impl Fn(Vec<E>) -> VectorForm) -> (VectorForm, Vec<u32>) {
        (form(self.elements), self.places)
    }
}

/// Cuts `elements`, whose nodes are at `rest` (m), into parts. A small list gives no parts.
pub(super) fn cut<E: Listed>(elements: &[E], rest: &[Vec3]) -> Vec<Cut<E>> {
    let gathered = |count: usize| count * elements.first().map_or(0, |e| e.nodes().len());
    if gathered(elements.len()) <= 2 * MOST {
        return Vec::new();
    }
    let centre = |element: &E| -> Vec3 {
        let nodes = element.nodes().iter();
        nodes.map(|&node| rest[node as usize]).sum()
    };
    let centres: Vec<Vec3> = elements.iter().map(centre).collect();
    let mut cuts = Vec::new();
    let mut open: Vec<Vec<u32>> = vec![(0..elements.len() as u32).collect()];
    while let Some(mut part) = open.pop() {
        if gathered(part.len()) > MOST {
            let upper = upper_half(&mut part, &centres);
            open.push(upper);
            open.push(part);
            continue;
        }
        part.sort_unstable();
        cuts.push(numbered(
            part.iter().map(|&e| elements[e as usize].clone()).collect(),
        ));
    }
    cuts
}

/// Takes from `part` the half of its elements with the larger centres along the longest edge of their box.
fn upper_half(part: &mut Vec<u32>, centres: &[Vec3]) -> Vec<u32> {
    let (mut low, mut high) = (Vec3::repeat(f64::INFINITY), Vec3::repeat(f64::NEG_INFINITY));
    for &element in part.iter() {
        low = low.inf(&centres[element as usize]);
        high = high.sup(&centres[element as usize]);
    }
    let axis = (high - low).imax();
    let half = part.len() / 2;
    // The numbers of the elements decide between equal centres.
    part.select_nth_unstable_by(half, |&a, &b| {
        let along = |element: u32| centres[element as usize][axis];
        along(a).total_cmp(&along(b)).then(a.cmp(&b))
    });
    part.split_off(half)
}

fn numbered<E: Listed>(mut elements: Vec<E>) -> Cut<E> {
    let mut places: Vec<u32> = elements.iter().flat_map(Listed::nodes).copied().collect();
    places.sort_unstable();
    places.dedup();
    for element in &mut elements {
        for node in element.nodes_mut() {
            // Each node is in the list.
            *node = places.binary_search(node).unwrap_or_default() as u32;
        }
    }
    Cut { elements, places }
}

/// One part: the kernel of its elements.
#[derive(Debug)]
struct Part<T> {
    kernel: Box<dyn Kernel<T>>,
    /// The place of each node of the kernel.
    places: Vec<u32>,
    /// The vector at the nodes of the kernel.
    u: Vec<Node<T>>,
    /// Elastic energy (J).
    energy: f64,
}

/// Elements in parts.
#[derive(Debug)]
pub(crate) struct Parts<T> {
    kernels: Vec<Part<T>>,
    /// The results of all parts, one part after the other, by the nodes of the part.
    results: Vec<Node<T>>,
    /// Indices into `results` of the results at each place, by part. Those of place `p` are from `ends[p - 1]` on.
    sources: Vec<u32>,
    ends: Vec<u32>,
}

impl<T: Real> Parts<T> {
    /// The kernels of `forms`, each with the places of its nodes, of which there are `count` in all.
    fn new(forms: Vec<(VectorForm, Vec<u32>)>, count: usize) -> Self
    where
        T: Precision,
    {
        let mut sources = vec![Vec::new(); count];
        let mut parts = Vec::with_capacity(forms.len());
        let mut total = 0;
        for (form, places) in forms {
            for (at, &place) in places.iter().enumerate() {
                sources[place as usize].push((total + at) as u32);
            }
            total += places.len();
            // Only a whole set is assembled. The kernel of a part has no slots, because this matrix couples nothing.
            let apart = BlockMatrix::new(places.len(), places.len(), core::iter::empty());
            parts.push(Part {
                kernel: form.kernel(&apart),
                u: vec![[T::ZERO; 4]; places.len()],
                places,
                energy: 0.0,
            });
        }
        let mut end = 0;
        Self {
            kernels: parts,
            results: vec![[T::ZERO; 4]; total],
            ends: sources
                .iter()
                .map(|sources| {
                    end += sources.len() as u32;
                    end
                })
                .collect(),
            sources: sources.concat(),
        }
    }

    /// Adds the results of `work` on each part with the vector `u` to `y`.
    fn add(
        &mut self,
        team: &dyn Team,
        u: &[Node<T>],
        y: &mut [Node<T>],
        work: &(impl Fn(&mut Part<T>, &mut [Node<T>]) + Sync),
    ) {
        let on_nodes = |part: &mut Part<T>, results: &mut [Node<T>]| {
            for (own, &place) in part.u.iter_mut().zip(&part.places) {
                *own = u[place as usize];
            }
            results.fill([T::ZERO; 4]);
            work(part, results);
        };
        if team.is_alone() {
            // The same sums, part by part, while the results are in the nearest cache.
            for part in &mut self.kernels {
                let results = &mut self.results[..part.places.len()];
                on_nodes(part, results);
                for (&place, result) in part.places.iter().zip(&*results) {
                    add(&mut y[place as usize], result);
                }
            }
            return;
        }
        each_part(team, &mut self.kernels, &mut self.results, &on_nodes);
        let (results, sources, ends) = (&self.results, &self.sources, &self.ends);
        team::each_run(team, y, RUN, &|first, y: &mut [Node<T>]| {
            let mut start = match first {
                0 => 0,
                first => ends[first - 1] as usize,
            };
            for (y, &end) in y.iter_mut().zip(&ends[first..]) {
                for &source in &sources[start..end as usize] {
                    add(y, &results[source as usize]);
                }
                start = end as usize;
            }
        });
    }

    fn bytes(&self) -> usize {
        let of_part = |part: &Part<T>| {
            part.kernel.bytes()
                + size_of_val(part.places.as_slice())
                + size_of_val(part.u.as_slice())
        };
        self.kernels.iter().map(of_part).sum::<usize>()
            + size_of_val(self.results.as_slice())
            + size_of_val(self.sources.as_slice())
            + size_of_val(self.ends.as_slice())
    }

    fn cost(&self, of_one: impl Fn(&dyn Kernel<T>) -> Option<Cost>) -> Option<Cost> {
        // Each part copies its vector and clears its results, both of which are then read again.
        let node = size_of::<Node<T>>();
        let mut sum = Cost::read(size_of_val(self.sources.as_slice()))
            + Cost::read(size_of_val(self.ends.as_slice()))
            + Cost::flops(3 * self.sources.len());
        for part in &self.kernels {
            let nodes = part.places.len();
            sum = sum + of_one(part.kernel.as_ref())?;
            sum = sum + Cost::read(size_of_val(part.places.as_slice()));
            sum = sum + Cost::write(2 * node * nodes) + Cost::read(2 * node * nodes).again();
        }
        Some(sum)
    }
}

/// Calls `work` for each of `parts` with the part of `results` that belongs to it.
fn each_part<T: Real>(
    team: &dyn Team,
    parts: &mut [Part<T>],
    results: &mut [Node<T>],
    work: &(impl Fn(&mut Part<T>, &mut [Node<T>]) + Sync),
) {
    match parts {
        [] => {}
        [part] => work(part, results),
        parts => {
            let (lower, upper) = parts.split_at_mut(parts.len() / 2);
            let nodes = lower.iter().map(|part| part.places.len()).sum();
            let (below, above) = results.split_at_mut(nodes);
            team.join(&mut || each_part(team, lower, below, work), &mut || {
                each_part(team, upper, above, work);
            });
        }
    }
}

/// A set of elements as a stepper computes it: whole or in parts.
#[derive(Debug)]
pub(crate) enum Divided<T> {
    /// All elements as one kernel.
    Whole(Box<dyn Kernel<T>>),
    /// The elements in parts.
    Parts(Parts<T>),
}

impl<T: Real> Divided<T> {
    /// The set of `forms`, each with the places of its nodes, of which there are `count` in all.
    pub(super) fn parts(forms: Vec<(VectorForm, Vec<u32>)>, count: usize) -> Self
    where
        T: Precision,
    {
        Self::Parts(Parts::new(forms, count))
    }

    /// See [`Kernel::linearize`].
    pub(crate) fn linearize(
        &mut self,
        team: &dyn Team,
        d: &[Node<T>],
        force: &mut [Node<T>],
    ) -> f64 {
        match self {
            Self::Whole(kernel) => kernel.linearize(d, force),
            Self::Parts(parts) => {
                parts.add(team, d, force, &|part, force| {
                    part.energy = part.kernel.linearize(&part.u, force);
                });
                parts.kernels.iter().map(|part| part.energy).sum()
            }
        }
    }

    /// See [`Kernel::product`].
    pub(crate) fn product(&mut self, team: &dyn Team, factor: T, u: &[Node<T>], y: &mut [Node<T>]) {
        match self {
            Self::Whole(kernel) => kernel.product(factor, u, y),
            Self::Parts(parts) => parts.add(team, u, y, &|part, y| {
                part.kernel.product(factor, &part.u, y);
            }),
        }
    }

    /// See [`Kernel::tearable`]. A set in parts cannot follow edits.
    pub(crate) fn tearable(&mut self) -> Option<&mut dyn TearableKernel<T>> {
        match self {
            Self::Whole(kernel) => kernel.tearable(),
            Self::Parts(_) => None,
        }
    }

    /// See [`Counted::linearize_cost`](super::kernel::Counted::linearize_cost).
    pub(crate) fn linearize_cost(&self) -> Option<Cost> {
        match self {
            Self::Whole(kernel) => kernel.linearize_cost(),
            Self::Parts(parts) => parts.cost(|kernel| kernel.linearize_cost()),
        }
    }

    /// See [`Counted::product_cost`](super::kernel::Counted::product_cost).
    pub(crate) fn product_cost(&self) -> Option<Cost> {
        match self {
            Self::Whole(kernel) => kernel.product_cost(),
            Self::Parts(parts) => parts.cost(|kernel| kernel.product_cost()),
        }
    }

    /// Memory of the set (bytes).
    pub(crate) fn bytes(&self) -> usize {
        match self {
            Self::Whole(kernel) => kernel.bytes(),
            Self::Parts(parts) => parts.bytes(),
        }
    }
}
