//! The offline build of `docs/install.md`, followed in a scratch copy of the checkout. It builds for the CPU at hand, so that one build
//! shows both: the vendored sources suffice, and a native program gives the same bytes.

use super::assert_same;
use super::every_stage::EveryStage;
use sastrugi_tests::checkout::{copy, run};
use sastrugi_tests::program;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

const PAGE: &str = "docs/install.md";

/// What is optimised: the rooms of kernels and what they compute with. The rest computes nothing, and takes most of the time of a build.
const OPTIMISED: [&str; 9] = [
    "libm",
    "sastrugi-numeric",
    "sastrugi-roughness",
    "sastrugi-statistics",
    "sastrugi-terrain",
    "sastrugi-texture",
    "sastrugi-mobility",
    "sastrugi-navigation",
    "sastrugi-imaging",
];

/// The commands of the page's block that opens with these words.
fn commands(page: &str, words: &str) -> String {
    let opening = format!("```{words}\n");
    let (_, rest) = page.split_once(&opening).unwrap_or_else(|| panic!("{PAGE} has no block `{words}`"));
    rest.split_once("```").unwrap().0.to_owned()
}

/// With network access or a filled cache, and without either.
fn blocks() -> [String; 2] {
    let page = fs::read_to_string(sastrugi_fixtures::workspace_root().join(PAGE)).unwrap();
    ["sh connected", "sh offline"].map(|words| commands(&page, words))
}

/// What the commands of the page have built.
struct Built {
    program: PathBuf,
    /// Whether cargo has used a registry all the same.
    has_registry: bool,
}

/// The second block finds neither a network (`--offline`) nor what this machine has downloaded (an empty `CARGO_HOME`). It builds the same crates
/// from the same sources as the page: for the CPU at hand, and most of them without optimisation.
static BUILT: LazyLock<Built> = LazyLock::new(|| {
    let [connected, offline] = blocks();
    let scratch = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let (folder, program) = (scratch.join("offline"), scratch.join("sastrugi-offline"));
    copy(&folder);
    run(&folder, &connected);
    let mut settings = fs::OpenOptions::new().append(true).open(folder.join(".cargo/config.toml")).unwrap();
    writeln!(settings, "\n[profile.release]\nopt-level = 0\n\n[profile.release.package]").unwrap();
    OPTIMISED.iter().for_each(|name| writeln!(settings, "{name}.opt-level = 3").unwrap());
    let home = folder.join("home");
    fs::create_dir(&home).unwrap();
    let before =
        format!("unset CARGO_TARGET_DIR; export CARGO_HOME='{}' RUSTFLAGS='-C target-cpu=native'", home.display());
    run(&folder, &format!("{before}\n{offline}"));
    let has_registry = home.join("registry").exists();
    fs::copy(folder.join("installed/bin/sastrugi"), &program).unwrap();
    fs::remove_dir_all(&folder).unwrap();
    Built { program, has_registry }
});

#[test]
fn val_install_says_how_to_build_offline() {
    let [connected, offline] = blocks();
    assert!(connected.contains("cargo vendor --locked"), "{connected}");
    assert!(offline.lines().all(|line| !line.starts_with("cargo ") || line.contains("--offline")), "{offline}");
}

/// The vendored sources alone give a program, which starts.
#[test]
#[ignore = "slow: it compiles"]
fn val_vendored_sources_build_offline() {
    assert!(!BUILT.has_registry, "cargo did not use the vendored sources alone");
}

/// A build for the CPU at hand (FMA, AVX2, AVX-512 if it has them) gives the same bytes.
#[test]
#[ignore = "slow: it compiles"]
fn gold_a_native_build_changes_nothing() {
    let study = EveryStage::new();
    let any = study.release("any", &mut Command::new(program()));
    let native = study.release("native", &mut Command::new(&BUILT.program));
    assert_same(&any, &native, "target-cpu=native");
}
