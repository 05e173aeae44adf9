"""From irradiance to grey levels: gain, vignetting, fixed pattern, noise, rounding and compression."""

import cv2
import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.intrinsics import Intrinsics
from tracknoise.simulation.imaging import Imaging

_FULL = np.float32(255.0)


class Sensor:
    """A sensor with a lens that vignettes, and the compression of its images.

    Parameters
    ----------
    camera
        Size of the images and principal point.
    imaging
        Effects. Shutter and exposure time are not effects of the sensor.
    noise_sigma
        Standard deviation of the Gaussian sensor noise, grey levels.
    pattern
        Random generator of the fixed pattern, which is the same in all images.
    """

    def __init__(
        self, camera: Intrinsics, imaging: Imaging, *, noise_sigma: float, pattern: np.random.Generator
    ) -> None:
        self._imaging, self._noise_sigma = imaging, noise_sigma
        shape = (camera.height, camera.width)
        sensitivity, offset = pattern.standard_normal((2, *shape), dtype=np.float32)
        falloff = _vignetting(camera, imaging.vignetting)
        self._response = falloff * (np.float32(1.0) + np.float32(imaging.prnu) * sensitivity)
        self._offset = np.float32(imaging.dsnu) * offset

    def image(self, irradiance: NDArray[np.float32], index: int, rng: np.random.Generator) -> NDArray[np.uint8]:
        """Image of one frame.

        Parameters
        ----------
        irradiance
            (height, width) float32, 1 is the sensor's full range.
        index
            Frame, on which the gain depends.
        rng
            Random generator of the noise.

        Returns
        -------
        (height, width) uint8
        """
        brightness = np.float32(self._imaging.auto_exposure.brightness(index))
        seen = irradiance * (brightness * np.maximum(self._response, 0.0))
        grain = photon_noise(seen, self._imaging.photon_gain, rng) + self._offset / _FULL
        image = expose(grain, self._noise_sigma, rng)
        return compressed(image, self._imaging.jpeg_quality) if self._imaging.jpeg_quality else image


def photon_noise(irradiance: NDArray[np.float32], gain: float, rng: np.random.Generator) -> NDArray[np.float32]:
    """Irradiance with photon noise: its variance at grey level I is gain I, grey levels squared.

    Parameters
    ----------
    irradiance
        (height, width) float32, not negative, 1 is the sensor's full range.
    gain
        Grey levels per electron; 0 for no noise.
    rng
        Random generator.
    """
    if gain == 0.0:
        return irradiance
    electrons = rng.poisson(irradiance.astype(np.float64) * (float(_FULL) / gain))
    return (electrons * (gain / float(_FULL))).astype(np.float32)


def expose(irradiance: NDArray[np.float32], noise_sigma: float, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Image that the sensor delivers.

    Parameters
    ----------
    irradiance
        (height, width) float32, 1 is the sensor's full range.
    noise_sigma
        Standard deviation of the Gaussian sensor noise, grey levels.
    rng
        Random generator of the noise.

    Returns
    -------
    (height, width) uint8
        Rounded, and clipped to 0..255.
    """
    grey = irradiance * _FULL
    if noise_sigma > 0.0:
        grey += np.float32(noise_sigma) * rng.standard_normal(grey.shape, dtype=np.float32)
    levels: NDArray[np.uint8] = np.clip(np.rint(grey), 0.0, 255.0).astype(np.uint8)
    return levels


def compressed(image: NDArray[np.uint8], quality: int) -> NDArray[np.uint8]:
    """An image after JPEG compression and decompression.

    Parameters
    ----------
    image
        (height, width) uint8.
    quality
        1 to 100.
    """
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_GRAYSCALE), dtype=np.uint8)


def _vignetting(camera: Intrinsics, loss: float) -> NDArray[np.float32]:
    """(height, width) float32: share of the light that reaches each pixel."""
    v, u = np.indices((camera.height, camera.width), dtype=np.float64)
    squared = np.square(u - camera.cx) + np.square(v - camera.cy)
    return np.asarray(1.0 - loss * squared / squared.max(), dtype=np.float32)
