//! Verb `serve`.

use crate::Verdict;
use crate::args::{Common, LogFormat, Serve};
use crate::failure::{Code, Failure};
use crate::output::{print, warn};
use sastrugi_schemas::counted;
use sastrugi_server::{LibrarySettings, Limits, Settings, Stop};
use sastrugi_stages::remote::check_local;
use serde_json::json;
use std::net::SocketAddr;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tracing_subscriber::EnvFilter;

/// Environment variable with the token, so that process lists do not show it.
const TOKEN: &str = "SASTRUGI_TOKEN";
/// Maximum number of tiles queued per worker.
const QUEUE_PER_WORKER: usize = 256;
const GIB: f64 = (1u64 << 30) as f64;

/// The running server, if any.
static RUNNING: OnceLock<Stop> = OnceLock::new();
static STOPPING: AtomicBool = AtomicBool::new(false);

/// Effect of an interrupt on a server.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Interrupt {
    /// Shut down gracefully.
    First,
    /// Stop immediately.
    Again,
}

/// Shuts the server down gracefully at the first interrupt; `None` if no server is running.
pub fn interrupted() -> Option<Interrupt> {
    let stop = RUNNING.get()?;
    if STOPPING.swap(true, Ordering::Relaxed) {
        return Some(Interrupt::Again);
    }
    stop.stop();
    Some(Interrupt::First)
}

/// `serve`.
pub fn serve(args: &Serve, common: &Common) -> Verdict {
    let listen: SocketAddr = args.listen.parse().map_err(|_| {
        Failure::usage(format!(
            "`--listen {}`: must be an IP address and a port, for example 127.0.0.1:8080",
            args.listen
        ))
    })?;
    args.library.as_deref().map_or(Ok(()), check_local)?;
    let token = std::env::var(TOKEN).ok().filter(|token| !token.is_empty());
    start_log(args, common);
    if !listen.ip().is_loopback() {
        let open =
            if token.is_none() { format!("; without {TOKEN} anyone on the network can use it") } else { String::new() };
        warn(&format!("sastrugi: warning: {listen} is reachable from other computers{open}"));
    }
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    let workers = common.threads.map_or(workers, usize::from);
    let defaults = Limits::default();
    let settings = Settings {
        paths: args.paths.clone(),
        listen,
        library: LibrarySettings {
            folder: args.library.clone(),
            disk_bytes: bytes("--library-bytes", &args.library_bytes)?,
            memory_bytes: bytes("--memory-bytes", &args.memory_bytes)?,
            workers,
            queue: QUEUE_PER_WORKER * workers,
        },
        limits: Limits {
            samples: args.samples_max,
            per_client: args.per_client as usize,
            connections: args.connections as usize,
            request: Duration::from_secs(args.request_seconds),
            // Half of what the cores can do in that time: the estimate is rough, and clients share the cores.
            work_s: 0.5 * args.request_seconds as f64 * workers as f64,
            ..defaults
        },
        token,
        origins: args.cors.clone(),
    };
    if settings.library.folder.is_some() && settings.library.disk_bytes == 0 {
        return Err(Failure::usage(
            "`--library-bytes 0` leaves no room for the tiles of --library; raise it, or omit --library",
        ));
    }
    let stop = RUNNING.get_or_init(Stop::default);
    let mut printed = Ok(());
    sastrugi_server::serve(&settings, stop, |address, collections| {
        let ids: Vec<&String> = collections.keys().collect();
        let count = counted(ids.len(), "collection");
        let text = format!("http://{address}/\n{count}: {}\nPress Ctrl-C to stop.", shortened(&ids));
        printed = print(common.json, &json!({ "address": format!("http://{address}/"), "collections": ids }), &text);
    })?;
    printed?;
    Ok(Code::Done)
}

fn shortened(ids: &[&String]) -> String {
    const SHOWN: usize = 8;
    let mut text = ids.iter().take(SHOWN).map(|id| id.as_str()).collect::<Vec<_>>().join(", ");
    if ids.len() > SHOWN {
        text.push_str(" ...");
    }
    text
}

/// Logs warnings on stderr, and more with --log or RUST_LOG.
fn start_log(args: &Serve, common: &Common) {
    let default = match (common.quiet, args.log) {
        (true, _) => "error",
        (_, true) => "info,sastrugi_server=debug",
        _ => "warn",
    };
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(default));
    let log = tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr);
    // A log that was started before is fine.
    drop(match args.log_format {
        LogFormat::Text => log.with_ansi(false).try_init(),
        LogFormat::Json => log.json().try_init(),
    });
}

/// A number of bytes, such as `10G`, `512M` or `1.5GiB`.
pub(super) fn bytes(option: &str, text: &str) -> Result<u64, Failure> {
    let end = text.find(|c: char| !(c.is_ascii_digit() || c == '.')).unwrap_or(text.len());
    let (number, unit) = text.split_at(end);
    let factor = match unit.trim().to_ascii_uppercase().trim_end_matches("IB").trim_end_matches('B') {
        "" => 1.0,
        "K" => GIB / f64::from(1u32 << 20),
        "M" => GIB / 1024.0,
        "G" => GIB,
        "T" => GIB * 1024.0,
        _ => f64::NAN,
    };
    let value = number.parse::<f64>().unwrap_or(f64::NAN) * factor;
    if (0.0..1e18).contains(&value) {
        return Ok(value as u64);
    }
    Err(Failure::usage(format!("`{option} {text}`: must be a number of bytes, such as 10G or 512M")))
}

#[cfg(test)]
mod tests {
    use super::bytes;

    #[test]
    fn val_bytes_are_read() {
        let read = |text| bytes("--library-bytes", text).map_err(|f| f.0.to_string());
        for (text, expected) in
            [("0", 0), ("17", 17), ("10G", 10 << 30), ("1.5GiB", 3 << 29), ("2k", 2048), ("3MB", 3 << 20)]
        {
            assert_eq!(read(text), Ok(expected), "{text}");
        }
        for text in ["", "G", "1X", "-1", "1e30", "1..2"] {
            assert!(read(text).is_err(), "{text}");
        }
    }
}
