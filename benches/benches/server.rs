//! The terrain server under load, compared with floors.
//!
//! * A patch of 512 x 512 samples (1 MB) that was requested before, by 1, 8 and 64 clients with persistent connections: as fast as possible, and
//!   at a constant 320 requests per second over all clients. The floor is a thread for each connection that sends the same bytes.
//! * A new patch of 256 x 256 samples 2 cm apart, compared with the same kernel in this process.
//! * A session of 500 map tiles from the whole planet down to the ground, over the 6 connections of a browser.
//! * Tiles of a DEM of a release by 8 clients, compared with titiler, with 2 workers, which serves the same heights as a COG on the same grid.
//! * Memory with 1000 connections.
//! * Time from the disconnection of the last client of a coarse window, which takes seconds, to the end of the work on it.
//!
//! Targets: 64 clients: median 2 ms, p99 10 ms; new patch: 60 ms of one core, and 5 ms beyond the kernel; session: 20 s cold, 2 s warm; 5 times the tiles of titiler;
//! work ends 50 ms after its last client. It takes 2 minutes on two otherwise idle cores, and measures the program that was built before:
//!
//! ```text
//! benches/floors/set_up && cargo build --release && cargo bench -p sastrugi-benches --bench server
//! ```

use sastrugi_benches::{python, script_of};
use sastrugi_numeric::Streams;
use serde_json::json;
use server::{Client, Server};
use std::io::{BufRead, BufReader, Write};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// The server and the client of the tests.
#[allow(dead_code, reason = "tests use more of it")]
#[path = "../../tests/src/server.rs"]
mod server;

const WORLD: &str = "/v1/collections/planet";
/// How long clients send requests as fast as possible, and at a constant rate.
const SPELL: Duration = Duration::from_secs(2);
/// Requests per second over all clients at the constant rate.
const STEADY: f64 = 320.0;
/// Connections of a browser.
const CONNECTIONS: usize = 6;
/// Levels of the map of a world.
const LEVELS: usize = 17;

fn main() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let planet = include_str!("../../fixtures/worlds/planet.toml");
    std::fs::write(folder.path().join("planet.toml"), planet).expect("a file can be written");
    cached(folder.path());
    fresh(folder.path());
    session(folder.path());
    tiles(folder.path());
    memory(folder.path());
    stopping(folder.path());
}

/// The program that was built with this bench.
fn program() -> PathBuf {
    let own = std::env::current_exe().expect("the bench has a path");
    own.ancestors().nth(2).expect("benches lie in target/<profile>/deps").join("sastrugi")
}

/// The quantile of sorted values.
fn part(sorted: &[f64], share: f64) -> f64 {
    sorted.get(((sorted.len().max(1) - 1) as f64 * share) as usize).copied().unwrap_or(f64::NAN)
}

fn sorted(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    values
}

fn milliseconds(since: Instant) -> f64 {
    1e3 * since.elapsed().as_secs_f64()
}

/// Measurements of the clients.
struct Load {
    /// Milliseconds of all answers, sorted.
    times: Vec<f64>,
    /// Answers per second.
    rate: f64,
}

impl Load {
    /// Clients that request the same bytes: as fast as possible, or at a constant rate, where times count from the scheduled start.
    fn of(address: &str, path: &str, clients: usize, steady: Option<f64>) -> Self {
        let start = Instant::now();
        let one = |client: usize| {
            let mut connection = Client::connect(address).expect("the server listens");
            let (mut times, mut body) = (Vec::new(), Vec::new());
            while start.elapsed() < SPELL {
                let turn = steady.map(|rate| {
                    let k = (times.len() * clients + client) as f64;
                    start + Duration::from_secs_f64(k / rate)
                });
                turn.iter().for_each(|at| std::thread::sleep(at.saturating_duration_since(Instant::now())));
                let asked = turn.unwrap_or_else(Instant::now);
                let (status, _) = connection.get_into(path, &mut body).expect("an answer");
                assert_eq!((status, body.len()), (200, 1 << 20));
                times.push(milliseconds(asked));
            }
            times
        };
        let times: Vec<f64> = std::thread::scope(|scope| {
            let one = &one;
            let asking: Vec<_> = (0..clients).map(|client| scope.spawn(move || one(client))).collect();
            asking.into_iter().flat_map(|a| a.join().expect("a client")).collect()
        });
        let rate = times.len() as f64 / start.elapsed().as_secs_f64();
        Self { times: sorted(times), rate }
    }

