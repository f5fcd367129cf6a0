//! Solves with a large factor in parts of its elimination tree, which several cores compute at once.
//!
//! The columns of a factor form a tree (see `supernodes`). Columns in separate subtrees do not depend on each other. A
//! large factor is cut into **forests** and the **top**. A forest consists of whole subtrees, and the top of the columns
//! above them. The forward pass
//! goes through all forests at once and then through the top, the backward pass through the top and then through all
//! forests (for instance A. Gupta and V. Kumar, "Parallel algorithms for forward elimination and backward substitution
//! in direct solution of sparse linear systems", 1995). The supernodes of the top are taken level by level of their
//! tree. The panels of a level are computed at once, and a large panel in groups of columns.
//!
//! A forest works on a copy of its places and on sums of its own for the places of the top. The top adds these sums in
//! the order of the forests. The cut depends on the factor alone, so the result is the same for any number of threads.
//!
//! The backward pass begins where the forward pass ended, so that one thread finds the panels that it read last in the
//! cache.

use super::packed::{self, Packed, Slice, lines, lines_of};
use super::supernodes::{Supernode, Supernodes};
use super::sweep::{self, LANES, Work, add_below, clear_padding, column_blocks, strips};
use crate::lanes::{Node, add};
use crate::team::{self, Team};
use core::ops::Range;

/// Factors with fewer cache lines in f32 are not cut: 4 MiB. A solve takes about a tenth of a millisecond there.
const LEAST: usize = 65_536;

/// A forest has at most the total over this number. More and smaller forests take one thread
/// some hundredths longer.
const FORESTS: usize = 8;

/// Cache lines of a group of columns: 128 KiB, some microseconds. Smaller groups take one thread some
/// hundredths longer.
const GROUP: usize = 2048;

/// Supernodes with places and rows of their own.
#[derive(Clone, Debug)]
struct Forest {
    /// The supernodes. Their places are numbered from zero, and places of the top follow.
    supernodes: Supernodes,
    /// The places of the factor.
    own: Range<usize>,
    /// The place in the top of each further place.
    outer: Vec<u32>,
    /// The cache lines of the panels.
    lines: Range<usize>,
    r: Vec<Node<f32>>,
    work: Work,
}

/// Columns of the panel of a front.
#[derive(Clone, Debug)]
struct Group {
    /// The first column.
    first: usize,
    /// Number of columns, padded.
    count: usize,
    lines: Range<usize>,
    /// The product of these columns.
    rows: Vec<f32>,
}

impl Group {
    /// The first column and the number of columns.
    fn columns(&self) -> (usize, usize) {
        (self.first, self.count)
    }

    fn panel<'a>(&self, packed: &'a Packed) -> Slice<'a> {
        packed.slice(self.lines.clone(), 0..0)
    }
}

/// A supernode of the top.
#[derive(Clone, Debug)]
struct Front {
    /// The supernode, by places of the top.
    block: Supernode,
    /// The places below.
    below: Vec<u32>,
    /// The columns of the factor.
    columns: Range<usize>,
    groups: Vec<Group>,
    work: Work,
}

/// The supernodes above all forests.
#[derive(Clone, Debug)]
struct Top {
    /// The supernodes, level by level. No supernode is below another supernode of its level.
    levels: Vec<Vec<Front>>,
    /// The place of the factor of each place.
    places: Vec<u32>,
    r: Vec<Node<f32>>,
}

/// A large factor in forests.
#[derive(Clone, Debug)]
pub(super) struct Subtrees {
    forests: Vec<Forest>,
    top: Top,
}

/// Room for each of `supernodes`.
fn work(supernodes: &Supernodes) -> Work {
    let most = |size: fn(&Supernode) -> usize| supernodes.blocks.iter().map(size).max();
    Work::new(
        most(|block| 3 * block.width()).unwrap_or(0),
        most(strips).unwrap_or(0),
    )
}

