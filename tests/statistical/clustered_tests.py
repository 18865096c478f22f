"""Reference values for the tests of `sastrugi-statistics` on clustered values: scipy 1.17.1, lifelines 0.30.3.

    pip install scipy lifelines; python3 tests/statistical/clustered_tests.py

Quantiles come from scipy, curves from lifelines (ties separated by 1e-9); the rest is computed in the obvious way.
"""

import numpy as np
from lifelines import AalenJohansenFitter
from scipy import stats

SHROUT = [[9, 2, 5, 8], [6, 1, 3, 2], [8, 4, 6, 8], [7, 1, 2, 6], [10, 5, 6, 9], [6, 2, 4, 7]]
UNEQUAL = [[0.9, 0.85, 0.95], [0.4], [0.7, 0.65, 0.8, 0.72, 0.61], [0.3, 0.55], [0.88, 0.91, 0.79, 0.86]]
# Distances and endings (1 arrived, 2 never will, 0 stopped) of each world.
WORLDS = [
    ([26.5, 31.0, 40.0, 90.0], [1, 1, 1, 0]),
    ([27.0, 28.0, 29.5, 33.0], [1, 1, 1, 1]),
    ([45.0, 52.5, 71.0, 90.0, 90.0], [1, 2, 1, 0, 0]),
    ([30.0, 34.0, 61.0], [1, 2, 1]),
    ([26.0, 36.0, 44.0, 90.0], [1, 1, 1, 0]),
    ([38.0, 57.0, 80.0, 90.0], [1, 1, 2, 0]),
]


def intraclass(clusters):
    values = np.concatenate(clusters)
    sizes = np.array([len(c) for c in clusters])
    n, k = len(values), len(clusters)
    between = sum(len(c) * (np.mean(c) - values.mean()) ** 2 for c in clusters) / (k - 1)
    within = sum(((np.array(c) - np.mean(c)) ** 2).sum() for c in clusters) / (n - k)
    m = (n - (sizes**2).sum() / n) / (k - 1)
    rho = (between - within) / (between + (m - 1) * within)
    low = between / within / stats.f.ppf(0.975, k - 1, n - k)
    high = between / within * stats.f.ppf(0.975, n - k, k - 1)
    effect = 1 + ((sizes**2).sum() / n - 1) * max(rho, 0)
    return rho, (low - 1) / (low + m - 1), (high - 1) / (high + m - 1), effect


def clopper_pearson(share, n):
    x = share * n
    return stats.beta.ppf(0.025, x, n - x + 1), stats.beta.ppf(0.975, x + 1, n - x)


def korn_graubard(share, variance, n, k):
    effective = min(share * (1 - share) / variance, n)
    return clopper_pearson(share, effective * (stats.t.ppf(0.975, n - 1) / stats.t.ppf(0.975, k - 1)) ** 2)


def arrived(worlds, at):
    distances = np.concatenate([w[0] for w in worlds])
    causes = np.concatenate([w[1] for w in worlds])
    fitter = AalenJohansenFitter(calculate_variance=False, jitter_level=1e-9, seed=1)
    curve = fitter.fit(distances, causes, event_of_interest=1).cumulative_density_.iloc[:, 0]
    return float(curve[curve.index <= at + 1e-6].iloc[-1])


def curve(at):
    k, n = len(WORLDS), sum(len(w[0]) for w in WORLDS)
    without = np.array([arrived(WORLDS[:c] + WORLDS[c + 1 :], at) for c in range(k)])
    share = arrived(WORLDS, at)
    return share, *korn_graubard(share, (k - 1) / k * ((without - without.mean()) ** 2).sum(), n, k)


print("intraclass, Shrout and Fleiss", *map(float, intraclass(SHROUT)))
print("intraclass, unequal", *map(float, intraclass(UNEQUAL)))
for share, variance in [(0.7, 0.004), (0.985, 0.0001)]:
    print("Korn and Graubard", share, variance, *map(float, korn_graubard(share, variance, 200, 20)))
for at in (30.0, 40.0, 57.0, 80.0):
    print("worlds, arrived by", at, *map(float, curve(at)))
