//! Schemathesis generates requests from the description of the terrain server's API and validates the answers against it.

use sastrugi_tests::server::{Server, WORLD};
use sastrugi_tests::{area, called, write};
use std::process::Command;

/// Generated requests for each operation and phase.
const EXAMPLES: &str = "200";
/// Least number of valid requests that are answered with 200: refusals alone would test little of the answers.
const RIGHT_MIN: u64 = 500;

/// Every answer is as described, and none is a server error: several thousand requests, the same every time. One check is left out: that everything
/// the description allows is accepted. The description cannot state that `origin` and `center` exclude each other, nor where ground ends.
#[test]
#[ignore = "slow: ./test --full"]
fn val_answers_are_as_described() {
    let Some(python) = super::python() else { return };
    let folder = area();
    write(folder.path(), "world.toml", WORLD);
    let server = Server::start(folder.path(), &["world.toml"], &[]);
    let url = format!("http://{}", server.address);
    let mut command = Command::new(python.with_file_name("schemathesis"));
    command.current_dir(folder.path()).args(["run", &format!("{url}/v1/openapi.json"), "--url", &url]);
    command.args(["--seed", "20261125", "--max-examples", EXAMPLES, "--exclude-checks", "positive_data_acceptance"]);
    command.args(["--phases", "examples,coverage,fuzzing,stateful", "--request-timeout", "90", "--no-color"]);
    let call = called(&mut command);
    println!("{}", call.stdout);
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
    let metrics = String::from_utf8(server.get("/metrics").body).unwrap();
    assert!(!metrics.contains("status=\"500\""), "{metrics}");
    let right = metrics.lines().filter(|line| line.contains("requests_total") && line.contains("status=\"200\""));
    let right: u64 = right.filter_map(|line| line.rsplit(' ').next()?.parse::<u64>().ok()).sum();
    assert!(right > RIGHT_MIN, "only {right} requests were answered with 200: {metrics}");
}
