//! The display of computed feeds, in cells.

use super::chart::{Window, columns};
use super::draw::{cells, draw};
use super::keys::{Order, Tab, View, Wish, follow};
use super::lines::lines;
use super::model::{Model, Over};
use super::palette::{Colours, Palette};
use super::{Ended, Options, collect, picture};
use crate::feed::{Command, Feed, FeedError};
use fuzz_rules::synthetic::Synthetic;
use host::live::{
    Bins, BodyState, Event, EventKind, Folded, Frame, HandState, Hello, Message, Playback, Range,
    Source, Vertices,
};
use host::record::Surface;
use proptest::prelude::*;
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use std::time::{Duration, Instant};

const SIZES: [(u16, u16); 4] = [(80, 24), (100, 30), (120, 40), (200, 60)];

/// Messages as a feed.
struct Given<I>(I);

impl<I: Iterator<Item = Message> + Send> Feed for Given<I> {
    fn next(&mut self, _wait: Duration) -> Result<Option<Message>, FeedError> {
        Ok(self.0.next())
    }

    fn command(&mut self, _command: &Command) {}

    fn present(&self) -> Vec<Message> {
        Vec::new()
    }
}

fn synthetic(frames: u64) -> Model {
    collect(&mut Given(Synthetic::new(frames).messages())).unwrap()
}

fn on(tab: Tab) -> View {
    View {
        tab,
        ..View::default()
    }
}

fn shown(model: &Model, view: &View, (width, height): (u16, u16)) -> String {
    picture::text(&cells(width, height, model, view, Palette::default()))
}

fn press(code: KeyCode, view: &mut View, model: &Model) -> Wish {
    follow(&KeyEvent::new(code, KeyModifiers::NONE), view, model)
}

#[test]
fn the_numbers_are_those_of_the_frame_at_every_size() {
    let model = synthetic(300);
    let frame = model.frame.as_ref().unwrap();
    assert_eq!((frame.totals.ticks, frame.totals.missed), (4800, 4));
    for size in SIZES {
        let text = shown(&model, &View::default(), size);
        let norm = frame.hands[0]
            .force
            .iter()
            .map(|f| f * f)
            .sum::<f64>()
            .sqrt();
        let force = format!("{norm:.2} N");
        for expected in [
            "synthetic",
            "real clock",
            "capped",
            "4.799 s",
            "0 dropped",
            "4,800",
            "1000.0 Hz",
            "missed 4",
            "p50 12.0 µs",
            "p99 40.0 µs",
            "max 150 µs",
            "age 6.00 ms",
            "trust 1.00",
            "live",
            "250.0 Hz of 250",
            "solve 80.0 µs",
            "condense 200 µs",
            "supplied 1.00 mJ",
            "stored 600 µJ",
            "peak 3.00 N",
            &force,
        ] {
            assert!(text.contains(expected), "{size:?}: {expected}\n{text}");
        }
    }
}

#[test]
fn no_label_is_cut_at_any_size() {
    let model = synthetic(300);
    for size in SIZES {
        for (tab, name) in Tab::ALL {
            let text = shown(&model, &on(tab), size);
            assert!(!text.contains('…'), "{size:?} {name}\n{text}");
            let expected: &[&str] = match tab {
                Tab::Overview => &[
                    "sheet",
                    "force 1 left (N)",
                    "lateness of ticks",
                    "events",
                    "state",
                ],
                Tab::Body => &["hands", "bodies", "1 left", "2 right", "arrow to 3.00 N"],
                Tab::Charts => &[
                    "force 1 left (N)",
                    "position 1 left (mm)",
                    "force 2 right (N)",
                    "position 2 right (mm)",
                    "model age sheet (ms)",
                    "energy sheet (mJ)",
                ],
                Tab::Timing => &[
                    "lateness of ticks",
                    "tick time",
                    "lateness (µs)",
                    "╵10 µs",
                    "medians",
                ],
                Tab::Events => &["left: force limited", "2 deadlines", "3.855 s"],
            };
            for label in expected.iter().chain(&["h help  q quit", "5 events"]) {
                assert!(text.contains(label), "{size:?} {name}: {label}\n{text}");
            }
        }
    }
}

