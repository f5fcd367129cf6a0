//! Colours that people with any colour vision tell apart: Okabe and Ito, *Color Universal Design* (2008).
//!
//! Colour is never the only mark: every curve has a letter, every hand a number and every event a word.

use ratatui::style::{Color, Modifier, Style};

/// The colours that the terminal has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Colours {
    /// None, as `NO_COLOR` asks.
    None,
    /// The eight of a console.
    Console,
    /// The 256 of most terminals.
    #[default]
    Indexed,
    /// All.
    True,
}

impl Colours {
    /// The colours that the variables `NO_COLOR`, `COLORTERM` and `TERM` name.
    pub fn of_environment() -> Self {
        let text =
            |name: &str| std::env::var_os(name).map(|value| value.to_string_lossy().into_owned());
        let (depth, term) = (text("COLORTERM"), text("TERM").unwrap_or_default());
        if text("NO_COLOR").is_some_and(|value| !value.is_empty()) || term == "dumb" {
            Self::None
        } else if matches!(depth.as_deref(), Some("truecolor" | "24bit")) {
            Self::True
        } else if term.contains("256color") || term.starts_with("tmux") {
            Self::Indexed
        } else if matches!(term.as_str(), "linux" | "vt100" | "vt220" | "ansi") {
            Self::Console
        } else {
            Self::Indexed
        }
    }
}

/// Colour by its name in the palette: red, green, blue; the nearest of 256; the nearest of the console.
type Tone = ((u8, u8, u8), u8, Color);

const ORANGE: Tone = ((0xe6, 0x9f, 0x00), 178, Color::Yellow);
const SKY: Tone = ((0x56, 0xb4, 0xe9), 74, Color::LightCyan);
const GREEN: Tone = ((0x00, 0x9e, 0x73), 36, Color::Green);
const YELLOW: Tone = ((0xf0, 0xe4, 0x42), 227, Color::LightYellow);
const BLUE: Tone = ((0x00, 0x72, 0xb2), 32, Color::LightBlue);
const VERMILLION: Tone = ((0xd5, 0x5e, 0x00), 166, Color::LightRed);
const PURPLE: Tone = ((0xcc, 0x79, 0xa7), 175, Color::LightMagenta);

/// The line at the top.
pub(super) const HEAD: Style = Style::new().add_modifier(Modifier::BOLD);

/// The styles of the display.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Palette(pub Colours);

impl Palette {
    fn tone(self, tone: Tone) -> Style {
        let ((red, green, blue), indexed, console) = tone;
        match self.0 {
            Colours::None => Style::new(),
            Colours::Console => Style::new().fg(console),
            Colours::Indexed => Style::new().fg(Color::Indexed(indexed)),
            Colours::True => Style::new().fg(Color::Rgb(red, green, blue)),
        }
    }

    /// A hand, by the index of its device.
    pub(super) fn hand(self, index: usize) -> Style {
        const TONES: [Tone; 8] = [VERMILLION, SKY, GREEN, PURPLE, ORANGE, YELLOW, BLUE, SKY];
        self.tone(TONES[index % TONES.len()])
    }

    /// A component of a position: x, y, z.
    pub(super) fn axis(self, index: usize) -> Style {
        self.tone([VERMILLION, GREEN, SKY][index % 3])
    }

    /// A body.
    pub(super) fn body(self, index: usize) -> Style {
        const TONES: [Tone; 4] = [YELLOW, PURPLE, GREEN, BLUE];
        match index.checked_sub(1) {
            None => Style::new(),
            Some(index) => self.tone(TONES[index % TONES.len()]),
        }
    }

    /// The force of a contact.
    pub(super) fn contact(self) -> Style {
        self.tone(ORANGE)
    }

    /// Titles and names of values.
    pub(super) fn label(self) -> Style {
        self.tone(SKY)
    }

    /// Rules and axes.
    pub(super) fn faint(self) -> Style {
        match self.0 {
            Colours::None => Style::new().add_modifier(Modifier::DIM),
            Colours::Console => Style::new().fg(Color::DarkGray),
            Colours::Indexed | Colours::True => Style::new().fg(Color::Indexed(243)),
        }
    }

    /// A value that needs attention.
    pub(super) fn alarm(self) -> Style {
        self.tone(VERMILLION)
            .add_modifier(Modifier::BOLD | Modifier::REVERSED)
    }

    /// Bars of a histogram.
    pub(super) fn bar(self) -> Style {
        self.tone(ORANGE)
    }
}
