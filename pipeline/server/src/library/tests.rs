//! Shared generation, limits, damaged records and killed writers.

use super::*;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};

const WRITER: &str = "SASTRUGI_TEST_LIBRARY_WRITER";

fn mix(state: &mut u64) -> u64 {
    *state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
    (*state ^ (*state >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 16
}

/// A tile determined by its number.
fn tile_of(number: u64, size: usize) -> Samples {
    let count = size * size;
    let values = |salt: u64| (0..count as u64).map(|k| ((number * 31 + salt + k) % 9973) as f32).collect::<Vec<_>>();
    let (albedo, rock, rock_potential) = (Some(values(1)), Some(values(3)), Some(values(2)));
    Samples { rows: size, cols: size, heights: values(0), albedo, rock, rock_potential }
}

fn key_of(number: u64) -> TileKey {
    TileKey::new(format!("{{\"tile\":{number}}}"))
}

fn settings(folder: Option<&Path>) -> Settings {
    let folder = folder.map(Path::to_owned);
    Settings { folder, disk_bytes: 1 << 30, memory_bytes: 1 << 20, workers: 2, queue: 256 }
}

fn open(settings: Settings) -> Arc<Library> {
    Library::open(&settings).unwrap()
}

fn runtime() -> tokio::runtime::Runtime {
    tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap()
}

async fn ask(library: &Arc<Library>, number: u64) -> Arc<Samples> {
    library.tile(key_of(number), Priority::Answer, move |_| Some(tile_of(number, 8))).await.unwrap()
}

async fn until(mut condition: impl FnMut() -> bool) {
    let start = Instant::now();
    while !condition() {
        assert!(start.elapsed() < Duration::from_secs(20), "waited too long");
        tokio::time::sleep(Duration::from_millis(1)).await;
    }
}

/// Waits until pending writes are done.
async fn idle(library: &Arc<Library>) {
    until(|| library.statistics().running == 0 && library.statistics().queued == 0).await;
}

/// All files below a folder whose name satisfies `wanted`.
fn files(folder: &Path, wanted: &dyn Fn(&str) -> bool) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap().flatten() {
        if entry.path().is_dir() {
            found.extend(files(&entry.path(), wanted));
        } else if wanted(&entry.file_name().to_string_lossy()) {
            found.push(entry.path());
        }
    }
    found
}

/// The first of a hundred requests is dropped; the other 99 are served by the same generation.
#[test]
fn val_a_hundred_requests_generate_once_when_the_first_is_dropped() {
    runtime().block_on(async {
        let library = open(settings(None));
        let (go, wait) = mpsc::channel::<()>();
        let leader = tokio::spawn({
            let library = library.clone();
            async move {
                let make = move |_: &AtomicBool| wait.recv().ok().map(|()| tile_of(7, 8));
                library.tile(key_of(7), Priority::Answer, make).await
            }
        });
        until(|| library.statistics().running == 1).await;
        let followers: Vec<_> = (0..99)
            .map(|_| {
                let library = library.clone();
                tokio::spawn(async move { library.tile(key_of(7), Priority::Answer, |_| panic!("again")).await })
            })
            .collect();
        until(|| library.flights().get(&key_of(7).digest).is_some_and(|f| f.waiters == 100)).await;
        leader.abort();
        assert!(leader.await.unwrap_err().is_cancelled());
        go.send(()).unwrap();
        for follower in followers {
            assert_eq!(*follower.await.unwrap().unwrap(), tile_of(7, 8));
        }
        let statistics = library.statistics();
        assert_eq!((statistics.made, statistics.cancelled), (1, 0));
    });
}

/// The last waiter to leave cancels; a request that arrives while the cancelled generation ends gets its own, correct tile.
#[test]
fn val_the_last_waiter_cancels_and_a_later_one_starts_again() {
    runtime().block_on(async {
        let library = open(settings(None));
        let (go, wait) = mpsc::channel::<()>();
        let (told, seen) = mpsc::channel();
        let make = move |cancel: &AtomicBool| {
            while !cancel.load(Ordering::SeqCst) {
                std::thread::yield_now();
            }
            told.send(()).unwrap();
            wait.recv().unwrap();
            Some(tile_of(666, 8))
        };
        let first = tokio::spawn({
            let library = library.clone();
            async move { library.tile(key_of(1), Priority::Answer, make).await }
        });
        until(|| library.statistics().running == 1).await;
        first.abort();
        let _ = first.await;
        seen.recv_timeout(Duration::from_secs(20)).unwrap();
        assert_eq!(*ask(&library, 1).await, tile_of(1, 8));
        go.send(()).unwrap();
        idle(&library).await;
        assert_eq!(*ask(&library, 1).await, tile_of(1, 8));
        assert_eq!((library.statistics().made, library.statistics().cancelled), (1, 1));
    });
}

/// With one busy worker: the queue is bounded, abandoned work is dropped, and answers go before background jobs.
#[test]
fn val_the_queue_is_bounded_and_ordered() {
    runtime().block_on(async {
        let library = open(Settings { workers: 1, queue: 2, ..settings(None) });
        let (go, wait) = mpsc::channel::<()>();
        let order = Arc::new(Mutex::new(Vec::new()));
        let spawn = |number: u64, priority| {
            let (library, order) = (library.clone(), order.clone());
            tokio::spawn(async move {
                let make = move |_: &AtomicBool| {
                    order.lock().unwrap().push(number);
                    Some(tile_of(number, 8))
                };
                library.tile(key_of(number), priority, make).await
            })
        };
        let held = tokio::spawn({
            let library = library.clone();
            async move {
                library.tile(key_of(0), Priority::Answer, move |_| wait.recv().ok().map(|()| tile_of(0, 8))).await
            }
        });
        until(|| library.statistics().running == 1).await;
        let mut waiting = Vec::new();
        let line = [(1, Priority::Background), (2, Priority::Answer), (3, Priority::Answer)];
        for (place, (number, priority)) in line.into_iter().enumerate() {
            waiting.push(spawn(number, priority));
            until(|| library.statistics().queued == place as u64 + 1).await;
        }
        assert_eq!(spawn(4, Priority::Answer).await.unwrap(), Err(Unavailable::Busy));
        waiting[1].abort();
        until(|| library.statistics().queued == 2).await;
        go.send(()).unwrap();
        held.await.unwrap().unwrap();
        waiting.remove(1);
        for request in waiting {
            request.await.unwrap().unwrap();
        }
        assert_eq!(*order.lock().unwrap(), [3, 1]);
    });
}

#[test]
fn val_failures_reach_the_waiters_and_the_pool_survives() {
    runtime().block_on(async {
        let library = open(Settings { workers: 1, ..settings(None) });
        let panicked = library.tile(key_of(1), Priority::Answer, |_| panic!("a kernel that fails on purpose")).await;
        assert!(matches!(panicked, Err(Unavailable::Failed(_))));
        assert!(matches!(library.tile(key_of(1), Priority::Answer, |_| None).await, Err(Unavailable::Failed(_))));
        assert_eq!(*ask(&library, 1).await, tile_of(1, 8));
        assert_eq!(library.statistics().failed, 2);
    });
}

/// A tile larger than the memory limit is served but not kept.
#[test]
fn val_memory_is_bounded() {
    runtime().block_on(async {
        let bytes = tile_of(0, 8).bytes();
        let library = open(Settings { memory_bytes: 20 * bytes, ..settings(None) });
        for number in 0..200 {
            ask(&library, number).await;
        }
        assert!(library.statistics().memory_bytes <= 20 * bytes);
        let large = library.tile(key_of(1000), Priority::Answer, |_| Some(tile_of(1000, 100))).await.unwrap();
        assert_eq!(*large, tile_of(1000, 100));
        assert!(library.statistics().memory_bytes <= 20 * bytes);
    });
}

/// Any flipped bit and any truncation is detected, and the record deleted and regenerated.
#[test]
fn prop_damaged_records_are_never_served() {
    runtime().block_on(async {
        let folder = tempfile::tempdir().unwrap();
        let library = open(Settings { memory_bytes: 0, ..settings(Some(folder.path())) });
        let path = library.disk.as_ref().unwrap().path(&key_of(5));
        let mut state = 5;
        for round in 0..400_u64 {
            ask(&library, 5).await;
            idle(&library).await;
            let mut bytes = fs::read(&path).unwrap();
            let place = if round < 60 { round as usize } else { mix(&mut state) as usize % bytes.len() };
            if round % 4 == 3 {
                bytes.truncate(place);
            } else {
                bytes[place] ^= 1 << (mix(&mut state) % 8);
            }
            fs::write(&path, bytes).unwrap();
            assert_eq!(*ask(&library, 5).await, tile_of(5, 8));
            idle(&library).await;
            assert_eq!(library.statistics().damaged, round + 1);
        }
        let other = library.disk.as_ref().unwrap().path(&key_of(6));
        fs::create_dir_all(other.parent().unwrap()).unwrap();
        fs::copy(&path, &other).unwrap();
        assert_eq!(*ask(&library, 6).await, tile_of(6, 8));
        assert_eq!(library.statistics().damaged, 401);
    });
}

#[test]
fn val_foreign_folders_are_refused_and_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("thesis.tex"), "mine").unwrap();
    let refused = Library::open(&settings(Some(folder.path()))).err().unwrap();
    assert!(matches!(refused, LibraryError::Occupied(_)), "{refused}");
    assert_eq!(files(folder.path(), &|_| true).len(), 1);
    let other = tempfile::tempdir().unwrap();
    fs::write(other.path().join("sastrugi-library.json"), "{\"program\":\"sastrugi\",\"library\":2}\n").unwrap();
    assert!(matches!(Library::open(&settings(Some(other.path()))), Err(LibraryError::Version(_))));
    let fresh = tempfile::tempdir().unwrap();
    drop(Library::open(&Settings { disk_bytes: 0, ..settings(Some(fresh.path())) }).unwrap());
    assert_eq!(files(fresh.path(), &|_| true).len(), 0);
}

