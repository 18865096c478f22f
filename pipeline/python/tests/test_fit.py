"""Fits: what may be quoted, and what they are made of."""

import math
import pickle
import warnings

import numpy as np
import pytest

import sastrugi
from sastrugi import Fit


def snow():
    return Fit({"model": "exponential", "parameters": {"sigma_m": 0.05, "range_m": 0.2}})


def test_intervals_hold_the_truth():
    site = snow().texture(16.0, 0.1, seed=1, phase="gaussian", periodic=False)
    found = sastrugi.fit(site, outer_scale=1.0, bootstrap=39)
    assert found.interval_level == 0.95 and "bootstrap" in found.interval_kind
    low, high = found.intervals["sigma_m"]
    assert low < found.parameters["sigma_m"] < high
    assert found.is_estimated("sigma_m") and found.verdict
    with pytest.raises(sastrugi.SastrugiError, match="the fit has no parameter `sill`; it has range_m, sigma_m"):
        found.is_estimated("sill")


def test_limits_are_not_estimates():
    """A range at the bound of its search: only its lower limit may be quoted."""
    bounded = Fit({
        "model": "exponential",
        "parameters": {"sigma_m": 1.0, "range_m": 420.0},
        "intervals": {"level": 0.95, "replicates": 99, "range_m": [4.4, None]},
        "diagnostics": {"range_at_search_bound": True},
    })
    assert bounded.intervals == {"range_m": (4.4, math.inf)}
    assert not bounded.is_estimated("range_m") and not bounded.is_estimated("sigma_m")


def test_files(tmp_path):
    snow().save(tmp_path / "fit.json")
    again = Fit.load(tmp_path / "fit.json")
    assert (again.model, again.parameters) == ("exponential", {"range_m": 0.2, "sigma_m": 0.05})
    (tmp_path / "other.json").write_text("{}")
    with pytest.raises(sastrugi.SastrugiError, match="not a fit file: `model` and `parameters` are required") as refused:
        Fit.load(tmp_path / "other.json")
    assert refused.value.code == 65
    for place, said in [(tmp_path, "is a folder; name a file"), ("", "the path is empty"), ("s3://a/fit.json", "must be a path on this machine")]:
        with pytest.raises(sastrugi.SastrugiError, match=said):
            snow().save(place)


def test_what_is_not_a_fit():
    """The text of a file is taken, its name is not."""
    for content in ["", "fit.json", "[1]", 3, None]:
        with pytest.raises(sastrugi.SastrugiError, match="^not a fit: expected a dict, or the text of a fit file") as refused:
            Fit(content)
        assert refused.value.code == 2


def test_wrong_values_are_named():
    for call, said in [
        (lambda: Fit({"model": "exponential", "parameters": {"sigma_m": "3 cm"}}), 'not a fit: `parameters.sigma_m` must be a number, got "3 cm"'),
        (lambda: Fit({"model": 3, "parameters": {}}), "not a fit: `model` must be text in quotes, got 3"),
        (lambda: snow().texture(4.0, "fine"), "`cell_m` must be a number, or two numbers: east-west and north-south, m"),
        (lambda: sastrugi.analyze(["a.mcap"], rate_hz="fast"), '`rate_hz` must be a number, got "fast"'),
        (lambda: sastrugi.analyze(["a.mcap"], rate_hz=5000), "`rate_hz 5000`: must be between 1 and 1000 Hz"),
        (lambda: sastrugi.analyze(["a.mcap"], differentiator="best"), "`differentiator` has the unknown value `best`; known: "),
        (lambda: sastrugi.roughness(snow().texture(4.0, 0.1), band=(5.0, 1.0)), "`band 5:1`: "),
    ]:
        with pytest.raises(sastrugi.SastrugiError) as refused:
            call()
        assert str(refused.value).startswith(said) and refused.value.code == 2


