//! The keys.

use super::body::Camera;
use super::model::Model;
use crate::feed::Command;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};

/// A view of the model in the display.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tab {
    /// The most important facts.
    #[default]
    Overview,
    /// The bodies.
    Body,
    /// The curves.
    Charts,
    /// Histograms and the host.
    Timing,
    /// The list of events.
    Events,
}

impl Tab {
    /// All, with their names, in the order of their keys.
    pub const ALL: [(Self, &str); 5] = [
        (Self::Overview, "overview"),
        (Self::Body, "body"),
        (Self::Charts, "charts"),
        (Self::Timing, "timing"),
        (Self::Events, "events"),
    ];
}

/// The state of the display itself.
#[derive(Clone, Debug, Default)]
pub struct View {
    /// The view that is shown.
    pub tab: Tab,
    /// The viewpoint of the bodies.
    pub camera: Camera,
    /// Whether surfaces are drawn as the edges of their triangles.
    pub wire: bool,
    /// Whether the forces of contacts are drawn.
    pub contacts: bool,
    /// Whether the clusters of contact are drawn in colour.
    pub clusters: bool,
    /// Whether the list of keys is shown.
    pub help: bool,
    /// The first chart, and the first event, that is shown.
    pub scroll: usize,
    /// A line for the person, such as the name of a saved file.
    pub notice: Option<String>,
    /// The model at the moment at which the person stopped the display.
    pub stopped: Option<Box<Model>>,
    /// Whether the display waits for a run, and for the next run after its end.
    pub waits: bool,
    /// Whether the operator of the run sits here: keys arm and stop the devices.
    pub operates: bool,
}

/// An order of the operator to all devices of the run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Stop the force, until the devices are armed again.
    Stop,
    /// Arm the devices.
    Arm,
    /// Let simulated hands take hold with their tools, and the next time let go.
    Take,
}

/// The request of a key beyond a change of the view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Wish {
    /// Nothing.
    None,
    /// End the display.
    Quit,
    /// A command for the feed.
    Command(Command),
    /// Save a still of the display.
    Save,
    /// Pass an order to the run.
    Order(Order),
    /// Draw the whole screen again.
    Redraw,
}

/// Angle of one press (rad).
const TURN: f64 = std::f64::consts::PI / 24.0;

/// Follows a key.
pub fn follow(key: &KeyEvent, view: &mut View, model: &Model) -> Wish {
    if key.kind == KeyEventKind::Release {
        return Wish::None;
    }
    view.notice = None;
    let control = key.modifiers.contains(KeyModifiers::CONTROL);
    let shift = key.modifiers.contains(KeyModifiers::SHIFT);
    match key.code {
        KeyCode::Char('c') if control => return Wish::Quit,
        KeyCode::Char('l') if control => return Wish::Redraw,
        KeyCode::Char(_) if control => return Wish::None,
        // Before all other keys: whatever the display shows, the force ends.
        KeyCode::Enter | KeyCode::Char(' ') if view.operates => return Wish::Order(Order::Stop),
        KeyCode::Char('a') if view.operates => return Wish::Order(Order::Arm),
        KeyCode::Char('t') if view.operates => return Wish::Order(Order::Take),
        KeyCode::Char('q') => return Wish::Quit,
        KeyCode::Esc if view.help => view.help = false,
        KeyCode::Char('h' | '?') | KeyCode::F(1) => view.help = !view.help,
        KeyCode::Char('s') => return Wish::Save,
        KeyCode::Char('w') => view.wire = !view.wire,
        KeyCode::Char('c') => view.contacts = !view.contacts,
        KeyCode::Char('k') => view.clusters = !view.clusters,
        KeyCode::Char('r') => view.camera = Camera::default(),
        KeyCode::Char('+' | '=') => view.camera.magnify(1.25),
        KeyCode::Char('-' | '_') => view.camera.magnify(0.8),
        KeyCode::Char(digit @ '1'..='5') => {
            let index = digit as usize - '1' as usize;
            view.tab = Tab::ALL[index].0;
            view.scroll = 0;
        }
        KeyCode::Tab => view.scroll = view.scroll.saturating_add(1),
        KeyCode::BackTab => view.scroll = view.scroll.saturating_sub(1),
        KeyCode::PageDown => view.scroll = view.scroll.saturating_add(10),
        KeyCode::PageUp => view.scroll = view.scroll.saturating_sub(10),
        KeyCode::Up => view.camera.turn(0.0, TURN),
        KeyCode::Down => view.camera.turn(0.0, -TURN),
        KeyCode::Left if !shift => view.camera.turn(TURN, 0.0),
        KeyCode::Right if !shift => view.camera.turn(-TURN, 0.0),
        _ if model.is_log() => return playback(key.code, model),
        KeyCode::Char('p' | ' ') => {
            view.stopped = match view.stopped.take() {
                None => Some(Box::new(model.clone())),
                Some(_) => None,
            };
        }
        _ => {}
    }
    Wish::None
}