/// With a file in place of a subfolder, the tile cannot be written but is still served.
#[test]
fn val_write_errors_do_not_fail_the_answer() {
    runtime().block_on(async {
        let folder = tempfile::tempdir().unwrap();
        let library = open(settings(Some(folder.path())));
        let path = library.disk.as_ref().unwrap().path(&key_of(1));
        fs::write(path.parent().unwrap(), "in the way").unwrap();
        assert_eq!(*ask(&library, 1).await, tile_of(1, 8));
        idle(&library).await;
        assert_eq!(*ask(&library, 1).await, tile_of(1, 8));
        assert_eq!((library.statistics().unwritten, library.statistics().memory_hits), (1, 1));
    });
}

/// Tiles that are cached, being generated, or partly used are known; so are records on disk.
#[test]
fn val_requested_tiles_are_known() {
    runtime().block_on(async {
        let folder = tempfile::tempdir().unwrap();
        let library = open(settings(Some(folder.path())));
        let keys = [key_of(1), key_of(2), key_of(3)];
        assert!(!library.knows_any(&keys));
        ask(&library, 2).await;
        assert!(library.knows_any(&keys) && library.has(&keys[1]) && !library.has(&keys[0]));
        library.remember(&keys[..1]);
        assert!(library.knows_any(&keys[..1]) && !library.has(&keys[0]) && !library.knows_any(&keys[2..]));
        idle(&library).await;
        drop(library);
        let again = open(settings(Some(folder.path())));
        assert!(again.has(&keys[1]) && !again.knows_any(&keys[..1]));
    });
}

