"""Heights from slopes by scipy's sparse solver, from the equations in the header of `photoclinometry/integration.rs`.

    check_photoclinometry.py PROBLEM.json

PROBLEM has shape, cell sizes, slopes and information matrix of every cell (null: none), soft constraints, and the program's heights. Heights must
agree within 1e-6 m.
"""

import json
import sys
from pathlib import Path

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve

from common import expect

FLOOR, LIMIT_M = 1e-3, 1e-6


class Equations:
    def __init__(self, size):
        self.size, self.entries, self.right = size, [], np.zeros(size)

    def add(self, rows, targets, weight):
        """Adds (r z - t)^T W (r z - t) for rows r = [(cell, factor), ...] of one or two differences."""
        for i, row in enumerate(rows):
            for j, other in enumerate(rows):
                for a, u in row:
                    self.right[a] += weight[i][j] * u * targets[j]
                    for b, v in other:
                        self.entries.append((a, b, weight[i][j] * u * v))

    def solve(self):
        i, j, v = (np.array(column) for column in zip(*self.entries))
        matrix = coo_matrix((v, (i, j)), shape=(self.size, self.size)).tocsc()
        return spsolve(matrix, self.right)


def correction(slopes, good, first, pitch, at, count):
    """What moves the mean of two slopes to their edge; the cell `first` is number `at` of `count` along the axis."""
    if at < 0 or at + 1 >= count or not (good[first] and good[first + pitch]):
        return 0.0
    before = at >= 1 and good[first - pitch]
    after = at + 2 < count and good[first + 2 * pitch]
    bend_before = slopes[first - pitch] - 2 * slopes[first] + slopes[first + pitch] if before else None
    bend_after = slopes[first] - 2 * slopes[first + pitch] + slopes[first + 2 * pitch] if after else None
    bends = [bend for bend in (bend_before, bend_after) if bend is not None]
    return -np.mean(bends) / 12 if bends else 0.0


def main():
    problem = json.loads(Path(sys.argv[1]).read_text())
    rows, cols = problem["shape"]
    step_x, step_y = problem["cell_m"]
    slopes = np.array(problem["slopes"])
    good = [w is not None for w in problem["information"]]
    floor = FLOOR * np.median([0.5 * (w[0] + w[2]) for w in problem["information"] if w])
    equations = Equations(rows * cols)
    for k in range(rows * cols):
        r, c = divmod(k, cols)
        a, b, d = problem["information"][k] or (0.0, 0.0, 0.0)
        a, d = a + floor, d + floor
        (p, q), across, down = slopes[k], slopes[:, 0], slopes[:, 1]
        along_x = [
            ([(k, 1 / step_x), (k - 1, -1 / step_x)], p + correction(across, good, k - 1, 1, c - 1, cols)) if c > 0 else None,
            ([(k + 1, 1 / step_x), (k, -1 / step_x)], p + correction(across, good, k, 1, c, cols)) if c + 1 < cols else None,
        ]
        along_y = [
            ([(k, 1 / step_y), (k + cols, -1 / step_y)], q + correction(down, good, k, cols, r, rows)) if r + 1 < rows else None,
            ([(k - cols, 1 / step_y), (k, -1 / step_y)], q + correction(down, good, k - cols, cols, r - 1, rows)) if r > 0 else None,
        ]
        for x in along_x:
            for y in along_y:
                if x and y:
                    equations.add([x[0], y[0]], [x[1], y[1]], [[a / 4, b / 4], [b / 4, d / 4]])
                elif x:
                    equations.add([x[0]], [x[1]], [[(a - b * b / d) / 4]])
                elif y:
                    equations.add([y[0]], [y[1]], [[(d - b * b / a) / 4]])
    for constraint in problem["constraints"]:
        equations.add([constraint["cells"]], [constraint["height_m"]], [[1 / constraint["sigma_m"] ** 2]])
    if not problem["constraints"]:
        equations.add([[(0, 1.0)]], [0.0], [[1.0]])
    heights = equations.solve()
    found = np.array(problem["heights_m"])
    if not problem["constraints"]:
        heights -= heights.mean()
    worst = np.abs(heights - found).max()
    print(f"{rows} x {cols} cells, {len(problem['constraints'])} constraints: heights agree within {worst:.1e} m")
    expect(worst < LIMIT_M, f"heights differ by up to {worst} m")
    expect(np.ptp(found) > 1.0, "the problem is trivial")


main()
