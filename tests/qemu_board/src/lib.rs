//! Real firmware in QEMU: [`Board`] runs the images of `firmware_proto/board`, and [`Paced`] makes an emulator of the line
//! of a board.
#![forbid(unsafe_code)]

pub mod board;
pub mod paced;

pub use board::{Board, BoardError, Truth};
pub use paced::Paced;
