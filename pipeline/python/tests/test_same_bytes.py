"""The same input gives the same bytes through the module and through the program, and the same sentence if it is refused."""

import json
import subprocess

import pytest
from conftest import DEMS, program, sums

import sastrugi

TERRAINS = {
    "multifractal": {"size_px": [90, 70], "high.fractal_dimension": 2.5},
    "weierstrass_mandelbrot": {"size_px": [64, 48], "cell_m": 0.1},
    "van_deusen": {"size_px": [64, 64]},
    "planetary": {"size_px": [60, 50], "cell_m": 0.02, "basic_spacing_m": 0.005},
}


def nested(parameters):
    """Dotted names as dicts."""
    found = {}
    for name, value in parameters.items():
        *above, last = name.split(".")
        table = found
        for word in above:
            table = table.setdefault(word, {})
        table[last] = value
    return found


@pytest.mark.parametrize("kind", TERRAINS)
def test_terrains(kind, sastrugi_program, tmp_path):
    options = [word for name, value in TERRAINS[kind].items() for word in ("--set", f"{name}={value}")]
    sastrugi_program("terrain", kind, *options, "--seed", 7, "-o", "program.tif")
    made = sastrugi.terrain(kind, seed=7, **nested(TERRAINS[kind]))
    made.save(tmp_path / "module.tif")
    assert (tmp_path / "module.tif").read_bytes() == (tmp_path / "program.tif").read_bytes()
    assert bool(made.maps) == (kind == "planetary")
    for name, values in made.maps.items():
        written = sastrugi.Heightfield.read(tmp_path / f"program.{name}.tif")
        assert written.values.shape == values.shape
        assert abs(written.values - values).max() <= 1e-6 * max(abs(values).max(), 1.0), name


@pytest.mark.parametrize("given", ["file", "heightfield"])
def test_elaborated_dems(given, sastrugi_program, tmp_path):
    dem = DEMS / "jacksboro.tif"
    window = {"origin_m": [21930.0, 20260.0], "size_px": [64, 48], "cell_m": 0.04}
    options = [word for name, value in window.items() for word in ("--set", f"{name}={value}")]
    sastrugi_program("terrain", "elaborate", "--set", f'dem="{dem}"', *options, "--seed", 3, "-o", "program.tif")
    sastrugi.elaborate(dem if given == "file" else sastrugi.Heightfield.read(dem), seed=3, **window).save(tmp_path / "module.tif")
    assert (tmp_path / "module.tif").read_bytes() == (tmp_path / "program.tif").read_bytes()


@pytest.mark.parametrize("site", ["otira.tif", "snow.tif"])
def test_fits(site, sastrugi_program, tmp_path):
    dem, scale, replicates = (DEMS / site, 0.5, 0) if site == "otira.tif" else (snow(tmp_path / site), 1.0, 39)
    sastrugi_program("fit", dem, "--outer-scale", scale, "--bootstrap", replicates, "--seed", 4, "-o", "program.json")
    found = sastrugi.fit(dem, outer_scale=scale, bootstrap=replicates, seed=4)
    found.save(tmp_path / "module.json")
    assert (tmp_path / "module.json").read_bytes() == (tmp_path / "program.json").read_bytes()
    # From the array: the same, except that no file is its source.
    of_array = sastrugi.fit(sastrugi.Heightfield.read(dem), outer_scale=scale, bootstrap=replicates, seed=4)
    assert {**of_array.to_dict(), "source": None} == {**found.to_dict(), "source": None}


def snow(path):
    """A file of a surface with sigma 5 cm and b 20 cm."""
    stated = sastrugi.Fit({"model": "exponential", "parameters": {"sigma_m": 0.05, "range_m": 0.2}})
    stated.texture(16.0, 0.1, seed=1, phase="gaussian", periodic=False).save(path)
    return path


def test_textures(sastrugi_program, tmp_path):
    sastrugi.fit(snow(tmp_path / "snow.tif"), outer_scale=1.0, bootstrap=0).save(tmp_path / "program.json")
    sastrugi_program("texture", "program.json", "--size", "8x6", "--cell", 0.05, "--seed", 5, "-o", "program.tif")
    sastrugi.Fit.load(tmp_path / "program.json").texture((8.0, 6.0), 0.05, seed=5).save(tmp_path / "module.tif")
    assert (tmp_path / "module.tif").read_bytes() == (tmp_path / "program.tif").read_bytes()