#[test]
fn a_small_terminal_gets_one_line_with_the_needed_size() {
    let text = shown(&synthetic(3), &View::default(), (79, 30));
    let lines: Vec<&str> = text
        .lines()
        .filter(|line| !line.trim().is_empty())
        .collect();
    assert_eq!(lines.len(), 1);
    assert!(lines[0].contains("needs 80 x 24 characters, found 79 x 30"));
}

/// Frames of 16 ticks with 1 N; `spike` replaces the greatest value of one frame.
fn flat(frames: u64, spike: Option<(u64, f64)>) -> Model {
    let mut model = Model::default();
    for number in 0..frames {
        let most = spike.map_or(1.0, |(at, force)| if at == number { force } else { 1.0 });
        let folded = Folded {
            first: 16 * number,
            last: 16 * number + 15,
            from_ns: 16_000_000 * number,
            to_ns: 16_000_000 * number + 15_000_000,
            ticks: 16,
            hands: vec![host::live::frame::FoldedHand {
                force_norm: Range { least: 1.0, most },
                ..Default::default()
            }],
            ..Folded::default()
        };
        let frame = Frame {
            number,
            time_ns: folded.to_ns,
            folded,
            hands: vec![HandState::default()],
            ..Frame::default()
        };
        model.take(Message::Frame(Box::new(frame)), Instant::now());
    }
    model
}

#[test]
fn a_spike_of_one_tick_reaches_the_top_of_its_chart() {
    let model = flat(625, Some((400, 5.0)));
    for size in SIZES {
        let buffer = cells(size.0, size.1, &model, &on(Tab::Charts), Palette::default());
        let (title, below) = (2, 2..size.0 / 2);
        // The axis ends at the spike, so that the first row of the chart has the dots of the spike alone.
        let is_dots = |x: u16, y: u16| {
            let symbol = buffer[(x, y)].symbol().chars().next().unwrap();
            ('\u{2801}'..='\u{28ff}').contains(&symbol)
        };
        let columns: Vec<u16> = below.filter(|x| is_dots(*x, title)).collect();
        assert_eq!(columns.len(), 1, "{size:?}\n{}", picture::text(&buffer));
        // 400 of 625 frames are 6.4 of 10 s.
        let inner = f64::from(size.0 / 2 - 9);
        let at = 7.0 + inner * 0.64;
        assert!(
            (f64::from(columns[0]) - at).abs() < 0.05 * inner,
            "{size:?} {columns:?}"
        );
    }
}

#[test]
fn what_is_older_than_the_chart_is_gone() {
    let model = flat(1000, Some((100, 5.0)));
    let window = Window {
        from_ns: 0,
        to_ns: 16_000_000_000,
    };
    let columns = columns(&model.history, window, 50, |piece| {
        piece.hands[0].force_norm
    });
    assert!(
        columns
            .iter()
            .all(|range| range.is_empty() || range.most == 1.0)
    );
}

/// A triangle in the plane z = `height`, which the camera sees from above.
fn triangle(body: u32, height: f32, size: f32) -> Message {
    Message::Surface(Surface {
        body,
        vertices: 3,
        triangle_count: 1,
        rest: vec![-size, -size, height, size, -size, height, 0.0, size, height],
        triangles: vec![0, 1, 2],
        ..Surface::default()
    })
}

#[test]
fn what_lies_behind_is_hidden() {
    let names = ["one", "two"].map(|name| host::live::BodyInfo {
        name: name.into(),
        ..Default::default()
    });
    let scene = |heights: [f32; 2]| {
        let mut model = Model::default();
        let hello = Hello {
            bodies: names.to_vec(),
            ..Hello::default()
        };
        model.take(Message::Hello(Box::new(hello)), Instant::now());
        // The second body covers the first if it is nearer.
        model.take(triangle(0, heights[0], 1.0), Instant::now());
        model.take(triangle(1, heights[1], 2.0), Instant::now());
        model
    };
    for wire in [false, true] {
        let mut view = on(Tab::Body);
        view.wire = wire;
        view.camera.yaw = 0.0;
        view.camera.pitch = std::f64::consts::FRAC_PI_2;
        let palette = Palette(Colours::True);
        let has = |model: &Model, body: usize| {
            let buffer = cells(100, 40, model, &view, palette);
            let style = palette.body(body);
            let dots = |cell: &&ratatui::buffer::Cell| {
                let symbol = cell.symbol().chars().next().unwrap();
                ('\u{2801}'..='\u{28ff}').contains(&symbol)
            };
            let of_body = |cell: &&ratatui::buffer::Cell| {
                cell.fg == style.fg.unwrap_or(ratatui::style::Color::Reset)
            };
            buffer.content.iter().filter(dots).filter(of_body).count()
        };
        let (below, above) = (scene([-0.5, 0.5]), scene([0.5, -0.5]));
        assert_eq!(has(&below, 0), 0, "{wire}");
        assert!(has(&above, 0) > 20 && has(&above, 1) > 20, "{wire}");
    }
}