/// The supernodes of the forests, as ranges that ascend; the supernodes in no range are those of the top. `None` for a
/// small factor, or one without separate subtrees.
pub(super) fn cut(supernodes: &Supernodes) -> Option<Vec<Range<usize>>> {
    let blocks = &supernodes.blocks;
    if blocks.iter().map(sweep::lines).sum::<usize>() < LEAST {
        return None;
    }
    let sizes: Vec<usize> = blocks.iter().map(lines).collect();
    let most = sizes.iter().sum::<usize>() / FORESTS;
    // The first supernode, the number of supernodes and the size of each subtree.
    let mut first: Vec<usize> = (0..blocks.len()).collect();
    let mut count = vec![1; blocks.len()];
    let mut size = sizes;
    let parent = |block: &Supernode| {
        let &above = supernodes.below_of(block).first()?;
        Some(blocks.partition_point(|other| other.end <= above))
    };
    let parents: Vec<Option<usize>> = blocks.iter().map(parent).collect();
    for at in 0..blocks.len() {
        if let Some(parent) = parents[at] {
            first[parent] = first[parent].min(first[at]);
            count[parent] += count[at];
            size[parent] += size[at];
        }
    }
    // A subtree can belong to a forest if its supernodes follow each other.
    let small = |at: usize| size[at] <= most && at + 1 - first[at] == count[at];
    let mut ranges: Vec<(Range<usize>, usize)> = Vec::new();
    for at in 0..blocks.len() {
        if !small(at) || parents[at].is_some_and(small) {
            continue;
        }
        match ranges.last_mut() {
            Some((range, sum)) if range.end == first[at] && *sum + size[at] <= most => {
                range.end = at + 1;
                *sum += size[at];
            }
            _ => ranges.push((first[at]..at + 1, size[at])),
        }
    }
    (ranges.len() > 1).then(|| ranges.into_iter().map(|(range, _)| range).collect())
}

impl Forest {
    /// The forest of the supernodes in `range`. `top` gives the place in the top of each place.
    fn new(supernodes: &Supernodes, range: Range<usize>, top: &[u32], start: &[u32]) -> Self {
        let blocks = &supernodes.blocks[range.clone()];
        let first = blocks[0].first;
        let end = blocks[blocks.len() - 1].end;
        let below = || blocks.iter().flat_map(|block| supernodes.below_of(block));
        let mut above: Vec<u32> = below().copied().filter(|&place| place >= end).collect();
        above.sort_unstable();
        above.dedup();
        let local = |&place: &u32| {
            if place < end {
                place - first
            } else {
                end - first + above.partition_point(|&other| other < place) as u32
            }
        };
        let shift = blocks[0].below_start;
        let own = Supernodes {
            blocks: blocks
                .iter()
                .map(|block| Supernode {
                    first: block.first - first,
                    end: block.end - first,
                    below_start: block.below_start - shift,
                    below_end: block.below_end - shift,
                })
                .collect(),
            below: below().map(local).collect(),
        };
        let size: usize = blocks.iter().map(lines).sum();
        let start = start[range.start] as usize;
        Self {
            work: work(&own),
            supernodes: own,
            own: first as usize..end as usize,
            r: vec![[0.0; 4]; (end - first) as usize + above.len()],
            outer: above.iter().map(|&place| top[place as usize]).collect(),
            lines: start..start + size,
        }
    }

    fn panels<'a>(&self, packed: &'a Packed) -> Slice<'a> {
        packed.slice(self.lines.clone(), 3 * self.own.start..3 * self.own.end)
    }

    fn forward(&mut self, packed: &Packed, r: &[Node<f32>]) {
        let (own, outer) = self.r.split_at_mut(self.own.len());
        own.copy_from_slice(&r[self.own.clone()]);
        outer.fill([0.0; 4]);
        let panels = self.panels(packed);
        packed::forward(&self.supernodes, panels, &mut self.work, &mut self.r);
    }

    fn backward(&mut self, packed: &Packed, top: &[Node<f32>], r: &mut [Node<f32>]) {
        let count = self.own.len();
        for (node, &place) in self.r[count..].iter_mut().zip(&self.outer) {
            *node = top[place as usize];
        }
        let panels = self.panels(packed);
        packed::backward(&self.supernodes, panels, &mut self.work, &mut self.r);
        clear_padding(&self.supernodes, &mut self.r);
        r.copy_from_slice(&self.r[..count]);
    }

    fn bytes(&self) -> usize {
        self.supernodes.bytes()
            + size_of_val(self.outer.as_slice())
            + size_of_val(self.r.as_slice())
            + self.work.bytes()
    }
}

