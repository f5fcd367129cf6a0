//! Tells the program the commit from which it is built (`PALPATE_COMMIT`), for the `machine` table of its results. A
//! build outside of a repository, or without git, works and names no commit.

use std::fs::canonicalize;
use std::process::Command;

/// The folders of the sources, from this one.
const SOURCES: [&str; 6] = [
    "../../rt_core",
    "../../sim",
    "../../firmware_proto",
    "../src",
    "../physics/src",
    "../study/src",
];

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=src");
    for folder in SOURCES {
        println!("cargo:rerun-if-changed={folder}");
    }
    // This file changes with every commit and checkout.
    if let Some(log) = git(&["rev-parse", "--git-path", "logs/HEAD"]) {
        println!("cargo:rerun-if-changed={log}");
    }
    // Sources that were unpacked inside another repository have no commit there.
    let own = |top: String| Some(canonicalize(top).ok()? == canonicalize("../..").ok()?);
    if git(&["rev-parse", "--show-toplevel"]).and_then(own) != Some(true) {
        return;
    }
    if let Some(commit) = git(&[
        "describe",
        "--always",
        "--abbrev=12",
        "--exclude=*",
        "--dirty=+",
    ]) {
        println!("cargo:rustc-env=PALPATE_COMMIT={commit}");
    }
}

/// What git prints; `None` if git fails or prints nothing.
fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    let text = text.trim();
    (output.status.success() && !text.is_empty()).then(|| text.to_owned())
}
