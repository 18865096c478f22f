"""FFT-MA written with numpy: the floor of the bench `fft_ma`.

Prints the fastest of five runs in seconds: everything, and the field alone from precomputed amplitudes.
"""

import sys
import time

import numpy as np


def amplitudes(n, cell=0.1, sigma=0.1, b=0.28):
    steps = np.minimum(np.arange(n), n - np.arange(n)) * cell
    covariance = sigma**2 * np.exp(-np.hypot(steps[:, None], steps[None, :]) / b)
    return np.sqrt(np.maximum(np.fft.rfft2(covariance).real, 0.0) * n * n)


def field(amplitude, n, seed):
    theta = 2.0 * np.pi * np.random.default_rng(seed).random(amplitude.shape)
    return np.fft.irfft2(amplitude * np.exp(1j * theta), s=(n, n))


n = int(sys.argv[1])
whole, alone = [], []
for seed in range(5):
    start = time.perf_counter()
    amplitude = amplitudes(n)
    middle = time.perf_counter()
    field(amplitude, n, seed)
    end = time.perf_counter()
    whole.append(end - start)
    alone.append(end - middle)
print(min(whole), min(alone))