    fn print(&self, name: &str, clients: usize, cpu_ms: Option<f64>) {
        let [median, late] = [0.5, 0.99].map(|share| part(&self.times, share));
        let cpu = cpu_ms.map_or(String::new(), |ms| format!(", {:.2} ms of a core each", ms / self.times.len() as f64));
        println!(
            "{name}, {clients} clients: median {median:.2} ms, p99 {late:.2} ms, {:.0} requests/s{cpu}",
            self.rate
        );
    }
}

/// A thread for each connection that sends 1 MB for every head that it reads.
fn floor_of_bytes() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = listener.local_addr().expect("it listens").to_string();
    let mut answer = b"HTTP/1.1 200 OK\r\nContent-Length: 1048576\r\n\r\n".to_vec();
    answer.resize(answer.len() + (1 << 20), 7);
    let answer: Arc<[u8]> = answer.into();
    std::thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            let answer = Arc::clone(&answer);
            std::thread::spawn(move || {
                let (mut lines, mut line) = (BufReader::new(stream), String::new());
                while lines.read_line(&mut line).is_ok_and(|count| count > 0) {
                    if line == "\r\n" && lines.get_mut().write_all(&answer).is_err() {
                        break;
                    }
                    line.clear();
                }
            });
        }
    });
    address
}

fn cached(folder: &Path) {
    let server = Server::start(folder, &["planet.toml"], &[]);
    let floor = floor_of_bytes();
    let path = format!("{WORLD}/patch?origin=0,0&size=512,512&resolution_m=0.02&format=raw");
    assert_eq!(server.get(&path).status, 200);
    for clients in [1, 8, 64] {
        for (way, steady) in [("as fast as possible", None), ("320/s", Some(STEADY))] {
            Load::of(&floor, &path, clients, steady).print(&format!("floor 1 MB, {way}"), clients, None);
            let before = server.processor_s();
            let load = Load::of(&server.address, &path, clients, steady);
            let cpu_ms = 1e3 * (server.processor_s() - before);
            load.print(&format!("cached 1 MB, {way}"), clients, Some(cpu_ms));
        }
    }
}

/// Places that were not requested before, compared with the kernel in this process.
fn fresh(folder: &Path) {
    let server = Server::start(folder, &["planet.toml", "--threads", "1"], &[("RAYON_NUM_THREADS", "1")]);
    let mut client = server.client().expect("it listens");
    let processes = json!([
        { "kind": "texture", "roughness_m": 0.025, "hurst": 0.75 },
        { "kind": "primary_craters", "density": 0.02, "diameter_min_m": 0.5, "diameter_max_m": 40000.0 },
        { "kind": "secondary_craters" },
        { "kind": "rocks", "coverage": 0.088 },
        { "kind": "albedo" },
        { "kind": "dust", "thickness_m": 0.005, "cover": 0.3 }
    ]);
    let (mut whole, mut alone, mut across, mut beyond) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for k in 0..24_u32 {
        // The samples of one tile of the library; later, of four.
        let place = [f64::from(37 * k + 3), f64::from(k * k) - 40.0].map(|n| n * 256.0 * 0.02);
        let params = json!({
            "size_px": [256, 256], "cell_m": 0.02, "basic_spacing_m": 0.005, "anchor_level": 24, "origin_m": place,
            "processes": processes
        });
        let generator = sastrugi_terrain::prepare("planetary", &params).expect("the bench's own parameters are valid");
        let mut ask = |[x, y]: [f64; 2]| {
            let asked = Instant::now();
            let path = format!("{WORLD}/patch?origin={x:?},{y:?}&size=256,256&resolution_m=0.02&format=raw");
            assert_eq!(client.get(&path).expect("an answer").status, 200);
            milliseconds(asked)
        };
        let answered = ask(place);
        let started = Instant::now();
        generator.generate(&Streams::for_seed(2026, "terrain"), &[]).expect("a surface");
        let made = milliseconds(started);
        across.push(ask(place.map(|at| at + 1310.72 + 2.56)));
        whole.push(answered);
        alone.push(made);
        beyond.push(answered - made);
    }
    let [whole, alone, across, beyond] = [whole, alone, across, beyond].map(sorted);
    println!(
        "new patch 256 x 256 at 2 cm, 24 places, one thread: {:.1} ms, kernel {:.1} ms, median of the differences {:.1} ms; across 4 tiles {:.1} ms",
        part(&whole, 0.5),
        part(&alone, 0.5),
        part(&beyond, 0.5),
        part(&across, 0.5)
    );
}

