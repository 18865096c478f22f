"""Reads a LeRobot dataset with pyarrow, pandas and numpy, and compares it with the release that it was made from.

    python check_lerobot.py RELEASE DATASET    files and fields; every frame against table `samples`, height patches against the terrain
                                               as rasterio reads it, statistics against numpy
"""

import json
import math
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import rasterio

from common import Mismatch, expect, table

SPLITS = ["train", "validation", "test", "other"]
DEFAULT = {"timestamp": "float32", "frame_index": "int64", "episode_index": "int64", "index": "int64", "task_index": "int64"}
QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
# At every n-th frame, the height patch is recomputed.
PATCH_STEP = 7


def arrow_type(feature):
    """The column of a feature, as Hugging Face datasets stores it."""
    value = {"float32": "float", "int64": "int64", "bool": "bool"}[feature["dtype"]]
    match feature["shape"]:
        case [1]:
            return value
        case [n]:
            return f"fixed_size_list<element: {value}>[{n}]"
        case [_, _]:
            return f"list<element: list<element: {value}>>"


def values(frames, name, feature):
    return np.array(frames.column(name).to_pylist()).reshape(len(frames), *feature["shape"])


def bilinear(heights, transform, x, y):
    """Heights between cell centres, NaN beyond the outer ones or next to cells without data."""
    col, row = (x - transform.c) / transform.a - 0.5, (y - transform.f) / transform.e - 0.5
    inside = (col >= 0) & (row >= 0) & (col <= heights.shape[1] - 1) & (row <= heights.shape[0] - 1)
    left = np.clip(np.floor(col).astype(int), 0, heights.shape[1] - 2)
    top = np.clip(np.floor(row).astype(int), 0, heights.shape[0] - 2)
    u, v = col - left, row - top
    upper = heights[top, left] * (1 - u) + heights[top, left + 1] * u
    lower = heights[top + 1, left] * (1 - u) + heights[top + 1, left + 1] * u
    return np.where(inside, upper * (1 - v) + lower * v, np.nan)


def terrain(release, path):
    with rasterio.open(release / path) as raster:
        heights = raster.read(1).astype(float)
        return np.where(heights == raster.nodata, np.nan, heights), raster.transform


def close(theirs, ours, relative=1e-6, absolute=1e-6):
    return np.allclose(theirs, ours, rtol=relative, atol=absolute, equal_nan=True)


def check_state(name, names, found, rows):
    start = rows[0]
    for column, label in enumerate(names):
        if label.endswith("_from_start_m"):
            key = label.replace("_from_start", "")
            expected = [row[key] - start[key] for row in rows]
        elif label.endswith("]"):
            key, wheel = label[:-1].split("[")
            expected = [row[key][int(wheel)] for row in rows]
        else:
            expected = [row[label] for row in rows]
        expect(close(found[:, column], np.array(expected)), f"{name}: state {label} is not that of the samples")


def check_patches(name, info, ground, heights, known, rows):
    """Points of the vehicle's frame: row 0 farthest ahead, column 0 farthest to the left."""
    patch = info["sastrugi"]["patch"]
    points, cell = patch["points"], patch["cell_m"]
    offset = ((points - 1) / 2 - np.arange(points)) * cell
    ahead, left = offset[:, None], offset[None, :]
    for k in range(0, len(rows), PATCH_STEP):
        row = rows[k]
        yaw = math.radians(row["yaw_deg"])
        x = row["x_m"] + ahead * math.cos(yaw) - left * math.sin(yaw)
        y = row["y_m"] + ahead * math.sin(yaw) + left * math.cos(yaw)
        expected = bilinear(*ground, x, y) - bilinear(*ground, np.array(row["x_m"]), np.array(row["y_m"]))
        # At the outer cell centres, rounding decides.
        differing = np.isfinite(expected) != known[k]
        expect(differing.sum() <= 2, f"{name}, frame {k}: {differing.sum()} points are known to one side only")
        both = np.isfinite(expected) & known[k]
        expect(close(heights[k][both], expected[both], 1e-6, 1e-5), f"{name}, frame {k}: heights differ from the terrain")
        expect(not heights[k][~known[k]].any(), f"{name}, frame {k}: an unknown height is not 0")
    return int((~known).sum())


def check_statistics(name, stats, data, exact=True):
    flat = data.reshape(-1, data.shape[-1]).astype(float)
    own = {"min": flat.min(0), "max": flat.max(0), "mean": flat.mean(0), "std": flat.std(0)}
    if exact:
        own |= {key: np.quantile(flat, q, axis=0) for key, q in QUANTILES.items()}
    expect(list(stats["count"]) == [len(data)], f"{name}: count {stats['count']} instead of {len(data)}")
    for key, expected in own.items():
        expect(np.shape(stats[key]) == expected.shape, f"{name}: {key} has shape {np.shape(stats[key])}")
        expect(close(stats[key], expected, 1e-9, 1e-9), f"{name}: {key} is {stats[key]} instead of {expected}")


