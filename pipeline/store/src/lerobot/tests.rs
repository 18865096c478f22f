use super::*;
use arrow_array::{Array, FixedSizeListArray, Float32Array, RecordBatch};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use std::collections::BTreeMap;

/// A state of two values, an action of one, a patch of 2 x 3 heights, and a flag.
fn description() -> Description {
    let feature = |name, kind, shape, names: &[&str]| Feature {
        name,
        kind,
        shape,
        names: names.iter().map(|name| (*name).to_owned()).collect(),
    };
    Description {
        robot: "husky_a200".to_owned(),
        fps: 20,
        features: vec![
            feature("observation.state", Kind::F32, Shape::Vector(2), &["x", "y"]),
            feature("action", Kind::F32, Shape::Scalar, &["speed"]),
            feature("observation.patch", Kind::F32, Shape::Matrix([2, 3]), &["row", "column"]),
            feature("next.done", Kind::Bool, Shape::Scalar, &[]),
        ],
        origin: json!({"name": "small", "license": "CC0-1.0"}),
    }
}

/// An episode whose values differ from those of every other one.
fn episode(split: &str, number: usize, frames: usize) -> Episode {
    let values = |each: usize| (0..frames * each).map(|k| (k * k + 7 * number) as f32 / 8.0).collect();
    Episode {
        split: split.to_owned(),
        task: format!("task {}", number % 2),
        terrain_id: "rough-0001".to_owned(),
        mission_id: format!("husky-{number:04}"),
        outcome: "success".to_owned(),
        start_m: [1.0, 2.0, number as f64],
        frames,
        values: vec![
            Values::F32(values(2)),
            Values::F32(values(1)),
            Values::F32(values(6)),
            Values::Bool((1..=frames).map(|k| k == frames).collect()),
        ],
    }
}

/// Three episodes in two splits.
fn episodes() -> [Episode; 3] {
    [episode("train", 0, 4), episode("train", 1, 3), episode("test", 2, 1)]
}

fn write_to(folder: &Path, file_bytes: u64) -> Summary {
    let mut writer = DatasetWriter::with_file_bytes(folder, description(), file_bytes).unwrap();
    episodes().iter().for_each(|episode| writer.push(episode).unwrap());
    writer.finish(folder, &[("README.md", b"read me".to_vec())]).unwrap()
}

/// Names and bytes of all files.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            match path.is_dir() {
                true => folders.push(path),
                false => {
                    let name = path.strip_prefix(folder).unwrap().to_str().unwrap().to_owned();
                    found.insert(name, fs::read(&path).unwrap());
                }
            }
        }
    }
    found
}

fn rows(path: &Path) -> RecordBatch {
    let reader = ParquetRecordBatchReaderBuilder::try_new(fs::File::open(path).unwrap()).unwrap();
    let mut batches = reader.with_batch_size(1 << 20).build().unwrap();
    batches.next().unwrap().unwrap()
}

fn integers(rows: &RecordBatch, column: &str) -> Vec<i64> {
    let column: Int64Array = rows.column_by_name(column).unwrap().as_any().downcast_ref().cloned().unwrap();
    column.values().to_vec()
}