impl Front {
    /// The supernode `block` with the places `below`, whose panel begins at the cache line `start`. `place` is its first
    /// place in the factor.
    fn new(block: Supernode, below: Vec<u32>, place: u32, start: usize) -> Self {
        let strips = strips(&block);
        let column = 3 * place as usize;
        let mut groups: Vec<Group> = Vec::new();
        let mut end = start;
        for (first, count) in column_blocks(3 * block.width()) {
            let begun = end;
            end += lines_of((first, count), strips);
            match groups.last_mut() {
                Some(group) if group.lines.len() < GROUP => {
                    group.count += count;
                    group.lines.end = end;
                }
                _ => groups.push(Group {
                    first,
                    count,
                    lines: begun..end,
                    rows: sweep::rows(strips),
                }),
            }
        }
        Self {
            work: Work::new(3 * block.width(), strips),
            columns: column..column + 3 * block.width(),
            block,
            below,
            groups,
        }
    }

    /// Computes the rows of the forward step.
    fn forward(&mut self, team: &dyn Team, packed: &Packed, r: &[Node<f32>]) {
        let scales = packed.slice(0..0, self.columns.clone());
        let (rows, columns) = self.work.parts();
        let rows = &mut rows[..strips(&self.block)];
        scales.begin(&self.block, r, rows, columns);
        let columns = &*columns;
        let strips = rows.len();
        team::each(team, &mut self.groups, &|group| {
            let (panel, columns_of) = (group.panel(packed), group.columns());
            let rows = &mut sweep::aligned(&mut group.rows)[..strips];
            rows.fill([0.0; LANES]);
            packed::forward_columns(panel, columns_of, &columns[columns_of.0..], rows);
        });
        for group in &mut self.groups {
            let part = &sweep::aligned(&mut group.rows)[..strips];
            for (sum, part) in rows.iter_mut().zip(part) {
                for lane in 0..LANES {
                    sum[lane] += part[lane];
                }
            }
        }
        scales.end(rows);
    }

    /// Computes the columns of the backward step.
    fn backward(&mut self, team: &dyn Team, packed: &Packed, r: &[Node<f32>]) {
        let scales = packed.slice(0..0, self.columns.clone());
        let (rows, columns) = self.work.parts();
        // The last number that is collected may be past the last strip.
        scales.collect(&self.block, &self.below, r, rows);
        let rows = &rows[..strips(&self.block)];
        backward(team, &self.groups, packed, rows, columns);
    }

    /// The places of the supernode take the columns.
    fn unpack(&mut self, packed: &Packed, r: &mut [Node<f32>]) {
        let scales = packed.slice(0..0, self.columns.clone());
        let (_, columns) = self.work.parts();
        scales.unpack(&self.block, columns, r);
    }

    fn bytes(&self) -> usize {
        let groups = self.groups.iter();
        let rows = groups.map(|group| size_of::<Group>() + size_of_val(group.rows.as_slice()));
        rows.sum::<usize>() + size_of_val(self.below.as_slice()) + self.work.bytes()
    }
}

/// Sets `x`, the columns of `groups`, to the product of the transposed panel with `rows`.
fn backward(
    team: &dyn Team,
    groups: &[Group],
    packed: &Packed,
    rows: &[[f32; LANES]],
    x: &mut [f32],
) {
    match groups {
        [] => {}
        [group] => {
            packed::backward_columns(group.panel(packed), group.columns(), rows, x);
        }
        groups => {
            let (left, right) = groups.split_at(groups.len() / 2);
            let (low, high) = x.split_at_mut(right[0].first - left[0].first);
            team.join(
                &mut || backward(team, right, packed, rows, high),
                &mut || {
                    backward(team, left, packed, rows, low);
                },
            );
        }
    }
}

impl Top {
    /// The supernodes with these `numbers`. `top` gives the place in the top of each place, `places` the inverse.
    fn new(
        supernodes: &Supernodes,
        numbers: &[usize],
        (top, places): (&[u32], Vec<u32>),
        start: &[u32],
    ) -> Self {
        let mut levels: Vec<Vec<Front>> = Vec::new();
        // The first level that each place allows its supernode.
        let mut least = vec![0_usize; places.len()];
        for &number in numbers {
            let block = &supernodes.blocks[number];
            let first = top[block.first as usize];
            let own = Supernode {
                first,
                end: first + block.end - block.first,
                ..*block
            };
            // All places below a supernode of the top are in the top.
            let below = supernodes.below_of(block).iter();
            let below: Vec<u32> = below.map(|&place| top[place as usize]).collect();
            let places = &least[own.first as usize..own.end as usize];
            let level = places.iter().copied().max().unwrap_or(0);
            for &place in &below {
                let least = &mut least[place as usize];
                *least = (*least).max(level + 1);
            }
            if levels.len() <= level {
                levels.push(Vec::new());
            }
            let start = start[number] as usize;
            levels[level].push(Front::new(own, below, block.first, start));
        }
        Self {
            levels,
            r: vec![[0.0; 4]; places.len()],
            places,
        }
    }

