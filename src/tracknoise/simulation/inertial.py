"""Readings of an inertial sensor on the simulated camera: angular rates and specific forces, with noise and biases.

The sensor is at the camera's centre, and its axes are those of the camera: x right, y down, z forward. With the
rotation R (world from camera), the position c, the biases b_g and b_a that walk, and gravity g in the world, it reads

    w + b_g + n_g,    R^T (d^2c/dt^2 - g) + b_a + n_a    (inertial.readings)

where w is the angular rate about the camera's own axes. A reading is of an instant: noise of density s has the standard
deviation s / sqrt(dt), and a bias takes steps of the density of its walk times sqrt(dt).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from tracknoise.geometry.pose import from_rotation

GRAVITY_M_S2 = 9.81
GRAVITY = np.array([0.0, 0.0, -GRAVITY_M_S2])
"""In the world of simulated motions, whose z axis points up, m/s^2."""
RATE_HZ = 200.0
"""Readings per second of EuRoC's sensor."""


@dataclass(frozen=True, slots=True, kw_only=True)
class InertialNoise:
    """Densities of the noise of an inertial sensor. The defaults are those that EuRoC states for its ADIS16448."""

    # gyro, accelerometer: white noise: rad/s and m/s^2 per sqrt(Hz)
    gyro: float = 1.6968e-4
    accelerometer: float = 2.0e-3
    # gyro_walk, accelerometer_walk: walk of the biases, which are 0 at first: rad/s^2 and m/s^3 per sqrt(Hz)
    gyro_walk: float = 1.9393e-5
    accelerometer_walk: float = 3.0e-3


class SmoothPath:
    """A path through the poses of frames, whose angular rate and acceleration are continuous.

    Positions are on a cubic spline, rotations on a spline with continuous angular acceleration. Both hold the pose of
    each frame. Beyond the first and the last frame, the nearest pieces go on.

    Parameters
    ----------
    times_s
        (n,) float64, increasing, seconds, n at least 2.
    world_from_camera
        (n, 4, 4) float64, rigid, the pose at each time.

    Raises
    ------
    ValueError
        If there are fewer than 2 frames.
    """

    def __init__(self, times_s: NDArray[np.float64], world_from_camera: NDArray[np.float64]) -> None:
        if len(times_s) < 2:
            raise ValueError(f"found {len(times_s)} frame, expected at least 2 for a motion")
        self._positions = CubicSpline(times_s, world_from_camera[:, :3, 3])
        self._rotations = RotationSpline(times_s, Rotation.from_matrix(world_from_camera[:, :3, :3]))

    def poses(self, at_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """(m, 4, 4) float64: world_from_camera at times (m,), seconds."""
        return from_rotation(self._rotations(at_s).as_matrix(), self._positions(at_s))

    def velocities(self, at_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """(m, 3) float64: velocities at times (m,), in the world, m/s."""
        return np.asarray(self._positions(at_s, 1))

    def rates(self, at_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """(m, 3) float64: angular rates at times (m,), about the camera's own axes, rad/s."""
        return np.asarray(self._rotations(at_s, 1))

    def forces(self, at_s: NDArray[np.float64], gravity: NDArray[np.float64]) -> NDArray[np.float64]:
        """(m, 3) float64: acceleration without gravity (3,) at times (m,), along the camera's own axes, m/s^2."""
        return np.asarray(self._rotations(at_s).inv().apply(self._positions(at_s, 2) - gravity))


@dataclass(frozen=True, slots=True, eq=False)
class InertialReadings:
    """What an inertial sensor reads, with the truth."""

    times_s: NDArray[np.float64]  # (m,) float64, seconds
    # gyro, accelerometer: (m, 3) float64: rad/s and m/s^2, along the camera's own axes
    gyro: NDArray[np.float64]
    accelerometer: NDArray[np.float64]
    # gyro_bias, accelerometer_bias: (m, 3) float64: the true biases
    gyro_bias: NDArray[np.float64]
    accelerometer_bias: NDArray[np.float64]


def inertial_readings(
    path: SmoothPath,
    times_s: NDArray[np.float64],
    rng: np.random.Generator,
    *,
    noise: InertialNoise | None = None,
    gravity: NDArray[np.float64] = GRAVITY,
) -> InertialReadings:
    """Read an inertial sensor on a path, (inertial.readings).

    Parameters
    ----------
    path
        Of the camera that the sensor is on.
    times_s
        (m,) float64, seconds, evenly spaced, m at least 2.
    rng
        Random generator of noise and biases.
    noise
        Of the sensor; by default EuRoC's.
    gravity
        (3,) float64, in the world, m/s^2.
    """
    densities = noise or InertialNoise()
    interval_s = float(times_s[1] - times_s[0])
    gyro_bias = _walked(rng, len(times_s), densities.gyro_walk * np.sqrt(interval_s))
    accelerometer_bias = _walked(rng, len(times_s), densities.accelerometer_walk * np.sqrt(interval_s))
    gyro = path.rates(times_s) + gyro_bias
    accelerometer = path.forces(times_s, gravity) + accelerometer_bias
    for values, density in ((gyro, densities.gyro), (accelerometer, densities.accelerometer)):
        values += density / np.sqrt(interval_s) * rng.standard_normal(values.shape)
    return InertialReadings(times_s, gyro, accelerometer, gyro_bias, accelerometer_bias)


def _walked(rng: np.random.Generator, count: int, step: float) -> NDArray[np.float64]:
    """(count, 3): random walks from 0 with this standard deviation of a step."""
    steps = step * rng.standard_normal((count, 3))
    steps[0] = 0.0
    return np.asarray(np.cumsum(steps, axis=0))
