"""Releases: tables in other libraries, missions, recordings, patches."""

import math
import pickle
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT

import sastrugi
from sastrugi import _native, _release

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "examples"))
from height_patches import HeightPatches  # noqa: E402


def test_tables_in_other_libraries(release):
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    missions = release.table("missions")
    ours = pyarrow.table(missions)
    parts = sorted((release.path / "tables" / "missions").glob("*.parquet"))
    theirs = pyarrow.concat_tables([parquet.read_table(part) for part in parts])
    assert ours.equals(theirs)
    assert ours.schema.metadata[b"sastrugi.table"] == b"missions"
    assert ours.schema.field("time_s").metadata[b"unit"] == b"s"
    assert pyarrow.schema(missions).equals(ours.schema)

    polars = pytest.importorskip("polars")
    assert polars.DataFrame(missions)["time_s"].to_list() == theirs["time_s"].to_pylist()
    duckdb = pytest.importorskip("duckdb")
    # A variable of this scope is a table for duckdb.
    assert duckdb.sql("select count(*), sum(time_s) from missions").fetchall()[0] == (len(missions), pytest.approx(missions["time_s"].sum()))


def test_tables_in_pandas(release):
    """Its constructor would make a frame of the names of the columns; it is told what to call instead."""
    pandas = pytest.importorskip("pandas")
    missions = release.table("missions")
    frame = missions.to_pandas()
    assert len(frame) == len(missions) and list(frame.columns) == list(missions)
    assert np.array_equal(frame["time_s"].to_numpy(), missions["time_s"], equal_nan=True)
    assert frame["outcome"].tolist() == missions["outcome"].tolist()
    for take in [pandas.DataFrame, np.asarray]:
        with pytest.raises(TypeError, match=r"a table is not one array: use table\[column\], to_numpy\(\) or to_pandas\(\)"):
            take(missions)


def test_tables_in_numpy(release):
    parquet = pytest.importorskip("pyarrow.parquet")
    mission = release.missions()[1]
    samples = release.samples(mission)
    part = parquet.read_table(release.path / "tables" / "samples" / f"part-{mission.terrain_id}.parquet")
    wanted = [row for row in part.to_pylist() if row["mission_id"] == mission.mission_id]
    assert 0 < len(wanted) < part.num_rows and len(samples) == len(wanted)
    assert samples["sample"].dtype == np.int64 and samples["sample"].tolist() == [row["sample"] for row in wanted]
    assert samples["x_m"].dtype == np.float64 and samples["x_m"].tolist() == [row["x_m"] for row in wanted]
    assert samples["wheel_slip_ratio"][0].tolist() == wanted[0]["wheel_slip_ratio"]
    assert samples["outcome"].tolist() == [row["outcome"] for row in wanted]
    first = samples.to_rows()[0]
    assert first["wheel_slip_ratio"] == wanted[0]["wheel_slip_ratio"] and type(first["sample"]) is int
    contact = [[math.nan if v is None else v for v in row["wheel_contact_z_m"]] for row in wanted]
    assert np.array_equal(np.stack(samples["wheel_contact_z_m"]), contact, equal_nan=True)
    units = {column.name: column.unit for column in samples.columns}
    assert (units["x_m"], units["outcome"]) == ("m", "")
    with pytest.raises(sastrugi.SastrugiError, match="^table samples has no column x; known: terrain_id, mission_id") as refused:
        samples["x"]
    assert refused.value.code == 2
    with pytest.raises(sastrugi.SastrugiError, match="there is no table mission; known: terrains") as refused:
        release.table("mission")
    assert refused.value.code == 2
    assert list(samples) == [column.name for column in samples.columns]
    assert "x_m" in samples and "x" not in samples and 0 not in samples
    assert len(release.table("rovers")) == 0 and release.table("rovers")["rover_id"].size == 0


def test_columns_of_flags_and_text(release, tmp_path):
    """Flags are an array that `~` negates, and `dict`s hold Python's own; a text that repeats is one object."""
    sastrugi.analyze([release.recording(mission) for mission in release.missions()[:2]], output=tmp_path / "logs.parquet")
    logs = sastrugi.Table(_native.Table("logs", [str(tmp_path / "logs.parquet")]))
    assert logs["resampled"].dtype == np.bool_ and (~logs["resampled"]).tolist() == [not flag for flag in logs["resampled"]]
    assert type(logs.to_rows()[0]["resampled"]) is bool
    terrains = release.table("terrains")["group"]
    assert terrains.tolist() == ["a"] * 3 and terrains[0] is terrains[2]