/// The cells of the picture with dots in this style.
fn dots_of(model: &Model, view: &View, style: ratatui::style::Style) -> usize {
    let buffer = cells(100, 40, model, view, Palette(Colours::True));
    let cells = buffer.content.iter().filter(|cell| {
        let symbol = cell.symbol().chars().next().unwrap();
        ('\u{2801}'..='\u{28ff}').contains(&symbol) && Some(cell.fg) == style.fg
    });
    cells.count()
}

#[test]
fn obstacles_follow_their_poses_and_contacts_are_drawn_if_asked() {
    let mut model = Model::default();
    let hello = Hello {
        bodies: vec![host::live::BodyInfo::default()],
        obstacles: vec![host::live::ObstacleInfo {
            shape: "mesh".into(),
            positions: vec![-1.0, -1.0, 0.0, 1.0, -1.0, 0.0, 0.0, 1.0, 0.0],
            triangles: vec![0, 1, 2],
            ..Default::default()
        }],
        ..Hello::default()
    };
    let frame = |z: f64| {
        Message::Frame(Box::new(Frame {
            obstacles: vec![host::live::ObstacleState {
                pose: [0.0, 0.0, z, 0.0, 0.0, 0.0, 1.0],
                ..Default::default()
            }],
            contacts: vec![host::live::ContactArrow {
                at: [0.0, 0.0, 0.0],
                force: [3.0, 0.0, 0.0],
                depth: 0.0,
            }],
            ..Frame::default()
        }))
    };
    let now = Instant::now();
    model.take(Message::Hello(Box::new(hello)), now);
    model.take(triangle(0, 0.0, 2.0), now);
    let mut view = on(Tab::Body);
    (view.camera.yaw, view.camera.pitch) = (0.0, std::f64::consts::FRAC_PI_2);
    let palette = Palette(Colours::True);
    // The obstacle is above the body, then below it.
    model.take(frame(0.5), now);
    assert!(dots_of(&model, &view, palette.faint()) > 20);
    assert_eq!(dots_of(&model, &view, palette.contact()), 0);
    press(KeyCode::Char('c'), &mut view, &model);
    assert!(dots_of(&model, &view, palette.contact()) > 3);
    model.take(frame(-0.5), now);
    assert_eq!(dots_of(&model, &view, palette.faint()), 0);
}