@pytest.mark.parametrize("method", ["modulated", "wavelet_statistics", "quilting", "exemplar"])
def test_textures_that_repeat_a_site(method, sastrugi_program, tmp_path):
    site = snow(tmp_path / "snow.tif")
    found = sastrugi.fit(site, outer_scale=1.0, bootstrap=0, statistics=True)
    found.save(tmp_path / "program.json")
    copies = method in ("quilting", "exemplar")
    options = ["--exemplar", "snow.tif"] if copies else []
    size = ["--size", "12x9", "--set", "periodic=false", "--seed", 5]
    sastrugi_program("texture", "program.json", "--method", method, *options, *size, "-o", "program.tif")
    of = {"method": method, "seed": 5, "periodic": False}
    for exemplar in [site, sastrugi.Heightfield.read(site)] if copies else [None]:
        made = found.texture((12.0, 9.0), exemplar=exemplar, **of)
        assert made.cell == (0.1, 0.1) and made.shape == (90, 120)
        made.save(tmp_path / "module.tif")
        assert (tmp_path / "module.tif").read_bytes() == (tmp_path / "program.tif").read_bytes()


def test_roughness_and_coregistration(sastrugi_program, tmp_path):
    a = sastrugi.Fit({"model": "gaussian", "parameters": {"sigma_m": 2.0, "range_m": 12.0}}).texture(96.0, 1.0, seed=2)
    b = sastrugi.Heightfield(a.values + 1.0, a.cell, origin=(0.3, -0.2))
    a.save(tmp_path / "a.tif")
    b.save(tmp_path / "b.tif")
    described = json.loads(sastrugi_program("roughness", "a.tif", "--band", "4:12", "--json"))
    assert sastrugi.roughness(tmp_path / "a.tif", band=(4.0, 12.0)) == described

    printed = json.loads(sastrugi_program("coregister", "a.tif", "b.tif", "-o", "program.tif", "--json"))
    found = sastrugi.coregister(tmp_path / "a.tif", tmp_path / "b.tif")
    assert (found.details, found.verdict) == (printed["coregistration"], printed["verdict"])
    found.difference.save(tmp_path / "module.tif")
    assert (tmp_path / "module.tif").read_bytes() == (tmp_path / "program.tif").read_bytes()


def test_roughness_that_a_vehicle_feels(sastrugi_program, tmp_path):
    """A vehicle by its name, its file and its lengths; and cells that are too large for a band, unless they are accepted."""
    rough = sastrugi.terrain("multifractal", seed=7, size_px=[200, 160])
    rough.save(tmp_path / "rough.tif")
    (tmp_path / "mine.toml").write_text('base = "husky_a200"\n')
    for vehicle in ["husky_a200", tmp_path / "mine.toml", "wb=0.5,r=0.2"]:
        described = json.loads(sastrugi_program("roughness", "rough.tif", "--vehicle", vehicle, "--json"))
        assert described["ride"]["rms_m"] > 0.0
        assert sastrugi.roughness(tmp_path / "rough.tif", vehicle=vehicle) == described
    with pytest.raises(sastrugi.SastrugiError, match=r"\(override with `allow_coarse=True`\)$") as refused:
        sastrugi.roughness(rough, band=(0.06, 1.0))
    assert refused.value.code == 65
    described = json.loads(sastrugi_program("roughness", "rough.tif", "--band", "0.06:1", "--allow-coarse", "--json"))
    assert sastrugi.roughness(tmp_path / "rough.tif", band=(0.06, 1.0), allow_coarse=True) == described


def test_studies(study, release, sastrugi_program, tmp_path):
    sastrugi_program("run", study, "-o", "program", "--quiet")
    assert sums(release.path) == sums(tmp_path / "program")


