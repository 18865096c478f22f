"""Portilla and Simoncelli's texture model as plenoptic synthesises it (PyTorch, by gradients): floor of the bench `measured_textures`.

    wavelet_statistics.py SIDE

Prints the seconds of one iteration on one thread, the mean of three, for a texture of SIDE x SIDE cells from as many: four scales, four
orientations. Its own example runs 150 iterations. The image is noise that is rough in patches, in [0, 1].
"""

import sys
import time

import numpy as np
import plenoptic as po
import torch

ITERATIONS = 3

torch.set_num_threads(1)
side = int(sys.argv[1])
generator = np.random.default_rng(1)
frequency = np.hypot(np.fft.fftfreq(side)[:, None], np.fft.rfftfreq(side))


def noise(width):
    """Smooth noise of unit variance."""
    smooth = np.exp(-0.5 * (2.0 * np.pi * width * frequency) ** 2)
    field = np.fft.irfft2(np.fft.rfft2(generator.standard_normal((side, side))) * smooth, (side, side))
    return field / field.std()


heights = noise(2.0) * np.exp(0.4 * noise(10.0))
scaled = (heights - heights.min()) / np.ptp(heights)
image = torch.as_tensor(scaled, dtype=torch.float32)[None, None]
model = po.models.PortillaSimoncelli(image.shape[-2:])
metamer = po.MetamerCTF(image, model, loss_function=po.loss.l2_norm)
metamer.setup((torch.rand_like(image) - 0.5) * 0.1 + image.mean())
start = time.perf_counter()
metamer.synthesize(ITERATIONS, change_scale_criterion=None, ctf_iters_to_check=7)
print((time.perf_counter() - start) / ITERATIONS)
