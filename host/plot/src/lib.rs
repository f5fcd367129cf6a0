//! Pictures of runs and of benchmarks. A picture is drawn once, and written as SVG or PNG.

pub mod atomic_file;
mod axis;
mod chart;
mod collisions;
mod direction;
mod file;
mod font;
mod force_displacement;
mod ink;
mod lines;
mod map;
mod page;
mod panels;
mod picture;
mod png;
mod reduce;
mod run;
mod still;
mod view;

pub use axis::Scale;
pub use chart::{Series, line_chart};
pub use collisions::collisions;
pub use direction::Component;
pub use file::write_picture;
pub use force_displacement::{LoadCurve, force_displacement};
pub use ink::Role;
pub use map::{Map, MapCell, MapLine, MapPanel, map};
pub use page::Marker;
pub use panels::{Panel, panels};
pub use picture::Picture;
pub use run::{Cause, DeviceSeries, Mark, PlotData, force_and_position};
pub use still::{Ribbons, StillPicture, still};
pub use view::{HandMark, Obstacle, Shape, ToolMark};

#[cfg(test)]
mod tests;