def test_missions(sastrugi_program, tmp_path):
    ground = sastrugi.terrain("multifractal", seed=3, size_px=[320, 300])
    ground.save(tmp_path / "ground.tif")
    rules = ["--set-missions", "length_m=5.0", "--set-missions", "border_m=1.5"]
    sastrugi_program("traverse", "ground.tif", "--missions", 2, "--seed", 9, *rules, "-o", "program", "--quiet")
    for name, dem in {"of-file": tmp_path / "ground.tif", "of-heightfield": ground}.items():
        driven = sastrugi.traverse(dem, tmp_path / name, missions=2, seed=9, rules={"length_m": 5.0, "border_m": 1.5})
        assert len(driven.missions()) == 2
        assert sums(driven.path) == sums(tmp_path / "program"), name


def test_routes(sastrugi_program, tmp_path):
    hills = sastrugi.Fit({"model": "gaussian", "parameters": {"sigma_m": 0.5, "range_m": 12.0}}).texture(96.0, 1.0, seed=2)
    hills.save(tmp_path / "hills.tif")
    printed = json.loads(
        sastrugi_program("navigate", "hills.tif", "--start", "10,10", "--goal", "70,60", "-o", "program.geojson", "--json")
    )
    route = sastrugi.navigate(tmp_path / "hills.tif", (10, 10), (70, 60), tmp_path / "module.geojson")
    assert (tmp_path / "module.geojson").read_bytes() == (tmp_path / "program.geojson").read_bytes()
    assert route.metrics == printed["route"]
    assert (sastrugi.navigate(hills, (10, 10), (70, 60)).points == route.points).all()
    assert abs(route.points[0, :2] - [10.0, 10.0]).max() < 1.0
    wall = [[30.0, 20.0], [34.0, 20.0], [34.0, 50.0], [30.0, 50.0], [30.0, 20.0]]
    (tmp_path / "wall.geojson").write_text(json.dumps({"type": "Polygon", "coordinates": [wall]}))
    around = sastrugi.navigate(hills, (10, 10), (70, 60), obstacles=tmp_path / "wall.geojson")
    assert around.metrics["length_m"] > route.metrics["length_m"]
    assert sastrugi.navigate(hills, (10, 10), (70, 60), obstacles=[str(tmp_path / "wall.geojson")]).metrics == around.metrics


def test_logs(release, sastrugi_program, tmp_path):
    logs = [release.recording(mission).path for mission in release.missions()[:2]]
    printed = json.loads(sastrugi_program("analyze", *logs, "-o", "program.parquet", "--json"))
    rows = sastrugi.analyze(logs, output=tmp_path / "module.parquet")
    assert rows == [{**one["log"], "notes": one["notes"]} for one in printed]
    assert (tmp_path / "module.parquet").read_bytes() == (tmp_path / "program.parquet").read_bytes()


def test_errors(tmp_path, monkeypatch):
    """The exception has the sentence that the program prints, and its exit code."""
    monkeypatch.chdir(tmp_path)
    flat = "ncols 60\nnrows 60\nxllcorner 500000\nyllcorner 4000000\ncellsize 1\n" + ("1 " * 60 + "\n") * 60
    (tmp_path / "flat.asc").write_text(flat)
    ends = ["--start", "1,1", "--goal", "2,2"]
    for arguments, call, code in [
        (["terrain", "multifractal", "--set", "size_pxx=[90, 70]", "-o", "a.tif"], lambda: sastrugi.terrain("multifractal", size_pxx=[90, 70]), 2),
        (["fit", "flat.asc", "--outer-scale", "0", "-o", "a.json"], lambda: sastrugi.fit("flat.asc", outer_scale=0.0), 2),
        (["fit", "none.tif", "--outer-scale", "9", "-o", "a.json"], lambda: sastrugi.fit("none.tif", outer_scale=9), 65),
        (["fit", "flat.asc", "--outer-scale", "9", "-o", "a.json"], lambda: sastrugi.fit("flat.asc", outer_scale=9), 65),
        (["navigate", "none.tif", *ends, "-o", "a.geojson"], lambda: sastrugi.navigate("none.tif", (1, 1), (2, 2)), 65),
        (["traverse", "none.tif", "-o", "a"], lambda: sastrugi.traverse("none.tif", "a"), 65),
    ]:
        done = subprocess.run([program(), *arguments], capture_output=True, text=True)
        with pytest.raises(sastrugi.SastrugiError) as refused:
            call()
        assert done.stderr.endswith(f"sastrugi: {refused.value}\n"), arguments
        assert refused.value.code == done.returncode == code, arguments
