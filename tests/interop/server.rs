//! The terrain server, read by independent clients.

use super::{called, python};
use sastrugi_tests::server::Server;
use std::process::Command;

/// GDAL reads the COG by ranges and map tiles by its drivers TMS and OGCAPI, numpy and Pillow the other formats: all give the same ground. Links
/// of OGC API - Tiles lead to what they describe, and morecantile places tiles where the server does.
#[test]
fn val_clients_read_the_server() {
    let Some(python) = python() else { return };
    let root = sastrugi_fixtures::workspace_root();
    let server = Server::start(&root, &["fixtures/worlds/planet.toml"], &[]);
    let call = called(Command::new(python).arg(root.join("tests/interop/check_server.py")).arg(&server.address));
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
}
