//! The terrain server: its answers are those of the program, for any client and any number of requests, and invalid requests are refused.

use sastrugi_mobility::rover::{Navigator, RoverParameters, SchoppersParameters, SojournerParameters, Track, drive};
use sastrugi_numeric::{Counter, Geometry, Grid, Ground, GroundGrid, GroundPoint, NoGround, Streams};
use sastrugi_server::client::{Client, ClientError, Patch};
use sastrugi_store::dem;
use sastrugi_terrain::planetary::{Planetary, RawPlanetary};
use sastrugi_tests::server::{Server, WORLD};
use sastrugi_tests::{area, sastrugi_in, write};
use serde_json::json;
use std::cell::RefCell;
use std::collections::HashMap;
use std::fs;
use std::io::{Read, Write};
use std::path::Path;
use std::time::{Duration, Instant};

const PATCH: &str = "/v1/collections/world/patch?origin=-1,2&size=300,200&resolution_m=0.02";
const TILES: &str = "/v1/collections/world/styles";

fn world(folder: &Path) {
    write(folder, "world.toml", WORLD);
}

/// Acceptance 14: the patch is that of `terrain`, bit for bit; the second answer is a hit with the same bytes, also after the server was killed; a
/// hundred simultaneous requests for one patch compute it once.
#[test]
fn val_patches_are_those_of_the_program() {
    let folder = area();
    world(folder.path());
    let call = sastrugi_in(folder.path(), &["terrain", "world.toml", "-o", "made.tif"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let made = dem::read(&folder.path().join("made.tif")).unwrap().grid;
    let albedo = dem::read(&folder.path().join("made.albedo.tif")).unwrap().grid;
    let mut server = Server::start(folder.path(), &["world.toml", "--library", "tiles"], &[]);
    let raw = format!("{PATCH}&format=raw");
    let bodies: Vec<Vec<u8>> = std::thread::scope(|scope| {
        let asking: Vec<_> = (0..100).map(|_| scope.spawn(|| server.get(&raw))).collect();
        asking.into_iter().map(|a| a.join().unwrap()).map(|a| (assert_eq!(a.status, 200), a.body).1).collect()
    });
    assert!(bodies.iter().all(|body| *body == bodies[0]));
    let heights = server.get(&raw).floats();
    assert_same_bits(&made, &heights);
    // The window lies in 2 x 2 tiles.
    let library = || server.get("/v1/library").json();
    assert_eq!(library()["made"], 4, "{}", library());
    let of_albedo = server.get(&format!("{raw}&field=albedo")).floats();
    assert_same_bits(&albedo, &of_albedo);
    assert_eq!(library()["made"], 4);
    let file = server.get(PATCH);
    fs::write(folder.path().join("patch.tif"), &file.body).unwrap();
    assert_eq!(dem::read(&folder.path().join("patch.tif")).unwrap().grid, made);
    std::thread::sleep(Duration::from_millis(300));
    server.kill();
    let again = Server::start(folder.path(), &["world.toml", "--library", "tiles"], &[]);
    assert_eq!(again.get(&raw).body, bodies[0]);
    let library = again.get("/v1/library").json();
    assert_eq!((&library["made"], &library["disk_hits"]), (&0.into(), &4.into()), "{library}");
}

/// The samples of a served patch are those of a raster, all of them, bit for bit.
fn assert_same_bits(made: &Grid, served: &[f32]) {
    assert_eq!(made.values.len(), served.len());
    let other = made.values.iter().zip(served).position(|(a, b)| (*a as f32).to_bits() != b.to_bits());
    assert_eq!(other, None, "the first sample that differs");
}

/// A small window is generated alone unless ground around it was requested before; then its tiles are generated. The bits are the same.
#[test]
fn val_lone_patches_are_generated_alone() {
    let folder = area();
    world(folder.path());
    let mut server = Server::start(folder.path(), &["world.toml", "--library", "tiles"], &[]);
    let patch = |server: &Server, first: i32, more: &str| {
        let origin = f64::from(first) * 0.02;
        let answer = server.get(&format!(
            "/v1/collections/world/patch?origin={origin:?},{origin:?}&size=256,256&resolution_m=0.02&format=raw{more}"
        ));
        assert_eq!(answer.status, 200);
        answer.floats()
    };
    let made = |server: &Server| {
        // A tile counts once it has been delivered.
        while server.get("/v1/library").json()["running"] != 0 {
            std::thread::sleep(Duration::from_millis(5));
        }
        server.get("/v1/library").json()["made"].as_u64().unwrap()
    };
    // Across the corner of four tiles.
    let alone = patch(&server, 100, "");
    assert_eq!(made(&server), 1);
    patch(&server, 100, "&field=albedo");
    patch(&server, 100, "&rotate=90");
    assert_eq!(made(&server), 1);
    let beside = patch(&server, 101, "");
    assert_eq!(made(&server), 5);
    for r in 1..256 {
        let (a, b) = (&alone[256 * (r - 1) + 1..256 * r], &beside[256 * r..256 * r + 255]);
        assert!(a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits()), "row {r}");
    }
    server.kill();
    let again = Server::start(folder.path(), &["world.toml", "--library", "tiles"], &[]);
    assert_eq!((patch(&again, 100, "&flip=none") == alone, patch(&again, 103, "").len()), (true, 1 << 16));
    assert_eq!(made(&again), 0);
    // A complete tile is generated at once, and its parts are taken from it.
    patch(&again, 1024, "");
    let part = "/v1/collections/world/patch?origin=20.6,20.6&size=100,100&resolution_m=0.02&format=raw";
    assert_eq!((again.get(part).status, made(&again)), (200, 1));
    // Larger windows are always generated in tiles: 3 x 3 of them.
    let large = "/v1/collections/world/patch?origin=71.68,71.68&size=514,514&resolution_m=0.02&format=raw";
    assert_eq!((again.get(large).status, made(&again)), (200, 10));
    // Windows that take too much work are refused before and after ground around them was requested.
    let coarse = "/v1/collections/world/patch?origin=0,0&size=200,200&resolution_m=40.96&format=raw";
    let refused = || (again.get(coarse).status, again.get(coarse).json()["detail"].clone());
    let before = refused();
    assert_eq!((before.0, again.get(&format!("{coarse}&feature_min_m=1000")).status), (413, 200));
    assert_eq!(refused(), before);
}

/// A pixel of a map tile is the ground at the centre of its cell, without features narrower than two pixels, at every level.
#[test]
fn val_pixels_are_the_ground_at_their_centres() {
    let folder = area();
    world(folder.path());
    let server = Server::start(folder.path(), &["world.toml"], &[]);
    let described = server.get("/v1/collections/world").json();
    let grid = &described["tile_grid"];
    let [west, north] = [0, 1].map(|k| grid["origin_m"][k].as_f64().unwrap());
    let tilejson = server.get("/v1/collections/world/xyz/elevation/tilejson.json").json();
    let offset = tilejson["offset_m"].as_f64().unwrap();
    // Pixels of 655.36 m where a web-Mercator client expects 611.50 m.
    assert!((tilejson["vertical_scale"].as_f64().unwrap() - 0.9331).abs() < 1e-4, "{tilejson}");
    for level in [16, 13, 9, 3, 0] {
        let step = grid["resolutions_m"][level].as_f64().unwrap();
        let side = 256.0 * step;
        let [col, row] = [((3.0 - west) / side) as u32, ((north - 4.0) / side) as u32];
        let tile = server.get(&format!("{TILES}/elevation/map/tiles/world/{level}/{row}/{col}"));
        assert_eq!(tile.status, 200, "level {level}");
        let pixels = rgba(&tile.body);
        for (r, c) in [(0, 0), (17, 200), (128, 128), (255, 3)] {
            let [red, green, blue, _] = pixels[256 * r + c];
            let height = offset + 5e-5 * (f64::from(red) * 65536.0 + f64::from(green) * 256.0 + f64::from(blue));
            let x = west + (256.0 * f64::from(col) + c as f64 + 0.5) * step;
            let y = north - (256.0 * f64::from(row) + r as f64 + 0.5) * step;
            let point = server.get(&format!("/v1/collections/world/point?x={x}&y={y}&feature_min_m={}", 2.0 * step));
            let exact = point.json()["elevation_m"].as_f64().unwrap();
            // Half a step of the encoding, and single precision.
            assert!((height - exact).abs() < 2.6e-5 + 1e-7 * exact.abs(), "level {level}: {height} {exact}");
        }
        // The same tile by z, x, y.
        let window = format!(
            "/v1/collections/world/xyz/elevation/{}/{}/{}.png",
            8 + level,
            (128 << level) + col,
            (127 << level) + row
        );
        assert_eq!(server.get(&window).body, tile.body);
    }
}

/// A coarse tile shows the share of rock that a fine patch has on average: rocks narrower than two pixels count, though they are left out of the heights.
#[test]
fn val_coarse_tiles_show_the_share_of_rock() {
    let folder = area();
    world(folder.path());
    let server = Server::start(folder.path(), &["world.toml"], &[]);
    // Without craters, whose rims have more rocks.
    let phenomena = "phenomena=1,3";
    let fine = format!(
        "/v1/collections/world/patch?origin=0,0&size=512,512&resolution_m=0.16&field=class&format=raw&{phenomena}"
    );
    let rocks = server.get(&fine).floats();
    assert!(rocks.iter().all(|rock| [0.0, 1.0].contains(rock)));
    let mean = rocks.iter().map(|rock| f64::from(*rock)).sum::<f64>() / rocks.len() as f64;
    // Pixels of 82 m, and rocks of at most 5 m.
    let tile = server.get(&format!("{TILES}/class/map/tiles/world/3/3/4?{phenomena}"));
    assert_eq!(tile.status, 200);
    for [_, _, _, opacity] in rgba(&tile.body) {
        let share = f64::from(opacity) / 255.0 / 0.85;
        // The fine patch is 82 m wide, and opacities are steps of 0.005.
        assert!((share - mean).abs() < 0.08 * mean + 0.003, "{share} {mean}");
    }
}

/// Work ends within 50 ms after its last client has left. The best of some trials counts, because other programs may hold the processors.
#[test]
fn val_abandoned_work_ends_soon() {
    let folder = area();
    world(folder.path());
    let server = Server::start(folder.path(), &["world.toml", "--threads", "1"], &[]);
    let mut watch = server.client().unwrap();
    let mut running = || watch.get("/v1/library").unwrap().json()["running"].as_u64().unwrap();
    let mut best = Duration::MAX;
    for k in 0..12 {
        let mut client = server.client().unwrap();
        // One tile.
        let x = f64::from(100 * k) * 256.0 * 2.56;
        let path = format!("/v1/collections/world/patch?origin={x},0&size=256,256&resolution_m=2.56&format=raw");
        write!(client.stream(), "GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n").unwrap();
        let asked = Instant::now();
        while running() == 0 {
            assert!(asked.elapsed() < Duration::from_secs(60), "the window was refused, or done at once");
            std::thread::sleep(Duration::from_millis(1));
        }
        std::thread::sleep(Duration::from_millis(10));
        assert_eq!(running(), 1, "such a window takes seconds");
        drop(client);
        let left = Instant::now();
        while running() > 0 {
            std::thread::sleep(Duration::from_micros(200));
        }
        best = best.min(left.elapsed());
    }
    assert!(best < Duration::from_millis(50), "{best:?}");
}

fn rgba(png: &[u8]) -> Vec<[u8; 4]> {
    let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut bytes).unwrap();
    bytes.chunks_exact(4).map(|p| [p[0], p[1], p[2], p[3]]).collect()
}

