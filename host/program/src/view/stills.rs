//! Saves a still of a display.

use ::view::terminal::model::Model;
use ::view::web::Picture;
use host::atomic_file::write_atomically;
use host::live::Message;
use host::plot;
use std::path::PathBuf;
use std::time::Instant;

/// The still that `messages` describe, in a form. An error is one line for the person.
pub(super) fn made(messages: &[Message], picture: Picture) -> Result<Vec<u8>, String> {
    let mut model = Model::default();
    for message in messages {
        model.take(message.clone(), Instant::now());
    }
    let shown = model.shown().ok_or("there is no frame yet")?;
    let still = shown.still();
    match picture {
        Picture::Svg => Ok(still.picture().svg().into_bytes()),
        Picture::Png => still.picture().png().map_err(|error| error.to_string()),
        Picture::Csv => Ok(still.vertices_csv().into_bytes()),
    }
}

/// Saves the still in the present folder, as a picture and as a table. Returns a line for the person.
pub(super) fn save(model: &Model) -> String {
    let Some(shown) = model.shown() else {
        return "there is no frame yet".to_owned();
    };
    let still = shown.still();
    let name = format!("still_{:.3}s", shown.frame.time_ns as f64 * 1e-9);
    let [picture, table] = ["png", "csv"].map(|ending| PathBuf::from(format!("{name}.{ending}")));
    let written = plot::write_picture(&picture, &still.picture())
        .and_then(|()| write_atomically(&table, still.vertices_csv().as_bytes()));
    match written {
        Ok(()) => format!("saved {} and {}", picture.display(), table.display()),
        Err(error) => error.to_string(),
    }
}
