//! `palpate run --replay` reports whether a log is reproduced, and the first difference.

use host::scene::Scene;
use std::error::Error;
use std::fs;
use std::process::{Command, Output};

type Outcome = Result<(), Box<dyn Error>>;

fn palpate(arguments: &[&str]) -> Result<(Output, String), Box<dyn Error>> {
    let output = Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(arguments)
        .output()?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned()
        + &String::from_utf8_lossy(&output.stderr);
    Ok((output, text))
}

#[test]
fn the_command_reports_the_first_difference_and_its_exit_code_agrees() -> Outcome {
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name).display().to_string();
    let (log, scene, json) = (at("run.mcap"), at("other.toml"), at("replay.json"));
    let (run, said) = palpate(&["run", "--duration", "0.5", "--log", &log])?;
    assert!(run.status.success(), "{said}");

    let (exact, said) = palpate(&["run", "--replay", &log])?;
    assert_eq!(exact.status.code(), Some(0), "{said}");
    assert!(said.contains("500 ticks reproduced exactly"), "{said}");

    let text = Scene::embedded_default()?.source.text;
    fs::write(&scene, text.replace("blend = 0.5 ", "blend = 1.0 "))?;
    let (differs, said) = palpate(&["run", &scene, "--replay", &log, "--json", &json])?;
    assert_eq!(differs.status.code(), Some(1), "{said}");
    assert!(
        said.contains(" s): device ") && said.contains(" now "),
        "{said}"
    );
    let json: serde_json::Value = serde_json::from_str(&fs::read_to_string(json)?)?;
    assert_eq!(json["schema"], "palpate.replay/1");
    assert!(json["first"]["tick"].is_u64(), "{json}");

    let (none, said) = palpate(&["run", "--replay", &at("none.mcap")])?;
    assert_eq!(none.status.code(), Some(1));
    assert!(said.contains("none.mcap: cannot read this log"), "{said}");
    let (both, _) = palpate(&["run", "--replay", &log, "--seed", "3"])?;
    assert_eq!(both.status.code(), Some(2));
    Ok(())
}