#[test]
fn a_tool_has_the_points_it_may_touch_its_force_and_a_line_to_its_hand() {
    let mut model = Model::default();
    let hello = Hello {
        bodies: vec![host::live::BodyInfo::default()],
        obstacles: vec![host::live::ObstacleInfo::default(); 2],
        // The tool of the second device is the second obstacle.
        tools: vec![host::live::ToolInfo {
            device: 1,
            obstacle: 1,
        }],
        ..Hello::default()
    };
    let hand = |x: f64| HandState {
        position: [x, 0.0, 0.0],
        ..Default::default()
    };
    let frame = |led: f64, force: f64, sites: Vec<[f32; 3]>| {
        let pose = |x: f64| [x, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        let state = |x: f64| host::live::ObstacleState {
            pose: pose(x),
            ..Default::default()
        };
        Message::Frame(Box::new(Frame {
            hands: vec![hand(-1.0), hand(1.0)],
            obstacles: vec![state(-1.0), state(0.0)],
            tools: vec![host::live::ToolState {
                device: 1,
                led: pose(led),
                force: [0.0, force, 0.0],
                sites,
                ..Default::default()
            }],
            ..Frame::default()
        }))
    };
    let now = Instant::now();
    model.take(Message::Hello(Box::new(hello)), now);
    let mut view = on(Tab::Body);
    (view.camera.yaw, view.camera.pitch) = (0.0, std::f64::consts::FRAC_PI_2);
    let palette = Palette(Colours::True);
    let mut drawn = |led: f64, force: f64, sites: Vec<[f32; 3]>| {
        model.take(frame(led, force, sites), now);
        [palette.hand(1), palette.hand(0)].map(|style| dots_of(&model, &view, style))
    };
    let [alone, other] = drawn(0.0, 0.0, Vec::new());
    // The line is half of the way between the hands, and the force is an arrow.
    let [lined, _] = drawn(1.0, 0.0, Vec::new());
    assert!(lined > alone + 15, "{lined} {alone}");
    let [forced, _] = drawn(0.0, 2.0, Vec::new());
    assert!(forced > alone + 3, "{forced} {alone}");
    let sites = vec![[0.3, 0.0, 0.0], [-0.3, 0.0, 0.0], [f32::NAN, 0.0, 0.0]];
    assert_eq!(drawn(0.0, 0.0, sites), [alone + 2, other]);
}

#[test]
fn clusters_have_a_colour_and_a_border_each_if_asked() {
    let mut model = Model::default();
    let hello = Hello {
        bodies: vec![host::live::BodyInfo {
            clusters: vec![0, 1, 1, 1],
            ..Default::default()
        }],
        ..Hello::default()
    };
    let sheet = Message::Surface(Surface {
        body: 0,
        vertices: 4,
        triangle_count: 2,
        // No square: its diagonal would be a line of the shade's pattern.
        rest: vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.6, 0.0, 1.0, 0.6, 0.0],
        triangles: vec![0, 1, 2, 3, 2, 1],
        ..Surface::default()
    });
    let now = Instant::now();
    model.take(Message::Hello(Box::new(hello)), now);
    model.take(sheet, now);
    let palette = Palette(Colours::True);
    for wire in [false, true] {
        let mut view = on(Tab::Body);
        (view.camera.yaw, view.camera.pitch) = (0.0, std::f64::consts::FRAC_PI_2);
        view.wire = wire;
        let dots = |view: &View| [0, 1].map(|cluster| dots_of(&model, view, palette.hand(cluster)));
        // The axes in the corner have these colours, too.
        let (without, axes) = (plain(&model, &view), dots(&view));
        assert!(axes.iter().all(|dots| *dots < 5), "{wire}");
        press(KeyCode::Char('k'), &mut view, &model);
        assert!(dots(&view).iter().all(|dots| *dots > 25), "{wire}");
        // Of a flat surface the border of the clusters is the only line inside, and an edge already has that line.
        assert_eq!(plain(&model, &view) == without, wire);
        press(KeyCode::Char('k'), &mut view, &model);
        assert_eq!(dots(&view), axes, "{wire}");
    }
}

/// The display without colours.
fn plain(model: &Model, view: &View) -> String {
    let buffer = cells(100, 40, model, view, Palette(Colours::None));
    buffer
        .content
        .iter()
        .map(ratatui::buffer::Cell::symbol)
        .collect()
}

#[test]
fn keys_turn_magnify_and_reset_the_picture() {
    let model = synthetic(10);
    let mut view = on(Tab::Body);
    let first = shown(&model, &view, (80, 24));
    for code in [
        KeyCode::Left,
        KeyCode::Up,
        KeyCode::Char('+'),
        KeyCode::Char('w'),
    ] {
        let before = shown(&model, &view, (80, 24));
        assert_eq!(press(code, &mut view, &model), Wish::None);
        assert_ne!(shown(&model, &view, (80, 24)), before, "{code:?}");
    }
    press(KeyCode::Char('w'), &mut view, &model);
    press(KeyCode::Char('r'), &mut view, &model);
    assert_eq!(shown(&model, &view, (80, 24)), first);
    assert_eq!(press(KeyCode::Char('q'), &mut view, &model), Wish::Quit);
    assert_eq!(press(KeyCode::Char('s'), &mut view, &model), Wish::Save);
}

