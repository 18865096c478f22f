//! The program on other processors, which qemu emulates for one process (`tests/engines/set_up qemu`): a study of every stage gives the same bytes.

use super::assert_same;
use super::every_stage::EveryStage;
use sastrugi_tests::{called, installed, program};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

/// Prints what the processor offers that runs it.
const OFFERS: &str = env!("CARGO_BIN_EXE_processor");

/// A processor that qemu emulates.
struct Processor {
    /// Its name for qemu; `-SET` takes an instruction set away.
    model: &'static str,
    /// What it must offer, as `processor.rs` prints it: a model that silently offers more would prove nothing.
    offers: &'static str,
}

const PROCESSORS: [Processor; 3] = [
    // What every x86-64 processor has.
    Processor { model: "qemu64,-sse3,-cx16", offers: "sse2" },
    // AVX, but neither AVX2 nor FMA.
    Processor { model: "SandyBridge", offers: "sse2 sse3 ssse3 sse4.1 sse4.2 popcnt avx" },
    // Wide vectors, and the functions of the C library that use FMA.
    Processor {
        model: "Haswell",
        offers: "sse2 sse3 ssse3 sse4.1 sse4.2 popcnt avx f16c fma bmi1 bmi2 lzcnt avx2 wide",
    },
];

/// A program on a processor of this model. The emulator's own libraries lie beside it; the program sees those of the system.
fn emulated(qemu: &Path, model: &str, program: &Path) -> Command {
    let libraries = qemu.with_file_name("../lib/x86_64-linux-gnu");
    let mut command = Command::new(qemu);
    command.env("LD_LIBRARY_PATH", libraries).args(["-U", "LD_LIBRARY_PATH", "-cpu", model]).arg(program);
    command
}

/// What the processor offers on which this command prints it.
fn offered(mut command: Command) -> String {
    let call = called(&mut command);
    assert_eq!(call.code, 0, "{}", call.stderr);
    call.stdout.trim().to_owned()
}

fn qemu() -> Option<PathBuf> {
    installed("engines/qemu/usr/bin/qemu-x86_64", "tests/engines/set_up qemu")
}

/// Prints the table of `docs/release.md`, with the first 16 digits of the SHA-256 of `SHA256SUMS`. Bags of ROS 2 and cloud-optimised GeoTIFFs, which are
/// not in that study, are compared too. The emulated processors run side by side: each is busy with one core for most of its time.
#[test]
#[ignore = "slow: ./test --full"]
fn gold_emulated_processors_change_nothing() {
    let Some(qemu) = qemu() else { return };
    let study = EveryStage::new();
    let release = |model: &str, offers: &str, command: &mut Command| {
        let start = Instant::now();
        let sums = study.release(model, command);
        let seconds = start.elapsed().as_secs_f64();
        // Of SHA256SUMS, whose lines these are.
        let lines: String = sums.iter().map(|(path, sum)| format!("{sum}  {path}\n")).collect();
        let of_sums = sastrugi_store::digest::of_text(&lines);
        println!("| {model} | {offers} | {} files | {} | {seconds:.0} s |", sums.len(), &of_sums[..16]);
        sums
    };
    let native = release("native", &offered(Command::new(OFFERS)), &mut Command::new(program()));
    let flavours = study.flavours("native", &mut Command::new(program()));
    std::thread::scope(|scope| {
        for Processor { model, offers } in PROCESSORS {
            let (qemu, native, release) = (&qemu, &native, &release);
            let (study, flavours) = (&study, &flavours);
            scope.spawn(move || {
                assert_eq!(
                    offered(emulated(qemu, model, Path::new(OFFERS))),
                    offers,
                    "{model} is not what it should be"
                );
                let other = release(model, offers, &mut emulated(qemu, model, &program()));
                assert_same(native, &other, model);
                let other = study.flavours(model, &mut emulated(qemu, model, &program()));
                assert_same(flavours, &other, &format!("{model}, other flavours"));
            });
        }
    });
}
