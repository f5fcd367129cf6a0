//! The results of a study that the report quotes: tables, and a picture. `palpate bench` prints, draws and writes them.

use host::plot::Picture;
use serde::Serialize;

/// The results of a study.
pub trait Results: Serialize {
    /// The tables, in Markdown.
    fn tables(&self) -> String;

    /// The picture; `None` for results without one.
    fn picture(&self) -> Option<Picture> {
        None
    }
}
