//! Missions, teams, rovers, routes and images stay within the memory that they state, by which a run decides what runs at the same time.

use peak_alloc::PeakAlloc;
use sastrugi_stages::job::ItemRef;
use sastrugi_stages::loaded::load_text;
use sastrugi_stages::runner::cache::Cache;
use sastrugi_stages::runner::execute::{Limits, execute};
use sastrugi_stages::runner::progress::{End, Progress};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

#[global_allocator]
static ALLOCATED: PeakAlloc = PeakAlloc;

/// Threads of the kernels: the missions, runs, rovers and searches that are in memory at once.
const THREADS: usize = 4;
/// Allowance beyond the stated memory, bytes: encoders of tables, recordings and pictures, and files that are hashed.
const SMALL: u64 = 8 << 20;

/// An item, and how much it may state.
struct Case {
    item: &'static str,
    /// What it states whatever the study, bytes: for small things that are not counted one by one.
    fixed: u64,
    /// Largest permitted ratio of the rest to the measured memory.
    factor: u64,
}

const MIB: u64 = 1 << 20;

/// Factor of jobs whose memory follows from their numbers of cells, pixels and samples. What is counted per cell is not all needed at the same
/// moment (reading, preparing, working, writing), and how well files compress is not known.
const COUNTED: u64 = 4;
/// Factor of jobs with searches. They state a queue that holds most cells, which takes a maze, and as many searches at once as there are
/// threads, which depends on the moment; over open ground the queue is short.
const SEARCHED: u64 = 8;

const CASES: [Case; 8] = [
    Case { item: "traverse/drive@rough", fixed: 64 * MIB, factor: COUNTED },
    Case { item: "route/roads@hills", fixed: 64 * MIB, factor: SEARCHED },
    Case { item: "route/cells@hills", fixed: 64 * MIB, factor: SEARCHED },
    Case { item: "navigate/known@hills", fixed: 128 * MIB, factor: COUNTED },
    Case { item: "navigate/seeing@hills", fixed: 128 * MIB, factor: SEARCHED },
    Case { item: "rover/rays@coarse", fixed: 0, factor: SEARCHED },
    Case { item: "image/map", fixed: 0, factor: COUNTED },
    Case { item: "image/camera", fixed: 0, factor: COUNTED },
];

/// Surfaces of a million cells, and small ones on which something else takes the memory: the map of the best paths of rovers, an image. Missions end
/// at their time limit, and rovers at their number of cycles, up to which memory is stated.
const STUDY: &str = r#"
[study]
name = "memory"
seed = 1
date = "2026-01-01"

[[terrain]]
id = "rough"
kind = "multifractal"
size_px = [1000, 1000]
cell_m = 0.1

[[terrain]]
id = "hills"
kind = "spheroids"
preset = "rough"
size_px = [1000, 1000]
cell_m = 1.0

[[terrain]]
id = "coarse"
kind = "multifractal"
size_px = [400, 400]
cell_m = 0.2

[[terrain]]
id = "plate"
kind = "multifractal"
size_px = [64, 64]
cell_m = 0.1

[[image]]
id = "map"
surface = "rough"
samples = 1

[[image]]
id = "camera"
surface = "plate"
samples = 1
camera = { kind = "pinhole", position_m = [3.2, 0.5, 3.0], target_m = [3.2, 3.2, 0.0], size_px = [1600, 1200] }

[[missions]]
id = "lines"
terrains = ["rough"]
count = 16
length_m = 40.0
border_m = 5.0

[[traverse]]
id = "drive"
missions = "lines"
timeout_s = 30.0
sample_rate_hz = 100

[[route]]
id = "roads"
terrains = ["hills"]
pairs = 2
border_m = 20.0
method = "roadmap"

[[route]]
id = "cells"
terrains = ["hills"]
pairs = 2
border_m = 20.0
method = "grid"

[[navigate]]
id = "known"
route = "cells"
formation = "wedge"
members = 4
spacing_m = 10.0

[[navigate]]
id = "seeing"
route = "cells"
formation = "wedge"
members = 4
spacing_m = 10.0
count = 2
sensing_radius_m = 30.0

[[rover]]
id = "rays"
kind = "sojourner_like"
terrains = ["coarse"]
rovers = 8
centre_m = [40.0, 40.0]
radius_m = 25.0
hazard_step_m = 1.0
hazard_span_m = 2.0
tilt_max_deg = 80.0
cycle_limit = 300
"#;

/// Peak memory of each item that ran, bytes, and how it ended. One item runs at a time.
#[derive(Default)]
struct Meter {
    before: AtomicUsize,
    ended: Mutex<BTreeMap<String, (u64, End)>>,
}

impl Progress for Meter {
    fn started(&self, _: &ItemRef, _: f64) {
        self.before.store(ALLOCATED.current_usage(), Ordering::SeqCst);
        ALLOCATED.reset_peak_usage();
    }

    fn ended(&self, item: &ItemRef, end: &End, _: f64) {
        let peak = ALLOCATED.peak_usage().saturating_sub(self.before.load(Ordering::SeqCst));
        let mut ended = self.ended.lock().unwrap_or_else(PoisonError::into_inner);
        ended.insert(item.to_string(), (peak as u64, end.clone()));
    }
}

#[test]
fn val_jobs_stay_within_their_stated_memory() {
    rayon::ThreadPoolBuilder::new().num_threads(THREADS).build_global().unwrap();
    let graph = load_text(STUDY, "study.toml", Path::new("")).unwrap().graph;
    let position = |case: &Case| {
        let (stage, id) = case.item.split_once('/').unwrap();
        graph.find(&ItemRef::new(stage, id)).unwrap_or_else(|| panic!("{} is not in the study", case.item))
    };
    let stated = CASES.map(|case| (position(&case), case));
    let folder = tempfile::tempdir().unwrap();
    let (cache, meter) = (Cache::open(folder.path()).unwrap(), Meter::default());
    let limits = Limits { workers: 1, memory_bytes: u64::MAX, beyond: true };
    let needed = graph.closure(stated.iter().map(|(position, _)| *position));
    let execution = execute(&graph, &cache, &needed, limits, &meter).unwrap();
    assert!(execution.failures.is_empty(), "{:?}", execution.failures);
    let ended = meter.ended.into_inner().unwrap();
    let mut wrong = Vec::new();
    for (position, Case { item, fixed, factor }) in stated {
        let ((used, end), stated) = (&ended[item], graph.node(position).job.memory_bytes());
        println!("{item}: {:.1} MB, stated {:.1} MB, {end:?}", 1e-6 * *used as f64, 1e-6 * stated as f64);
        if *used > stated + SMALL || stated > fixed + factor * used {
            wrong.push((item, *used, stated));
        }
    }
    assert!(wrong.is_empty(), "item, memory used and stated, bytes: {wrong:?}");
}