/// Invalid requests are refused in one sentence, with a status that distinguishes client from server errors.
#[test]
fn val_wrong_requests_are_refused() {
    let folder = area();
    world(folder.path());
    fs::write(folder.path().join("secret.txt"), "not for clients").unwrap();
    let server = Server::start(folder.path(), &["world.toml", "--samples-max", "100000"], &[]);
    let c = "/v1/collections/world";
    let long = format!("{c}/patch?{}", "x".repeat(9000));
    let cases = [
        (400, format!("{c}/patch")),
        (400, format!("{c}/patch?origin=0,0")),
        (400, format!("{c}/patch?origin=0,0&size=0,5")),
        (400, format!("{c}/patch?origin=0,0&size=2.5,5")),
        (400, format!("{c}/patch?origin=0,0&center=0,0&size=5,5")),
        (400, format!("{c}/patch?origin=nan,0&size=5,5")),
        (400, format!("{c}/patch?origin=0,0&size=5,5&resolution_m=0")),
        (400, format!("{c}/patch?origin=0,0&size=5,5&rotate=45")),
        (400, format!("{c}/patch?origin=0,0&size=5,5&downsample=1")),
        (400, format!("{c}/patch?origin=0,0&size=5,5&phenomena=9")),
        (400, format!("{c}/patch?origin=0,0&size=5,5&phenomena=1&field=albedo")),
        (400, format!("{c}/patch?origin=0,0&size=5,5&fromat=npy")),
        (400, format!("{c}/patch?origin=0,0&origin=1,1&size=5,5")),
        (400, format!("{c}/point?x=1")),
        (400, format!("{c}/profile?line=0,0")),
        (400, format!("{c}/profile?line=1,1;1,1")),
        (404, "/v1/collections/moon".to_owned()),
        (404, format!("{c}/styles/relief/map/tiles/world/17/0/0")),
        (404, format!("{c}/styles/relief/map/tiles/world/2/4/0")),
        (404, format!("{c}/styles/gold/map/tiles/world/2/0/0")),
        (404, format!("{c}/styles/relief/map/tiles/world/-1/0/0")),
        (404, format!("{c}/xyz/relief/7/64/63.png")),
        (404, format!("{c}/tracks/none")),
        (404, "/v1/jobs/99".to_owned()),
        (404, "/secret.txt".to_owned()),
        (404, "/../secret.txt".to_owned()),
        (404, "/%2e%2e/secret.txt".to_owned()),
        (404, "/v1/collections/..%2f..%2fetc%2fpasswd".to_owned()),
        (413, format!("{c}/patch?origin=0,0&size=1000,1000")),
        // An image may have a quarter of the samples.
        (413, format!("{c}/patch?origin=0,0&size=159,159&field=image")),
        (414, long),
        (422, format!("{c}/patch?origin=1e14,0&size=5,5&resolution_m=0.005")),
        (422, format!("{c}/patch?origin=0,0&size=3,1&field=image")),
    ];
    assert_eq!(server.get(&format!("{c}/patch?origin=0,0&size=158,158&field=image")).status, 200);
    for (status, path) in &cases {
        let answer = server.get(path);
        assert_eq!(answer.status, *status, "{path}: {}", String::from_utf8_lossy(&answer.body));
        assert_eq!(answer.header("content-type"), Some("application/problem+json"), "{path}");
        assert!(answer.json()["detail"].as_str().unwrap().len() > 10, "{path}");
    }
    let post = |media: &str, body: &str| {
        let answer = server.send("POST", "/v1/jobs", &[&format!("Content-Type: {media}")], body);
        assert_eq!(answer.header("content-type"), Some("application/problem+json"), "{body}");
        answer.status
    };
    let json = "application/json";
    assert_eq!((post(json, "{"), post(json, "[\"world\", [0, 0, 1, 1]]"), post(json, "{\"x\": 1}")), (400, 400, 400));
    assert_eq!(post(json, &" ".repeat(100_000)), 413);
    // Requests that pages of other sites may send without preflight.
    assert_eq!(post("text/plain", "{\"collection\": \"world\", \"bounds_m\": [0, 0, 1, 1]}"), 415);
    assert_eq!(server.send("PUT", "/v1/jobs", &[], "").status, 405);
    assert_eq!(server.get_with("/v1", &["Host: evil.example"]).status, 400);
    let called = |host: &str| {
        let mut stream = std::net::TcpStream::connect(&server.address).unwrap();
        write!(stream, "GET /v1 HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n").unwrap();
        let mut text = String::new();
        stream.read_to_string(&mut text).unwrap();
        text[9..12].to_owned()
    };
    assert_eq!((called("evil.example"), called("evil.example:80")), ("421".to_owned(), "421".to_owned()));
    assert_eq!((called("localhost:8080"), called("[::1]:8080")), ("200".to_owned(), "200".to_owned()));
}

