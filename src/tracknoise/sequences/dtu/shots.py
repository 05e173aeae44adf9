"""The images of a scene under several lightings, read from files once for all of them."""

from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.camera import Camera
from tracknoise.sequences.images import read_gray

_PIXELS_AT_ONCE, _ROWS_AT_ONCE = 2048, 64  # so that what is worked on stays in the processor's cache


class Shots(Protocol):
    """Images of one scene by frame and lighting."""

    def image(self, index: int, lighting: int) -> NDArray[np.uint8]:
        """(height, width) uint8: one frame, in one of the lightings by its index.

        Raises
        ------
        DataError
            If a file is missing, truncated or of another size than the camera's.
        """
        ...


class Taken:
    """Images that were taken, or relit, in each lighting: a file for each.

    Parameters
    ----------
    paths
        Files by frame and lighting.
    camera
        Whose size the files have.
    halve
        Whether images have half of that size, each pixel the mean of four.
    """

    def __init__(self, paths: list[list[Path]], camera: Camera, *, halve: bool) -> None:
        self._paths, self._camera, self._halve = paths, camera, halve

    def image(self, index: int, lighting: int) -> NDArray[np.uint8]:
        """(height, width) uint8: see `Shots.image`."""
        image = read_gray(self._paths[index][lighting], self._camera)
        if not self._halve:
            return image
        sums = np.empty(_halved_shape(self._camera), np.float32)
        sums_of_four(image, out=sums)
        halved: NDArray[np.uint8] = np.rint(sums / np.float32(4.0)).astype(np.uint8)
        return halved


class Relit:
    """Images in lightings that are mixed from those of the LEDs; all of the latest frame are kept.

    Parameters
    ----------
    paths
        Files by frame and LED.
    weights
        (lightings, LEDs) float64, not negative: the share of each LED in each lighting, multiples of 1/16384 whose sum
        is 1 for each lighting. All sums are exact then, whatever the order of additions; images are rounded once.
    camera
        Whose size the files have.
    halve
        Whether images have half of that size, each pixel the mean of four.
    """

    def __init__(self, paths: list[list[Path]], weights: NDArray[np.float64], camera: Camera, *, halve: bool) -> None:
        self._paths, self._weights, self._camera, self._halve = paths, weights, camera, halve
        self._index: int | None = None
        self._images: list[NDArray[np.uint8]] = []
        self._light: NDArray[np.float32] | None = None  # kept, since new memory costs as much time as the arithmetic

    def __getstate__(self) -> dict[str, Any]:
        """Without the images: a copy in another process reads them again."""
        return {**self.__dict__, "_index": None, "_images": [], "_light": None}

    def image(self, index: int, lighting: int) -> NDArray[np.uint8]:
        """(height, width) uint8, read-only: see `Shots.image`."""
        if index != self._index:
            self._images, self._index = self._relit(index), index
        return self._images[lighting]

    def _relit(self, index: int) -> list[NDArray[np.uint8]]:
        if self._light is None:
            shape = _halved_shape(self._camera) if self._halve else (self._camera.height, self._camera.width)
            self._light = np.empty((len(self._paths[index]), *shape), np.float32)
        for path, light in zip(self._paths[index], self._light, strict=True):
            image = read_gray(path, self._camera)
            if self._halve:
                sums_of_four(image, out=light)
            else:
                light[:] = image
        relit = mix(self._light, (self._weights / (4 if self._halve else 1)).astype(np.float32))
        relit.flags.writeable = False
        return list(relit)


def mix(light: NDArray[np.float32], weights: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Weighted sums of images, rounded to the nearest grey level.

    Parameters
    ----------
    light
        (LEDs, height, width) float32.
    weights
        (lightings, LEDs) float32.

    Returns
    -------
    (lightings, height, width) uint8
    """
    pixels = light.reshape(len(light), -1)
    mixed = np.empty((len(weights), pixels.shape[1]), np.uint8)
    for start in range(0, pixels.shape[1], _PIXELS_AT_ONCE):
        part = weights @ pixels[:, start : start + _PIXELS_AT_ONCE]
        mixed[:, start : start + _PIXELS_AT_ONCE] = np.rint(part, out=part)
    return mixed.reshape(-1, *light.shape[1:])


def sums_of_four(image: NDArray[np.uint8], *, out: NDArray[np.float32]) -> None:
    """Sums of 2x2 pixels.

    Parameters
    ----------
    image
        (height, width) uint8, both even.
    out
        (height / 2, width / 2) float32, where they go.
    """
    pairs = np.ascontiguousarray(image).view(np.uint16)  # two neighbours in a row, whichever byte is the first
    for top in range(0, len(out), _ROWS_AT_ONCE):
        band = pairs[2 * top : 2 * (top + _ROWS_AT_ONCE)]
        band = (band & 0xFF) + (band >> 8)
        np.add(band[0::2], band[1::2], out=out[top : top + _ROWS_AT_ONCE])


def _halved_shape(camera: Camera) -> tuple[int, int]:
    return camera.height // 2, camera.width // 2