#[test]
fn keys_are_orders_only_where_the_operator_sits() {
    let model = synthetic(10);
    let orders = [
        (KeyCode::Enter, Order::Stop),
        (KeyCode::Char(' '), Order::Stop),
        (KeyCode::Char('a'), Order::Arm),
        (KeyCode::Char('t'), Order::Take),
    ];
    for (code, order) in orders {
        let mut view = View::default();
        assert_eq!(press(code, &mut view, &model), Wish::None, "{code:?}");
        view.operates = true;
        // Whatever is shown, and however often.
        for help in [false, true, true] {
            view.help = help;
            assert_eq!(
                press(code, &mut view, &model),
                Wish::Order(order),
                "{code:?}"
            );
        }
    }
    let view = View {
        operates: true,
        help: true,
        ..View::default()
    };
    let text = shown(&model, &view, (80, 24));
    assert!(
        text.contains("STOP the force") && text.contains("Enter stops  h help"),
        "{text}"
    );
    assert!(!shown(&model, &View::default(), (80, 24)).contains("Enter stops"));
}

#[test]
fn a_stopped_display_stays_while_the_run_goes_on() {
    let mut model = synthetic(10);
    let mut view = View::default();
    press(KeyCode::Char('p'), &mut view, &model);
    let stopped = shown(&model, &view, (80, 24));
    assert!(stopped.contains("the display is stopped"));
    for message in Synthetic::new(400).messages().take(2 + 400) {
        model.take(message, Instant::now());
    }
    let age = |text: &str| text.lines().skip(1).map(String::from).collect::<Vec<_>>();
    assert_eq!(age(&shown(&model, &view, (80, 24))), age(&stopped));
    press(KeyCode::Char('p'), &mut view, &model);
    assert!(shown(&model, &view, (80, 24)).contains("6.399 s"));
}

fn log() -> Model {
    let mut model = Model::default();
    let hello = Hello {
        source: Source::Log,
        file: "/tmp/run.mcap".into(),
        scene: "stretch".into(),
        clock: "virtual".into(),
        ..Hello::default()
    };
    model.take(Message::Hello(Box::new(hello)), Instant::now());
    let playback = Playback {
        playing: true,
        speed: 0.5,
        from_ns: 0,
        to_ns: 4_000_000_000,
        at_ns: 2_500_000_000,
        tick: 2500,
        complete: true,
        events: vec![Event {
            kind: EventKind::Trip,
            tick: 1000,
            time_ns: 1_000_000_000,
            text: "left: force limited".into(),
        }],
        ..Playback::default()
    };
    model.take(Message::Playback(Box::new(playback)), Instant::now());
    model
}

#[test]
fn the_keys_of_a_log_move_through_it() {
    let (model, mut view) = (log(), View::default());
    let seek = |time_ns| Wish::Command(Command::Seek { time_ns });
    for (code, wish) in [
        (KeyCode::Char(' '), Wish::Command(Command::Pause)),
        (
            KeyCode::Char('.'),
            Wish::Command(Command::Step { ticks: 1 }),
        ),
        (
            KeyCode::Char('['),
            Wish::Command(Command::Step { ticks: -100 }),
        ),
        (KeyCode::Char('}'), seek(3_500_000_000)),
        (KeyCode::Char('{'), seek(1_500_000_000)),
        (KeyCode::Home, seek(0)),
        (KeyCode::End, seek(4_000_000_000)),
        (KeyCode::Char('n'), Wish::Command(Command::Next)),
        (KeyCode::Char('N'), Wish::Command(Command::Previous)),
        (
            KeyCode::Char('>'),
            Wish::Command(Command::Speed { factor: 1.0 }),
        ),
    ] {
        assert_eq!(press(code, &mut view, &model), wish, "{code:?}");
    }
    let right = KeyEvent::new(KeyCode::Right, KeyModifiers::SHIFT);
    assert_eq!(follow(&right, &mut view, &model), seek(3_500_000_000));
    let text = shown(&model, &view, (80, 24));
    for expected in [
        "log run.mcap",
        "▶ plays at 0.50 x",
        "2.500 s of 4.000 s",
        "tick 2500",
    ] {
        assert!(text.contains(expected), "{expected}\n{text}");
    }
    // The letter of the event stands at a quarter of the line.
    let line: Vec<char> = text.lines().nth(22).unwrap().chars().collect();
    assert_eq!(line[20], 'T');
}

