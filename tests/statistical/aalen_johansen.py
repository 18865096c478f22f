"""Reference for `val_of_an_independent_program` in analysis/statistics/src/incidence.rs.

Cumulative incidence of competing endings (0: censored) by scikit-survival 0.28.0 (handles ties) and by lifelines 0.30.3
(ties set apart by 1e-9). Run: pip install scikit-survival lifelines; python aalen_johansen.py
"""

import numpy as np
from lifelines import AalenJohansenFitter
from sksurv.nonparametric import cumulative_incidence_competing_risks

DISTANCES = np.array(
    [3.1, 3.1, 4.0, 5.2, 5.2, 5.2, 6.0, 7.7, 7.7, 9.3, 9.3, 11.0, 12.5, 12.5, 14.1, 16.0, 16.0, 18.8, 20.0, 20.0, 21.5]
    + [25.0, 28.0, 30.5, 35.0, 35.0, 35.0, 35.0]
)
CAUSES = np.array([1, 2, 0, 1, 1, 2, 3, 2, 0, 1, 3, 0, 2, 1, 1, 2, 2, 0, 1, 0, 3, 2, 0, 1, 0, 0, 0, 0])
PLACES = [5.2, 9.3, 16.0, 21.5, 35.0]

at, shares = cumulative_incidence_competing_risks(CAUSES, DISTANCES)
for place in PLACES:
    last = np.searchsorted(at, place, side="right") - 1
    print("scikit-survival", place, [float(v) for v in shares[1:, last]])
for cause in (1, 2, 3):
    fitter = AalenJohansenFitter(calculate_variance=False, jitter_level=1e-9, seed=1)
    curve = fitter.fit(DISTANCES, CAUSES, event_of_interest=cause).cumulative_density_.iloc[:, 0]
    print("lifelines", cause, [float(curve[curve.index <= place + 1e-6].iloc[-1]) for place in PLACES])
