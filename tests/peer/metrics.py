"""Metrics of a traverse from poses at a fixed rate, implemented independently from their definition in docs/traversal.md."""

import numpy as np


def euler(poses):
    """Roll, pitch and yaw of rows (time, x, y, z, qw, qx, qy, qz), rad."""
    w, x, y, z = poses[:, 4:8].T
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1, 1))
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return roll, pitch, yaw


def of_poses(poses, rate_hz):
    """Root mean squares: vertical acceleration, m/s2, and rates of pitch and roll, deg/s."""
    roll, pitch, _ = euler(poses)

    def rms(values):
        return float(np.sqrt(np.mean(np.square(values)))) if len(values) else float("nan")

    def rate(angle):
        return np.degrees(np.diff(np.unwrap(angle)) * rate_hz)

    return {
        "rms_vertical_acceleration_m_s2": rms(np.diff(poses[:, 3], 2) * rate_hz**2),
        "rms_pitch_rate_deg_s": rms(rate(pitch)),
        "rms_roll_rate_deg_s": rms(rate(roll)),
    }
