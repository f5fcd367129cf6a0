//! Serves the page with the synthetic sheet, for the tests of the page and for its development.
//!
//! ```sh
//! cargo run -p palpate-view --example serve_synthetic -- [--port PORT] [--edge VERTICES] [--log] [--stall-after FRAMES]
//! ```

mod paced;

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use view::web::{Options, Picture, serve};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (mut port, mut edge, mut log, mut left) = (0, 21, false, u64::MAX);
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut number = || arguments.next().unwrap_or_default().parse::<u64>();
        match argument.as_str() {
            "--port" => port = number()? as u16,
            "--edge" => edge = number()? as u32,
            "--stall-after" => left = number()?,
            "--log" => log = true,
            other => return Err(format!("the argument {other} is unknown").into()),
        }
    }
    let options = Options {
        port,
        say: Arc::new(|line| println!("{line}")),
        draw: Arc::new(|_, picture| match picture {
            Picture::Csv => Ok(b"time_s\n0\n".to_vec()),
            _ => Err("The synthetic feed has no picture.".into()),
        }),
        stop: Arc::new(AtomicBool::new(false)),
    };
    let feed = paced::Paced::new(edge, log, left);
    serve(Box::new(feed), &options)?;
    Ok(())
}
