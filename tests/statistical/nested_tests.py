"""Reference values for the tests of `sastrugi-statistics` on groups of terrains: scipy 1.17.1, statsmodels 0.15.0, numpy.

    python3 tests/statistical/nested_tests.py

Each line names the function it comes from. The mixed logistic model is maximised here by a general minimiser on a likelihood whose
integrals come from adaptive quadrature (`scipy.integrate.quad`), so that only the model is shared with the Rust program.
"""

import itertools

import numpy as np
import pandas as pd
from scipy import integrate, optimize, stats
from statsmodels.regression import mixed_linear_model
from statsmodels.stats import multitest, power, weightstats

A = [62.0, 71.5, 55.0, 80.0, 66.5, 71.5]
B = [58.0, 49.0, 71.5, 40.5, 55.0]
C = [44.0, 52.5, 40.5, 61.0]
D = [1.5, -0.5, 3.0, 0.0, 2.5, 0.5, -1.0, 4.0]
BLOCKS = [[71.0, 64.0, 60.0], [55.0, 57.0, 41.0], [80.0, 62.0, 61.5], [66.0, 70.0, 49.0], [48.0, 40.0, 44.0]]


def exact(samples, statistic, kind):
    test = stats.permutation_test(
        samples, statistic, permutation_type=kind, alternative="greater", n_resamples=np.inf, vectorized=False
    )
    return test.statistic, test.pvalue


def permutations():
    means = lambda a, b: abs(np.mean(a) - np.mean(b))
    print("permutation_test, means", *exact((A, B), means, "independent"))
    ranks = stats.rankdata(A + B)
    rank = dict(zip(A + B, ranks))
    sums = lambda a, b: abs(sum(rank[v] for v in b) - len(B) * (len(A) + len(B) + 1) / 2)
    print("permutation_test, rank sum", *exact((A, B), sums, "independent"))
    print("permutation_test, mean of differences", *exact((D,), lambda d: abs(np.mean(d)), "samples"))
    size = dict(zip(np.abs(D), stats.rankdata(np.abs(D))))
    signed = lambda d: abs(sum(np.sign(v) * size[abs(v)] for v in d))
    print("permutation_test, signed rank (Pratt)", *exact((D,), signed, "samples"))
    y = A[:4] + B[:3] + C[:3]
    x = [0] * 4 + [1] * 3 + [2] * 3
    centred = stats.rankdata(y) - (len(y) + 1) / 2
    seen = sorted(set(itertools.permutations(x)))
    found = np.abs(np.array(seen) @ centred)
    p = np.mean(found >= found[seen.index(tuple(x))])
    print("spearmanr", stats.spearmanr(x, y).statistic, "all", len(seen), "p", p)
    page = stats.page_trend_test(-np.array(BLOCKS), method="exact")
    print("page_trend_test, falling", page.statistic, page.pvalue)


def effects():
    print("shift", np.median(np.subtract.outer(B, A)))
    print("delta", np.mean(np.sign(np.subtract.outer(B, A))))
    walsh = [(D[i] + D[j]) / 2 for i in range(len(D)) for j in range(i, len(D))]
    print("paired shift", np.median(walsh), "paired delta", np.mean(np.sign(D)))


