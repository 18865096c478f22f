//! A terrain server that a test has started, and a client for it.

use crate::program;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// A small world with most features of worlds.
pub const WORLD: &str = r#"
kind = "planetary"
seed = 11
size_px = [300, 200]
cell_m = 0.02
basic_spacing_m = 0.005
origin_m = [-1.0, 2.0]
processes = [
    { kind = "texture" },
    { kind = "primary_craters", diameter_max_m = 200.0 },
    { kind = "rocks", coverage = 0.118 },
    { kind = "albedo" },
]
"#;

/// A running server; killed when dropped.
pub struct Server {
    process: Child,
    /// `127.0.0.1:PORT`.
    pub address: String,
}

/// Answer of a server.
#[derive(Clone, Debug)]
pub struct Answer {
    /// Status.
    pub status: u16,
    /// Head, lower case.
    pub head: String,
    /// Body.
    pub body: Vec<u8>,
}

impl Answer {
    /// A header.
    pub fn header(&self, name: &str) -> Option<&str> {
        self.head.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(": "))
    }

    /// The body as JSON.
    ///
    /// # Panics
    /// When it is not JSON.
    pub fn json(&self) -> serde_json::Value {
        serde_json::from_slice(&self.body).expect("the body is JSON")
    }

    /// The body as float32, little-endian.
    pub fn floats(&self) -> Vec<f32> {
        self.body.chunks_exact(4).map(|v| f32::from_le_bytes([v[0], v[1], v[2], v[3]])).collect()
    }
}

impl Server {
    /// Starts the program in a folder with `serve` and these arguments, on a free port.
    ///
    /// # Panics
    /// When it does not start.
    pub fn start(folder: &Path, arguments: &[&str], environment: &[(&str, &str)]) -> Self {
        let mut command = Command::new(program());
        command.args(["serve", "--listen", "127.0.0.1:0"]).args(arguments);
        Self::start_command(command.current_dir(folder).envs(environment.iter().copied()))
    }

    /// Starts a server with a command that turns into it (`exec`).
    ///
    /// # Panics
    /// When it does not start.
    pub fn start_command(command: &mut Command) -> Self {
        let mut process = command.stdout(Stdio::piped()).spawn().expect("the program starts");
        let mut line = String::new();
        let out = process.stdout.take().expect("it prints");
        BufReader::new(out).read_line(&mut line).expect("it prints its address");
        let address = line.trim().trim_start_matches("http://").trim_end_matches('/').to_owned();
        assert!(!address.is_empty(), "the server did not start");
        Self { process, address }
    }

    /// `GET` with additional headers, as `name: value`.
    ///
    /// # Panics
    /// When there is no answer.
    pub fn get_with(&self, path: &str, headers: &[&str]) -> Answer {
        self.send("GET", path, headers, "")
    }

    /// `GET`.
    pub fn get(&self, path: &str) -> Answer {
        self.get_with(path, &[])
    }

    /// Any request.
    ///
    /// # Panics
    /// When there is no answer.
    pub fn send(&self, method: &str, path: &str, headers: &[&str], body: &str) -> Answer {
        let mut stream = TcpStream::connect(&self.address).expect("the server listens");
        stream.set_read_timeout(Some(Duration::from_secs(120))).expect("a timeout");
        let more: String = headers.iter().map(|line| format!("{line}\r\n")).collect();
        let length = body.len();
        let head = format!(
            "{method} {path} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\nContent-Length: {length}\r\n{more}\r\n",
            self.address
        );
        stream.write_all(head.as_bytes()).expect("the head goes out");
        stream.write_all(body.as_bytes()).expect("the body goes out");
        let mut bytes = Vec::new();
        stream.read_to_end(&mut bytes).expect("an answer comes");
        answer(&bytes)
    }

    /// A persistent connection.
    ///
    /// # Errors
    /// The server is gone or accepts no connection.
    pub fn client(&self) -> io::Result<Client> {
        Client::connect(&self.address)
    }