/// Requests that would take too long are refused in advance, with a bound on features that would work; and it does.
#[test]
fn val_too_much_work_is_refused_with_advice() {
    let folder = area();
    world(folder.path());
    let fine = "kind = \"planetary\"\nseed = 11\nsize_px = [30, 20]\ncell_m = 0.0001\nbasic_spacing_m = 0.0001\nprocesses = [{ kind = \"texture\" }]\n";
    write(folder.path(), "fine.toml", fine);
    let server = Server::start(folder.path(), &["world.toml", "fine.toml"], &[]);
    let refused = |path: &str| {
        let answer = server.get(path);
        let detail = answer.json()["detail"].as_str().unwrap().to_owned();
        assert_eq!(answer.status, 413, "{path}: {detail}");
        detail
    };
    for window in ["size=256,256&resolution_m=40.96", "size=5000,1&resolution_m=5.12"] {
        let path = format!("/v1/collections/world/patch?origin=0,0&{window}&format=raw");
        let detail = refused(&path);
        let bound = detail.split_once("feature_min_m=").and_then(|(_, bound)| bound.split('`').next());
        assert_eq!(server.get(&format!("{path}&feature_min_m={}", bound.unwrap())).status, 200, "{detail}");
    }
    let wide = "/v1/collections/world/patch?origin=0,0&format=raw&size";
    assert!(refused(&format!("{wide}=1000000,1")).contains("Request a smaller area"));
    assert_eq!(server.get(&format!("{wide}=10000,1")).status, 200);
    let line = "/v1/collections/world/profile?line=0,0;314572,0&samples=4096&resolution_m=5.12&feature_min_m=0";
    assert!(refused(line).contains("Request a smaller area"));
    // A line across the whole map has the detail of the map's coarsest level, also with few samples.
    let across = server.get("/v1/collections/world/profile?line=-80000,0;80000,1&samples=3").json();
    let level = server.get("/v1/collections/world").json()["tile_grid"]["resolutions_m"][0].clone();
    assert_eq!(across["resolution_m"], level, "{across}");
    // A spacing between two lattices is interpolated between the points of the finer one.
    let between = server.get("/v1/collections/world/point?x=0&y=0&resolution_m=0.03").json();
    assert_eq!(between["resolution_m"], json!(0.02), "{between}");
    // A single point of the same ground is cheap.
    assert_eq!(server.get("/v1/collections/world/point?x=0&y=0&resolution_m=5.12").status, 200);
    // Only a world on a DEM points to it. The coarsest lattice of a world has 2^40 times its basic spacing.
    let coarse = server.get("/v1/collections/fine/point?x=0&y=0&resolution_m=1e9");
    let detail = coarse.json()["detail"].as_str().unwrap().to_owned();
    assert!(coarse.status == 400 && detail.contains("at most") && !detail.contains("DEM"), "{detail}");
}

/// Defaults of a request are part of the cache key of its answer: two files of one world have different answers.
#[test]
fn val_worlds_with_other_cells_are_distinct() {
    let folder = area();
    world(folder.path());
    write(folder.path(), "coarse.toml", &WORLD.replace("cell_m = 0.02", "cell_m = 0.04"));
    let server = Server::start(folder.path(), &["world.toml", "coarse.toml"], &[]);
    let patch = |id: &str, more: &str| {
        server.get(&format!("/v1/collections/{id}/patch?origin=0,4&size=50,40&format=raw{more}"))
    };
    let (fine, coarse) = (patch("world", ""), patch("coarse", ""));
    assert_ne!((&fine.body, fine.header("etag")), (&coarse.body, coarse.header("etag")));
    assert_eq!(coarse.header("grid-resolution-m"), Some("0.04"));
    assert_eq!(coarse.header("grid-origin-m"), Some("0.0,4.0"));
    assert_eq!(patch("world", "&resolution_m=0.04").body, coarse.body);
    assert_eq!(patch("coarse", "&rotate=90").header("grid-origin-m"), None);
    // The same request, written differently.
    let (a, b) = (patch("world", "&resolution_m=0.02"), patch("world", "&resolution_m=2e-2&rotate=0"));
    assert_eq!((a.header("etag"), fine.header("etag")), (b.header("etag"), a.header("etag")));
    let between = server.get("/v1/collections/world/study?origin=0.001,0.0123&size=50,40&resolution_m=0.013");
    assert_eq!(between.status, 400);
    let scale = patch("world", "&field=albedo").status;
    assert_eq!(scale, 200);
    let png = server.get("/v1/collections/world/patch?origin=0,4&size=50,40&format=png&field=albedo");
    assert!(png.header("grid-note").unwrap().starts_with("values are "), "{}", png.head);
    // An image states its sun, in the answer and in the file.
    let image =
        "/v1/collections/world/patch?origin=0,4&size=50,40&field=image&sun_azimuth_deg=100&sun_elevation_deg=20.5";
    let sun = "sun at azimuth 100 and elevation 20.5 degrees";
    assert_eq!(server.get(&format!("{image}&format=raw")).header("grid-note"), Some(sun));
    assert!(String::from_utf8_lossy(&server.get(image).body).contains(sun));
    let zero = |origin: &str| server.get(&format!("/v1/collections/world/patch?origin={origin}&size=8,8"));
    assert_eq!(zero("-0,0").header("etag"), zero("0,0").header("etag"));
}

