"""An outside judge of textures: can a classifier of patches tell a texture from its site?

    check_textures.py [--deals N] WINDOW_CELLS SITE TEXTURE...

Rasters are detrended by scipy's moving average of WINDOW_CELLS cells, the texture with the site's holes, and cut into patches of half a
window. A random forest (scikit-learn) sees of each patch the features of `features`, none of which needs the place. It is cross-validated by
place: both rasters are cut across their longer side into strips of complete lines of patches, and each strip is judged by a forest that saw only
patches of the same raster at least a window away from it, so that neighbours of a patch are never in both.

AUC: probability that the forest ranks a patch of the texture above one of the site, the mean over strips. At 0.5 the forest cannot tell them apart,
at 1 it always can; below 0.5 it cannot either. Printed as JSON for each texture:
* `auc`: of all patches, the most that the forest can learn;
* `auc_halved`: of half of the texture's blocks (two windows wide) against half of the site's, the mean over 20 random choices. It is this that is
  compared with the site, whose parts hold no more patches.
For the site, from as many patches of each kind:
* `band`: 5 and 95 % of the AUC when the blocks of the site itself are dealt out at random, N times (99), as `real` and `synthetic`: what the
  method gives where there is nothing to tell. Here, for `auc_halved` and for `interleaved`, strips are of complete lines of blocks;
* `halves`: the AUC of one half of the site against the other, and `interleaved`: of the black against the white blocks of a chessboard.
A texture `passes` if its `auc_halved` lies below the upper end of the band. It `passes_halves` if it lies below that of the halves, or passes: it is
then no farther from the site than the site's own halves are from each other, which says little where the ground changes from end to end.

Importable: `judge(site, texture, window)` with arrays, NaN where there is no data; raises `TooFewPatches`.
"""

import argparse
import json
import sys

import numpy as np
import rasterio
from scipy.ndimage import uniform_filter
from scipy.stats import kurtosis, skew
from sklearn.ensemble import RandomForestClassifier
from sklearn.metrics import roc_auc_score

STRIPS = 5
TREES = 50
DEALS = 99
HALVINGS = 20
DATA_SHARE = 0.9
PATCHES_MIN = 20


class TooFewPatches(Exception):
    """A raster has too few patches with data and relief."""


def residual(heights, window):
    """Heights less their moving average over the cells with data; NaN where fewer than half of a window's have."""
    data = np.isfinite(heights)
    share = uniform_filter(data.astype(float), window, mode="constant")
    mean = uniform_filter(np.where(data, heights, 0.0), window, mode="constant") / np.maximum(share, 1e-9)
    return np.where(data & (share > 0.5), heights - mean, np.nan)


def with_holes(texture, site):
    """The texture without the cells that the site lacks, repeated where it is larger."""
    rows, cols = (np.arange(n) % m for n, m in zip(texture.shape, site.shape))
    return np.where(np.isfinite(site[np.ix_(rows, cols)]), texture, np.nan)


def moments(values):
    """Logarithm of the root mean square, skewness, and logarithm of the flatness."""
    return [0.5 * np.log(np.mean(values**2)), skew(values), np.log(kurtosis(values, fisher=False))]


def features(patch):
    """Of heights, slopes, curvatures and increments over 1, 2 and 4 cells: sizes, skewness and flatness; anisotropy; spectrum by octave."""
    patch = np.where(np.isfinite(patch), patch, np.nanmean(patch))
    north, east = np.gradient(patch)
    bend = (patch[1:-1, 2:] + patch[1:-1, :-2] + patch[2:, 1:-1] + patch[:-2, 1:-1] - 4.0 * patch[1:-1, 1:-1]).ravel()
    slope = np.hypot(north, east).ravel()
    found = moments(patch.ravel() - patch.mean()) + moments(slope) + moments(bend)
    found += list(np.quantile(slope, [0.1, 0.5, 0.9]) / np.sqrt(np.mean(slope**2)))
    found.append(np.log(np.mean(north**2) / np.mean(east**2)))
    for lag in (1, 2, 4):
        steps = np.concatenate([(patch[lag:] - patch[:-lag]).ravel(), (patch[:, lag:] - patch[:, :-lag]).ravel()])
        found.append(np.log(kurtosis(steps, fisher=False)))
    taper = np.hanning(patch.shape[0] + 2)[1:-1, None] * np.hanning(patch.shape[1] + 2)[1:-1]
    power = np.abs(np.fft.fft2((patch - patch.mean()) * taper)) ** 2
    frequency = np.hypot(*np.meshgrid(*(np.fft.fftfreq(n) for n in patch.shape), indexing="ij"))
    octaves = [(frequency >= f) & (frequency < 2.0 * f) for f in (0.0625, 0.125, 0.25)]
    return found + list(np.diff(np.log([power[octave].mean() for octave in octaves if octave.any()])))