#[test]
fn val_a_dataset_has_the_files_and_fields_of_version_3() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let summary = write_to(&out, FILE_MB << 20);
    assert_eq!(summary.splits, [("train".to_owned(), 0, 2), ("test".to_owned(), 2, 3)]);
    assert_eq!((summary.episodes, summary.frames, summary.tasks.len()), (3, 8, 2));
    let names: Vec<String> = files(&out).into_keys().collect();
    let expected = [
        "README.md",
        "data/chunk-000/file-000.parquet",
        "meta/episodes/chunk-000/file-000.parquet",
        "meta/info.json",
        "meta/stats.json",
        "meta/tasks.parquet",
    ];
    assert_eq!(names, expected);
    let info: Value = serde_json::from_slice(&fs::read(out.join(INFO)).unwrap()).unwrap();
    assert_eq!(info["codebase_version"], "v3.0");
    assert_eq!(info["splits"], json!({"train": "0:2", "test": "2:3"}));
    assert_eq!([&info["total_episodes"], &info["total_frames"], &info["total_tasks"], &info["fps"]], [3, 8, 2, 20]);
    let patch = &info["features"]["observation.patch"];
    assert_eq!(patch, &json!({"dtype": "float32", "shape": [2, 3], "names": ["row", "column"]}));
    assert_eq!(info["features"]["timestamp"], json!({"dtype": "float32", "shape": [1], "names": null}));
    assert_eq!(info["features"].as_object().unwrap().len(), 9);
    assert_eq!(info["sastrugi"]["license"], "CC0-1.0");
    // Nothing else was left beside it.
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn val_frames_and_episodes_point_at_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    write_to(&out, FILE_MB << 20);
    let frames = rows(&out.join("data/chunk-000/file-000.parquet"));
    assert_eq!(integers(&frames, "index"), (0..8).collect::<Vec<i64>>());
    assert_eq!(integers(&frames, "episode_index"), [0, 0, 0, 0, 1, 1, 1, 2]);
    assert_eq!(integers(&frames, "frame_index"), [0, 1, 2, 3, 0, 1, 2, 0]);
    assert_eq!(integers(&frames, "task_index"), [0, 0, 0, 0, 1, 1, 1, 0]);
    let time: Float32Array = frames.column_by_name("timestamp").unwrap().as_any().downcast_ref().cloned().unwrap();
    assert_eq!(time.values()[..5], [0.0, 0.05, 0.1, 0.15, 0.0]);
    let state: FixedSizeListArray =
        frames.column_by_name("observation.state").unwrap().as_any().downcast_ref().cloned().unwrap();
    let state: Float32Array = state.value(5).as_any().downcast_ref().cloned().unwrap();
    // Second frame of the second episode.
    assert_eq!(state.values()[..], [(4.0 + 7.0) / 8.0, (9.0 + 7.0) / 8.0]);
    let episodes = rows(&out.join("meta/episodes/chunk-000/file-000.parquet"));
    assert_eq!(integers(&episodes, "dataset_from_index"), [0, 4, 7]);
    assert_eq!(integers(&episodes, "dataset_to_index"), [4, 7, 8]);
    assert_eq!(integers(&episodes, "length"), [4, 3, 1]);
    for name in ["stats/observation.patch/q99", "stats/index/count", "mission_id", "start_z_m"] {
        assert!(episodes.column_by_name(name).is_some(), "{name}");
    }
}

/// Episodes with more values than an array can hold are written in several arrays, and the rows are the same.
#[test]
fn val_long_episodes_are_written_in_parts() {
    let folder = tempfile::tempdir().unwrap();
    let [whole, parts] = ["whole", "parts"].map(|name| folder.path().join(name));
    write_to(&whole, FILE_MB << 20);
    let mut writer = DatasetWriter::beside(&parts, description()).unwrap();
    // A patch has six values.
    assert_eq!(writer.frames_at_once, VALUES_MAX / 6);
    writer.frames_at_once = 3;
    episodes().iter().for_each(|episode| writer.push(episode).unwrap());
    writer.finish(&parts, &[]).unwrap();
    for name in ["data/chunk-000/file-000.parquet", "meta/episodes/chunk-000/file-000.parquet"] {
        assert_eq!(rows(&parts.join(name)), rows(&whole.join(name)), "{name}");
    }
}

/// The larger the frames, the fewer of them in a row group, so that memory is bounded.
#[test]
fn val_row_groups_are_limited_by_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let side = 1024;
    let patch = Feature {
        name: "patch",
        kind: Kind::F32,
        shape: Shape::Matrix([side, side]),
        names: vec!["row".to_owned(); 2],
    };
    let mut writer = DatasetWriter::beside(&out, Description { features: vec![patch], ..description() }).unwrap();
    let frames = 20;
    let values = vec![Values::F32(vec![0.5; frames * side * side])];
    writer.push(&Episode { frames, values, ..episode("train", 0, 1) }).unwrap();
    writer.finish(&out, &[]).unwrap();
    let file = fs::File::open(out.join("data/chunk-000/file-000.parquet")).unwrap();
    let groups = ParquetRecordBatchReaderBuilder::try_new(file).unwrap().metadata().row_groups().to_vec();
    // A frame has 4 MiB, and a few bytes more.
    assert_eq!(groups.iter().map(|group| group.num_rows()).collect::<Vec<_>>(), [15, 5]);
}

/// Full files are closed between episodes; the rows say in which file they are.
#[test]
fn val_files_are_filled_with_whole_episodes() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    write_to(&out, 1);
    let data = |k: usize| out.join(format!("data/chunk-000/file-{k:03}.parquet"));
    let lengths: Vec<usize> = (0..3).map(|k| rows(&data(k)).num_rows()).collect();
    assert_eq!((lengths, data(3).exists()), (vec![4, 3, 1], false));
    for k in 0..3 {
        let row = rows(&out.join(format!("meta/episodes/chunk-000/file-{k:03}.parquet")));
        assert_eq!(integers(&row, "data/file_index"), [k]);
        assert_eq!(integers(&row, "meta/episodes/file_index"), [k]);
        assert_eq!(integers(&row, "episode_index"), [k]);
    }
}