/// Addresses of the tiles that a map of 5 x 4 tiles shows while zooming from the complete extent down to the ground, with two pans per level.
fn walk(server: &Server) -> Vec<String> {
    let grid = server.get(WORLD).json()["tile_grid"].clone();
    let number = |value: &serde_json::Value| value.as_f64().expect("a number");
    let [west, north] = [0, 1].map(|k| number(&grid["origin_m"][k]));
    let mut paths = Vec::new();
    for level in 0..LEVELS {
        let side = 256.0 * number(&grid["resolutions_m"][level]);
        let [cols, rows] = [0, 1].map(|k| number(&grid["matrix_sizes"][level][k]) as i64);
        let [col, row] = [((3.0 - west) / side) as i64, ((north + 1.7) / side) as i64];
        let mut seen = std::collections::BTreeSet::new();
        for [right, down] in [[0, 0], [2, 0], [2, 1], [3, 1]] {
            for (r, c) in (0..4).flat_map(|r| (0..5).map(move |c| (r, c))) {
                let at = [row + r + down - 2, col + c + right - 2];
                let there = (0..rows).contains(&at[0]) && (0..cols).contains(&at[1]);
                if there && seen.len() < 36 && seen.insert(at) {
                    paths.push(format!("{WORLD}/styles/relief/map/tiles/planet/{level}/{}/{}", at[0], at[1]));
                }
            }
        }
    }
    paths.truncate(500);
    paths
}

/// Seconds until all paths are answered to `clients` clients, each requesting the next, and milliseconds of each answer.
fn ask_all(address: &str, paths: &[String], clients: usize) -> (f64, Vec<f64>) {
    let (next, start) = (AtomicUsize::new(0), Instant::now());
    let times = Mutex::new(vec![0.0; paths.len()]);
    std::thread::scope(|scope| {
        for _ in 0..clients {
            scope.spawn(|| {
                let mut client = Client::connect(address).expect("the server listens");
                let mut body = Vec::new();
                loop {
                    let k = next.fetch_add(1, Ordering::Relaxed);
                    let (Some(path), asked) = (paths.get(k), Instant::now()) else { break };
                    let (status, _) = client.get_into(path, &mut body).expect("an answer");
                    assert!(status == 200 || status == 204, "{path}: {status}: {}", String::from_utf8_lossy(&body));
                    times.lock().expect("no client has failed")[k] = milliseconds(asked);
                }
            });
        }
    });
    (start.elapsed().as_secs_f64(), times.into_inner().expect("no client has failed"))
}

