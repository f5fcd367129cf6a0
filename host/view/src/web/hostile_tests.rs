//! What a connection sends: any bytes, no panic, and no way past the token.

use super::service;
use crate::door::judge;
use fuzz_rules::changed::Mutator;

/// The token of the requests.
const TOKEN: &str = "0123456789abcdef0123456789abcdef";

/// Reads the head of a request and checks it as the server does. Returns whether the request may have its path.
///
/// # Panics
/// If a request is admitted without the token, or without the name of this machine.
fn request(bytes: &[u8]) -> bool {
    let Ok(Some((request, _))) = judge(bytes, TOKEN, "", &service::admits) else {
        return false;
    };
    let field = |name| {
        request
            .headers()
            .get(name)
            .and_then(|value| value.to_str().ok())
    };
    let host = field("host").unwrap_or_default();
    let names = ["127.0.0.1", "localhost", "[::1]"];
    let named = names.iter().any(|name| {
        let start = host.as_bytes().get(..name.len());
        start.is_some_and(|start| start.eq_ignore_ascii_case(name.as_bytes()))
    });
    assert!(named, "the server answers under another name: {host}");
    let target = request.uri().to_string();
    assert!(
        target.starts_with(&format!("/{TOKEN}")),
        "the server answers without the token: {target}"
    );
    let origin = field("origin").map(|origin| origin.replacen("http://", "", 1));
    assert!(
        !request.headers().contains_key("origin") || origin.as_deref() == Some(host),
        "the server answers another page: {origin:?}"
    );
    true
}

/// Reads a command of a page. Returns whether the server understands the command.
///
/// # Panics
/// If a speed outside the allowed range is passed on.
fn command(bytes: &[u8]) -> bool {
    use crate::feed::Command;
    // A WebSocket refuses a text that is not UTF-8 before the server reads the text.
    let text = String::from_utf8_lossy(bytes);
    let understood = service::understand(&text);
    if let Ok(Some(Command::Speed { factor })) = understood {
        assert!((0.001..=100.0).contains(&factor), "the speed {factor}");
    }
    understood.is_ok()
}

/// Requests that are sound: for the page, for a file, and for a WebSocket.
fn requests() -> Vec<Vec<u8>> {
    let page =
        format!("GET /{TOKEN}/?a=1 HTTP/1.1\r\nHost: 127.0.0.1:8420\r\nAccept: text/html\r\n\r\n");
    let file = format!(
        "GET /{TOKEN}/vendor/uPlot.esm.js HTTP/1.1\r\nHost: [::1]:8420\r\nOrigin: http://[::1]:8420\r\n\r\n"
    );
    let socket = format!(
        "GET /{TOKEN}/socket HTTP/1.1\r\nHost: localhost:8420\r\nOrigin: http://localhost:8420\r\n\
         Upgrade: websocket\r\nConnection: keep-alive, Upgrade\r\nSec-WebSocket-Version: 13\r\n\
         Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
    );
    [page, file, socket].map(String::into_bytes).into()
}

/// Commands of each kind.
fn commands() -> Vec<Vec<u8>> {
    let commands = [
        r#"{"do":"play"}"#,
        r#"{"do":"pause"}"#,
        r#"{"do":"step","ticks":-1}"#,
        r#"{"do":"seek","time_ns":1500000000}"#,
        r#"{"do":"speed","factor":0.5}"#,
        r#"{"do":"next"}"#,
        r#"{"do":"previous"}"#,
        r#"{"do":"stress","on":true}"#,
        r#"{"do":"drawn"}"#,
    ];
    commands.map(|text| text.as_bytes().to_vec()).into()
}

/// Changes sound requests and commands at random, and reads `count` of each. Fewer than `most` are accepted.
fn change(count: u32, most: u32) {
    type Reader = fn(&[u8]) -> bool;
    let kinds: [(Vec<Vec<u8>>, Reader); 2] = [(requests(), request), (commands(), command)];
    for (seeds, read) in kinds {
        assert!(seeds.iter().all(|bytes| read(bytes)));
        let mut mutator = Mutator::new(4);
        let mut accepted = 0;
        for _ in 0..count {
            let mut bytes = seeds[mutator.below(seeds.len())].clone();
            mutator.change(&mut bytes, &(0..0));
            accepted += u32::from(read(&bytes));
        }
        // Some changes leave the meaning, and most do not.
        assert!((20..most).contains(&accepted), "{accepted}");
    }
}

#[test]
fn changed_requests_and_commands_do_not_panic() {
    change(20_000, 15_000);
}

#[test]
#[ignore = "a million inputs of each kind: `cargo test --release -p palpate-view --lib web::hostile_tests -- --ignored`"]
fn a_million_changed_requests_and_commands_do_not_panic() {
    change(1_000_000, 750_000);
}
