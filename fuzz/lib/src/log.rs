//! Logs, and the messages from a run to its viewer: any bytes, no panic.

use host::live::Message;
use std::io::Cursor;
use std::time::Duration;
use view::feed::{Command, Feed};
use view::playback::Player;

/// Reads a log, whole or cut. Returns the number of its ticks.
pub fn read(bytes: &[u8]) -> usize {
    host::log::read_log(bytes).map_or(0, |rows| rows.len())
}

/// Reads a message of a stream, and writes it again. Returns one if the bytes are a message.
pub fn message(bytes: &[u8]) -> usize {
    let Ok(message) = Message::decode(bytes) else {
        return 0;
    };
    let mut again = Vec::new();
    message.encode(&mut again);
    1
}

/// Opens a log and plays it with every kind of command. Returns one if the log could be opened.
pub fn play(bytes: &[u8]) -> usize {
    let Ok(mut player) = Player::of(Cursor::new(bytes), "run.mcap", |_| ()) else {
        return 0;
    };
    let commands = [
        Command::Speed { factor: 3.0 },
        Command::Seek { time_ns: 2_000_000 },
        Command::Play,
        Command::Next,
        Command::Previous,
        Command::Step { ticks: 1 },
        Command::Step { ticks: -1 },
        Command::Step { ticks: 1 << 40 },
        Command::Seek { time_ns: u64::MAX },
        Command::Play,
    ];
    for command in &commands {
        player.command(command);
        player.advance(Duration::from_millis(20));
        let _ = player.present();
        // After an error the player has no further messages.
        while let Ok(Some(_)) = player.take() {}
    }
    1
}
