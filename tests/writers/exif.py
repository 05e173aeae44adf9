"""Writes JPEG files whose EXIF data say how the camera was held."""

import struct
from pathlib import Path

import cv2
import numpy as np


def save_turned(path: Path, image: np.ndarray, orientation: int) -> None:
    """The image as a JPEG file with one EXIF entry: the tag 0x112 (orientation), a short."""
    path.parent.mkdir(parents=True, exist_ok=True)
    done, jpeg = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 98])
    assert done
    tiff = b"II*\0" + struct.pack("<IHHHIHHI", 8, 1, 0x112, 3, 1, orientation, 0, 0)
    content = b"Exif\0\0" + tiff
    data = jpeg.tobytes()
    path.write_bytes(data[:2] + b"\xff\xe1" + struct.pack(">H", len(content) + 2) + content + data[2:])