def check_episode(release, info, episode, frames, rows, mission, terrains):
    name = f"{episode['terrain_id']}/{episode['mission_id']}"
    expect(len(frames) == len(rows) == episode["length"], f"{name}: {len(frames)} frames, {len(rows)} samples")
    features = info["features"]
    data = {key: values(frames, key, feature) for key, feature in features.items()}
    check_state(name, features["observation.state"]["names"], data["observation.state"], rows)
    for column, label in enumerate(features["action"]["names"]):
        expect(close(data["action"][:, column], np.array([row[label] for row in rows])), f"{name}: action {label}")
    last = np.arange(len(rows)) == len(rows) - 1
    succeeded = mission["outcome"] == "success"
    expect((data["next.done"][:, 0] == last).all(), f"{name}: next.done")
    expect((data["next.success"][:, 0] == (last & succeeded)).all(), f"{name}: next.success")
    expect(close(data["timestamp"][:, 0], np.array([row["time_s"] for row in rows])), f"{name}: timestamp")
    expect((data["frame_index"][:, 0] == np.arange(len(rows))).all(), f"{name}: frame_index")
    expect((data["index"][:, 0] == episode["dataset_from_index"] + np.arange(len(rows))).all(), f"{name}: index")
    expect(episode["outcome"] == mission["outcome"] and episode["split"] == (mission["split"] or "train"), f"{name}: labels")
    start = [episode[key] for key in ["start_x_m", "start_y_m", "start_z_m"]]
    expect(start == [rows[0][key] for key in ["x_m", "y_m", "z_m"]], f"{name}: start {start}")
    ground = terrain(release, terrains[episode["terrain_id"]]["path"])
    known = data["observation.height_known"]
    unknown = check_patches(name, info, ground, data["observation.height_patch"], known, rows)
    for key, array in data.items():
        stats = {stat: episode[f"stats/{key}/{stat}"] for stat in ["min", "max", "mean", "std", "count", *QUANTILES]}
        check_statistics(f"{name}, {key}", stats, array)
    return data, unknown


def check(release, dataset):
    info = json.loads((dataset / "meta/info.json").read_text())
    expect(info["codebase_version"] == "v3.0", f"format {info['codebase_version']}")
    features = info["features"]
    expect({key: features[key]["dtype"] for key in DEFAULT} == DEFAULT, "the features of every dataset are missing")
    files = sorted((dataset / "data").glob("*/*.parquet"))
    frames = pa.concat_tables(pq.read_table(file) for file in files)
    types = {field.name: str(field.type) for field in frames.schema}
    expect(types == {key: arrow_type(feature) for key, feature in features.items()}, f"columns of the data: {types}")
    episodes = [row for file in sorted((dataset / "meta/episodes").glob("*/*.parquet")) for row in pq.read_table(file).to_pylist()]
    expect(len(episodes) == info["total_episodes"] and len(frames) == info["total_frames"], "totals of info.json")
    expect(frames.column("index").to_pylist() == list(range(len(frames))), "the index of the frames")

    tasks = pd.read_parquet(dataset / "meta/tasks.parquet")
    expect(tasks["task_index"].tolist() == list(range(info["total_tasks"])), "tasks.parquet: the indices")
    expect(all(isinstance(task, str) for task in tasks.index), "tasks.parquet: the index is not the text of the tasks")

    samples = {}
    for row in table(release, "samples"):
        samples.setdefault((row["terrain_id"], row["mission_id"]), []).append(row)
    missions = {(row["terrain_id"], row["mission_id"]): row for row in table(release, "missions")}
    terrains = {row["terrain_id"]: row for row in table(release, "terrains")}
    merged, unknown = [], 0
    for number, episode in enumerate(episodes):
        expect(episode["episode_index"] == number, f"episode {number} has index {episode['episode_index']}")
        key = (episode["terrain_id"], episode["mission_id"])
        part = frames.slice(episode["dataset_from_index"], episode["dataset_to_index"] - episode["dataset_from_index"])
        expect(set(part.column("episode_index").to_pylist()) == {number}, f"episode {number}: its frames lie elsewhere")
        task = tasks.index[part.column("task_index")[0].as_py()]
        expect([task] == episode["tasks"] and missions[key]["vehicle"] in task, f"episode {number}: task {task}")
        data, beyond = check_episode(release, info, episode, part, samples[key], missions[key], terrains)
        merged.append(data)
        unknown += beyond

    stats = json.loads((dataset / "meta/stats.json").read_text())
    for key in features:
        check_statistics(key, stats[key], np.concatenate([data[key] for data in merged]), exact=False)
        weights = [episode["length"] for episode in episodes]
        for quantile in QUANTILES:
            mean = np.average([episode[f"stats/{key}/{quantile}"] for episode in episodes], axis=0, weights=weights)
            expect(close(stats[key][quantile], mean, 1e-9, 1e-9), f"{key}: {quantile} is not the mean of the episodes")

    order = [(SPLITS.index(episode["split"]), episode["terrain_id"], episode["mission_id"]) for episode in episodes]
    expect(order == sorted(order), "the episodes are not in order of split, terrain and mission")
    for split, text in info["splits"].items():
        first, end = map(int, text.split(":"))
        found = {episode["split"] for episode in episodes[first:end]}
        expect(found == {split} and end > first, f"split {split}: episodes of {found}")
    return {"episodes": len(episodes), "frames": len(frames), "splits": info["splits"], "unknown": unknown, "tasks": len(tasks)}


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(f"usage: {sys.argv[0]} RELEASE DATASET")
    try:
        print(json.dumps(check(Path(sys.argv[1]), Path(sys.argv[2]))))
    except Mismatch as mismatch:
        sys.exit(str(mismatch))