def patches(heights, side):
    """Features and places (row and column of the middle, cells) of the patches with enough data and relief."""
    found, places = [], []
    for row in range(0, heights.shape[0] - side + 1, side):
        for col in range(0, heights.shape[1] - side + 1, side):
            patch = heights[row : row + side, col : col + side]
            if np.isfinite(patch).mean() >= DATA_SHARE and np.nanstd(patch) > 0.0:
                found.append(features(patch))
                places.append([row + side / 2, col + side / 2])
    if len(found) < PATCHES_MIN:
        raise TooFewPatches(f"{len(found)} patches of {side} x {side} cells with data and relief; at least {PATCHES_MIN} are needed")
    values = np.nan_to_num(np.array(found), posinf=50.0, neginf=-50.0)
    return values, np.array(places)


def folds(places, window, step=1):
    """Strip of each place across the longer side, and for each strip which places a forest may see: those a window or more away.

    Places in one line of `step` cells are in one strip.
    """
    along = places[:, np.argmax(np.ptp(places, axis=0))]
    lines, line = np.unique(along // step, return_inverse=True)
    strip = line * STRIPS // len(lines)
    away = [np.abs(along[:, None] - along[strip == k]).min(axis=1, initial=np.inf) - window // 2 for k in range(STRIPS)]
    return strip, np.array([(strip != k) & (away[k] >= window) for k in range(STRIPS)])


def auc(values, labels, strips, seen):
    """Mean AUC over strips of forests that saw the others; NaN if no strip has both labels."""
    found = []
    for strip in range(STRIPS):
        test, train = strips == strip, seen[strip]
        if len(set(labels[test])) < 2 or len(set(labels[train])) < 2:
            continue
        forest = RandomForestClassifier(TREES, min_samples_leaf=2, class_weight="balanced", random_state=0, n_jobs=1)
        forest.fit(values[train], labels[train])
        found.append(roc_auc_score(labels[test], forest.predict_proba(values[test])[:, 1]))
    return float(np.mean(found)) if found else float("nan")


def against(one, other, window, step=1):
    """AUC of one set of patches against another; each has strips of its own."""
    values = np.concatenate([one[0], other[0]])
    labels = np.repeat([0, 1], [len(one[0]), len(other[0])])
    (first, seen), (second, also_seen) = folds(one[1], window, step), folds(other[1], window, step)
    return auc(values, labels, np.concatenate([first, second]), np.concatenate([seen, also_seen], axis=1))


def dealt(places, window, random):
    """A label, 0 or 1, of each place; half of the blocks of two windows have each."""
    blocks, block = np.unique((places // (2 * window)).astype(int), axis=0, return_inverse=True)
    return random.permutation(np.arange(len(blocks)) % 2)[block.ravel()]


def halved(site, texture, window):
    """Mean AUC of half of the blocks of one against half of the other's."""
    random = np.random.default_rng(1)
    found = []
    for _ in range(HALVINGS):
        kept = [dealt(places, window, random) == 0 for _, places in (site, texture)]
        parts = [(values[k], places[k]) for k, (values, places) in zip(kept, (site, texture))]
        found.append(against(*parts, window, 2 * window))
    return float(np.nanmean(found))


def within(site, window, deals=DEALS):
    """What the site gives against itself: halves, interleaved blocks, and the band of blocks dealt out at random."""
    values, places = site
    along = places[:, np.argmax(np.ptp(places, axis=0))]
    half = (along > np.median(along)).astype(int)
    halves = against((values[half == 0], places[half == 0]), (values[half == 1], places[half == 1]), window)
    colour = (places // (2 * window)).astype(int).sum(axis=1) % 2
    by_block = folds(places, window, 2 * window)
    interleaved = auc(values, colour, *by_block)
    random = np.random.default_rng(0)
    found = [auc(values, dealt(places, window, random), *by_block) for _ in range(deals)]
    return {"halves": halves, "interleaved": interleaved, "band": [float(q) for q in np.nanquantile(found, [0.05, 0.95])]}


def judge(site, textures, window, deals=DEALS):
    """AUC of each texture against the site, and what the site gives against itself."""
    side = window // 2
    real = patches(residual(site, window), side)
    own = within(real, window, deals)
    band = own["band"][1]
    found = []
    for texture in textures:
        synthetic = patches(residual(with_holes(texture, site), window), side)
        value = halved(real, synthetic, window)
        found.append(
            {
                "auc": against(real, synthetic, window),
                "auc_halved": value,
                "patches": [len(real[0]), len(synthetic[0])],
                "passes": value <= band,
                # The AUC of the halves may have no value.
                "passes_halves": value <= band or value <= own["halves"],
            }
        )
    return {"textures": found, "site": own}


def read(path):
    with rasterio.open(path) as raster:
        return raster.read(1, masked=True).astype(float).filled(np.nan)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--deals", type=int, default=DEALS)
    parser.add_argument("window", type=int)
    parser.add_argument("rasters", nargs="+")
    given = parser.parse_args()
    site, *textures = map(read, given.rasters)
    json.dump(judge(site, textures, given.window, given.deals), sys.stdout, indent=1)
    print()