fn session(folder: &Path) {
    let arguments = ["planet.toml", "--library", "tiles"];
    let mut server = Server::start(folder, &arguments, &[]);
    let paths = walk(&server);
    let before = server.processor_s();
    let (cold, times) = ask_all(&server.address, &paths, CONNECTIONS);
    let cpu = server.processor_s() - before;
    let (warm, _) = ask_all(&server.address, &paths, CONNECTIONS);
    let count = paths.len() as u64;
    let start = Instant::now();
    let records = || {
        let shelves = std::fs::read_dir(folder.join("tiles")).expect("the library").flatten();
        let tiles = shelves.flat_map(|shelf| std::fs::read_dir(shelf.path()).into_iter().flatten().flatten());
        tiles.filter(|file| file.path().extension().is_some_and(|e| e == "tile")).count() as u64
    };
    while records() < count && start.elapsed() < Duration::from_secs(20) {
        std::thread::sleep(Duration::from_millis(50));
    }
    server.kill();
    let again = Server::start(folder, &arguments, &[]);
    let (disk, _) = ask_all(&again.address, &paths, CONNECTIONS);
    let library = again.get("/v1/library").json();
    println!(
        "session of {count} tiles, {CONNECTIONS} connections: cold {cold:.1} s ({cpu:.1} s of a core), warm {warm:.3} s, from disk after a restart \
         {disk:.2} s ({} read, {} made)",
        library["disk_hits"], library["made"]
    );
    let mut line = String::from("  cold, ms a tile by level:");
    for level in 0..LEVELS {
        let part = format!("/planet/{level}/");
        let own: Vec<f64> =
            paths.iter().zip(&times).filter(|(path, _)| path.contains(&part)).map(|(_, t)| *t).collect();
        // Time spent waiting for others is counted there.
        line += &format!(" {level}: {:.0}", own.iter().sum::<f64>() / (own.len() * CONNECTIONS) as f64);
    }
    println!("{line}");
}

/// titiler; ended when dropped.
struct Titiler {
    process: Child,
    address: String,
}

impl Titiler {
    fn start(file: &Path) -> Option<Self> {
        let python = python("floors")?;
        let port = TcpListener::bind("127.0.0.1:0").ok()?.local_addr().ok()?.port();
        let mut command = Command::new(python);
        command.arg(script_of("server.py")).arg(file).args([port.to_string(), "4".to_owned()]);
        // GDAL as tuned in titiler's guide for local files.
        command
            .env("PYTHONDONTWRITEBYTECODE", "1")
            .env("GDAL_CACHEMAX", "200")
            .env("GDAL_DISABLE_READDIR_ON_OPEN", "EMPTY_DIR")
            .env("PYTHONWARNINGS", "ignore");
        let process = command.stdout(Stdio::null()).spawn().ok()?;
        let made = Self { process, address: format!("127.0.0.1:{port}") };
        let start = Instant::now();
        while start.elapsed() < Duration::from_secs(60) {
            if Client::connect(&made.address).is_ok() {
                // The second worker may still be starting.
                std::thread::sleep(Duration::from_secs(3));
                return Some(made);
            }
            std::thread::sleep(Duration::from_millis(200));
        }
        None
    }
}

impl Drop for Titiler {
    fn drop(&mut self) {
        // Its workers exit with it on SIGTERM, not on SIGKILL.
        drop(Command::new("kill").arg(self.process.id().to_string()).status());
        drop(self.process.wait());
    }
}

const HILLS: &str = r#"
[study]
name = "load"
seed = 7
date = "2026-01-01"

[[terrain]]
id = "hills"
kind = "planetary"
cell_m = 1.0
basic_spacing_m = 1.0
size_px = [2048, 2048]
processes = [{ kind = "texture" }]
"#;