/// ETags, ranges and encodings; a smooth version of the same ground; four quarter turns give the original.
#[test]
fn val_answers_have_tags_ranges_and_encodings() {
    let folder = area();
    world(folder.path());
    let server = Server::start(folder.path(), &["world.toml"], &[]);
    let whole = server.get(PATCH);
    let tag = whole.header("etag").unwrap().to_owned();
    let held = |tag: &str| server.get_with(PATCH, &[&format!("If-None-Match: {tag}")]);
    assert_eq!((held(&tag).status, held(&tag).header("etag")), (304, Some(tag.as_str())));
    assert_eq!((held("*").status, held(&tag.replace("\"", "")).status), (304, 200));
    let part = server.get_with(PATCH, &["Range: bytes=100-199"]);
    assert_eq!((part.status, part.body.as_slice()), (206, &whole.body[100..200]));
    let beyond = server.get_with(PATCH, &["Range: bytes=99999999-"]);
    assert_eq!((beyond.status, beyond.header("content-type")), (416, Some("application/problem+json")));
    assert_eq!(beyond.header("content-range").unwrap(), format!("bytes */{}", whole.body.len()));
    // It must not be stored as if it were the answer.
    assert_eq!((beyond.header("cache-control"), beyond.header("etag")), (Some("no-store"), None));
    let json = server.get_with("/v1/collections", &["Accept-Encoding: gzip"]);
    assert_eq!(json.header("content-encoding"), Some("gzip"));
    packed(&server);
    let raw = |more: &str| server.get(&format!("{PATCH}&format=raw{more}")).floats();
    let turned = raw("&rotate=90");
    let plain = raw("");
    assert!((0..200).all(|r| (0..300).all(|c| plain[300 * r + c] == turned[200 * (299 - c) + r])));
    let (smooth, bare) = (raw("&phenomena=1"), raw("&phenomena=1,2,4"));
    assert!(smooth != plain && bare != plain && bare != smooth);
    assert_eq!(raw("&phenomena=1,2,3,4"), plain);
    let mean = raw("&downsample=1&method=mean");
    let first: f64 = [0, 1, 300, 301].iter().map(|k| f64::from(plain[*k])).sum::<f64>() / 4.0;
    assert!((f64::from(mean[0]) - first).abs() < 1e-6);
    let point = server.get("/v1/collections/world/point?x=-1&y=2&resolution_m=0.02").json();
    assert_eq!(point["elevation_m"].as_f64().unwrap() as f32, plain[300 * 199]);
    let line =
        server.get("/v1/collections/world/profile?line=-1,2;3,2&samples=201&resolution_m=0.02&feature_min_m=0").json();
    let profile = line["elevation_m"].as_array().unwrap();
    assert!((0..201).all(|k| (profile[k].as_f64().unwrap() - f64::from(plain[300 * 199 + k])).abs() < 1e-5));
    let section = String::from_utf8(server.get("/v1/collections/world/study?origin=-1,2&size=300,200").body).unwrap();
    let study = format!(
        "[study]\nname = \"s\"\nseed = 1\ndate = \"2026-11-25\"\nlicense = \"CC-BY-4.0\"\ncreators = [\"x\"]\n\n{section}"
    );
    write(folder.path(), "study.toml", &study);
    let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let made = dem::read(&folder.path().join("release/terrain/world.tif")).unwrap().grid;
    assert_same_bits(&made, &plain);
}

/// Compressed answers have their own ETags, with which clients revalidate them; ranges refer to the uncompressed answer.
fn packed(server: &Server) {
    let raw = format!("{PATCH}&format=raw");
    let plain = server.get(&raw);
    let tag = plain.header("etag").unwrap().trim_matches('"').to_owned();
    for encoding in ["gzip", "zstd"] {
        let packed = server.get_with(&raw, &[&format!("Accept-Encoding: {encoding}")]);
        let own = format!("\"{tag}-{encoding}\"");
        assert_eq!(packed.header("content-encoding"), Some(encoding));
        assert_eq!((packed.header("etag"), packed.header("vary")), (Some(own.as_str()), Some("accept-encoding")));
        assert!(packed.body.len() < plain.body.len());
        let again = server.get_with(&raw, &[&format!("Accept-Encoding: {encoding}"), &format!("If-None-Match: {own}")]);
        assert_eq!((again.status, again.header("etag")), (304, Some(own.as_str())));
        let part = server.get_with(&raw, &["Range: bytes=0-9", &format!("If-Range: {own}")]);
        assert_eq!((part.status, part.body.len()), (200, plain.body.len()));
    }
    let part = server.get_with(&raw, &["Range: bytes=0-9", &format!("If-Range: \"{tag}\""), "Accept-Encoding: gzip"]);
    assert_eq!((part.status, part.header("content-encoding")), (206, None));
    let page = server.get_with("/page.js", &["Accept-Encoding: gzip"]);
    let own = format!("If-None-Match: {}", page.header("etag").unwrap());
    assert_eq!(server.get_with("/page.js", &["Accept-Encoding: gzip", &own]).status, 304);
    // A range is for GET alone.
    for range in ["", "Range: bytes=0-9", "Range: bytes=99999999-"] {
        let more: Vec<&str> = Some(range).filter(|range| !range.is_empty()).into_iter().collect();
        let head = server.send("HEAD", &raw, &more, "");
        assert_eq!((head.status, head.body.len()), (200, 0), "{range}");
        assert_eq!(head.header("content-length").unwrap(), plain.body.len().to_string());
    }
}

/// Only pages of the named origins may read answers and refusals.
#[test]
fn val_named_origins_may_read() {
    let folder = area();
    world(folder.path());
    let arguments = ["world.toml", "--cors", "https://a.example", "--cors", "http://b.example:81"];
    let server = Server::start(folder.path(), &arguments, &[("SASTRUGI_TOKEN", "a-secret")]);
    let allowed = |path: &str, origin: &str| {
        let answer = server.get_with(path, &[&format!("Origin: {origin}")]);
        answer.header("access-control-allow-origin").map(str::to_owned)
    };
    for path in ["/v1?token=a-secret", "/v1", "/v1/nothing"] {
        assert_eq!(allowed(path, "https://a.example").as_deref(), Some("https://a.example"), "{path}");
        assert_eq!(allowed(path, "http://b.example:81").as_deref(), Some("http://b.example:81"));
        assert_eq!(allowed(path, "https://c.example"), None);
    }
    let asks = ["Origin: https://a.example", "Access-Control-Request-Method: GET"];
    assert_eq!(server.send("OPTIONS", PATCH, &asks, "").status, 200);
    for (wrong, code) in [("example.org", 2), ("https://example.org/x", 2), ("https://", 2)] {
        let call = sastrugi_in(folder.path(), &["serve", "world.toml", "--cors", wrong]);
        assert_eq!(call.code, code, "{}", call.stderr);
        assert!(call.stderr.contains("--cors"), "{}", call.stderr);
    }
    for option in ["--connections", "--per-client"] {
        for value in ["0", "18446744073709551615"] {
            assert_eq!(sastrugi_in(folder.path(), &["serve", "world.toml", option, value]).code, 2);
        }
    }
    assert_eq!(sastrugi_in(folder.path(), &["serve", "world.toml", "--library", "world.toml"]).code, 2);
    let any = Server::start(folder.path(), &["world.toml", "--cors", "*"], &[]);
    let answer = any.get_with("/v1", &["Origin: https://c.example"]);
    assert_eq!(answer.header("access-control-allow-origin"), Some("*"));
}

