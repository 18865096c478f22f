"""Heightfields: rows from the north, holes, files, other libraries."""

import copy
import pickle

import numpy as np
import pytest
from conftest import DEMS

import sastrugi
from sastrugi import Heightfield


def test_row_0_is_north(tmp_path):
    """An ESRI grid lists rows from the north; its corner is that in the south-west."""
    (tmp_path / "a.asc").write_text("ncols 3\nnrows 2\nxllcorner 10\nyllcorner 20\ncellsize 0.5\nNODATA_value -1\n1 2 3\n4 5 -1\n")
    read = Heightfield.read(tmp_path / "a.asc")
    assert np.array_equal(read.values, [[1, 2, 3], [4, 5, np.nan]], equal_nan=True)
    assert read.x.tolist() == [10.25, 10.75, 11.25]
    assert read.y.tolist() == [20.75, 20.25]
    part = Heightfield.read(tmp_path / "a.asc", window=(10.5, 20.0, 11.5, 20.5))
    assert np.array_equal(part.values, [[5, np.nan]], equal_nan=True)
    assert part.origin == (10.5, 20.0)


def test_files_keep_place_and_system(tmp_path):
    dem = Heightfield.read(DEMS / "pozo_blanca.tif")
    assert dem.crs.epsg == 26911
    dem.save(tmp_path / "b.tif", compress="zstd")
    back = Heightfield.read(tmp_path / "b.tif")
    assert (back.cell, back.origin, back.crs.epsg) == (dem.cell, dem.origin, 26911)
    assert np.array_equal(back.values, dem.values, equal_nan=True)
    notes = dem.save(tmp_path / "b.npy")
    assert any("CRS" in note for note in notes)
    assert np.array_equal(np.load(tmp_path / "b.npy"), dem.values, equal_nan=True)


def test_copies_and_pickles(tmp_path):
    """Worker processes get heightfields with their system; its GeoTIFF keys are those of the file."""
    dem = Heightfield.read(DEMS / "pozo_blanca.tif")
    dem.save(tmp_path / "a.tif")
    for name, again in {"pickled": pickle.loads(pickle.dumps(dem)), "copied": copy.deepcopy(dem)}.items():
        assert (again.cell, again.origin, again.crs.epsg, again.crs.name) == (dem.cell, dem.origin, 26911, dem.crs.name)
        again.save(tmp_path / f"{name}.tif")
        assert (tmp_path / f"{name}.tif").read_bytes() == (tmp_path / "a.tif").read_bytes()


def test_arrays_of_any_layout(tmp_path):
    """Transposed, sliced, flipped and integer arrays are taken by their elements."""
    values = np.arange(12.0).reshape(3, 4)
    layouts = {
        "turned": values.T,
        "thinned": values[:, ::2],
        "fortran": np.asfortranarray(values),
        "flipped": values[::-1],
        "mirrored": values[:, ::-1],
    }
    for name, array in {**layouts, "integers": values.astype(int)}.items():
        dem = Heightfield(array, cell=1.0)
        # Nothing lays these out anew before they are read.
        assert (dem.values is array) == (name in layouts), name
        dem.save(tmp_path / f"{name}.npy")
        assert np.array_equal(np.load(tmp_path / f"{name}.npy"), array), name


def test_arrays_of_any_memory(tmp_path):
    """A field of packed records, as tables of points are read, values at odd addresses, and those of other machines."""
    values = np.arange(12.0).reshape(3, 4)
    records = np.zeros((3, 4), dtype=[("z", "<f8"), ("class", "<i4")])
    records["z"] = values
    odd = np.frombuffer(b"x" + values.tobytes(), dtype="<f8", offset=1).reshape(3, 4)
    assert records["z"].strides == (48, 12) and not odd.flags.aligned
    for name, array in {"field": records["z"], "odd": odd, "big-endian": values.astype(">f8"), "single": values.astype("f4")}.items():
        dem = Heightfield(array, cell=1.0)
        dem.save(tmp_path / f"{name}.npy")
        assert np.array_equal(dem.values, values) and np.array_equal(np.load(tmp_path / f"{name}.npy"), values), name


def test_heightfields_as_arrays():
    """As NumPy asks: a copy only if it is allowed, and then of any type."""
    dem = Heightfield([[1.0, 2.0]], cell=1.0)
    assert np.asarray(dem) is dem.values and dem.__array__(np.float64, copy=False) is dem.values
    copied = np.array(dem)
    assert copied is not dem.values and np.asarray(dem, dtype=np.float32).tolist() == [[1.0, 2.0]]
    with pytest.raises(ValueError, match="heights are float64; float32 requires a copy"):
        dem.__array__(np.float32, copy=False)
    # Numbers that are objects are numbers.
    assert Heightfield(np.array([[1, 2.5]], dtype=object), cell=1.0).values.tolist() == [[1.0, 2.5]]