#[test]
fn the_times_of_a_log_say_that_they_are_those_of_the_whole_log() {
    let (run, mut model) = (synthetic(300), log());
    let frame = run.frame.clone().unwrap();
    model.take(Message::Frame(Box::new(frame)), Instant::now());
    let times = |model: &Model| {
        let text = shown(model, &View::default(), (200, 60));
        text.matches("whole log:").count()
    };
    // Lateness, tick time, and the age of the models of one body.
    assert_eq!((times(&run), times(&model)), (0, 3));
}

#[test]
fn a_message_of_playback_without_lists_keeps_the_lists() {
    let mut model = log();
    let playback = Playback {
        at_ns: 1,
        ..Playback::default()
    };
    model.take(Message::Playback(Box::new(playback)), Instant::now());
    assert_eq!(model.playback.as_ref().unwrap().events.len(), 1);
    assert_eq!(model.playback.as_ref().unwrap().at_ns, 1);
}

#[test]
fn the_help_lists_the_keys() {
    for (model, expected) in [(synthetic(1), "the run goes on"), (log(), "double speed")] {
        let mut view = View::default();
        press(KeyCode::Char('h'), &mut view, &model);
        let text = shown(&model, &view, (80, 24));
        assert!(
            text.contains(expected) && text.contains("rotate the bodies"),
            "{text}"
        );
    }
}

#[test]
fn the_end_and_its_reason_stay_on_the_screen() {
    let mut model = synthetic(10);
    model.take(Message::End(String::new()), Instant::now());
    assert!(shown(&model, &View::default(), (80, 24)).contains("the run is over; q quits"));
    let waiting = View {
        waits: true,
        ..View::default()
    };
    assert!(shown(&model, &waiting, (80, 24)).contains("waits for the next run; q quits"));
    assert!(shown(&Model::default(), &waiting, (80, 24)).contains("there is no run yet"));
    model.over = Some(Over::Broken("the connection to the run broke off".into()));
    assert!(shown(&model, &View::default(), (80, 24)).contains("broke off; q quits"));
}

#[test]
fn without_colours_no_cell_has_a_colour() {
    let model = synthetic(300);
    for (tab, _) in Tab::ALL {
        let buffer = cells(120, 40, &model, &on(tab), Palette(Colours::None));
        for cell in &buffer.content {
            assert_eq!(cell.fg, ratatui::style::Color::Reset);
            assert_eq!(cell.bg, ratatui::style::Color::Reset);
        }
    }
}

#[test]
fn lines_have_one_line_a_second_and_one_for_each_event() {
    let mut out = Vec::new();
    let feed = Box::new(Given(Synthetic::new(313).messages()));
    let ended = lines(feed, &Options::default(), &mut out).unwrap();
    assert_eq!(ended, Ended::Over);
    let text = String::from_utf8(out).unwrap();
    let starts = |word: &str| text.lines().filter(|line| line.contains(word)).count();
    // 5.008 s: the first frame, and the seconds 1 to 5.
    assert_eq!(starts("  ticks "), 6, "{text}");
    // Frames 40, 140, 240 trip; frames 80, 180, 280 miss.
    assert_eq!(
        (
            starts("event trip: left: force limited"),
            starts("event missed")
        ),
        (3, 3)
    );
    assert!(
        text.lines()
            .last()
            .unwrap()
            .starts_with("the end, at 5.007 s")
    );
    let line = text.lines().find(|line| line.starts_with("1.")).unwrap();
    for part in [
        "missed 0",
        "lateness p99 40.0 µs",
        "left ",
        "right ",
        "age 6.00 ms",
        "250.0 Hz",
    ] {
        assert!(line.contains(part), "{part}: {line}");
    }
}