#[test]
fn val_the_same_episodes_give_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let [one, other] = ["one", "other"].map(|name| folder.path().join(name));
    [&one, &other].into_iter().for_each(|out| drop(write_to(out, FILE_MB << 20)));
    assert_eq!(files(&one), files(&other));
    // A dataset of ours is replaced, with the same bytes.
    write_to(&one, FILE_MB << 20);
    assert_eq!(files(&one), files(&other));
}

#[test]
fn val_other_files_are_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let [notes, file, foreign] = ["notes", "file", "foreign"].map(|name| folder.path().join(name));
    fs::create_dir(&notes).unwrap();
    assert!(check_folder(&notes).is_ok() && check_folder(&folder.path().join("new")).is_ok());
    fs::write(notes.join("a.txt"), "kept").unwrap();
    fs::write(&file, "kept").unwrap();
    // A dataset that another program recorded.
    fs::create_dir_all(foreign.join("meta")).unwrap();
    fs::write(foreign.join(INFO), r#"{"codebase_version": "v3.0"}"#).unwrap();
    for occupied in [&notes, &file, &foreign] {
        let error = DatasetWriter::beside(occupied, description()).err().unwrap();
        assert!(matches!(error, LerobotError::Occupied { .. }), "{error}");
    }
    assert_eq!(fs::read(notes.join("a.txt")).unwrap(), b"kept");
}

/// A pipe in place of the description of a dataset is not read, which could block for ever.
#[cfg(unix)]
#[test]
fn val_pipes_are_not_read() {
    let folder = tempfile::tempdir().unwrap();
    let info = folder.path().join(INFO);
    fs::create_dir_all(info.parent().unwrap()).unwrap();
    assert!(std::process::Command::new("mkfifo").arg(&info).status().unwrap().success());
    let error = check_folder(folder.path()).unwrap_err();
    assert!(matches!(error, LerobotError::Occupied { .. }), "{error}");
}

/// A writer that is dropped leaves nothing.
#[test]
fn val_an_unfinished_dataset_vanishes() {
    let folder = tempfile::tempdir().unwrap();
    let mut writer = DatasetWriter::beside(&folder.path().join("out"), description()).unwrap();
    writer.push(&episode("train", 0, 4)).unwrap();
    drop(writer);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
#[should_panic(expected = "a split is one range of episodes")]
fn val_an_interrupted_split_is_a_bug() {
    let folder = tempfile::tempdir().unwrap();
    let mut writer = DatasetWriter::beside(&folder.path().join("out"), description()).unwrap();
    ["train", "test", "train"].iter().for_each(|split| writer.push(&episode(split, 0, 2)).unwrap());
}

/// By hand: a matrix of one frame counts over its rows, column by column.
#[test]
fn val_statistics_of_a_matrix_are_those_of_its_columns() {
    let feature = &description().features[2];
    let stats = feature.stats(&Values::F32(vec![1.0, 2.0, 3.0, 5.0, 4.0, 3.0]), 1);
    assert_eq!((&stats.min[..], &stats.max[..]), (&[1.0, 2.0, 3.0][..], &[5.0, 4.0, 3.0][..]));
    assert_eq!((&stats.mean[..], &stats.std()[..]), (&[3.0, 3.0, 3.0][..], &[2.0, 1.0, 0.0][..]));
    assert_eq!((stats.count, &stats.quantiles[2][..]), (1, &[3.0, 3.0, 3.0][..]));
}

/// Merged extremes, means and variances are those of all values at once.
#[test]
fn prop_merged_statistics_are_those_of_everything() {
    let value = |k: usize| libm::sin(k as f64) * 3.0 + if k > 20 { 100.0 } else { 0.0 };
    let values: Vec<f64> = (0..50).map(value).collect();
    let of = |values: &[f64]| Stats::of(std::iter::once(values.to_vec()), values.len() as u64);
    let whole = of(&values);
    let mut merged = of(&values[..7]);
    [&values[7..20], &values[20..21], &values[21..]].into_iter().for_each(|part| merged.merge(&of(part)));
    assert_eq!((merged.count, &merged.min, &merged.max), (50, &whole.min, &whole.max));
    assert!((merged.mean[0] - whole.mean[0]).abs() < 1e-12, "{} {}", merged.mean[0], whole.mean[0]);
    assert!((merged.std()[0] - whole.std()[0]).abs() < 1e-12, "{} {}", merged.std()[0], whole.std()[0]);
    // Quantiles are weighted by frames.
    let mut halves = of(&[1.0]);
    halves.merge(&of(&[5.0, 5.0, 5.0]));
    assert_eq!(halves.quantiles[2], [4.0]);
}