def test_masks_are_holes(tmp_path):
    """Of a masked array, as rasters are read elsewhere, the hidden cells are holes, whatever lies under the mask."""
    array = np.ma.masked_equal(np.array([[1, -9999], [3, 4]], dtype=np.int32), -9999)
    dem = Heightfield(array, cell=1.0)
    assert type(dem.values) is np.ndarray and np.array_equal(dem.values, [[1, np.nan], [3, 4]], equal_nan=True)
    dem.values = np.ma.masked_greater(np.array([[1.0, 2.0], [3.0, 4.0]]), 2.0)
    dem.save(tmp_path / "a.npy")
    assert np.array_equal(np.load(tmp_path / "a.npy"), [[1, 2], [np.nan, np.nan]], equal_nan=True)
    # An array of the right type is not copied.
    values = np.zeros((2, 3))
    assert Heightfield(values, cell=1.0).values is values


def test_heights_are_real_numbers():
    for wrong, said in [
        (np.ones((2, 2)) * 1j, "an array of complex128"),
        (np.array([["1", "2"]]), "an array of <U1"),
        ([[1.0], [1.0, 2.0]], "[[1.0], [1.0, 2.0]]"),
        (np.array([["a", None]], dtype=object), "an array of object"),
        (np.array([["1", 2.0]], dtype=object), "an array of object"),
    ]:
        with pytest.raises(sastrugi.SastrugiError) as refused:
            Heightfield(wrong, cell=1.0)
        assert (str(refused.value), refused.value.code) == (f"heights must be an array of real numbers, got {said}", 2)


def test_xarray_and_matplotlib():
    pytest.importorskip("xarray")
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    dem = Heightfield([[1.0, 2.0], [3.0, np.nan]], cell=(2.0, 1.0), origin=(10.0, 5.0))
    array = dem.to_xarray()
    assert float(array.sel(x=11.0, y=6.5)) == 1.0
    assert float(array.sel(x=11.0, y=5.5)) == 3.0
    axes = dem.plot()
    assert list(axes.images[0].get_extent()) == [10.0, 14.0, 5.0, 7.0]


def test_refusals():
    for make, sentence in [
        (lambda: Heightfield([1.0, 2.0], cell=1.0), "heights must be an array (rows, columns), got 1 dimension"),
        (lambda: Heightfield([[1.0]], cell=(1.0, 2.0, 3.0)), "`cell` must be one or two numbers, got (1.0, 2.0, 3.0)"),
        (lambda: Heightfield.read("a.tif", window=(1.0, 2.0)), "`window` must be 4 numbers, got (1.0, 2.0)"),
        (lambda: Heightfield([[1.0, 2.0]], cell=-1.0).save("a.tif"), "`cell` is [-1.0, -1.0]; cell sizes must be finite and above 0"),
        (lambda: Heightfield([[1.0, 2.0]], cell=1.0).save("s3://a/b.tif"), "s3://a/b.tif: this output must be a path"),
        (lambda: sastrugi.traverse(Heightfield([[1.0, 2.0]], cell=1.0), "gs://a/b"), "gs://a/b: this output must be a path"),
        (lambda: Heightfield([[1.0, 2.0]], cell=1.0).save("a.tif", compress="lzma"), '`compress` is "lzma"'),
        (lambda: Heightfield([[1.0]], cell="a"), "`cell` must be one or two numbers, got 'a'"),
        (lambda: Heightfield([[1.0]], cell=[[1.0], [2.0, 3.0]]), "`cell` must be one or two numbers, got [[1.0], [2.0, 3.0]]"),
        (lambda: sastrugi.roughness(Heightfield([[1.0]], cell=1.0), band="12"), "`band` must be 2 numbers, got '12'"),
        (lambda: sastrugi.terrain("multifractal", seed=-1), "`seed` must be a whole number from 0 to 18446744073709551615, got -1"),
        (lambda: sastrugi.terrain("multifractal", seed=2**64), "`seed` must be a whole number from 0 to"),
        (lambda: sastrugi.traverse("a.tif", seed=1.5), "`seed` must be a whole number from 0 to 18446744073709551615, got 1.5"),
        (lambda: sastrugi.fit(np.zeros((9, 9)), outer_scale=1.0), "an array has no cell size; pass Heightfield(array, cell)"),
        (lambda: sastrugi.coregister(np.zeros((9, 9)), np.zeros((9, 9))), "an array has no cell size; pass Heightfield(array, cell)"),
        (lambda: sastrugi.elaborate(np.zeros((9, 9))), "an array has no cell size; pass Heightfield(array, cell)"),
        (lambda: sastrugi.traverse(np.zeros((9, 9))), "an array has no cell size; pass Heightfield(array, cell)"),
        (lambda: sastrugi.fit(b"x.tif", outer_scale=1.0), "heights must be an array of real numbers, got b'x.tif'"),
    ]:
        with pytest.raises(sastrugi.SastrugiError) as refused:
            make()
        assert str(refused.value).startswith(sentence)
        assert refused.value.code == 2
    with pytest.raises(sastrugi.SastrugiError, match="A is in degrees; DEMs are co-registered in metres") as refused:
        sastrugi.coregister(DEMS / "jacksboro.tif", DEMS / "jacksboro.tif")
    assert refused.value.code == 65
    with pytest.raises(sastrugi.SastrugiError, match="the height in row 0, column 1 is infinite; mark holes with NaN") as refused:
        Heightfield([[1.0, np.inf]], cell=1.0).save("a.tif")
    assert refused.value.code == 65
