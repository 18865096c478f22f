//! The page of the terrain server: a browser shows the server's values, and the bundle in the program is built from its sources.
//! Requires node >= 18, the packages in `.cache/page` (`./test` installs them) and, for the browser, Chromium.

use super::{area, called, sastrugi_in, write};
use sastrugi_store::dem;
use sastrugi_tests::server::Server;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Paths where `smoke.mjs` looks for a browser, after the variable `CHROMIUM`.
const BROWSERS: [&str; 3] = ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"];
const NODE_MIN: u32 = 18;

/// A vehicle and a rover, each on a small terrain.
const DRIVEN: &str = r#"
[study]
name = "driven"
seed = 7
date = "2026-11-25"
license = "CC0-1.0"

[[terrain]]
id = "plain"
kind = "multifractal"
size_px = [300, 300]

[[missions]]
id = "short"
terrains = ["plain"]
count = 2
length_m = 6.0
border_m = 2.0

[[traverse]]
id = "husky"
missions = "short"
vehicle = "husky_a200"

[[terrain]]
id = "rocky"
kind = "planetary"
size_m = [12.0, 12.0]
cell_m = 0.16
basic_spacing_m = 0.01
origin_m = [-6.08, -6.08]
processes = [{ kind = "rocks", coverage = 0.05, diameter_min_m = 0.04, diameter_max_m = 1.0 }, { kind = "albedo" }]

[[rover]]
id = "circle"
kind = "sojourner_like"
terrains = ["rocky"]
rovers = 2
radius_m = 5.0
distance_limit_m = 60.0
"#;

/// The browser's readout, colours, profile, tracks, playback and study of a box agree with the server, on a world and on a release.
#[test]
fn val_the_page_agrees_with_the_server() {
    let Some(page) = page() else { return };
    if !has_browser() {
        // No test installs a browser; without one, this test is skipped, as in `.ci/look`.
        return eprintln!("SKIPPED: Chromium is not installed, and CHROMIUM does not name it");
    }
    let folder = area();
    write(folder.path(), "study.toml", DRIVEN);
    let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let world = sastrugi_fixtures::workspace_root().join("fixtures/worlds/planet.toml");
    let server = Server::start(folder.path(), &[world.to_str().unwrap(), "release"], &[]);
    let url = format!("http://{}", server.address);
    let smoke = ["test/smoke.mjs", &url, "pictures"];
    let call = called(Command::new("node").current_dir(page.path()).args(smoke).env("SMOKE_SIZE", "960x640"));
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
    let section = std::fs::read_to_string(page.path().join("pictures/study.toml")).unwrap();
    assert_study_is_served(folder.path(), &server, &section);
}

/// A study with the section that the page gives for a drawn box generates the samples that the server has there, bit for bit.
fn assert_study_is_served(folder: &Path, server: &Server, section: &str) {
    let head = "[study]\nname = \"box\"\nseed = 1\ndate = \"2026-11-25\"\nlicense = \"CC0-1.0\"\n\n";
    write(folder, "box.toml", &format!("{head}{section}"));
    let call = sastrugi_in(folder, &["run", "box.toml", "-o", "box", "--quiet"]);
    assert_eq!(call.code, 0, "{section}{}", call.stderr);
    let made = dem::read(&folder.join("box/terrain/planet.tif")).unwrap().grid;
    let g = made.geometry;
    let [x, y] = [g.x(0), g.y(g.rows - 1)];
    let patch = format!("origin={x},{y}&size={},{}&resolution_m={}&format=raw", g.cols, g.rows, g.cell[0]);
    let served = server.get(&format!("/v1/collections/planet/patch?{patch}")).floats();
    assert_eq!(served.len(), made.values.len());
    assert!(made.values.iter().zip(&served).all(|(a, b)| (*a as f32).to_bits() == b.to_bits()), "{patch}");
}

/// The committed bundle is that of the sources, byte for byte.
#[test]
fn gold_the_bundle_is_that_of_the_sources() {
    let Some(page) = page() else { return };
    let call = called(Command::new("node").arg("check.mjs").current_dir(page.path()));
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
}

/// A copy of the page's folder with access to the installed packages; `None` (after a message) if they or node are missing.
fn page() -> Option<tempfile::TempDir> {
    let root = sastrugi_fixtures::workspace_root();
    let packages = root.join(".cache/page/node_modules");
    if !packages.join("puppeteer-core").exists() {
        skipped("the packages of the server's page are not installed; ./test installs them");
        return None;
    }
    if node_version().is_none_or(|version| version < NODE_MIN) {
        skipped(&format!("node {NODE_MIN} or later is not installed"));
        return None;
    }
    let folder = area();
    copy(&root.join("pipeline/server/page"), folder.path());
    std::os::unix::fs::symlink(packages, folder.path().join("node_modules")).unwrap();
    Some(folder)
}

fn copy(from: &Path, to: &Path) {
    for entry in std::fs::read_dir(from).unwrap().map(Result::unwrap) {
        let (path, copied) = (entry.path(), to.join(entry.file_name()));
        if path.is_file() {
            std::fs::copy(path, copied).unwrap();
        } else if entry.file_name() != "node_modules" {
            std::fs::create_dir(&copied).unwrap();
            copy(&path, &copied);
        }
    }
}

/// The major version, such as 20 of `v20.1.0`; `None` without node.
fn node_version() -> Option<u32> {
    let output = Command::new("node").arg("--version").output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    text.trim().strip_prefix('v')?.split('.').next()?.parse().ok()
}

fn has_browser() -> bool {
    let named = std::env::var_os("CHROMIUM").map(PathBuf::from);
    named.into_iter().chain(BROWSERS.map(PathBuf::from)).any(|path| path.exists())
}

/// Prints a message; in CI, a check that does not run must not pass.
fn skipped(why: &str) {
    assert!(std::env::var_os("CI").is_none(), "{why}");
    eprintln!("SKIPPED: {why}");
}
