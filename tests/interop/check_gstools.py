"""GSTools' covariances for the `gstools` blocks of fit files agree with ours.

    check_gstools.py GOLDEN.json FIT.json...

GOLDEN.json: a list of {gstools, lags_m, covariance_m2}; every fit file must have a block that loads, with the variance and
range of its own parameters. Relative tolerance 1e-9 of the sill.
"""

import json
import math
import sys

import gstools

TOLERANCE = 1e-9


def model_of(block):
    """A model from a block, as in `docs/formats.md`."""
    arguments = {key: value for key, value in block.items() if key != "model"}
    return getattr(gstools, block["model"])(dim=2, **arguments)


def check_golden(path):
    worst, cases = 0.0, json.load(open(path))
    assert cases and all(case["lags_m"] and len(case["lags_m"]) == len(case["covariance_m2"]) for case in cases), path
    for case in cases:
        model = model_of(case["gstools"])
        sill = model.sill
        for (x, y), ours in zip(case["lags_m"], case["covariance_m2"]):
            theirs = sill if x == y == 0.0 else float(model.cov_spatial(([x], [y]))[0])
            error = abs(theirs - ours) / sill
            worst = max(worst, error)
            assert error <= TOLERANCE, (case["model"], x, y, theirs, ours)
    return worst


def check_fit(path):
    fit = json.load(open(path))
    model = model_of(fit["gstools"])
    own = fit["parameters"]
    assert math.isclose(model.var, own["sigma_m"] ** 2, rel_tol=TOLERANCE), path
    assert math.isclose(model.nugget, own.get("nugget_m2", 0.0), rel_tol=TOLERANCE), path
    assert math.isclose(float(model.anis[0]), own.get("ratio", 1.0), rel_tol=TOLERANCE), path
    if fit["model"].endswith("exponential"):
        # Along the axis the correlation at one range is 1/e; azimuths are clockwise from north.
        azimuth, b = math.radians(own.get("azimuth_deg", 0.0)), own["range_m"]
        along = float(model.cov_spatial(([b * math.sin(azimuth)], [b * math.cos(azimuth)]))[0])
        assert math.isclose(along, model.var / math.e, rel_tol=TOLERANCE), path


def main(golden, *fits):
    worst = check_golden(golden)
    for fit in fits:
        check_fit(fit)
    print(json.dumps({"worst_relative_error": worst, "fits": len(fits)}))


if __name__ == "__main__":
    main(*sys.argv[1:])