/// The keys that move through a log.
fn playback(code: KeyCode, model: &Model) -> Wish {
    const SECOND: i64 = 1_000_000_000;
    let Some(playback) = &model.playback else {
        return Wish::None;
    };
    let at = |offset: i64| Command::Seek {
        time_ns: playback
            .at_ns
            .saturating_add_signed(offset)
            .clamp(playback.from_ns, playback.to_ns.max(playback.from_ns)),
    };
    let faster = |factor: f64| Command::Speed {
        factor: (playback.speed * factor).clamp(0.001, 100.0),
    };
    Wish::Command(match code {
        KeyCode::Char(' ' | 'p') if playback.playing => Command::Pause,
        KeyCode::Char(' ' | 'p') => Command::Play,
        KeyCode::Char('.') => Command::Step { ticks: 1 },
        KeyCode::Char(',') => Command::Step { ticks: -1 },
        KeyCode::Char(']') => Command::Step { ticks: 100 },
        KeyCode::Char('[') => Command::Step { ticks: -100 },
        KeyCode::Char('}') | KeyCode::Right => at(SECOND),
        KeyCode::Char('{') | KeyCode::Left => at(-SECOND),
        KeyCode::Char('n') => Command::Next,
        KeyCode::Char('N') => Command::Previous,
        KeyCode::Char('>') => faster(2.0),
        KeyCode::Char('<') => faster(0.5),
        KeyCode::Home => at(i64::MIN),
        KeyCode::End => at(i64::MAX),
        _ => return Wish::None,
    })
}

/// The list of keys, for a run and for a log. `operates`: the operator of the run sits here.
pub(super) fn help(log: bool, operates: bool) -> Vec<(&'static str, &'static str)> {
    let mut keys = Vec::new();
    if operates {
        keys.extend([
            ("Enter, space", "STOP the force of all devices"),
            ("a", "arm the devices"),
            ("t", "simulated hands take hold by their tools, or let go"),
        ]);
    }
    keys.extend([
        ("1 2 3 4 5", "overview, body, charts, timing, events"),
        ("arrows", "rotate the bodies"),
        ("+  -  r", "larger, smaller, reset the picture"),
        ("w", "surfaces shaded, or as wire"),
        ("c", "show or hide the forces of contacts"),
        ("k", "show or hide the clusters of contact"),
        (
            "Tab, PgDn",
            "scroll charts or events; back: Shift-Tab, PgUp",
        ),
        ("s", "save the shown moment"),
        ("h", "show or hide this list"),
    ]);
    if log {
        keys.extend([
            ("space", "play or pause"),
            (",  .", "one tick back, forward"),
            ("[  ]", "100 ticks back, forward"),
            ("{  }", "1 s back, forward; also Shift with an arrow"),
            ("N  n", "previous, next event"),
            ("<  >", "half, double speed"),
            ("Home End", "first, last tick"),
            ("q", "quit"),
        ]);
    } else {
        keys.extend([
            ("p", "stop or continue the display; the run goes on"),
            ("q", "quit the display; the run goes on"),
        ]);
    }
    keys
}