def test_one_statement_of_each_parameter():
    """What an argument states is not stated again under the name that it has in a study."""
    for call, said in [
        (lambda: snow().texture(4.0, 0.1, size_m=[8.0, 8.0]), "`size` already states `size_m`; leave out `size_m`"),
        (lambda: snow().texture(4.0, 0.1, cell_m=0.2), "`cell` already states `cell_m`; leave out `cell_m`"),
        (lambda: sastrugi.fit("a.tif", outer_scale=1.0, outer_scale_m=2.0), "`outer_scale` already states `outer_scale_m`"),
        (lambda: sastrugi.traverse("a.tif", missions=2, rules={"count": 3}), "`missions` already states `count`"),
        (lambda: sastrugi.navigate("a.tif", (0, 0), (1, 1), team={"size": 3}), "`team` needs a `formation`"),
    ]:
        with pytest.raises(sastrugi.SastrugiError) as refused:
            call()
        assert str(refused.value).startswith(said) and refused.value.code == 2
    with pytest.raises(TypeError, match="topc"):
        sastrugi.analyze(["a.mcap"], topc="x")
    hills = snow().texture(4.0, 0.1)
    with pytest.raises(sastrugi.SastrugiError, match="no parameter names the input `hils`; they name hills") as refused:
        sastrugi.terrain("compose", inputs={"hills": hills, "hils": hills}, size_px=[8, 8], cell_m=0.1, processes=[{"of": "hills"}])
    assert refused.value.code == 2


def test_notes_on_reading_are_warnings(tmp_path):
    """A file that states no cell size is read with an assumed one, which decides the numbers."""
    np.save(tmp_path / "site.npy", snow().texture(16.0, 0.1, seed=1).values)
    window = {"size_px": [64, 48], "cell_m": 0.25, "origin_m": [50.0, 50.0], "basic_spacing_m": 0.25, "hurst": 0.7, "roughness_m": 0.01}
    for measure in [
        lambda: sastrugi.roughness(tmp_path / "site.npy"),
        lambda: sastrugi.fit(tmp_path / "site.npy", outer_scale=10.0, model="exponential", bootstrap=0),
        lambda: sastrugi.coregister(tmp_path / "site.npy", tmp_path / "site.npy"),
        lambda: sastrugi.elaborate(tmp_path / "site.npy", **window),
        lambda: sastrugi.terrain("elaborate", inputs={"site": tmp_path / "site.npy"}, dem="site", **window),
    ]:
        with pytest.warns(UserWarning, match="no cell size") as issued:
            measure()
        assert {warning.filename for warning in issued} == {__file__}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sastrugi.roughness(tmp_path / "site.npy", cell=0.1)


def test_plot():
    pytest.importorskip("matplotlib").use("Agg")
    site = snow().texture(16.0, 0.1, seed=1, phase="gaussian", periodic=False)
    axes = sastrugi.fit(site, outer_scale=1.0, bootstrap=0).plot()
    assert [line.get_label() for line in axes.lines] == ["measured", "exponential"]
    with pytest.raises(sastrugi.SastrugiError, match="a stated model has no measured covariance"):
        snow().plot()


def test_textures_that_repeat_a_site_say_what_they_need(tmp_path):
    site = snow().texture(16.0, 0.1, seed=1, phase="gaussian", periodic=False)
    found = sastrugi.fit(site, outer_scale=1.0, bootstrap=0)
    with pytest.raises(sastrugi.SastrugiError, match="fit the DEM with `statistics=True`"):
        found.texture(8.0, method="modulated")
    with pytest.raises(sastrugi.SastrugiError, match="give the DEM of the fit as `exemplar`"):
        found.texture(8.0, method="quilting")
    with pytest.raises(sastrugi.SastrugiError, match="keeps the directions of the site"):
        found.texture(8.0, method="quilting", exemplar=site, ratio=0.5)
    # Other heights with the same cells are not those of the fit.
    other = snow().texture(16.0, 0.1, seed=2, phase="gaussian", periodic=False)
    with pytest.raises(sastrugi.SastrugiError, match="does not give the residual of the fit"):
        found.texture(8.0, method="quilting", exemplar=other)
    # A file that states no cell size is read with that of the fit.
    np.save(tmp_path / "site.npy", site.values)
    assert found.texture(8.0, method="quilting", exemplar=tmp_path / "site.npy").shape == (80, 80)
    masked = Fit({**found.to_dict(), "source": {"file": "a.tif", "sha256": "", "window": None, "masks": [{"file": "m", "sha256": "", "excludes": True}]}})
    with pytest.raises(sastrugi.SastrugiError, match="the fit has masks or is of a difference"):
        masked.texture(8.0, method="quilting", exemplar="a.tif")


def test_errors_are_those_of_the_program():
    with pytest.raises(sastrugi.SastrugiError) as refused:
        snow().texture(4.0, 0.1, phases="unit")
    assert str(refused.value) == "`fft_ma` has no parameter `phases`; did you mean `phase`?"
    with pytest.raises(sastrugi.SastrugiError, match="a parameter is not a finite number"):
        snow().texture(4.0, math.nan)
    again = pickle.loads(pickle.dumps(refused.value))
    assert (str(again), again.code) == (str(refused.value), 2)
