//! Tools in a view: where each one's device would lead it, where the surface keeps it, and the force of the surface.

use plotters::prelude::*;

use super::super::ink::Ink;
use super::super::lines;
use super::super::page::{self, Area, Drawn, UNITS};
use super::{Camera, arrow, flat, whole};

/// A tool as it is drawn, in addition to its obstacle.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ToolMark {
    /// The number of the hand that leads it.
    pub hand: usize,
    /// Where the surface keeps its centre (m).
    pub at: [f64; 3],
    /// Where its device would lead its centre (m).
    pub led: [f64; 3],
    /// Points of its shape there (m), of which the outline is drawn.
    pub ghost: Vec<[f64; 3]>,
    /// The force of the surface on it (N).
    pub force: [f64; 3],
    /// The points of the surface among which contacts are looked for (m).
    pub sites: Vec<[f64; 3]>,
}

/// Draws a tool: a dashed outline where its device would lead it, a line from there to where it is, a dot for each site, and an arrow
/// along the force.
pub(super) fn draw(area: &Area, camera: &Camera, tool: &ToolMark, per_newton: f64) -> Drawn {
    let ink = Ink {
        color: page::series_color(tool.hand),
        dash: &[4.0, 3.0],
        width: 1.2,
    };
    let places = tool.ghost.iter().filter_map(|point| camera.place(*point));
    let mut outline: Vec<_> = outline(places.collect()).into_iter().map(whole).collect();
    outline.extend(outline.first().copied());
    if outline.len() > 3 {
        lines::line(area, &outline, ink)?;
    }
    for place in tool.sites.iter().filter_map(|site| camera.place(*site)) {
        for (radius, color) in [(3, WHITE), (2, ink.color)] {
            area.draw(&Circle::new(whole(place), radius * UNITS, color.filled()))?;
        }
    }
    let (Some(at), Some([across, up])) = (camera.place(tool.at), flat(tool.force)) else {
        return Ok(());
    };
    if let Some(led) = camera.place(tool.led) {
        lines::line(area, &[whole(led), whole(at)], ink)?;
    }
    let by = per_newton * f64::from(UNITS);
    arrow(area, at, [at[0] + by * across, at[1] - by * up], page::TEXT)
}

/// The corners of the convex hull of points, in order: the algorithm of Andrew (1979).
fn outline(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let half = |points: &mut dyn Iterator<Item = &[f64; 2]>| {
        let mut chain: Vec<[f64; 2]> = Vec::new();
        for &[x, y] in points {
            while let [.., [ax, ay], [bx, by]] = chain[..]
                && (bx - ax) * (y - ay) <= (by - ay) * (x - ax)
            {
                chain.pop();
            }
            chain.push([x, y]);
        }
        // The last point begins the other half.
        chain.pop();
        chain
    };
    let mut hull = half(&mut points.iter());
    hull.extend(half(&mut points.iter().rev()));
    hull
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_outline_has_the_outer_corners_in_order() {
        let square = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        let inner = [[1.0, 1.0], [1.0, 0.0], [0.5, 1.5], [2.0, 2.0]];
        assert_eq!(outline([square, inner].concat()), square);
        assert_eq!(outline(vec![[1.0, 1.0]]).len(), 0);
        assert_eq!(outline(Vec::new()).len(), 0);
    }
}
