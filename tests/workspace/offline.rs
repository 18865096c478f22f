//! The offline build of `docs/install.md`, followed in a scratch copy of the checkout.

use super::walk::{checkout, run};
use std::fs;

const PAGE: &str = "docs/install.md";

/// The variable of cargo that turns optimisation off, which takes most of the time of a build.
const QUICKLY: &str = "CARGO_PROFILE_RELEASE_OPT_LEVEL=0";

/// The commands of the page's block that opens with these words.
fn commands(page: &str, words: &str) -> String {
    let opening = format!("```{words}\n");
    let (_, rest) = page.split_once(&opening).unwrap_or_else(|| panic!("{PAGE} has no block `{words}`"));
    rest.split_once("```").unwrap().0.to_owned()
}

/// With network access or a filled cache, and without either.
fn blocks() -> [String; 2] {
    let page = super::licences::read(PAGE);
    ["sh connected", "sh offline"].map(|words| commands(&page, words))
}

#[test]
fn val_install_says_how_to_build_offline() {
    let [connected, offline] = blocks();
    assert!(connected.contains("cargo vendor --locked"), "{connected}");
    assert!(offline.lines().all(|line| !line.starts_with("cargo ") || line.contains("--offline")), "{offline}");
}

/// The second block finds neither a network (`--offline`) nor what this machine has downloaded (an empty `CARGO_HOME`). It builds the same crates
/// from the same sources as the page, without optimisation.
#[test]
#[ignore = "slow: it compiles"]
fn val_vendored_sources_build_offline() {
    let [connected, offline] = blocks();
    let copy = checkout("offline");
    run(&copy, &connected);
    let home = copy.join("home");
    fs::create_dir(&home).unwrap();
    run(&copy, &format!("unset CARGO_TARGET_DIR; export CARGO_HOME='{}' {QUICKLY}\n{offline}", home.display()));
    assert!(!home.join("registry").exists(), "cargo did not use the vendored sources alone");
    fs::remove_dir_all(&copy).unwrap();
}