/// Two libraries share a folder that holds only a fraction of the requested tiles.
#[test]
fn prop_two_libraries_share_a_small_folder() {
    runtime().block_on(async {
        let folder = tempfile::tempdir().unwrap();
        let small = || Settings { memory_bytes: 3000, disk_bytes: 20 * 4096, ..settings(Some(folder.path())) };
        let libraries = [open(small()), open(small())];
        let asking = (0..4_u64).map(|task| {
            let library = libraries[task as usize % 2].clone();
            tokio::spawn(async move {
                let mut state = task;
                for _ in 0..400 {
                    let number = mix(&mut state) % 60;
                    assert_eq!(*ask(&library, number).await, tile_of(number, 8));
                }
            })
        });
        for task in asking.collect::<Vec<_>>() {
            task.await.unwrap();
        }
        idle(&libraries[0]).await;
        idle(&libraries[1]).await;
        let all = [libraries[0].statistics(), libraries[1].statistics()];
        assert!(all.iter().all(|s| s.damaged == 0 && s.evicted > 0 && s.disk_hits > 0), "{all:?}");
        drop(Library::open(&small()).unwrap());
        let left = files(folder.path(), &|name| name.ends_with(".tile"));
        // Each record occupies one block.
        assert!(left.len() <= 20, "{}", left.len());
    });
}

/// Child process of the test below; writes records until it is killed.
#[test]
#[ignore = "the process that the next test starts"]
fn val_child_writes_until_it_is_killed() {
    let Some(folder) = std::env::var_os(WRITER) else { return };
    let disk = Disk::open(Path::new(&folder), 1 << 30).unwrap();
    std::thread::scope(|scope| {
        for thread in 0..4_u64 {
            let disk = &disk;
            scope.spawn(move || {
                let (start, mut state) = (Instant::now(), u64::from(std::process::id()) + thread);
                while start.elapsed() < Duration::from_secs(20) {
                    let number = mix(&mut state) % 200;
                    disk.write(&key_of(number), &tile_of(number, 64));
                }
            });
        }
    });
}

