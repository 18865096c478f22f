"""A dataset of height patches and outcomes for a learner, without a dependency on one.

`HeightPatches` has what `torch.utils.data.Dataset` asks for, `__len__` and `__getitem__`, so a DataLoader takes it as it is:

    dataset = HeightPatches(sastrugi.Release("release"), split="train")
    loader = torch.utils.data.DataLoader(dataset, batch_size=32, shuffle=True)

With `num_workers`, add `multiprocessing_context="spawn"`: a forked process has no threads to compute with.

Run it to see the shapes: python height_patches.py RELEASE
"""

from __future__ import annotations

import sys

import numpy as np

import sastrugi


class HeightPatches:
    """The ground around the vehicle at the start of each mission, and whether the mission arrived.

    An item is a pair: heights above the ground under base_link, float32 of shape (1, rows, columns), row 0 ahead; and 1.0 for `success`, otherwise 0.0. Samples
    outside the terrain are 0, the height of the ground under base_link.
    """

    def __init__(
        self, release: sastrugi.Release, split: str | None = None, size: float = 4.0, cell: float = 0.1, time: float = 0.0
    ) -> None:
        self.release = release
        self.missions = release.missions(split=split)
        self.size, self.cell, self.time = size, cell, time

    def __len__(self) -> int:
        return len(self.missions)

    def __getitem__(self, index: int) -> tuple[np.ndarray, np.float32]:
        mission = self.missions[index]
        patch = self.release.height_patch(mission, self.time, self.size, self.cell)
        heights = np.nan_to_num(patch, nan=0.0).astype(np.float32)[np.newaxis]
        return heights, np.float32(mission["outcome"] == "success")


if __name__ == "__main__":
    dataset = HeightPatches(sastrugi.Release(sys.argv[1]))
    heights, arrived = dataset[0]
    print(f"{len(dataset)} patches of {heights.shape}, {heights.dtype}; the first arrived: {bool(arrived)}")
