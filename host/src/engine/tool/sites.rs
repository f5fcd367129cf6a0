//! The sites of a patch: the vertices of a surface that stand for the others.
//!
//! Where the surface near the tool has more vertices than a patch has sites, the sites are some of the vertices, the denser the
//! nearer their triangles are to the tool. Each other vertex belongs to the nearest site, and its force counts at the site (vertex clustering: Rossignac
//! and Borrel, "Multi-resolution 3D approximations for rendering complex scenes", 1993). A vertex that was a site stays one while
//! it is near.

use super::near::{Near, Vertex};
use physics::Vec3;
use rt_core::hull::Hull;
use rt_core::tool::MAX_SITES;

/// The scale of the distances between sites in the first trial, by how much it is larger in each next one while there are too many
/// sites, and where the trials end.
const LEAST: f64 = 0.1;
const FURTHER: f64 = 1.1;
const LARGEST: f64 = 1e6;
/// The distance from the surface, as a fraction of the size of the tool, within which sites are equally dense.
const FINEST: f64 = 0.25;

/// How the sites lie around a tool.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spread {
    /// The largest distance of the surface of the tool from its centre (m).
    size: f64,
    /// How much denser the sites are across a slender tool than along it. Sites in one line have no triangles between them.
    across: f64,
}

impl Spread {
    pub(super) fn of(hull: &Hull, radius: f64) -> Self {
        let corners = hull.corners().iter();
        let longest = corners.max_by(|a, b| a.norm().total_cmp(&b.norm()));
        let along = longest.and_then(|corner| corner.try_normalize(0.0));
        let along = along.unwrap_or_default();
        let aside = |corner: &Vec3| (corner - along * along.dot(corner)).norm();
        let width = hull.corners().iter().map(aside).fold(0.0, f64::max);
        let size = hull.extent() + radius;
        Self {
            size,
            across: (size / (width + radius)).sqrt(),
        }
    }

    /// Whether both vertices can be sites, of which `far` is the later choice. `nearest` is the distance of the surface (m).
    fn is_apart(&self, far: &Near, other: &Near, scale: f64, nearest: f64) -> bool {
        let along = far.on_tool - other.on_tool;
        let across = (far.place - other.place - along) * self.across;
        let least = scale * (far.surface - nearest + FINEST * self.size);
        along.norm_squared() + across.norm_squared() > least * least
    }

    /// Chooses the sites among the vertices near the tool, and the site of each other vertex. A vertex that was a site keeps its slot.
    pub(super) fn choose(&self, vertices: &mut [Near], slots: &mut [Option<Vertex>; MAX_SITES]) {
        let sites = self.chosen(vertices, slots);
        let former = core::mem::replace(slots, [None; MAX_SITES]);
        let mut of_slot = [None; MAX_SITES];
        let mut new: Vec<usize> = Vec::new();
        for site in sites {
            let vertex = Some(vertices[site].vertex);
            match former.iter().position(|slot| *slot == vertex) {
                Some(slot) => (slots[slot], of_slot[slot]) = (vertex, Some(site)),
                None => new.push(site),
            }
        }
        for site in new {
            if let Some(slot) = slots.iter().position(Option::is_none) {
                (slots[slot], of_slot[slot]) = (Some(vertices[site].vertex), Some(site));
            }
        }
        let centres = of_slot.map(|site| site.map(|site| vertices[site]));
        for near in vertices {
            let each = centres.iter().enumerate();
            let same = each.filter_map(|(slot, centre)| {
                let centre = centre.filter(|centre| centre.vertex.side == near.vertex.side)?;
                Some((slot, (centre.place - near.place).norm_squared()))
            });
            let nearest = same.min_by(|a, b| a.1.total_cmp(&b.1));
            near.site = nearest.map_or(0, |(slot, _)| slot);
        }
    }

    /// The vertices that become sites: former sites first, then the nearest ones. Each body and obstacle near the
    /// tool has a site, unless there are more of them than sites.
    fn chosen(&self, vertices: &[Near], former: &[Option<Vertex>; MAX_SITES]) -> Vec<usize> {
        let mut order: Vec<usize> = (0..vertices.len()).collect();
        if order.len() <= MAX_SITES {
            return order;
        }
        let is_kept = |near: &Near| former.contains(&Some(near.vertex));
        order.sort_by(|a, b| {
            let [a, b] = [*a, *b].map(|at| &vertices[at]);
            let by_kept = is_kept(b).cmp(&is_kept(a));
            let by_surface = by_kept.then(a.surface.total_cmp(&b.surface));
            by_surface.then(a.distance.total_cmp(&b.distance))
        });
        let each = vertices.iter().map(|near| near.surface);
        let nearest = each.fold(f64::INFINITY, f64::min);
        let (mut scale, mut sites) = (LEAST, Vec::new());
        loop {
            sites.clear();
            for at in &order {
                let near = &vertices[*at];
                let mut others = sites.iter().map(|site: &usize| &vertices[*site]);
                let is_new = others.all(|other| {
                    other.vertex.side != near.vertex.side
                        || self.is_apart(near, other, scale, nearest)
                });
                if is_new {
                    sites.push(*at);
                }
                if sites.len() > MAX_SITES {
                    break;
                }
            }
            if sites.len() <= MAX_SITES || scale > LARGEST {
                sites.truncate(MAX_SITES);
                return sites;
            }
            scale *= FURTHER;
        }
    }
}