/// Writers killed at any instant leave only complete records, and the next opening removes all temporary files.
#[test]
fn prop_killed_writers_leave_whole_records() {
    let folder = tempfile::tempdir().unwrap();
    let (mut state, mut leftovers) = (3, 0);
    for _ in 0..30 {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--ignored", "--exact", "library::tests::val_child_writes_until_it_is_killed"])
            .env(WRITER, folder.path())
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_millis(20 + mix(&mut state) % 80));
        child.kill().unwrap();
        child.wait().unwrap();
        leftovers += files(folder.path(), &|name| name.starts_with(".sastrugi-partial")).len();
        let disk = Disk::open(folder.path(), 1 << 30).unwrap();
        assert_eq!(files(folder.path(), &|name| name.starts_with(".sastrugi-partial")).len(), 0);
        let there = (0..200).filter(|number| disk.path(&key_of(*number)).exists());
        there.for_each(|number| assert_eq!(disk.read(&key_of(number)), Some(tile_of(number, 64))));
        assert_eq!(disk.damaged.load(Ordering::Relaxed), 0);
    }
    let records = files(folder.path(), &|name| name.ends_with(".tile")).len();
    println!("{records} records, {leftovers} leftovers cleared");
    assert!(records > 0);
}

/// Hits are counted and return the tile; their cost is printed.
#[test]
fn val_hits_return_the_tile() {
    runtime().block_on(async {
        let folder = tempfile::tempdir().unwrap();
        let library = open(Settings { memory_bytes: 1 << 24, ..settings(Some(folder.path())) });
        let make = |_: &AtomicBool| Some(tile_of(1, 256));
        library.tile(key_of(1), Priority::Answer, make).await.unwrap();
        idle(&library).await;
        let start = Instant::now();
        for _ in 0..10_000 {
            library.tile(key_of(1), Priority::Answer, make).await.unwrap();
        }
        println!("memory hit {:?}", start.elapsed() / 10_000);
        assert_eq!((library.statistics().memory_hits, library.statistics().made), (10_000, 1));
        let disk = library.disk.as_ref().unwrap();
        let start = Instant::now();
        (0..100).for_each(|_| assert!(disk.read(&key_of(1)).is_some()));
        println!("disk hit {:?}", start.elapsed() / 100);
        assert_eq!(disk.read(&key_of(1)), Some(tile_of(1, 256)));
    });
}

/// A library whose only worker blocks until the sender sends.
async fn busy(folder: Option<&Path>) -> (Arc<Library>, mpsc::Sender<()>) {
    let library = open(Settings { workers: 1, ..settings(folder) });
    let (go, wait) = mpsc::channel::<()>();
    let blocker = Arc::clone(&library);
    tokio::spawn(async move {
        let make = move |_: &AtomicBool| wait.recv().ok().map(|()| tile_of(0, 8));
        blocker.tile(key_of(0), Priority::Answer, make).await
    });
    until(|| library.statistics().running == 1).await;
    (library, go)
}

/// A tile queued in the background is generated first once a client waits for it.
#[test]
fn val_an_answer_overtakes_background_tiles() {
    runtime().block_on(async {
        let (library, go) = busy(None).await;
        let order = Arc::new(Mutex::new(Vec::new()));
        let request = |number: u64, priority: Priority| {
            let (library, order) = (Arc::clone(&library), Arc::clone(&order));
            tokio::spawn(async move {
                let make = move |_: &AtomicBool| {
                    order.lock().unwrap().push(number);
                    Some(tile_of(number, 8))
                };
                library.tile(key_of(number), priority, make).await.unwrap()
            })
        };
        let mut all = Vec::new();
        for number in 1..4 {
            all.push(request(number, Priority::Background));
            until(|| library.statistics().queued == number).await;
        }
        all.push(request(3, Priority::Answer));
        until(|| library.flights().get(&key_of(3).digest).is_some_and(|f| f.waiters == 2)).await;
        go.send(()).unwrap();
        for one in all {
            one.await.unwrap();
        }
        assert_eq!(*order.lock().unwrap(), [3, 1, 2]);
    });
}

/// Records are read even while every worker is busy.
#[test]
fn val_records_do_not_wait_for_workers() {
    let folder = tempfile::tempdir().unwrap();
    runtime().block_on(async {
        let library = open(settings(Some(folder.path())));
        ask(&library, 5).await;
        idle(&library).await;
        let (library, go) = busy(Some(folder.path())).await;
        let read = library.tile(key_of(5), Priority::Answer, |_| panic!("made again")).await.unwrap();
        assert_eq!(*read, tile_of(5, 8));
        assert_eq!((library.statistics().disk_hits, library.statistics().made), (1, 0));
        go.send(()).unwrap();
    });
}