#[test]
fn a_picture_has_the_texts_and_the_dots() {
    let model = synthetic(300);
    let buffer = cells(120, 36, &model, &View::default(), Palette(Colours::True));
    let svg = picture::svg(&buffer);
    assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"));
    assert!(svg.contains("force 1 left (N)") && svg.contains("#d55e00"));
    let dots = |symbol: &str| ('\u{2801}'..='\u{28ff}').contains(&symbol.chars().next().unwrap());
    let dots = buffer
        .content
        .iter()
        .filter(|cell| dots(cell.symbol()))
        .count();
    assert!(dots > 50 && svg.matches("<path").count() > dots);
}

/// A number of any kind.
fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => -10.0..10.0,
        1 => any::<f64>(),
        1 => Just(f64::NAN),
        1 => Just(f64::INFINITY),
        1 => Just(0.0),
    ]
}

fn any_range() -> impl Strategy<Value = Range> {
    prop_oneof![
        Just(Range::EMPTY),
        (any_number(), any_number()).prop_map(|(least, most)| Range { least, most }),
    ]
}

fn any_text() -> impl Strategy<Value = String> {
    prop_oneof![Just("normal".to_owned()), ".{0,40}"]
}

fn any_time() -> impl Strategy<Value = u64> {
    prop_oneof![0..20_000_000_000_u64, any::<u64>()]
}

fn any_folded() -> impl Strategy<Value = Folded> {
    let hand = (any_range(), any_range()).prop_map(|(force_norm, position)| {
        host::live::frame::FoldedHand {
            force_norm,
            position: [position; 3],
            ..Default::default()
        }
    });
    let body =
        (any_range(), any_range()).prop_map(|(age, supplied)| host::live::frame::FoldedBody {
            age,
            supplied,
            stored: age,
            ..Default::default()
        });
    let hands = prop::collection::vec(hand, 0..9);
    let bodies = prop::collection::vec(body, 0..9);
    (any_time(), any_time(), 0..100_u64, hands, bodies).prop_map(
        |(from_ns, to_ns, ticks, hands, bodies)| Folded {
            from_ns,
            to_ns,
            ticks,
            missed: ticks / 2,
            hands,
            bodies,
            ..Folded::default()
        },
    )
}

fn any_hand() -> impl Strategy<Value = HandState> {
    let vector = || [any_number(), any_number(), any_number()];
    (vector(), vector(), any_number(), any_text(), any::<bool>()).prop_map(
        |(position, force, peak_force, safety, fresh)| HandState {
            position,
            force,
            peak_force,
            safety,
            fresh,
            ..HandState::default()
        },
    )
}

fn any_body() -> impl Strategy<Value = BodyState> {
    let positions = prop::collection::vec(any_number().prop_map(|x| x as f32), 0..30);
    (
        any_number(),
        any_text(),
        0..3_u32,
        prop::option::of(positions),
    )
        .prop_map(|(age, state, epoch, positions)| BodyState {
            state,
            age,
            trust: age,
            withheld: age,
            vertices: positions.map(|positions| Vertices {
                epoch,
                count: positions.len() as u32 / 3,
                positions,
                ..Vertices::default()
            }),
            ..BodyState::default()
        })
}

fn any_event() -> impl Strategy<Value = Event> {
    (any_time(), any_text()).prop_map(|(time_ns, text)| Event {
        kind: EventKind::StaleModel,
        tick: 0,
        time_ns,
        text,
    })
}