def test_missions_are_made_on_demand(release):
    """A column is read when it is asked for; slices, rows and pickles are as those of lists and dicts."""
    every = sastrugi.Release(release.path).missions()
    assert len(every) == 6 and set(every._columns._read) == {"terrain_id"}
    # With splits, the table has several files; the missions are in the order of their ids all the same.
    assert [mission.id for mission in every] == sorted(mission.id for mission in every)
    rows = {f"{row['terrain_id']}/{row['mission_id']}": row for row in release.table("missions").to_rows()}
    assert every[1]["outcome"] == rows[every[1].id]["outcome"]
    assert set(every._columns._read) == {"terrain_id", "mission_id", "outcome"}
    assert all(repr(mission.row) == repr(rows[mission.id]) for mission in every)
    assert every[-2:] == [every[4], every[5]] and every[-1] in every and every.index(every[3]) == 3
    with pytest.raises(IndexError):
        every[6]
    with pytest.raises(KeyError):
        every[0]["wheels"]
    assert "wheels" not in every[0].row and list(every[0].row) == list(release.table("missions"))
    again = pickle.loads(pickle.dumps(every[2]))
    assert again == every[2] and type(again.row) is dict and repr(again.row) == repr(every[2].row)
    train = pickle.loads(pickle.dumps(release.missions(split="train")))
    assert list(train) == list(release.missions(split="train")) and repr(train).endswith(": 2 of split train)")


def test_tracks_of_a_terrain_are_read_together(release, monkeypatch):
    every = release.missions()

    def tracks():
        opened = sastrugi.Release(release.path)
        return {mission: opened.track(mission) for mission in every}, list(opened._tracks)

    found, blocks = tracks()
    assert [block.terrain_id for block in blocks] == ["rough-0001", "rough-0002", "rough-0003"]
    for mission, track in found.items():
        samples = release.samples(mission)
        for values, column in zip(track[:4], ["time_s", "x_m", "y_m", "z_m"]):
            assert values.tolist() == samples[column].tolist(), column
        assert track.heading.tolist() == np.unwrap(np.radians(samples["yaw_deg"])).tolist()
    # A terrain with more samples than a block has several; what is kept is limited by bytes, but for the last block.
    monkeypatch.setattr(_release, "BLOCK_SAMPLES", 1)
    apart, blocks = tracks()
    assert [block.first for block in blocks] == [block.last for block in blocks] == [mission.mission_id for mission in every]
    assert all(np.array_equal(apart[mission], found[mission]) for mission in every)
    monkeypatch.setattr(_release, "TRACK_BYTES", 0)
    assert [block.terrain_id for block in tracks()[1]] == ["rough-0003"]


def test_heightfields_are_kept_up_to_a_size(release, monkeypatch):
    """Two of 300 x 320 cells are, where a third does not fit; patches do not depend on it."""
    monkeypatch.setattr(_release, "GROUND_BYTES", 2 * 8 * 300 * 320)
    opened = sastrugi.Release(release.path)
    for mission in release.missions():
        expected = release.height_patch(mission, 0.0, 2.0, 0.5)
        assert np.array_equal(opened.height_patch(mission, 0.0, 2.0, 0.5), expected, equal_nan=True)
    assert list(opened._grounds) == ["rough-0002", "rough-0003"]


def test_missions_by_split(release):
    every = release.missions()
    splits = {split: release.missions(split=split) for split in ("train", "validation", "test")}
    assert sorted(m.id for part in splits.values() for m in part) == [m.id for m in every]
    assert all(len(part) == 2 and len({m.terrain_id for m in part}) == 1 for part in splits.values())
    assert every[0]["outcome"] == every[0].row["outcome"]
    assert len({*every, *release.missions()}) == len(every) and len(release.missions(split="other")) == 0
    with pytest.raises(sastrugi.SastrugiError, match="there is no split 'trian'; known: train, validation, test, other") as refused:
        release.missions(split="trian")
    assert refused.value.code == 2
    with pytest.raises(sastrugi.SastrugiError, match="there is no mission 'rough-0001/none'; it has rough-0001/") as refused:
        release.samples("rough-0001/none")
    assert refused.value.code == 2


def test_recordings(release):
    mission = release.missions()[0]
    samples = release.samples(mission)
    poses = next(stream for stream in release.recording(mission).poses() if stream.topic == "/vehicle/pose")
    assert poses.position.shape == (len(samples), 3) and poses.orientation.shape == (len(samples), 4)
    assert np.allclose(poses.position[:, 0], samples["x_m"], atol=1e-6)
    seconds = (poses.time_ns - poses.time_ns[0]) / 1e9
    assert np.allclose(seconds, samples["time_s"] - samples["time_s"][0], atol=1e-6)


def bilinear(dem, x, y):
    """Heights between cell centres, written down again: from the four centres around each point."""
    column = (x - dem.x[0]) / dem.cell[0]
    row = (dem.y[0] - y) / dem.cell[1]
    i, j = np.floor(row).astype(int), np.floor(column).astype(int)
    f, g = row - i, column - j
    z = dem.values
    return (1 - f) * ((1 - g) * z[i, j] + g * z[i, j + 1]) + f * ((1 - g) * z[i + 1, j] + g * z[i + 1, j + 1])