fn tiles(folder: &Path) {
    std::fs::write(folder.join("study.toml"), HILLS).expect("a file can be written");
    let mut run = Command::new(program());
    run.args(["run", "study.toml", "-o", "release", "--quiet"]).current_dir(folder).stdout(Stdio::null());
    assert!(run.status().expect("the program starts").success());
    let server = Server::start(folder, &["release"], &[]);
    let hills = "/v1/collections/load.hills";
    let cog = server.get(&format!("{hills}/patch?origin=0,0&size=2048,2048"));
    let file = folder.join("hills.tif");
    std::fs::write(&file, &cog.body).expect("a file can be written");
    let all: Vec<[u32; 3]> =
        (0..4).flat_map(|z| (0..1 << z).flat_map(move |y| (0..1 << z).map(move |x| [z, y, x]))).collect();
    let titiler = Titiler::start(&file);
    if titiler.is_none() {
        println!("titiler: not installed (benches/floors/set_up installs it)");
    }
    for (layer, own, theirs) in [
        ("hillshade", "hillshade", "algorithm=hillshade&buffer=3"),
        ("terrain_rgb", "terrain_rgb", "algorithm=terrainrgb"),
    ] {
        let ours: Vec<String> =
            all.iter().map(|[z, y, x]| format!("{hills}/styles/{own}/map/tiles/load.hills/{z}/{y}/{x}")).collect();
        // A new server, with the file read once.
        let server = Server::start(folder, &["release"], &[]);
        ask_all(&server.address, &[format!("{hills}/styles/relief/map/tiles/load.hills/0/0/0")], 1);
        let rate = |address: &str, paths: &[String]| paths.len() as f64 / ask_all(address, paths, 8).0;
        let (fast, again) = (rate(&server.address, &ours), rate(&server.address, &ours));
        println!("tiles of {layer}, 8 clients: {fast:.0} tiles/s new, {again:.0} tiles/s again");
        if let Some(titiler) = &titiler {
            let theirs: Vec<String> = all
                .iter()
                .map(|[z, y, x]| format!("/tiles/plane/{z}/{x}/{y}.png?{theirs}&url={}", file.display()))
                .collect();
            let (first, slow) = (rate(&titiler.address, &theirs), rate(&titiler.address, &theirs));
            println!(
                "  titiler, 2 workers: {first:.0} tiles/s new, {slow:.0} tiles/s again; ours new over theirs again {:.1}",
                fast / slow
            );
        }
    }
}

fn memory(folder: &Path) {
    let server = Server::start(folder, &["planet.toml"], &[]);
    let tile = format!("{WORLD}/styles/relief/map/tiles/planet/16/0/0");
    assert_eq!(server.get(&tile).status, 200);
    let most = || server.memory_kb("VmHWM") as f64 / 1024.0;
    let before = most();
    let mut body = Vec::new();
    let idle: Vec<Client> = (0..1000)
        .map(|_| {
            let mut client = server.client().expect("it listens");
            client.get_into("/healthz", &mut body).expect("an answer");
            client
        })
        .collect();
    let with_idle = most();
    drop(idle);
    let asked: Vec<Client> = (0..1000)
        .map(|_| {
            let mut client = server.client().expect("it listens");
            client.get_into(&tile, &mut body).expect("an answer");
            client
        })
        .collect();
    println!(
        "peak memory: {before:.1} MB before, {with_idle:.1} MB with {} idle connections, {:.1} MB with as many that requested a tile",
        asked.len(),
        most()
    );
}

fn stopping(folder: &Path) {
    let server = Server::start(folder, &["planet.toml", "--threads", "1"], &[]);
    let mut watch = server.client().expect("it listens");
    let mut running = move || {
        let library = watch.get("/v1/library").expect("an answer").json();
        (library["running"].as_u64().unwrap_or_default(), library["cancelled"].as_u64().unwrap_or_default())
    };
    let mut times = Vec::new();
    for k in 0..40_u64 {
        let mut client = server.client().expect("it listens");
        let path = format!("{WORLD}/patch?origin={},0&size=256,256&resolution_m=2.56&format=raw", 1e5 * k as f64);
        write!(client.stream(), "GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n").expect("it reads");
        let asked = Instant::now();
        while running().0 == 0 {
            assert!(asked.elapsed() < Duration::from_secs(10), "the window was refused, or done at once");
            std::thread::sleep(Duration::from_millis(1));
        }
        // At any point of the work.
        std::thread::sleep(Duration::from_millis(5 + 37 * k % 400));
        drop(client);
        let left = Instant::now();
        while running().0 > 0 {
            std::thread::sleep(Duration::from_micros(200));
        }
        times.push(milliseconds(left));
    }
    let (times, (_, cancelled)) = (sorted(times), running());
    println!(
        "work after its last client has left, {} windows of which {cancelled} were under way: median {:.1} ms, longest {:.1} ms",
        times.len(),
        part(&times, 0.5),
        part(&times, 1.0)
    );
}