fn any_message() -> impl Strategy<Value = Message> {
    let hello = (
        any_text(),
        0..9_usize,
        0..9_usize,
        any::<bool>(),
        any_number(),
    )
        .prop_map(|(name, devices, bodies, log, rate)| {
            Message::Hello(Box::new(Hello {
                source: if log { Source::Log } else { Source::Run },
                scene: name.clone(),
                file: name.clone(),
                tick_rate: rate,
                devices: vec![
                    host::live::DeviceInfo {
                        name: name.clone(),
                        ..Default::default()
                    };
                    devices
                ],
                bodies: vec![
                    host::live::BodyInfo {
                        name,
                        ..Default::default()
                    };
                    bodies
                ],
                obstacles: vec![
                    host::live::ObstacleInfo {
                        positions: (0..3 * devices).map(|k| k as f32 * 0.01).collect(),
                        triangles: vec![0, 1, 2, 7, 8, 9],
                        ..Default::default()
                    };
                    bodies
                ],
                ..Hello::default()
            }))
        });
    // `decode` allows only indices of vertices that exist; a display trusts nothing.
    let surface = (
        0..9_u32,
        0..3_u32,
        0..10_u32,
        prop::collection::vec(0..12_u32, 0..30),
    )
        .prop_map(|(body, epoch, vertices, triangles)| {
            Message::Surface(Surface {
                body,
                epoch,
                vertices,
                rest: (0..3 * vertices)
                    .map(|k| (k * k % 7) as f32 * 0.01)
                    .collect(),
                lines: triangles.clone(),
                triangles,
                ..Surface::default()
            })
        });
    let bins = prop::collection::vec((any::<u64>(), any::<u64>()), 0..20).prop_map(Bins);
    let frame = (
        any_time(),
        any_folded(),
        prop::collection::vec(any_hand(), 0..9),
        prop::collection::vec(any_body(), 0..9),
        prop::collection::vec(any_event(), 0..4),
        bins,
        any::<u64>(),
    )
        .prop_map(|(time_ns, folded, hands, bodies, events, bins, count)| {
            let mut frame = Frame {
                time_ns,
                folded,
                hands,
                bodies,
                events,
                ..Frame::default()
            };
            for hand in &frame.hands {
                let [x, y, z] = hand.position;
                frame.obstacles.push(host::live::ObstacleState {
                    pose: [x, y, z, x, y, z, x],
                    positions: Vec::new(),
                });
                frame.tools.push(host::live::ToolState {
                    led: [x, y, z, x, y, z, x],
                    force: hand.force,
                    sites: vec![hand.position.map(|x| x as f32)],
                    ..Default::default()
                });
                frame.contacts.push(host::live::ContactArrow {
                    at: hand.position.map(|x| x as f32),
                    force: hand.force.map(|x| x as f32),
                    depth: 0.0,
                });
            }
            frame.totals.ticks = count;
            frame.totals.lateness_bins = bins.clone();
            frame.totals.duration_bins = bins;
            Message::Frame(Box::new(frame))
        });
    let playback = (
        [any_time(), any_time(), any_time()],
        any_number(),
        prop::collection::vec(any_folded(), 0..4),
        prop::collection::vec(any_event(), 0..4),
        any_text(),
    )
        .prop_map(|([from_ns, to_ns, at_ns], speed, overview, events, note)| {
            Message::Playback(Box::new(Playback {
                speed,
                from_ns,
                to_ns,
                at_ns,
                notes: vec![note],
                overview,
                events,
                ..Playback::default()
            }))
        });
    prop_oneof![
        1 => hello,
        2 => surface,
        4 => frame,
        1 => playback,
        1 => prop::collection::vec(any_folded(), 0..5).prop_map(Message::History),
        1 => any_text().prop_map(Message::End),
        1 => any_text().prop_map(Message::Refused),
    ]
}

fn any_key() -> impl Strategy<Value = KeyCode> {
    prop_oneof![
        any::<char>().prop_map(KeyCode::Char),
        prop::sample::select(
            "12345hpswr+-n N,.[]{}<>"
                .chars()
                .map(KeyCode::Char)
                .collect::<Vec<_>>()
        ),
        prop::sample::select(vec![
            KeyCode::Up,
            KeyCode::Left,
            KeyCode::Home,
            KeyCode::End,
            KeyCode::Tab,
            KeyCode::PageDown,
        ]),
    ]
}

proptest! {
    #[test]
    fn no_input_breaks_the_display(
        steps in prop::collection::vec((any_message(), any_key()), 1..12),
        width in 1..150_u16,
        height in 1..60_u16,
    ) {
        let (mut model, mut view) = (Model::default(), View::default());
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        for (message, key) in steps {
            model.take(message, Instant::now());
            follow(&KeyEvent::new(key, KeyModifiers::NONE), &mut view, &model);
            for (tab, _) in Tab::ALL {
                view.tab = tab;
                terminal
                    .draw(|frame| {
                        let area = frame.area();
                        let palette = Palette::default();
                        draw(frame.buffer_mut(), area, &model, &view, palette, Instant::now());
                    })
                    .unwrap();
            }
        }
    }
}