/// Background tiles leave exactly one thread to waiting clients.
#[test]
fn val_background_work_leaves_a_thread_to_answers() {
    runtime().block_on(async {
        let library = open(settings(None));
        let mut held = Vec::new();
        for number in 0..3 {
            let (go, wait) = mpsc::channel::<()>();
            let shared = Arc::clone(&library);
            let make = move |_: &AtomicBool| wait.recv().ok().map(|()| tile_of(number, 8));
            let ahead = async move { shared.tile(key_of(number), Priority::Background, make).await };
            held.push((tokio::spawn(ahead), go));
            // One after the other: the third has to be the one that is queued.
            until(|| library.flights().len() as u64 == number + 1).await;
        }
        until(|| library.statistics().running == 2 && library.statistics().queued == 1).await;
        assert_eq!(*ask(&library, 7).await, tile_of(7, 8));
        until(|| library.statistics().running == 2 && library.statistics().queued == 1).await;
        // That thread takes a queued background tile once a client waits for it.
        let joined = tokio::spawn({
            let library = Arc::clone(&library);
            async move { ask(&library, 2).await }
        });
        until(|| library.statistics().running == 3).await;
        for (request, go) in held.into_iter().rev() {
            go.send(()).unwrap();
            request.await.unwrap().unwrap();
        }
        assert_eq!(*joined.await.unwrap(), tile_of(2, 8));
    });
}

/// A damaged record is regenerated by a worker and does not occupy a reader.
#[test]
fn val_damaged_records_are_made_by_workers() {
    let folder = tempfile::tempdir().unwrap();
    runtime().block_on(async {
        let library = open(settings(Some(folder.path())));
        for number in 1..=5 {
            ask(&library, number).await;
        }
        idle(&library).await;
        let disk = library.disk.as_ref().unwrap();
        (1..=4).for_each(|number| fs::write(disk.path(&key_of(number)), "damaged").unwrap());
        let (library, go) = busy(Some(folder.path())).await;
        let damaged: Vec<_> = (1..=4)
            .map(|number| {
                let library = Arc::clone(&library);
                tokio::spawn(async move { ask(&library, number).await })
            })
            .collect();
        until(|| library.statistics().damaged == 4).await;
        assert_eq!(*library.tile(key_of(5), Priority::Answer, |_| panic!("made again")).await.unwrap(), tile_of(5, 8));
        go.send(()).unwrap();
        for (number, request) in (1..).zip(damaged) {
            assert_eq!(*request.await.unwrap(), tile_of(number, 8));
        }
    });
}

/// Six records of one block exceed a limit of five; down to nine tenths of it, four remain. Those used longest ago go, whatever their numbers.
#[test]
fn val_the_least_recently_used_records_are_evicted() {
    let folder = tempfile::tempdir().unwrap();
    let disk = Disk::open(folder.path(), 5 * 4096).unwrap();
    let write = |number: u64, used_s: u64| {
        disk.write(&key_of(number), &tile_of(number, 8));
        let used = std::time::SystemTime::UNIX_EPOCH + Duration::from_secs(used_s);
        fs::File::options().write(true).open(disk.path(&key_of(number))).unwrap().set_modified(used).unwrap();
    };
    [(1, 500), (2, 100), (3, 400), (4, 200), (5, 300)].into_iter().for_each(|(number, used_s)| write(number, used_s));
    assert_eq!(disk.counts(), [0, 0, 0, 5 * 4096]);
    disk.write(&key_of(6), &tile_of(6, 8));
    let left: Vec<u64> = (1..=6).filter(|number| disk.has(&key_of(*number))).collect();
    assert_eq!((left, disk.counts()), (vec![1, 3, 5, 6], [0, 2, 0, 4 * 4096]));
    // A record that is read counts as used now.
    assert!(disk.read(&key_of(5)).is_some());
    [7, 8].into_iter().for_each(|number| disk.write(&key_of(number), &tile_of(number, 8)));
    let left: Vec<u64> = (1..=8).filter(|number| disk.has(&key_of(*number))).collect();
    assert_eq!(left, [5, 6, 7, 8]);
}

/// A record larger than the limit is not written.
#[test]
fn val_records_beyond_the_limit_are_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let disk = Disk::open(folder.path(), 5 * 4096).unwrap();
    // 64 x 64 samples of four fields take 64 KiB.
    disk.write(&key_of(1), &tile_of(1, 64));
    assert!(!disk.has(&key_of(1)));
    assert_eq!(disk.counts(), [0; 4]);
}
