//! The page in headless Chromium, driven by `web_page/page.cjs`, and the decoder of the page in node.
//!
//! The tests need `node`, and the first needs `chromium` and a folder with the npm package `playwright-core`, which the
//! environment variable `PALPATE_NODE_MODULES` names. A test whose tools are missing is skipped with a line.

#[path = "../examples/paced/mod.rs"]
mod paced;

mod browser;

use browser::{exists, scripts};
use fuzz_rules::synthetic::Synthetic;
use host::live::{Message, Vertices};
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use view::feed::Feed;
use view::web::Draw;

/// Vertices along an edge of the sheet of the run: as many triangles as the boundary of a body of 6,000 tetrahedra.
const EDGE: u32 = 37;

/// The vertices of a frame of the synthetic feed.
fn sent(number: u64) -> Vertices {
    let mut feed = Synthetic::with_edge(u64::MAX, EDGE);
    loop {
        if let Ok(Some(Message::Frame(mut frame))) = feed.next(Duration::ZERO)
            && frame.number == number
        {
            return frame.bodies.remove(0).vertices.unwrap();
        }
    }
}

#[test]
fn the_page_shows_what_was_sent_and_obeys_mouse_and_keyboard() {
    let Some(mut script) = browser::script("page.cjs") else {
        return;
    };
    let stop = Arc::new(AtomicBool::new(false));
    let draw: Arc<Draw> = Arc::new(|_, _| Ok(b"time_s\n0\n".to_vec()));
    let serve = |feed| browser::server(Box::new(feed), Arc::clone(&draw), &stop);
    let (run, run_at) = serve(paced::Paced::new(EDGE, false, u64::MAX));
    let (log, log_at) = serve(paced::Paced::new(21, true, u64::MAX));
    script.args([&run_at, &log_at]);
    let text = browser::lines(script);
    stop.store(true, Ordering::Release);
    let _ = (run.join(), log.join());
    eprintln!("{text}");
    // The vertices that the page drew are those of the feed, bit for bit.
    let drawn = text.lines().find_map(|line| line.strip_prefix("DRAWN "));
    let drawn: serde_json::Value = serde_json::from_str(drawn.unwrap()).unwrap();
    let vertices = sent(drawn["number"].as_u64().unwrap());
    assert_eq!(drawn["step"], vertices.step);
    let bits: Vec<u64> = vertices
        .positions
        .iter()
        .map(|x| u64::from(x.to_bits()))
        .collect();
    let drawn: Vec<u64> = serde_json::from_value(drawn["bits"].clone()).unwrap();
    assert!(drawn == bits, "the page drew other vertices");
}

#[test]
fn the_decoder_of_the_page_reads_what_the_program_encodes() {
    if !exists("node") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let mut feed = Synthetic::new(3);
    let mut expected = Vec::new();
    loop {
        let message = feed.next(Duration::ZERO).unwrap().unwrap();
        let message = with_stress(message);
        let mut bytes = Vec::new();
        message.encode(&mut bytes);
        let name = format!("{}.bin", expected.len());
        std::fs::write(folder.path().join(name), &bytes).unwrap();
        let last = matches!(message, Message::End(_));
        expected.push(facts(&message));
        if last {
            break;
        }
    }
    let expected = serde_json::to_vec(&expected).unwrap();
    std::fs::write(folder.path().join("expected.json"), expected).unwrap();
    let decoder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/web/page/message.js");
    // Node takes the decoder for a module by its suffix.
    std::fs::copy(decoder, folder.path().join("message.mjs")).unwrap();
    let output = Command::new("node")
        .arg(scripts().join("decode.cjs"))
        .arg(folder.path())
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{text}");
}

/// The message, a frame with stresses.
fn with_stress(mut message: Message) -> Message {
    if let Message::Frame(frame) = &mut message {
        for vertices in frame
            .bodies
            .iter_mut()
            .filter_map(|body| body.vertices.as_mut())
        {
            vertices.stressed = true;
            vertices.stress = (0..vertices.count).map(|i| 0.1 * i as f32).collect();
        }
    }
    message
}

/// The parts of a message: the JSON part, and the bits of the arrays.
fn facts(message: &Message) -> serde_json::Value {
    let bits =
        |values: &[f32]| -> Vec<u32> { values.iter().map(|value| value.to_bits()).collect() };
    let (json, arrays) = match message {
        Message::Hello(hello) => (serde_json::to_value(hello), vec![]),
        Message::Surface(surface) => (
            serde_json::to_value(surface),
            vec![
                bits(&surface.rest),
                surface.triangles.clone(),
                surface.lines.clone(),
            ],
        ),
        Message::Frame(frame) => {
            let vertices = frame
                .bodies
                .iter()
                .filter_map(|body| body.vertices.as_ref());
            let arrays = vertices.flat_map(|v| [bits(&v.positions), bits(&v.stress)]);
            (serde_json::to_value(frame), arrays.collect())
        }
        Message::End(text) | Message::Refused(text) => (serde_json::to_value(text), vec![]),
        Message::History(folded) => (serde_json::to_value(folded), vec![]),
        Message::Playback(playback) => (serde_json::to_value(playback), vec![]),
    };
    serde_json::json!({ "kind": message.kind(), "json": json.unwrap(), "arrays": arrays })
}