def test_patches_turn_with_the_vehicle(release):
    mission = release.missions()[0]
    dem, track = release.terrain(mission.terrain_id), release.track(mission)
    # Between two samples, in the middle of the mission.
    k = len(track.time) // 2
    time = 0.25 * track.time[k] + 0.75 * track.time[k + 1]
    x, y, _, heading = (0.25 * values[k] + 0.75 * values[k + 1] for values in track[1:])
    patch = release.height_patch(mission, time, (1.0, 0.6), 0.1)
    assert patch.shape == (10, 6)
    ahead, left = np.meshgrid(0.1 * (4.5 - np.arange(10)), 0.1 * (2.5 - np.arange(6)), indexing="ij")
    expected = bilinear(dem, x + ahead * math.cos(heading) - left * math.sin(heading), y + ahead * math.sin(heading) + left * math.cos(heading))
    assert np.allclose(patch, expected - bilinear(dem, np.array([x]), np.array([y]))[0], atol=1e-9)
    assert np.allclose(release.height_patch(mission, time, (1.0, 0.6), 0.1, relative=False), expected, atol=1e-9)


def test_patches_reach_beyond_the_terrain(release):
    mission = release.missions()[0]
    wide = release.height_patch(mission, 0.0, 200.0, 1.0)
    assert wide.shape == (200, 200) and np.isnan(wide[0, 0]) and np.isfinite(wide).any()
    for time, size, cell, sentence in [
        (-1.0, 4.0, 0.1, "`time` is -1.0; mission"),
        (math.nan, 4.0, 0.1, "`time` is nan; mission"),
        (0.0, 0.01, 0.1, "`size` is 0.01 x 0.01 m with `cell` 0.1 m; each side must be a whole number of cells, 1 to 4096"),
        (0.0, 4.0, -0.1, "`size` is 4 x 4 m with `cell` -0.1 m"),
        (0.0, 4e5, 0.1, "`size` is 400000 x 400000 m with `cell` 0.1 m"),
    ]:
        with pytest.raises(sastrugi.SastrugiError) as refused:
            release.height_patch(mission, time, size, cell)
        assert str(refused.value).startswith(sentence) and refused.value.code == 2


def test_a_dataset_for_learners(release):
    dataset = HeightPatches(pickle.loads(pickle.dumps(release)), split="train")
    heights, arrived = dataset[1]
    assert len(dataset) == 2 and heights.shape == (1, 40, 40) and heights.dtype == np.float32
    mission = release.missions(split="train")[1]
    assert arrived == (mission["outcome"] == "success")
    expected = np.nan_to_num(release.height_patch(mission, 0.0, 4.0, 0.1)).astype(np.float32)
    assert np.array_equal(heights[0], expected) and np.ptp(expected) > 0.0


def test_what_is_no_release(tmp_path):
    with pytest.raises(sastrugi.SastrugiError, match="not a release: it has no manifest.json") as refused:
        sastrugi.Release(tmp_path)
    assert refused.value.code == 65
    # The example of the manual names files that exist.
    assert (ROOT / "pipeline" / "python" / "examples" / "height_patches.py").is_file()


def test_damaged_releases(tmp_path):
    (tmp_path / "manifest.json").write_text("{")
    damaged = sastrugi.Release(tmp_path)
    for look, said in [(lambda: damaged.manifest, "manifest.json: not a manifest"), (lambda: damaged.tables, "tables: no such folder")]:
        with pytest.raises(sastrugi.SastrugiError, match=said) as refused:
            look()
        assert refused.value.code == 65


def test_a_release_without_splits_says_so(study, tmp_path):
    whole = tmp_path / "study.toml"
    whole.write_text(study.read_text().replace("split = [0.34, 0.33, 0.33]\n", ""))
    release = sastrugi.run(whole, tmp_path / "release")
    assert len(release.missions()) == 6
    with pytest.raises(sastrugi.SastrugiError, match="its missions are not split; set `.study. split`, or leave out `split`") as refused:
        release.missions(split="train")
    assert refused.value.code == 2


def test_missions_in_no_split_are_others(study, tmp_path):
    """If some terrains have a group, terrains without one are in no split."""
    more = '[[terrain]]\nid = "plain"\nkind = "multifractal"\nsize_px = [320, 300]\n\n[[missions]]'
    mixed = study.read_text().replace("[[missions]]", more).replace('terrains = ["rough"]', 'terrains = ["rough", "plain"]')
    (tmp_path / "study.toml").write_text(mixed)
    release = sastrugi.run(tmp_path / "study.toml", tmp_path / "release")
    others = release.missions(split="other")
    assert len(others) == 2 and {mission.terrain_id for mission in others} == {"plain"} and others[0]["split"] is None
    assert len(release.missions()) == 8 and len(release.track(others[1]).time) == others[1]["samples"]
