//! Writes a release with a number of synthetic missions: `synthetic_release DEST MISSIONS`.

use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let made = match arguments.as_slice() {
        [dest, missions] => missions
            .parse()
            .map_err(|_| format!("\"{missions}\" is not a number of missions"))
            .and_then(|n| sastrugi_tests::synthetic::release(Path::new(dest), n).map_err(|e| e.to_string())),
        _ => Err("usage: synthetic_release DEST MISSIONS".to_owned()),
    };
    match made {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