    /// Memory of its process in kB: `VmHWM`, the peak, or `VmRSS`, the current resident memory.
    ///
    /// # Panics
    /// When the system does not report it.
    pub fn memory_kb(&self, figure: &str) -> u64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.process.id())).expect("the server runs");
        let line = status.lines().find_map(|line| line.strip_prefix(figure)?.strip_prefix(':'));
        line.and_then(|line| line.split_whitespace().next()?.parse().ok()).expect("the system reports the value")
    }

    /// CPU time of its process so far, s.
    ///
    /// # Panics
    /// When the system does not report it.
    pub fn processor_s(&self) -> f64 {
        let text = std::fs::read_to_string(format!("/proc/{}/stat", self.process.id())).expect("the server runs");
        let after = text.rsplit(')').next().unwrap_or_default();
        let ticks = after.split_whitespace().skip(11).take(2).filter_map(|word| word.parse::<f64>().ok());
        // Linux counts hundredths of a second here on every machine.
        ticks.sum::<f64>() / 100.0
    }

    /// Kills it immediately.
    pub fn kill(&mut self) {
        // It may have exited already.
        drop(self.process.kill());
        drop(self.process.wait());
    }

    /// Terminates it with SIGTERM and returns its exit code.
    ///
    /// # Panics
    /// When it does not exit within 20 s.
    pub fn terminate(&mut self) -> Option<i32> {
        let id = self.process.id().to_string();
        Command::new("kill").args(["-TERM", &id]).status().expect("kill is there");
        let start = Instant::now();
        loop {
            if let Some(status) = self.process.try_wait().expect("its state is known") {
                return status.code();
            }
            assert!(start.elapsed() < Duration::from_secs(20), "the server does not exit");
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.kill();
    }
}

/// A connection that persists between requests. It returns complete answers or none.
pub struct Client {
    stream: BufReader<TcpStream>,
}

impl Client {
    /// Connects.
    ///
    /// # Errors
    /// There is no listener.
    pub fn connect(address: &str) -> io::Result<Self> {
        let stream = TcpStream::connect(address)?;
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(Duration::from_secs(120)))?;
        Ok(Self { stream: BufReader::with_capacity(1 << 16, stream) })
    }

    /// The stream, to send anything but a regular request.
    pub fn stream(&mut self) -> &mut TcpStream {
        self.stream.get_mut()
    }

    /// `GET`.
    ///
    /// # Errors
    /// The connection ends before the answer is complete.
    pub fn get(&mut self, path: &str) -> io::Result<Answer> {
        let mut body = Vec::new();
        let (status, head) = self.get_into(path, &mut body)?;
        Ok(Answer { status, head, body })
    }

    /// `GET` into an existing buffer; returns status and head, lower case.
    ///
    /// # Errors
    /// The connection ends before the answer is complete.
    pub fn get_into(&mut self, path: &str, body: &mut Vec<u8>) -> io::Result<(u16, String)> {
        let request = format!("GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n");
        self.stream.get_mut().write_all(request.as_bytes())?;
        self.answer_into(body)
    }

    /// The answer to data written to [`Client::stream`].
    ///
    /// # Errors
    /// The connection ends before the answer is complete.
    pub fn answer_into(&mut self, body: &mut Vec<u8>) -> io::Result<(u16, String)> {
        let mut head = String::new();
        while !head.ends_with("\r\n\r\n") {
            if self.stream.read_line(&mut head)? == 0 {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
        }
        let head = head.trim_end().to_lowercase();
        let status = head.split(' ').nth(1).and_then(|s| s.parse().ok()).ok_or(io::ErrorKind::InvalidData)?;
        let length = head.lines().find_map(|line| line.strip_prefix("content-length: ")?.parse().ok()).unwrap_or(0);
        body.resize(length, 0);
        self.stream.read_exact(body)?;
        Ok((status, head))
    }
}

fn answer(bytes: &[u8]) -> Answer {
    let end = bytes.windows(4).position(|w| w == b"\r\n\r\n").expect("the answer has a head");
    let head = String::from_utf8_lossy(&bytes[..end]).to_lowercase();
    let status = head.split(' ').nth(1).and_then(|s| s.parse().ok()).expect("the answer has a status");
    let mut body = bytes[end + 4..].to_vec();
    if head.contains("transfer-encoding: chunked") {
        body = unchunked(&body);
    }
    Answer { status, head, body }
}

fn unchunked(mut rest: &[u8]) -> Vec<u8> {
    let mut body = Vec::new();
    while let Some(end) = rest.windows(2).position(|w| w == b"\r\n") {
        let size = usize::from_str_radix(std::str::from_utf8(&rest[..end]).unwrap_or("0"), 16).unwrap_or(0);
        if size == 0 {
            break;
        }
        body.extend(&rest[end + 2..end + 2 + size]);
        rest = &rest[end + 4 + size..];
    }
    body
}