def intervals():
    for n, x in ((10, 0), (10, 3), (10, 10), (10, 3.5)):
        low = stats.beta.ppf(0.025, x, n - x + 1) if x > 0 else 0.0
        high = stats.beta.ppf(0.975, x + 1, n - x) if x < n else 1.0
        print("beta.ppf", n, x, low, high)
    for n, m in ((3, 3), (4, 4), (5, 6), (10, 10), (20, 20)):
        # The p of U = k - 1, for samples that have it: the second group above all of the first but k - 1 pairs.
        tails = [stats.mannwhitneyu(*with_u(n, m, u), alternative="less", method="exact").pvalue for u in range(n * m // 2)]
        print("mannwhitneyu", n, m, sum(p <= 0.025 for p in tails))
    for n in (5, 6, 10, 20):
        tails = [stats.wilcoxon(with_w(n, w), alternative="less", method="exact").pvalue for w in range(n * (n + 1) // 4)]
        print("wilcoxon", n, sum(p <= 0.025 for p in tails))


def with_u(n, m, u):
    """Samples of n and m values of which u pairs have the first above the second."""
    first = np.array([u // n + (k < u % n) for k in range(n)]) - 0.5 + np.arange(n) * 1e-6
    return first, np.arange(m, dtype=float)


def with_w(n, w):
    """Differences of magnitudes 1 to n of which the positive ones sum to w."""
    d = -np.arange(1.0, n + 1)
    for rank in range(n, 0, -1):
        if rank <= w:
            d[rank - 1], w = rank, w - rank
    return d


def equivalence():
    print("ttost_ind, margin 25", weightstats.ttost_ind(B, A, -25, 25, usevar="unequal")[0])
    compared = weightstats.CompareMeans.from_data(B, A)
    print("tconfint_diff, 90 %", compared.tconfint_diff(alpha=0.1, usevar="unequal"), compared.dof_satt())
    print("ttost_paired, margin 3", weightstats.ttost_paired(np.array(D), np.zeros(len(D)), -3, 3)[0])
    print("t.interval, 90 %", stats.t.interval(0.9, len(D) - 1, np.mean(D), stats.sem(D)))


def several():
    p = [0.5, 0.01, 0.03, 0.02, 0.0004, 0.02]
    print("multipletests, holm", [float(v) for v in multitest.multipletests(p, method="holm")[1]])
    values = D + [12.0, -9.0]
    print("quantile, linear", np.quantile(values, [0.25, 0.5, 0.75], method="linear"))
    inside = tukey(values)
    print("whiskers", min(inside), max(inside), "outliers", sorted(set(values) - set(inside)))
    x, y = A[:5], B
    print("pearsonr", float(stats.pearsonr(x, y).statistic), "spearmanr", float(stats.spearmanr(x, y).statistic))


def tukey(values):
    low, high = np.quantile(values, [0.25, 0.75])
    return [v for v in values if low - 1.5 * (high - low) <= v <= high + 1.5 * (high - low)]


def components():
    """Balanced nested data: the estimators of the analysis of variance are those of restricted maximum likelihood."""
    group, member, value = [], [], []
    for g, members in enumerate(NESTED):
        for m, repeats in enumerate(members):
            group += [g] * len(repeats)
            member += [f"m{m}"] * len(repeats)
            value += repeats
    data = pd.DataFrame({"group": group, "member": member, "value": value})
    fit = mixed_linear_model.MixedLM.from_formula(
        "value ~ 1", groups="group", re_formula="1", vc_formula={"member": "0 + member"}, data=data
    ).fit(reml=True, method="powell", xtol=1e-12, ftol=1e-14, maxiter=20000)
    print("MixedLM, REML", float(fit.cov_re.iloc[0, 0]), float(fit.vcomp[0]), float(fit.scale))


NESTED = [
    [[3.0, 5.0, 4.5], [9.0, 7.5, 8.0], [6.0, 6.5, 4.0]],
    [[13.0, 14.5, 12.0], [10.0, 11.5, 11.0], [17.0, 16.0, 15.0]],
    [[8.0, 7.0, 9.5], [12.5, 11.0, 13.0], [9.0, 10.0, 8.5]],
    [[5.5, 4.0, 6.0], [2.0, 3.5, 1.0], [7.0, 8.0, 6.5]],
]


def distributions():
    for t, n in [(-2.5, 1), (-1.3, 2.5), (0.7, 7), (3.1, 38.6), (-6.0, 1000), (-0.001, 4), (-40.0, 3)]:
        print(f"t.cdf ({t}, {n}, {float(stats.t.cdf(t, n))!r}),")
    for q, n in [(0.975, 1), (0.95, 9.3), (0.025, 38), (0.6, 2), (0.9999, 5)]:
        print(f"t.ppf ({q}, {n}, {float(stats.t.ppf(q, n))!r}),")
    for x, k in [(3.84, 1), (0.02, 1), (5.99, 2), (7.0, 3), (30.0, 4), (0.5, 7), (120.0, 10)]:
        print(f"chi2.sf ({x}, {k}, {float(stats.chi2.sf(x, k))!r}),")


GOALS = [
    [19, 20, 17, 20, 15, 18, 20, 19],
    [17, 12, 18, 9, 20, 16, 14, 19],
    [10, 14, 3, 16, 12, 17, 8, 11],
]


def likelihood(parameters, rows):
    *b, s = parameters
    total = 0.0
    for x, y, n in rows:
        f = np.dot(x, b)
        g = lambda u: y * (f + s * u) - n * np.logaddexp(0, f + s * u) - u * u / 2
        top = optimize.minimize_scalar(lambda u: -g(u), bounds=(-9, 9), method="bounded").x
        height = g(top)
        integrand = lambda u: np.exp(g(u) - height)
        value = integrate.quad(integrand, top - 9, top + 9, points=[top], epsabs=0, epsrel=1e-12, limit=200)[0]
        total += height + np.log(value) - 0.5 * np.log(2 * np.pi)
    return total


def hessian(f, at, h=1e-3):
    n = len(at)
    out = np.empty((n, n))
    step = np.eye(n) * h
    for i in range(n):
        for j in range(n):
            # Fourth order in h: central differences at h and 2 h.
            def second(k):
                a, b = k * step[i], k * step[j]
                return (f(at + a + b) - f(at + a - b) - f(at - a + b) + f(at - a - b)) / (4 * k * k * h * h)
            out[i, j] = (4 * second(1) - second(2)) / 3
    return out


def mixed(design, name):
    rows = [(design(g), y, 20) for g, group in enumerate(GOALS) for y in group]
    loss = lambda p: -likelihood(p, rows)
    start = np.array([1.0] * len(rows[0][0]) + [0.8])
    found = optimize.minimize(loss, start, method="BFGS", options={"gtol": 1e-7})
    fine = {"xatol": 1e-10, "fatol": 1e-13, "maxiter": 4000}
    found = optimize.minimize(loss, found.x, method="Nelder-Mead", options=fine)
    errors = np.sqrt(np.diag(np.linalg.inv(hessian(loss, found.x))))
    print("mixed logistic,", name, "log likelihood", -found.fun)
    print("    estimates", found.x.tolist(), "errors", errors.tolist())
    return -found.fun


def models():
    null = mixed(lambda g: [1.0], "intercept")
    groups = mixed(lambda g: [1.0, float(g == 1), float(g == 2)], "groups")
    chi2 = 2 * (groups - null)
    print("ratio", chi2, stats.chi2.sf(chi2, 2))
    mixed(lambda g: [1.0, float(g)], "trend")


def powers():
    for difference, between, within, n, m in [(10, 150, 1600, 20, 20), (10, 150, 1600, 40, 5), (15, 60, 1900, 10, 40)]:
        d = difference / np.sqrt(between + within / m)
        print("TTestIndPower", difference, between, within, n, m, power.TTestIndPower().power(d, n, 0.05))
        print("TTestPower", difference, between, within, n, m, power.TTestPower().power(d, n, 0.05))


for part in (permutations, effects, intervals, equivalence, several, components, distributions, models, powers):
    part()
