use super::*;

fn door() -> Door {
    Door {
        token: "abc".into(),
        origins: vec!["https://viewer.example".into()],
    }
}

const USUAL: [(&str, &str); 6] = [
    ("Host", "127.0.0.1:8765"),
    ("Connection", "keep-alive, Upgrade"),
    ("Upgrade", "websocket"),
    ("Sec-WebSocket-Version", "13"),
    // The example of RFC 6455, section 1.3.
    ("Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ=="),
    ("Sec-WebSocket-Protocol", "foxglove.websocket.v1"),
];

/// A request with the usual fields, in which `change` has another value or, if empty, is missing.
fn request(path: &str, change: (&str, &str)) -> String {
    let mut text = format!("GET {path} HTTP/1.1\r\n");
    let added = !USUAL.iter().any(|(name, _)| *name == change.0);
    let added = added.then_some(change);
    for (name, value) in USUAL.into_iter().chain(added) {
        let value = if name == change.0 { change.1 } else { value };
        if !value.is_empty() {
            text += &[name, ": ", value, "\r\n"].concat();
        }
    }
    text + "\r\n"
}

fn judge(path: &str, change: (&str, &str)) -> Result<String, Refusal> {
    match door().judge(request(path, change).as_bytes()) {
        Verdict::Admitted { response } => Ok(response),
        Verdict::Refused(refusal) => Err(refusal),
        Verdict::Incomplete => panic!("the request is whole"),
    }
}

#[test]
fn a_client_with_the_token_is_admitted() {
    let response = judge("/abc", ("", "")).expect("admitted");
    assert!(response.starts_with("HTTP/1.1 101 "));
    assert!(response.contains("\r\nSec-WebSocket-Accept: s3pPLMBiTxaQ9kYGzzhZRbK+xOo=\r\n"));
    assert!(response.contains("\r\nSec-WebSocket-Protocol: foxglove.websocket.v1\r\n"));
    assert!(judge("/abc/", ("", "")).is_ok());
}

#[test]
fn the_protocol_is_one_that_the_client_offers() {
    let answered = |offered: &str| judge("/abc", ("Sec-WebSocket-Protocol", offered));
    let new = answered("foxglove.sdk.v1").expect("admitted");
    assert!(new.contains("\r\nSec-WebSocket-Protocol: foxglove.sdk.v1\r\n"));
    let both = answered("foxglove.sdk.v1, foxglove.websocket.v1").expect("admitted");
    assert!(both.contains("\r\nSec-WebSocket-Protocol: foxglove.websocket.v1\r\n"));
    assert!(answered("").is_err());
    assert!(answered("mqtt").is_err());
}

#[test]
fn a_wrong_token_is_refused() {
    for path in [
        "/", "/ab", "/abd", "/abcd", "/abc?x", "/ABC", "abc", "abcabc", "*",
    ] {
        let refusal = judge(path, ("", "")).expect_err(path);
        assert_eq!(refusal.status, "403 Forbidden", "{path}");
        assert!(
            !refusal.reason.contains("abc"),
            "the token is told: {refusal:?}"
        );
    }
}

#[test]
fn only_names_of_this_machine_are_served() {
    for host in ["localhost", "LocalHost:1", "[::1]:8765", "127.0.0.1"] {
        assert!(judge("/abc", ("Host", host)).is_ok(), "{host}");
    }
    for host in [
        "evil.example",
        "127.0.0.1.evil.example",
        "localhost.evil.example:8765",
        "localhost:",
        "localhost:123456",
        "localhost:80:80",
        "127.0.0.2",
        "127.0.0.1@evil.example",
        "",
    ] {
        assert!(judge("/abc", ("Host", host)).is_err(), "{host}");
    }
    let twice = request("/abc", ("", "")).replace("Host:", "Host: evil.example\r\nHost:");
    assert!(matches!(
        door().judge(twice.as_bytes()),
        Verdict::Refused(refusal) if refusal.reason == "the field Host occurs twice"
    ));
}

#[test]
fn pages_of_other_places_are_refused_unless_they_are_listed() {
    for origin in [
        "http://localhost:8080",
        "https://127.0.0.1",
        "http://[::1]:3000",
        "file://",
        "https://viewer.example",
        "HTTPS://Viewer.Example",
    ] {
        assert!(judge("/abc", ("Origin", origin)).is_ok(), "{origin}");
    }
    for origin in [
        "null",
        "https://evil.example",
        "https://viewer.example.evil.example",
        "http://viewer.example",
        "http://localhost.evil.example",
        "http://localhost@evil.example",
        "http://evil.example/localhost",
        "file://evil",
        "chrome-extension://abcdef",
        "localhost",
    ] {
        let refusal = judge("/abc", ("Origin", origin)).expect_err(origin);
        assert!(
            refusal
                .reason
                .ends_with(&format!("--allow-origin {origin}"))
        );
    }
    let control = judge("/abc", ("Origin", "http://\u{9b}2J")).expect_err("refused");
    assert!(
        control.reason.contains("http://\\xc2\\x9b2J"),
        "{control:?}"
    );
}

#[test]
fn a_person_who_opens_the_address_in_a_browser_is_told_what_it_is_for() {
    let refusal = judge("/abc", ("Upgrade", "")).expect_err("no WebSocket");
    assert_eq!(refusal.status, "426 Upgrade Required");
    assert!(
        refusal
            .response()
            .ends_with("such as Foxglove or Lichtblick\n")
    );
}

#[test]
fn a_request_is_judged_when_it_is_whole() {
    let whole = request("/abc", ("", ""));
    for length in 0..whole.len() {
        let verdict = door().judge(&whole.as_bytes()[..length]);
        assert_eq!(verdict, Verdict::Incomplete, "{length}");
    }
    let refused = |bytes: &[u8]| matches!(door().judge(bytes), Verdict::Refused(_));
    assert!(refused(format!("{whole}x").as_bytes()));
    assert!(refused(&[b'G'; LONGEST_REQUEST]));
    assert!(refused(whole.replace("GET", "POST").as_bytes()));
    assert!(refused(whole.replace("HTTP/1.1", "HTTP/1.0").as_bytes()));
    assert!(refused(b"\x16\x03\x01\x02\x00\x01\x00"));
}
