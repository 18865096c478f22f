//! A shared cache and releases in an object store, against a server program (`tests/engines/set_up s3`).

use sastrugi_tests::{Called, area, called, differing, installed, program, run_study, small_study, sums, write};
use std::fs;
use std::io::{Read, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

const KEY: &str = "test-key";
const SECRET: &str = "test-secret";

/// A running server with one bucket, `terrains`; its objects are files in a folder.
struct Server {
    child: Child,
    port: u16,
    root: tempfile::TempDir,
}

impl Server {
    /// Starts the server; `None` (after a message) if it is not installed.
    fn start() -> Option<Self> {
        let server = installed("engines/s3/bin/s3s-fs", "tests/engines/set_up s3")?;
        let root = area();
        fs::create_dir(root.path().join("terrains")).unwrap();
        // Free at this moment; the server takes it in the next.
        let port = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap().local_addr().unwrap().port();
        let child = Command::new(server)
            .args(["--host", "127.0.0.1", "--port", &port.to_string(), "--access-key", KEY, "--secret-key", SECRET])
            .arg(root.path())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let server = Self { child, port, root };
        let start = Instant::now();
        while TcpStream::connect((Ipv4Addr::LOCALHOST, port)).is_err() {
            assert!(start.elapsed() < Duration::from_secs(20), "the server does not listen");
            std::thread::sleep(Duration::from_millis(50));
        }
        Some(server)
    }

    /// The program with the environment of the server.
    fn call(&self, folder: &Path, arguments: &[&str]) -> Called {
        let mut command = Command::new(program());
        command.args(arguments).current_dir(folder);
        command.env("AWS_ACCESS_KEY_ID", KEY).env("AWS_SECRET_ACCESS_KEY", SECRET).env("AWS_REGION", "us-east-1");
        command.env("AWS_ENDPOINT_URL", format!("http://127.0.0.1:{}", self.port)).env("AWS_ALLOW_HTTP", "true");
        // A proxy does not know this machine.
        for name in ["HTTP_PROXY", "http_proxy", "ALL_PROXY", "all_proxy"] {
            command.env_remove(name);
        }
        called(&mut command)
    }

    fn object(&self, name: &str) -> PathBuf {
        self.root.path().join("terrains").join(name)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // It may have been killed by the test.
        let _ = self.child.kill().and_then(|()| self.child.wait());
    }
}

fn succeeds(call: &Called) {
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
}

/// Ancestors, shards and the release in one bucket, without any shared folder: the bytes of one machine.
#[test]
#[ignore = "slow: needs an S3 server"]
fn val_a_bucket_is_cache_and_place_of_a_release() {
    let Some(server) = Server::start() else { return };
    let folder = area();
    let path = folder.path();
    let whole = run_study(path, &small_study(), &[]);
    let cache = ["--cache", "s3://terrains/cache", "--quiet"];
    let ancestors = ["run", "study.toml", "--ancestors", "2", "--work", "ancestors"];
    succeeds(&server.call(path, &[&ancestors[..], &cache].concat()));
    for (part, output) in [("1/2", "part-1"), ("2/2", "part-2")] {
        let run = ["run", "study.toml", "--shard", part, "-o", output, "--json"];
        let call = server.call(path, &[&run[..], &cache].concat());
        succeeds(&call);
        let summary: serde_json::Value = serde_json::from_str(&call.stdout).unwrap();
        assert_eq!(summary["cache"]["problems"], serde_json::json!([]), "{summary}");
        assert!(summary["cache"]["fetched"].as_u64().unwrap() > 0, "{summary}");
    }
    let merge = ["merge", "part-1", "part-2", "-o", "s3://terrains/small", "--quiet"];
    succeeds(&server.call(path, &merge));
    assert_eq!(differing(&whole, &sums(&server.object("small"))), [""; 0]);
    succeeds(&server.call(path, &["verify", "s3://terrains/small", "--quiet"]));
    // The same release again changes nothing.
    succeeds(&server.call(path, &merge));
    succeeds(&server.call(path, &["run", "study.toml", "-o", "s3://terrains/small", "--quiet"]));
    // Another one is refused for what is at the address, not for the copy in the work area, and nothing of it is uploaded.
    write(path, "study.toml", &small_study().replace("name = \"small\"", "name = \"other\""));
    let call = server.call(path, &["run", "study.toml", "-o", "s3://terrains/small", "--quiet"]);
    assert!(
        call.code == 2 && call.stderr.contains("already contains another release"),
        "{} {}",
        call.code,
        call.stderr
    );
    assert_eq!(differing(&whole, &sums(&server.object("small"))), [""; 0]);
    // Damage is found.
    let readme = server.object("small/README.md");
    let text = fs::read_to_string(&readme).unwrap();
    fs::write(&readme, text.replacen('a', "b", 1)).unwrap();
    let call = server.call(path, &["verify", "s3://terrains/small", "--quiet"]);
    assert!(call.code == 4 && call.stdout.contains("README.md"), "{} {}", call.code, call.stdout);
    let call = server.call(path, &["cache", "s3://terrains/cache", "--max-bytes", "0", "--json"]);
    succeeds(&call);
    let pruned: serde_json::Value = serde_json::from_str(&call.stdout).unwrap();
    assert!(pruned["entries"] == 0 && pruned["removed"].as_u64().unwrap() > 0, "{pruned}");
}

/// Without its manifest there is no release; the next run uploads what is missing.
#[test]
#[ignore = "slow: needs an S3 server"]
fn val_an_interrupted_upload_is_no_release() {
    let Some(server) = Server::start() else { return };
    let folder = area();
    let path = folder.path();
    let whole = run_study(path, &small_study(), &[]);
    let run = ["run", "study.toml", "-o", "s3://terrains/a/small", "--work", "release.work", "--quiet"];
    succeeds(&server.call(path, &run));
    fs::remove_file(server.object("a/small/manifest.json")).unwrap();
    fs::remove_file(server.object("a/small/fit/fit.json")).unwrap();
    assert_eq!(server.call(path, &["verify", "s3://terrains/a/small", "--quiet"]).code, 4);
    assert_eq!(server.call(path, &["verify", "s3://terrains/a", "--quiet"]).code, 65);
    // The server itself refuses to replace the checksums: without a manifest, nothing else keeps another release away.
    write(path, "other.toml", &small_study().replace("name = \"small\"", "name = \"other\""));
    let other = ["run", "other.toml", "-o", "s3://terrains/a/small", "--work", "other.work", "--quiet"];
    let call = server.call(path, &other);
    assert!(call.code == 2 && call.stderr.contains("unfinished upload"), "{} {}", call.code, call.stderr);
    succeeds(&server.call(path, &run));
    assert_eq!(differing(&whole, &sums(&server.object("a/small"))), [""; 0]);
    succeeds(&server.call(path, &["verify", "s3://terrains/a/small", "--quiet"]));
}

/// A terrain above 16 MiB, which is uploaded in parts.
const LARGE: &str = r#"
[study]
name = "large"
seed = 7
date = "2026-01-01"

[[terrain]]
id = "wide"
kind = "weierstrass_mandelbrot"
size_px = [4000, 4000]
"#;

/// Files that are uploaded in parts arrive whole, in a release and in a cache, also if a killed upload left the release without its manifest.
#[test]
#[ignore = "slow: needs an S3 server"]
fn val_large_files_are_uploaded_in_parts() {
    let Some(server) = Server::start() else { return };
    let folder = area();
    let path = folder.path();
    let whole = run_study(path, LARGE, &[]);
    let run = |work: &str| {
        let cache = ["--cache", "s3://terrains/cache", "--work", work, "--json", "--quiet"];
        let call = server.call(path, &[&["run", "study.toml", "-o", "s3://terrains/large"][..], &cache].concat());
        succeeds(&call);
        serde_json::from_str::<serde_json::Value>(&call.stdout).unwrap()
    };
    run("first.work");
    let is_large = |name: &String| fs::metadata(server.object("large").join(name)).unwrap().len() > 16 << 20;
    let large = whole.keys().find(|name| is_large(name)).unwrap();
    assert_eq!(differing(&whole, &sums(&server.object("large"))), [""; 0]);
    succeeds(&server.call(path, &["verify", "s3://terrains/large", "--quiet"]));
    fs::remove_file(server.object("large/manifest.json")).unwrap();
    fs::remove_file(server.object("large").join(large)).unwrap();
    let again = run("second.work");
    assert_eq!((again["computed"].as_u64(), &again["cache"]["damaged"]), (Some(0), &serde_json::json!([])), "{again}");
    succeeds(&server.call(path, &["verify", "s3://terrains/large", "--quiet"]));
}

/// Two runs share a cache in a bucket; a bucket that does not exist is a failure (1), and a server that has gone is worth a retry (75).
#[test]
#[ignore = "slow: needs an S3 server"]
fn val_a_store_that_fails_is_reported() {
    let Some(mut server) = Server::start() else { return };
    let folder = area();
    let path = folder.path();
    let whole = run_study(path, &small_study(), &[]);
    let outputs = ["one", "two"];
    let run = |output: &str| {
        let cache = ["--cache", "s3://terrains/both", "--threads", "1", "--quiet"];
        server.call(path, &[&["run", "study.toml", "-o", output][..], &cache].concat()).code
    };
    let codes = std::thread::scope(|scope| {
        let run = &run;
        let runs = outputs.map(|output| scope.spawn(move || run(output)));
        runs.map(|run| run.join().unwrap())
    });
    assert_eq!(codes, [0, 0]);
    for output in outputs {
        assert_eq!(differing(&whole, &sums(&path.join(output))), [""; 0]);
    }
    let call = server.call(path, &["run", "study.toml", "-o", "s3://nowhere/small", "--quiet"]);
    assert!(call.code == 1 && call.stderr.contains("s3://nowhere"), "{} {}", call.code, call.stderr);
    server.child.kill().and_then(|()| server.child.wait()).unwrap();
    for arguments in [&["-o", "s3://terrains/late"][..], &["-o", "late", "--cache", "s3://terrains/both"]] {
        let call = server.call(path, &[&["run", "study.toml", "--quiet"], arguments].concat());
        assert!(call.code == 75 && call.stderr.contains("s3://terrains"), "{} {}", call.code, call.stderr);
        assert!(!path.join("late").exists());
    }
}

/// What cannot be right is refused before anything is asked of a server.
#[test]
fn val_addresses_are_checked_first() {
    let folder = area();
    let path = folder.path();
    write(path, "study.toml", &small_study());
    let cases: [(&[&str], &str); 11] = [
        (&["-o", "s3://"], "expected s3://bucket"),
        (&["-o", "s3:///a"], "expected s3://bucket"),
        (&["-o", "a", "--cache", "s3://b/../c"], "expected s3://bucket"),
        (&["-o", "s3://b/part-1", "--shard", "1/2"], "a shard is a folder"),
        (&["-o", "gs://b/c"], "give a folder, or s3://bucket/prefix"),
        (&["-o", "a", "--work", "s3://b/c"], "must be a path on this machine"),
        (&["-o", "s3://b/c", "--work", "gs://b"], "must be a path on this machine"),
        (&["-o", "a", "--cache", "gs://b/c"], "give a folder, or s3://bucket/prefix"),
        (&["-o", "a", "--cache", "S3://b/c"], "give a folder, or s3://bucket/prefix"),
        (&["-o", "a", "--cache", "s3:/bucket"], "give a folder, or s3://bucket/prefix"),
        (&["-o", "a", "--cache", ""], "is empty"),
    ];
    for (arguments, words) in cases {
        let run = [&["run", "study.toml", "--quiet"], arguments].concat();
        let call = called(Command::new(program()).args(&run).current_dir(path));
        assert!(call.code == 2 && call.stderr.contains(words), "{arguments:?}: {} {}", call.code, call.stderr);
    }
    let heights = "1 2 3 4\n2 3 4 3\n1 3 2 1\n2 2 1 1\n";
    write(path, "a.asc", &format!("ncols 4\nnrows 4\nxllcorner 0\nyllcorner 0\ncellsize 1\n{heights}"));
    for arguments in [
        &["traverse", "a.asc", "--vehicle", "husky_a200", "-o", "s3://b/c"][..],
        &["convert", "release", "s3://b/c", "--for", "lerobot"],
        &["convert", "a.asc", "gs://b/c.tif"],
        &["terrain", "multifractal", "-o", "s3://b/c.tif"],
        &["report", "release", "-o", "s3://b/c"],
        &["serve", "a.toml", "--library", "s3://b/c"],
        &["merge", "part-1", "-o", "gs://b/c"],
        &["init", "-o", "gs://b/study.toml"],
        &["hillshade", "a.asc", "-o", "s3://b/c.png"],
        &["fit", "a.asc", "--outer-scale", "2", "--table", "gs://b/fits.csv"],
        &["fit", "a.asc", "--outer-scale", "2", "-o", "fit.json", "--plot", "gs://b/fit.svg"],
        &["roughness", "a.asc", "--classes", "gs://b/classes.tif"],
        &["analyze", "a.mcap", "-o", "gs://b/logs.parquet"],
    ] {
        let call = called(Command::new(program()).args(arguments).current_dir(path));
        let says = call.stderr.contains("a path on this machine") || call.stderr.contains("give a folder, or s3");
        assert!(call.code == 2 && says, "{arguments:?}: {} {}", call.code, call.stderr);
    }
    assert_eq!(fs::read_dir(path).unwrap().count(), 2);
}

/// A machine whose service of roles refuses: the message names what to set, not that service.
#[test]
fn val_missing_credentials_are_named() {
    let service = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let endpoint = format!("http://{}", service.local_addr().unwrap());
    std::thread::spawn(move || {
        for mut client in service.incoming().map_while(Result::ok) {
            let _ = client.read(&mut [0; 4096]);
            let _ = client.write_all(b"HTTP/1.1 403 Forbidden\r\nContent-Length: 0\r\nConnection: close\r\n\r\n");
        }
    });
    let mut command = Command::new(program());
    command.args(["verify", "s3://terrains/demo"]).env("AWS_METADATA_ENDPOINT", endpoint);
    for name in ["AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY", "AWS_WEB_IDENTITY_TOKEN_FILE"] {
        command.env_remove(name);
    }
    let call = called(&mut command);
    assert_eq!(call.code, 2, "{}", call.stderr);
    assert!(call.stderr.contains("no credentials; set AWS_ACCESS_KEY_ID"), "{}", call.stderr);
}
