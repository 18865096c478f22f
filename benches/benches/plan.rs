//! Planning of studies with many small terrains: from text to graph, including keys and a scan of an empty work area.
//!
//! Items per second; a terrain has four items (generate, describe, draw missions, drive). The target is
//! 100 000 missions in 5 s: 5 000 terrains of 20 missions, or at worst 100 000 terrains of one, the largest size here.

use divan::Bencher;
use divan::counter::ItemsCount;
use sastrugi_stages::loaded::load_text;
use sastrugi_stages::studies::plan_of;
use std::path::Path;

const TERRAINS: [usize; 3] = [50, 5_000, 100_000];
const ITEMS_PER_TERRAIN: usize = 4;

fn main() {
    divan::main();
}

#[divan::bench(sample_count = 3, args = TERRAINS)]
fn plan(bencher: Bencher, terrains: usize) {
    let text = format!(
        "[study]\nname = \"many\"\nseed = 1\ndate = \"2026-01-01\"\n\n[[terrain]]\nid = \"t\"\nkind = \"multifractal\"\n\
         size_px = [64, 64]\ncount = {terrains}\n\n[[missions]]\nid = \"m\"\nterrains = [\"t\"]\ncount = 20\n\
         length_m = 2.0\nborder_m = 0.5\n\n\
         [[traverse]]\nid = \"h\"\nmissions = \"m\"\n"
    );
    let folder = tempfile::tempdir().unwrap_or_else(|e| panic!("{e}"));
    let output = folder.path().join("release");
    bencher.counter(ItemsCount::new(ITEMS_PER_TERRAIN * terrains)).bench(|| {
        let loaded = load_text(&text, "study", Path::new("")).unwrap_or_else(|e| panic!("{e}"));
        plan_of(&loaded, &output, None, None).unwrap_or_else(|e| panic!("{e}")).stale.len()
    });
}
