"""The camera models by name, as files and settings call them."""

from collections.abc import Sequence
from types import MappingProxyType

from tracknoise.geometry.camera import DISTORTION_COUNTS, Camera
from tracknoise.geometry.double_sphere import DoubleSphereCamera
from tracknoise.geometry.fisheye import EquidistantCamera

KnownCamera = Camera | EquidistantCamera | DoubleSphereCamera

COEFFICIENTS = MappingProxyType(
    {
        "pinhole": "no numbers",
        "radtan": "0, 4, 5 or 8 numbers (k1, k2, p1, p2, k3, k4, k5, k6)",
        "equidistant": "4 numbers (k1, k2, k3, k4)",
        "double_sphere": "2 numbers (xi, alpha)",
    }
)
"""What the coefficients of each model are, by name of the model."""

_COUNTS = {"pinhole": (0,), "radtan": DISTORTION_COUNTS, "equidistant": (4,), "double_sphere": (2,)}


def make_camera(
    model: str, size: tuple[int, int], intrinsics: Sequence[float], coefficients: tuple[float, ...]
) -> KnownCamera:
    """Make a camera of a model in `COEFFICIENTS`.

    Parameters
    ----------
    model
        Name of the model.
    size
        Width and height, px.
    intrinsics
        fx, fy, cx, cy, px.
    coefficients
        Of the lens, as the model has them.

    Raises
    ------
    ValueError
        If the model does not have so many coefficients, or a value is impossible; the message begins with the field.
    """
    if len(coefficients) not in _COUNTS[model]:
        raise ValueError(f"distortion is {[*coefficients]}, expected {COEFFICIENTS[model]} for the model {model}")
    width, height = size
    fx, fy, cx, cy = intrinsics
    if model == "double_sphere":
        xi, alpha = coefficients
        return DoubleSphereCamera(width, height, fx, fy, cx, cy, xi, alpha)
    if model == "equidistant":
        k1, k2, k3, k4 = coefficients
        return EquidistantCamera(width, height, fx, fy, cx, cy, (k1, k2, k3, k4))
    return Camera(width, height, fx, fy, cx, cy, coefficients)


def model_of(camera: KnownCamera) -> str:
    """Name of a camera's model in `COEFFICIENTS`; ``radtan`` for a pinhole camera, whose distortion is none."""
    match camera:
        case DoubleSphereCamera():
            return "double_sphere"
        case EquidistantCamera():
            return "equidistant"
        case Camera():
            return "radtan"


def coefficients_of(camera: KnownCamera) -> tuple[float, ...]:
    """Coefficients of a camera's lens, as `make_camera` takes them."""
    return (camera.xi, camera.alpha) if isinstance(camera, DoubleSphereCamera) else camera.distortion