/// A token, a limit for each client, and a graceful shutdown.
#[test]
fn val_access_is_limited() {
    let folder = area();
    world(folder.path());
    let mut server =
        Server::start(folder.path(), &["world.toml", "--per-client", "1"], &[("SASTRUGI_TOKEN", "a-secret")]);
    assert_eq!(server.get("/v1/collections").status, 401);
    assert_eq!(server.get_with("/v1/collections", &["Authorization: Bearer wrong"]).status, 401);
    assert_eq!(server.get_with("/v1/collections", &["Authorization: Bearer a-secret"]).status, 200);
    assert_eq!(server.get("/v1/collections?token=a-secret").status, 200);
    assert_eq!((server.get("/").status, server.get("/healthz").status), (200, 200));
    // An image of a million samples takes seconds.
    let slow = "/v1/collections/world/patch?origin=0,0&size=1000,1000&field=image&token=a-secret";
    let busy = std::thread::scope(|scope| {
        // The slow answer may arrive while the other request is answered.
        let slow = scope.spawn(|| while server.get(slow).status == 429 {});
        loop {
            let answer = server.get("/v1/collections?token=a-secret");
            if answer.status == 429 || slow.is_finished() {
                break answer;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    });
    assert_eq!((busy.status, busy.header("retry-after")), (429, Some("1")));
    let metrics = String::from_utf8(server.get("/metrics?token=a-secret").body).unwrap();
    assert!(metrics.contains("sastrugi_requests_total{route=\"/v1/collections\",status=\"401\"} 2"), "{metrics}");
    assert_eq!(server.get("/metrics").status, 401);
    assert_eq!(server.terminate(), Some(0));
}

/// The log has one line per request: a JSON object if requested, otherwise text.
#[test]
fn val_requests_are_logged() {
    let folder = area();
    world(folder.path());
    for (format, is_json) in [("json", true), ("text", false)] {
        let log = folder.path().join(format);
        let mut command = std::process::Command::new(sastrugi_tests::program());
        command.args(["serve", "--listen", "127.0.0.1:0", "world.toml", "--log", "--log-format", format]);
        command.env_remove("RUST_LOG").current_dir(folder.path()).stderr(fs::File::create(&log).unwrap());
        let mut server = Server::start_command(&mut command);
        assert_eq!((server.get("/v1/collections").status, server.get("/v1/jobs/99?token=secret").status), (200, 404));
        assert_eq!(server.terminate(), Some(0));
        let said = fs::read_to_string(&log).unwrap();
        assert!(!said.contains("secret"), "tokens may stand behind the path: {said}");
        let lines: Vec<&str> =
            said.lines().filter(|line| line.contains("\"request\"") || line.contains(" request ")).collect();
        assert_eq!(lines.len(), 2, "{said}");
        assert_eq!(said.lines().all(|line| serde_json::from_str::<serde_json::Value>(line).is_ok()), is_json, "{said}");
        if is_json {
            let fields =
                lines.iter().map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap()["fields"].clone());
            let fields: Vec<_> =
                fields.map(|f| (f["method"].clone(), f["path"].clone(), f["status"].clone())).collect();
            assert_eq!(fields[0], (json!("GET"), json!("/v1/collections"), json!(200)));
            assert_eq!(fields[1], (json!("GET"), json!("/v1/jobs/99"), json!(404)));
        }
    }
}

/// A server that is told to stop finishes the open requests.
#[test]
fn val_a_stopping_server_finishes_open_requests() {
    let folder = area();
    world(folder.path());
    let mut server = Server::start(folder.path(), &["world.toml", "--threads", "1"], &[]);
    let (mut open, address) = (server.client().unwrap(), server.address.clone());
    let patch = "/v1/collections/world/patch?origin=0,0&size=1024,1024&resolution_m=0.02&format=raw";
    let answer = std::thread::scope(|scope| {
        let asked = scope.spawn(move || open.get(patch).unwrap());
        while server.get("/v1/library").json()["running"] == 0 {
            std::thread::sleep(Duration::from_millis(5));
        }
        assert_eq!(server.terminate(), Some(0));
        asked.join().unwrap()
    });
    assert_eq!((answer.status, answer.body.len()), (200, 4 << 20));
    assert!(sastrugi_tests::server::Client::connect(&address).is_err());
}

/// Jobs that prepare tiles in advance: run, listed, cancelled.
#[test]
fn val_jobs_prepare_tiles_in_advance() {
    let folder = area();
    world(folder.path());
    let server = Server::start(folder.path(), &["world.toml"], &[]);
    let order = |bounds: &str| {
        let body = format!("{{\"collection\": \"world\", \"bounds_m\": {bounds}, \"resolution_m\": 0.02}}");
        server.send("POST", "/v1/jobs", &["Content-Type: application/json"], &body)
    };
    let taken = order("[-1, 2, 5, 6]");
    assert_eq!((taken.status, taken.header("location")), (202, Some("/v1/jobs/1")));
    let state = |path: &str, wanted: &str| {
        for _ in 0..600 {
            let job = server.get(path).json();
            if job["state"] == wanted {
                return job;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        panic!("{path} is not {wanted}: {}", server.get(path).json());
    };
    let job = state("/v1/jobs/1", "done");
    assert_eq!(job["tiles"], job["tiles_made"]);
    // A tile counts once it has been delivered.
    let made = || server.get("/v1/library").json()["made"].clone();
    assert!((0..600).any(|_| made() == job["tiles"] || (std::thread::sleep(Duration::from_millis(50)), false).1));
    assert_eq!(server.get(PATCH).status, 200);
    assert_eq!(made(), job["tiles"]);
    // Coarse tiles take seconds each: cancelling them, and requesting other tiles, does not wait for them.
    let body = "{\"collection\": \"world\", \"bounds_m\": [1e5, 1e5, 2e5, 2e5], \"resolution_m\": 2.56}";
    assert_eq!(server.send("POST", "/v1/jobs", &["Content-Type: application/json"], body).status, 202);
    assert_eq!(server.get("/v1/collections/world/point?x=777&y=777").status, 200);
    assert_eq!(server.get("/v1/jobs/2").json()["state"], "running");
    let cancelled = server.send("DELETE", "/v1/jobs/2", &[], "");
    assert_eq!((cancelled.status, &cancelled.json()["state"]), (200, &"cancelled".into()));
    let idle = (0..600).any(|_| {
        std::thread::sleep(Duration::from_millis(20));
        server.get("/v1/library").json()["running"] == 0
    });
    assert!(idle);
    assert_eq!(server.send("DELETE", "/v1/jobs/2", &[], "").status, 409);
    assert_eq!(order("[0, 0, 1e9, 1e9]").status, 413);
    assert_eq!(order("[5, 0, 1, 1]").status, 400);
    // A job states what it generates, also what was not requested.
    let body =
        "{\"collection\": \"world\", \"bounds_m\": [0, 0, 1, 1], \"phenomena\": [2, 1], \"feature_min_m\": null}";
    let taken = server.send("POST", "/v1/jobs", &["Content-Type: application/json"], body).json();
    assert_eq!(
        (&taken["resolution_m"], &taken["phenomena"], &taken["feature_min_m"]),
        (&json!(0.02), &json!([2, 1]), &json!(0.0))
    );
    assert_eq!(server.get("/v1/jobs").json()["jobs"].as_array().unwrap().len(), 3);
}

/// The terrains of a release are served with their maps and tracks; their pixels at the finest level are their cells.
#[test]
fn val_releases_are_served() {
    let folder = area();
    write(folder.path(), "study.toml", &sastrugi_tests::small_study());
    let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let server = Server::start(folder.path(), &["release"], &[]);
    let all = server.get("/v1/collections").json();
    let collections = all["collections"].as_array().unwrap();
    assert!(!collections.is_empty());
    let (mut tracks, mut compared) = (0, 0);
    for collection in collections {
        let id = collection["id"].as_str().unwrap();
        let own = &collection["tile_grid"];
        let name = id.split_once('.').unwrap().1;
        let file = ["terrain", "dem", "texture"].map(|stage| folder.path().join(format!("release/{stage}/{name}.tif")));
        let grid = dem::read(file.iter().find(|f| f.is_file()).unwrap()).unwrap().grid;
        let g = grid.geometry;
        let (rows, cols) = (g.rows.min(40), g.cols.min(50));
        let patch = server.get(&format!(
            "/v1/collections/{id}/patch?origin={},{}&size={cols},{rows}&format=raw",
            g.x(0),
            g.y(g.rows - 1)
        ));
        if g.cell[0] == g.cell[1] {
            compared += 1;
            let heights = patch.floats();
            assert_eq!(heights.len(), rows * cols, "{id}");
            for (r, c) in (0..rows).flat_map(|r| (0..cols).map(move |c| (r, c))) {
                let (a, b) = (grid.at(g.rows - rows + r, c) as f32, heights[r * cols + c]);
                assert!(a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan()), "{id} {r} {c}: {a} {b}");
            }
        }
        let level = own["levels"].as_u64().unwrap() - 1;
        let tile = |layer: &str| server.get(&format!("/v1/collections/{id}/styles/{layer}/map/tiles/{id}/{level}/0/0"));
        assert_eq!(tile("relief").status, 200);
        let pixels = rgba(&tile("terrarium").body);
        if g.cell[0] == g.cell[1] {
            for (r, c) in (0..rows).flat_map(|r| (0..cols).map(move |c| (r, c))) {
                let [red, green, blue, opaque] = pixels[256 * r + c];
                let seen = f64::from(red) * 256.0 + f64::from(green) + f64::from(blue) / 256.0 - 32768.0;
                let height = grid.at(r, c);
                assert!((seen - height).abs() < 0.002 || (opaque == 0 && height.is_nan()), "{id} {r} {c}");
            }
        }
        for track in server.get(&format!("/v1/collections/{id}/tracks")).json()["tracks"].as_array().unwrap() {
            let one = server.get(&format!("/v1/collections/{id}/tracks/{}", track["id"].as_str().unwrap())).json();
            assert!(one["x_m"].as_array().unwrap().len() > 1);
            tracks += 1;
        }
        // Points and profiles are interpolated between the cells of the file, whatever spacing is requested.
        let [x, y] = [g.x(cols / 2) + 0.3 * g.cell[0], g.y(rows / 2) + 0.4 * g.cell[1]];
        let height = |path: &str, pointer: &str| {
            let answer = server.get(&format!("/v1/collections/{id}/{path}")).json();
            assert_eq!(answer["resolution_m"].as_f64(), collection["cell_m"].as_f64(), "{id} {path}");
            answer.pointer(pointer).unwrap().clone()
        };
        let own = height(&format!("point?x={x}&y={y}"), "/elevation_m");
        assert_eq!(height(&format!("point?x={x}&y={y}&resolution_m=1000"), "/elevation_m"), own);
        let line = format!("profile?line={x},{y};{},{}&samples=2", g.x(g.cols - 1), g.y(0));
        assert_eq!(height(&line, "/elevation_m/0"), own);
        // Beyond its edge there is no data, whatever the sample spacing.
        let [_, _, east, north] = [0, 1, 2, 3].map(|k| collection["bounds_m"][k].as_f64().unwrap());
        for step in [g.cell[0], 4.0 * g.cell[0], 64.0 * g.cell[0]] {
            let (x, y) = (east + 0.6 * g.cell[0], north - 0.5 * g.size()[1]);
            let point = server.get(&format!("/v1/collections/{id}/point?x={x}&y={y}&resolution_m={step}")).json();
            assert!(point["elevation_m"].is_null(), "{id} {step}: {point}");
        }
    }
    // Three terrains and the texture have square cells.
    assert!(tracks > 0 && compared >= 3, "{tracks} {compared}");
}

/// A measured DEM in degrees is served in metres, as in a study; its cells, which are not square, are at the right places.
#[test]
fn val_dems_in_degrees_are_served_in_metres() {
    let folder = area();
    let file = sastrugi_fixtures::workspace_root().join("fixtures/dem/jacksboro.tif");
    let study = format!(
        "[study]\nname = \"site\"\nseed = 1\ndate = \"2026-11-25\"\nlicense = \"CC0-1.0\"\n\n[[dem]]\nid = \"jacksboro\"\n\
         file = \"{}\"\nlicense = \"public domain\"\n",
        file.display()
    );
    write(folder.path(), "study.toml", &study);
    let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let metric = dem::read(&folder.path().join("release/dem/jacksboro.metric.tif")).unwrap().grid;
    let server = Server::start(folder.path(), &["release"], &[]);
    let described = server.get("/v1/collections/site.jacksboro").json();
    let g = metric.geometry;
    assert_eq!(described["cell_m"].as_f64(), Some(g.cell[0].min(g.cell[1])));
    for (row, col) in [(0, 0), (17, 230), (g.rows - 1, g.cols - 1)] {
        let path = format!("/v1/collections/site.jacksboro/point?x={:?}&y={:?}", g.x(col), g.y(row));
        let point = server.get(&path).json();
        assert_eq!(point["elevation_m"].as_f64().unwrap() as f32, metric.at(row, col) as f32, "{row} {col}");
    }
}

/// A file that is no longer what its release sealed is not served.
#[test]
fn val_changed_files_are_not_served() {
    let folder = area();
    write(folder.path(), "study.toml", &sastrugi_tests::small_study());
    let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let terrains = fs::read_dir(folder.path().join("release/terrain")).unwrap().flatten();
    let file = terrains.map(|e| e.path()).find(|p| p.extension().is_some_and(|e| e == "tif")).unwrap();
    let id = file.file_stem().unwrap().to_string_lossy().split('.').next().unwrap().to_owned();
    let mut read = dem::read(&file).unwrap();
    read.grid.values.iter_mut().for_each(|z| *z += 100.0);
    dem::write(&file, &read.grid, &read.info.crs, &dem::WriteOptions::default()).unwrap();
    let server = Server::start(folder.path(), &["release"], &[]);
    let all = server.get("/v1/collections").json();
    let own =
        all["collections"].as_array().unwrap().iter().find(|c| c["id"].as_str().unwrap().ends_with(&format!(".{id}")));
    let (own, [west, south]) =
        own.map(|c| (c["id"].as_str().unwrap(), [0, 1].map(|k| c["bounds_m"][k].as_f64().unwrap()))).unwrap();
    let answer = server.get(&format!("/v1/collections/{own}/point?x={}&y={}", west + 1.0, south + 1.0));
    assert_eq!(answer.status, 500, "{}", answer.head);
    assert!(answer.json()["detail"].as_str().unwrap().contains("changed"), "{}", answer.json());
}

/// Tracks of tables that are no longer what their release sealed are not served, and their number is unknown; clients do not see where the release
/// lies. An unknown track is refused without reading samples.
#[test]
fn val_changed_tables_are_not_served() {
    let folder = area();
    write(folder.path(), "study.toml", &sastrugi_tests::small_study());
    let call = sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let release = folder.path().join("release");
    let server = Server::start(folder.path(), &[release.to_str().unwrap()], &[]);
    let all = server.get("/v1/collections").json();
    let driven = all["collections"].as_array().unwrap().iter().find(|c| c["tracks"].as_u64().unwrap() > 1).unwrap();
    let c = format!("/v1/collections/{}", driven["id"].as_str().unwrap());
    let list = server.get(&format!("{c}/tracks")).json();
    assert_eq!((&list["total"], list["tracks"].as_array().map(Vec::len)), (&driven["tracks"], Some(tracks_of(driven))));
    let track = |k: usize| format!("{c}/tracks/{}", list["tracks"][k]["id"].as_str().unwrap());
    let first = server.get(&track(0));
    assert_eq!((first.status, first.json()["id"].clone()), (200, list["tracks"][0]["id"].clone()));
    assert!(first.json()["time_s"].as_array().unwrap().windows(2).all(|t| t[0].as_f64() <= t[1].as_f64()));
    let tag = format!("If-None-Match: {}", first.header("etag").unwrap());
    assert_eq!(server.get_with(&track(0), &[&tag]).status, 304);
    let refused = |server: &Server, path: &str, status: u16| {
        let answer = server.get(path);
        let detail = answer.json()["detail"].as_str().unwrap().to_owned();
        assert_eq!(answer.status, status, "{path}: {detail}");
        assert!(!detail.contains(folder.path().to_str().unwrap()), "{detail}");
        detail
    };
    damage(&release.join("tables/samples"));
    assert!(refused(&server, &track(1), 500).contains("changed"));
    // The first track was read while its table was what the release sealed.
    assert_eq!(server.get(&track(0)).body, first.body);
    refused(&server, &format!("{c}/tracks/{}", "none".repeat(100)), 404);
    damage(&release.join("tables/missions"));
    assert!(refused(&server, &format!("{c}/tracks"), 500).contains("changed"));
    let again = Server::start(folder.path(), &[release.to_str().unwrap()], &[]);
    assert!(again.get(&c).json()["tracks"].is_null());
    assert!(refused(&again, &format!("{c}/tracks"), 500).contains("changed"));
}

fn tracks_of(collection: &serde_json::Value) -> usize {
    collection["tracks"].as_u64().unwrap() as usize
}

/// Changes a byte in each file of a folder.
fn damage(folder: &Path) {
    for file in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        let mut bytes = fs::read(&file).unwrap();
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        fs::write(&file, bytes).unwrap();
    }
}

/// Ground received from a server, in the same tiles as a world generated in this process.
struct ServedGround {
    client: Client,
    cell_m: f64,
    tiles: RefCell<HashMap<[i64; 2], GroundGrid>>,
}

impl ServedGround {
    const TILE: i64 = 256;

    /// A tile in cells from its south-west sample, with the first column and row of its neighbours.
    fn tile(&self, place: [i64; 2]) -> GroundGrid {
        let side = Self::TILE as usize + 1;
        let origin_m = place.map(|at| (Self::TILE * at) as f64 * self.cell_m);
        let patch = Patch { resolution_m: Some(self.cell_m), ..Patch::new("world", origin_m, [side; 2]) };
        let mut tile = self.client.ground(&patch).unwrap();
        tile.heights.geometry = Geometry { origin: [-0.5; 2], ..Geometry::square(side, side, 1.0) };
        tile
    }
}

impl Ground for ServedGround {
    fn at(&self, x_m: f64, y_m: f64) -> Result<GroundPoint, NoGround> {
        let position = [x_m, y_m].map(|at| at / self.cell_m);
        let place = position.map(|p| (p.floor() as i64).div_euclid(Self::TILE));
        let mut tiles = self.tiles.borrow_mut();
        let tile = tiles.entry(place).or_insert_with(|| self.tile(place));
        let [x, y] = [0, 1].map(|axis| position[axis] - (Self::TILE * place[axis]) as f64);
        tile.sample(x, y).ok_or(NoGround { x_m, y_m })
    }

    fn cell_m(&self) -> f64 {
        self.cell_m
    }
}

/// Rovers of both navigators on ground from the server, through the Rust client, have the same tracks as in this process, bit for bit.
#[test]
fn val_rovers_on_ground_from_the_server_have_the_same_tracks() {
    let folder = area();
    write(folder.path(), "world.toml", &WORLD.replace("{ kind = \"primary_craters\", diameter_max_m = 200.0 },", ""));
    let server = Server::start(folder.path(), &["world.toml"], &[]);
    let client = Client::new(&format!("http://{}", server.address));
    let parameters = RoverParameters { rovers: 3, radius_m: 6.0, ..RoverParameters::default() };
    let served = ServedGround { client, cell_m: parameters.cell_m, tiles: RefCell::default() };
    let processes = json!([{"kind": "texture"}, {"kind": "rocks", "coverage": 0.118}, {"kind": "albedo"}]);
    let raw = RawPlanetary {
        size_px: Some([16, 16]),
        basic_spacing_m: Some(0.005),
        processes: serde_json::from_value(processes).unwrap(),
        ..RawPlanetary::default()
    };
    let world = Planetary::try_from(raw).unwrap();
    let streams = Streams::for_seed(11, "terrain");
    let ground = world.ground(&streams, parameters.cell_m, &[], 400).unwrap();
    let starts = parameters.starts(&Streams::for_seed(5, "rover"), |_| true);
    let noise = Counter::new(&mut Streams::for_seed(5, "rover").stream("noise"));
    let mut cycles = 0;
    for navigator in
        [Navigator::Sojourner(SojournerParameters::default()), Navigator::Schoppers(SchoppersParameters::default())]
    {
        let task = navigator.task(&parameters);
        for (k, start) in starts.iter().enumerate() {
            let one = |ground: &dyn Ground| {
                let mut track = Track::new(&ground, &task, 0.05);
                let key = noise.at(k as i64);
                let end = drive(&ground, &task, navigator.policy().as_mut(), start, key, |cycle| track.add(cycle));
                (end, track.finish().samples)
            };
            let (here, there) = (one(&ground.view()), one(&served));
            assert_eq!(here, there, "{} {k}", navigator.kind());
            cycles += here.1.len();
        }
    }
    assert!(cycles > 300, "{cycles}");
}

/// The client lists what is served, and reports why a request is refused.
#[test]
fn val_the_client_reads_what_is_served() {
    let folder = area();
    world(folder.path());
    let server = Server::start(folder.path(), &["world.toml"], &[("SASTRUGI_TOKEN", "a-secret")]);
    let client = Client::new(&format!("http://{}/", server.address));
    assert!(matches!(client.collections(), Err(ClientError::Refused { status: 401, .. })));
    let client = client.with_token("a-secret");
    let all = client.collections().unwrap();
    assert_eq!((all.len(), all[0].id.as_str(), all[0].cell_m), (1, "world", 0.02));
    let call = sastrugi_in(folder.path(), &["terrain", "world.toml", "-o", "made.tif"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    let made = dem::read(&folder.path().join("made.tif")).unwrap().grid;
    let patch = client.patch(&Patch::new("world", [-1.0, 2.0], [300, 200])).unwrap();
    assert_eq!(patch.values, made.to_f32().values);
    let [ours, theirs] = [patch.geometry, made.geometry].map(|g| (g.rows, g.cols, g.cell, g.origin));
    assert!((0..2).all(|axis| (ours.3[axis] - theirs.3[axis]).abs() < 1e-12), "{ours:?} {theirs:?}");
    let smooth = Patch { phenomena: Some(vec![1]), ..Patch::new("world", [-1.0, 2.0], [300, 200]) };
    assert_ne!(client.patch(&smooth).unwrap(), patch);
    match client.patch(&Patch::new("moon", [0.0; 2], [3, 3])) {
        Err(ClientError::Refused { status: 404, detail }) => assert!(detail.contains("moon"), "{detail}"),
        other => panic!("{other:?}"),
    }
}

/// A measured DEM with synthesised detail is served as `terrain` generates it, bit for bit; its map ends at its posts, and its pixels are its points.
#[test]
fn val_elaborated_dems_are_served() {
    let folder = area();
    let dem = "kind = \"planetary\"\nseed = 4\nsize_px = [60, 50]\ncell_m = 5.12\nbasic_spacing_m = 0.01\norigin_m = [1024.0, 2048.0]\n\
               processes = [{ kind = \"base_slope\", gradient = [0.1, 0.05] }, { kind = \"texture\", roughness_m = 0.05, hurst = 0.7 }]\n";
    let site = "kind = \"elaborate\"\nseed = 5\ndem = \"dem.tif\"\nsize_px = [300, 200]\ncell_m = 0.04\nbasic_spacing_m = 0.01\n\
                origin_m = [1130.0, 2150.0]\nprocesses = [{ kind = \"rocks\", coverage = 0.118 }, { kind = \"albedo\" }]\n";
    write(folder.path(), "dem.toml", dem);
    write(folder.path(), "site.toml", site);
    for (spec, output) in [("dem.toml", "dem.tif"), ("site.toml", "site.tif")] {
        let call = sastrugi_in(folder.path(), &["terrain", spec, "-o", output]);
        assert_eq!(call.code, 0, "{}", call.stderr);
    }
    let made = dem::read(&folder.path().join("site.tif")).unwrap().grid;
    let posts = dem::read(&folder.path().join("dem.tif")).unwrap().grid;
    let server = Server::start(folder.path(), &["site.toml"], &[]);
    let c = "/v1/collections/site";
    let patch = server.get(&format!("{c}/patch?origin=1130,2150&size=300,200&format=raw")).floats();
    assert_same_bits(&made, &patch);
    let smooth = server.get(&format!("{c}/patch?origin=1130,2150&size=300,200&format=raw&phenomena=")).floats();
    assert!(patch.iter().zip(&smooth).filter(|(a, b)| a != b).count() > 100);
    // At a post, whatever features are left out.
    let post = [posts.geometry.x(30), posts.geometry.y(20)];
    for more in ["", "&feature_min_m=3", "&resolution_m=0.64"] {
        let point = server.get(&format!("{c}/point?x={}&y={}{more}", post[0], post[1])).json();
        assert!(
            (point["elevation_m"].as_f64().unwrap() - posts.at(20, 30)).abs() < 0.02,
            "{point} {}",
            posts.at(20, 30)
        );
    }
    // A pixel of each level, and the area beyond the posts.
    let described = server.get(c).json();
    let grid = &described["tile_grid"];
    let [west, north] = [0, 1].map(|k| grid["origin_m"][k].as_f64().unwrap());
    let levels = grid["levels"].as_u64().unwrap();
    assert_eq!(levels, 8, "pixels of 2 cm to 2.56 m, half the posts: {described}");
    let mut sorted = posts.values.clone();
    sorted.sort_by(f64::total_cmp);
    let range = [0, 1].map(|k| described["height_range_m"][k].as_f64().unwrap());
    assert_eq!(range, [0.05, 0.95].map(|share| sorted[(share * sorted.len() as f64) as usize]));
    // A line across the complete DEM, with samples farther apart than the posts.
    let line = server.get(&format!("{c}/profile?line=1030,2055;1320,2290&samples=20")).json();
    assert_eq!(line["resolution_m"], json!(2.56), "{line}");
    for level in 0..levels {
        let step = grid["resolutions_m"][level as usize].as_f64().unwrap();
        let [col, row] = [(1180.0 - west) / step, (north - 2190.0) / step].map(|at| at as u32);
        let tile = server.get(&format!("{c}/styles/terrarium/map/tiles/site/{level}/{}/{}", row / 256, col / 256));
        let [red, green, blue, _] = rgba(&tile.body)[(256 * (row % 256) + col % 256) as usize];
        let seen = f64::from(red) * 256.0 + f64::from(green) + f64::from(blue) / 256.0 - 32768.0;
        let [x, y] = [west + (f64::from(col) + 0.5) * step, north - (f64::from(row) + 0.5) * step];
        let point = server.get(&format!("{c}/point?x={x}&y={y}&feature_min_m={}", 2.0 * step)).json();
        assert!((seen - point["elevation_m"].as_f64().unwrap()).abs() < 0.003, "level {level}: {seen} {point}");
    }
    assert!(server.get(&format!("{c}/point?x=1000&y=2150")).json()["elevation_m"].is_null());
    let coarse = server.get(&format!("{c}/patch?origin=1130,2150&size=5,5&resolution_m=20"));
    assert!(
        coarse.status == 400 && coarse.json()["detail"].as_str().unwrap().contains("the DEM itself"),
        "{}",
        coarse.json()
    );
    assert_eq!(server.get(&format!("{c}/study?origin=1130,2150&size=5,5")).status, 400);
    // TileJSON offers steps of 4 mm and 10 cm for pixels of suitable size, and fine steps throughout.
    for (layer, maxzoom) in [("terrarium", 8 + 4), ("terrain_rgb", 8 + 4), ("elevation", 8 + 7)] {
        let offered = server.get(&format!("{c}/xyz/{layer}/tilejson.json")).json();
        assert_eq!(offered["maxzoom"], json!(maxzoom), "{layer}");
    }
    // A hole is empty on the map, and its edge agrees with point queries.
    let mut holed = dem::read(&folder.path().join("dem.tif")).unwrap();
    (0..50 * 60)
        .filter(|k| (20..30).contains(&(k / 60)) && (20..40).contains(&(k % 60)))
        .for_each(|k| holed.grid.values[k] = f64::NAN);
    let options = dem::WriteOptions::default();
    dem::write(&folder.path().join("holed.tif"), &holed.grid, &dem::Crs::default(), &options).unwrap();
    write(
        folder.path(),
        "holed.toml",
        &site.replace("dem.tif", "holed.tif").replace("1130.0, 2150.0", "1030.0, 2060.0"),
    );
    let holes = Server::start(folder.path(), &["holed.toml"], &[]);
    let h = "/v1/collections/holed";
    let [col, row] = [1150.0 - west, north - 2170.0].map(|at| (at / (256.0 * 0.02)) as u32);
    assert_eq!(holes.get(&format!("{h}/styles/relief/map/tiles/holed/7/{row}/{col}")).status, 204);
    let line = holes.get(&format!("{h}/patch?origin=1030,2170&size=128,1&resolution_m=0.64&format=raw")).floats();
    for (k, z) in line.iter().enumerate() {
        let point = holes.get(&format!("{h}/point?x={}&y=2170&resolution_m=0.64", 1030.0 + 0.64 * k as f64)).json();
        assert_eq!(point["elevation_m"].as_f64().map(|own| own as f32), Some(*z).filter(|z| z.is_finite()), "{k}");
    }
    assert!(line.iter().any(|z| z.is_nan()) && line.iter().any(|z| z.is_finite()));
    // Errors in the input are reported at startup.
    let near = "altimetry_points_m = [[1140.0, 2160.0, 9.0], [1140.004, 2160.0, 8.0]]\n";
    write(folder.path(), "wrong.toml", &format!("{site}{near}"));
    let refused = sastrugi_in(folder.path(), &["serve", "wrong.toml"]);
    assert!(refused.code == 65 && refused.stderr.contains("altimetry_points_m"), "{}", refused.stderr);
    // Another DEM with the same name is another collection.
    let tag = server.get(&format!("{c}/patch?origin=1130,2150&size=5,5")).header("etag").unwrap().to_owned();
    write(folder.path(), "dem.toml", &dem.replace("seed = 4", "seed = 6"));
    assert_eq!(sastrugi_in(folder.path(), &["terrain", "dem.toml", "-o", "dem.tif"]).code, 0);
    let again = Server::start(folder.path(), &["site.toml"], &[]);
    assert_ne!(again.get(&format!("{c}/patch?origin=1130,2150&size=5,5")).header("etag"), Some(tag.as_str()));
}
