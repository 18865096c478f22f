"""Opens a dataset with LeRobot's own loader, and the release with Hugging Face datasets. Without a network.

    python load_lerobot.py RELEASE DATASET    every frame, subsets by split, frames before and after, a batch of PyTorch; statistics as
                                              LeRobot computes and aggregates them; every table of the release by its dataset card
"""

import json
import sys
from pathlib import Path

import datasets
import numpy as np
import pyarrow.parquet as pq
import torch
from lerobot.datasets.compute_stats import aggregate_stats, compute_episode_stats
from lerobot.datasets.lerobot_dataset import LeRobotDataset

STATISTICS = ["min", "max", "mean", "std", "count"]
QUANTILES = ["q01", "q10", "q50", "q90", "q99"]


def expect(condition, sentence):
    if not condition:
        sys.exit(sentence)


def opened(dataset, **options):
    return LeRobotDataset("sastrugi/test", root=dataset, **options)


def samples_of(release):
    rows = {}
    for file in sorted((release / "tables/samples").glob("*.parquet")):
        for row in pq.read_table(file).to_pylist():
            rows.setdefault((row["terrain_id"], row["mission_id"]), []).append(row)
    return rows


def check_frames(whole, release):
    """Every frame has the features' shapes and types, and the values of its sample."""
    samples, names = samples_of(release), whole.meta.features["observation.state"]["names"]
    types = {"float32": torch.float32, "int64": torch.int64, "bool": torch.bool}
    columns = {key: names.index(key) for key in ["vx_m_s", "pitch_deg", "distance_to_goal_m"]}
    wheel = names.index("wheel_slip_ratio[0]")
    for k in range(len(whole)):
        frame = whole[k]
        for key, feature in whole.meta.features.items():
            shape = () if tuple(feature["shape"]) == (1,) else tuple(feature["shape"])
            found = (tuple(frame[key].shape), frame[key].dtype)
            expect(found == (shape, types[feature["dtype"]]), f"frame {k}: {key} has shape and type {found}")
        episode = whole.meta.episodes[int(frame["episode_index"])]
        row = samples[episode["terrain_id"], episode["mission_id"]][int(frame["frame_index"])]
        state = frame["observation.state"]
        values = {key: float(state[column]) for key, column in columns.items()} | {"slip": float(state[wheel])}
        expected = {key: row[key] for key in columns} | {"slip": row["wheel_slip_ratio"][0]}
        near = all(abs(values[key] - expected[key]) <= 1e-5 * max(1.0, abs(expected[key])) for key in values)
        expect(near, f"frame {k}: {values} instead of {expected}")
        action = frame["action"].tolist()
        expect(np.allclose(action, [row["command_speed_m_s"], row["command_yaw_rate_deg_s"]], atol=1e-4), f"frame {k}: action {action}")
        expect([frame["task"]] == episode["tasks"], f"frame {k}: task {frame['task']}")
    return len(whole)


def check_subsets(whole, dataset):
    for split, text in whole.meta.info["splits"].items():
        first, end = map(int, text.split(":"))
        part = opened(dataset, episodes=list(range(first, end)))
        numbers = {int(index) for index in part.hf_dataset["episode_index"]}
        expect(numbers == set(range(first, end)), f"split {split}: episodes {numbers}")
    step = 1 / whole.fps
    around = opened(dataset, delta_timestamps={"observation.state": [-step, 0.0], "action": [0.0, step]})
    first, second = around[0], around[1]
    expect(first["observation.state_is_pad"].tolist() == [True, False], "the frame before the first is not padding")
    expect(torch.equal(second["observation.state"][0], whole[0]["observation.state"]), "the frame before the second is another")
    expect(torch.equal(first["action"][1], whole[1]["action"]), "the action after the first is another")
    batch = next(iter(torch.utils.data.DataLoader(around, batch_size=8, shuffle=True)))
    patch = whole.meta.features["observation.height_patch"]["shape"]
    expect(tuple(batch["observation.height_patch"].shape) == (8, *patch), "a batch of height patches")
    expect(tuple(batch["action"].shape) == (8, 2, 2) and len(batch["task"]) == 8, "a batch of actions and tasks")


def check_statistics(whole, dataset):
    """Extremes, means and deviations as LeRobot computes them; everything as it aggregates the episodes."""
    files = sorted((dataset / "meta/episodes").glob("*/*.parquet"))
    stored, features = [], whole.meta.features
    for row in (row for file in files for row in pq.read_table(file).to_pylist()):
        names = STATISTICS + QUANTILES
        stored.append({key: {name: np.array(row[f"stats/{key}/{name}"]) for name in names} for key in features})
    plain = whole.hf_dataset.with_format("numpy")
    for number, stats in enumerate(stored):
        episode = whole.meta.episodes[number]
        rows = plain[episode["dataset_from_index"] : episode["dataset_to_index"]]
        data = {key: np.array(rows[key]).astype(float) for key in features}
        for key, own in compute_episode_stats(data, features).items():
            for name in STATISTICS:
                expect(own[name].shape == stats[key][name].shape, f"episode {number}, {key}: shape of {name}")
                near = np.allclose(own[name], stats[key][name], rtol=1e-5, atol=1e-5)
                expect(near, f"episode {number}, {key}: {name} is {stats[key][name]} instead of {own[name]}")
    for key, own in aggregate_stats(stored).items():
        for name, value in own.items():
            near = np.allclose(value, whole.meta.stats[key][name], rtol=1e-9, atol=1e-9)
            expect(near, f"{key}: {name} is {whole.meta.stats[key][name]} instead of {value}")


def check_card(release):
    """The dataset card of the release needs nothing else: every table, by split where its files are."""
    rows = {}
    for folder in sorted((release / "tables").iterdir()):
        loaded = datasets.load_dataset(str(release), folder.name)
        rows[folder.name] = {split: part.num_rows for split, part in loaded.items()}
        expected = sum(pq.read_metadata(file).num_rows for file in folder.glob("*.parquet"))
        expect(sum(rows[folder.name].values()) == expected, f"table {folder.name}: {rows[folder.name]} of {expected} rows")
    expect(set(rows["missions"]) == {"train", "validation", "test"}, f"splits of the missions: {rows['missions']}")
    default = datasets.load_dataset(str(release))
    expect({split: part.num_rows for split, part in default.items()} == rows["missions"], "the default table is not missions")
    return rows


def main(release, dataset):
    whole = opened(dataset)
    frames = check_frames(whole, release)
    check_subsets(whole, dataset)
    check_statistics(whole, dataset)
    print(json.dumps({"frames": frames, "episodes": whole.num_episodes, "tables": check_card(release)}))


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(f"usage: {sys.argv[0]} RELEASE DATASET")
    main(Path(sys.argv[1]), Path(sys.argv[2]))