    /// The forward pass.
    fn forward(&mut self, team: &dyn Team, packed: &Packed) {
        for fronts in &mut self.levels {
            let r = &self.r;
            team::each(team, fronts, &|front| front.forward(team, packed, r));
            for front in fronts {
                let (rows, _) = front.work.parts();
                add_below(&front.block, &front.below, rows, &mut self.r);
            }
        }
    }

    /// The backward pass.
    fn backward(&mut self, team: &dyn Team, packed: &Packed) {
        for fronts in self.levels.iter_mut().rev() {
            let r = &self.r;
            team::each_from_last(team, fronts, &|front| front.backward(team, packed, r));
            for front in fronts {
                front.unpack(packed, &mut self.r);
            }
        }
        for node in &mut self.r {
            node[3] = 0.0;
        }
    }

    fn bytes(&self) -> usize {
        self.levels
            .iter()
            .flatten()
            .map(Front::bytes)
            .sum::<usize>()
            + size_of_val(self.places.as_slice())
            + size_of_val(self.r.as_slice())
    }
}

impl Subtrees {
    /// The forests of the supernodes in each of `ranges` (see [`cut`]). The panels of `supernodes` begin at the cache
    /// lines `start`.
    pub(super) fn new(supernodes: &Supernodes, ranges: Vec<Range<usize>>, start: &[u32]) -> Self {
        let blocks = &supernodes.blocks;
        let mut numbers = Vec::new();
        let mut next = 0;
        for range in &ranges {
            numbers.extend(next..range.start);
            next = range.end;
        }
        numbers.extend(next..blocks.len());
        let mut places = Vec::new();
        let count = blocks.last().map_or(0, |block| block.end as usize);
        let mut top = vec![u32::MAX; count];
        for &number in &numbers {
            for place in blocks[number].first..blocks[number].end {
                top[place as usize] = places.len() as u32;
                places.push(place);
            }
        }
        let forest = |range| Forest::new(supernodes, range, &top, start);
        Self {
            forests: ranges.into_iter().map(forest).collect(),
            top: Top::new(supernodes, &numbers, (&top, places), start),
        }
    }

    /// Solves for one right-hand side in place.
    pub(super) fn solve(&mut self, team: &dyn Team, packed: &Packed, r: &mut [Node<f32>]) {
        let before = &*r;
        team::each(team, &mut self.forests, &|forest| {
            forest.forward(packed, before);
        });
        let top = &mut self.top;
        for (node, &place) in top.r.iter_mut().zip(&top.places) {
            *node = r[place as usize];
        }
        for forest in &self.forests {
            for (sum, &place) in forest.r[forest.own.len()..].iter().zip(&forest.outer) {
                add(&mut top.r[place as usize], sum);
            }
        }
        top.forward(team, packed);
        top.backward(team, packed);
        for (node, &place) in top.r.iter().zip(&top.places) {
            r[place as usize] = *node;
        }
        let top = &self.top.r;
        each_forest(team, &mut self.forests, 0, r, &|forest, own| {
            forest.backward(packed, top, own);
        });
    }

    /// Memory of the forests (bytes).
    pub(super) fn bytes(&self) -> usize {
        self.forests.iter().map(Forest::bytes).sum::<usize>() + self.top.bytes()
    }
}

/// Calls `work` for each of `forests`, from the last on, with its places in `r`, which begins at place `first`.
fn each_forest(
    team: &dyn Team,
    forests: &mut [Forest],
    first: usize,
    r: &mut [Node<f32>],
    work: &(impl Fn(&mut Forest, &mut [Node<f32>]) + Sync),
) {
    match forests {
        [] => {}
        [forest] => {
            let own = forest.own.start - first..forest.own.end - first;
            work(forest, &mut r[own]);
        }
        forests => {
            let (lower, upper) = forests.split_at_mut(forests.len() / 2);
            let middle = upper[0].own.start;
            let (below, above) = r.split_at_mut(middle - first);
            team.join(
                &mut || each_forest(team, upper, middle, above, work),
                &mut || each_forest(team, lower, first, below, work),
            );
        }
    }
}
