//! Runs the image of a firmware in QEMU, and serves it as a device on a TCP port of this machine:
//! `cargo run --release -p palpate-qemu-board --example board -- IMAGE [PORT]`. `tests/firmware` builds the images.

use devices::transport::Stream;
use emulator::{Listener, Served, serve};
use qemu_board::{Board, Paced};
use std::error::Error;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// Longest time between two requests for bytes of the board.
const PERIOD: Duration = Duration::from_micros(500);
/// Longest time between two checks for a host.
const WAIT: Duration = Duration::from_millis(10);

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let usage = "usage: board IMAGE [PORT]; tests/firmware builds the images";
    let image = arguments.next().ok_or(usage)?;
    let port = arguments.next().map_or(Ok(4000), |port| port.parse());
    let mut listener = Listener::tcp(port.map_err(|error| format!("the port: {error}; {usage}"))?)?;
    let mut board = Board::start(Path::new(&image))?;
    let mut device = Paced::new(Stream::tcp(&board.line().to_string())?);
    // This call finds an image that does not run, before a host comes.
    board.truth()?;
    println!("{}", listener.connection());
    let stop = AtomicBool::new(false);
    loop {
        device.clear();
        if let Some(mut host) = listener.host(WAIT)? {
            // An error is the end of a host. The next one may come.
            let _ = serve(
                &mut device,
                &mut host,
                PERIOD,
                &stop,
                &mut Served::default(),
            );
        }
    }
}
