"""Tracks of a front end of plain OpenCV, written as tracknoise imports them: docs/your-tracks.md.

Corners of Shi and Tomasi are followed from image to image by Lucas-Kanade, and back. Replace `followed` by your own.

python own_opencv_tracks.py IMAGES FILE.csv
"""

import csv
import sys
from pathlib import Path

import cv2
import numpy as np

MOST, APART_PX, BACKWARD_PX = 300, 15, 0.5


def followed(before, image, points):
    """Positions (n, 2) float32 of points in the next image, and whether each was found."""
    found, ok, _ = cv2.calcOpticalFlowPyrLK(before, image, points, None)
    back, ok_back, _ = cv2.calcOpticalFlowPyrLK(image, before, found, None)
    inside = ((found >= 0) & (found < image.shape[::-1])).all(axis=1)
    near = np.linalg.norm(back - points, axis=1) < BACKWARD_PX
    return found, (ok[:, 0] == 1) & (ok_back[:, 0] == 1) & inside & near


def new_corners(image, points):
    """Positions (n, 2) float32 of corners away from the points that are followed."""
    mask = np.full_like(image, 255)
    for x, y in points:
        cv2.circle(mask, (round(float(x)), round(float(y))), APART_PX, 0, -1)
    missing = MOST - len(points)
    corners = cv2.goodFeaturesToTrack(image, missing, 0.01, APART_PX, mask=mask) if missing > 0 else None
    return np.empty((0, 2), np.float32) if corners is None else corners.reshape(-1, 2)


def main(images, file):
    """Follow points through the images of a folder, in the order of their names."""
    points, tracks, begun, before = np.empty((0, 2), np.float32), np.empty(0, int), 0, None
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("w", newline="") as opened:
        writer = csv.writer(opened)
        writer.writerow(["track", "image", "u_px", "v_px"])
        for path in sorted(one for one in images.iterdir() if cv2.haveImageReader(str(one))):
            image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
            if len(points):
                points, found = followed(before, image, points)
                points, tracks = points[found], tracks[found]
            corners = new_corners(image, points)
            points = np.concatenate([points, corners])
            tracks = np.append(tracks, begun + np.arange(len(corners)))
            begun, before = begun + len(corners), image
            writer.writerows([track, path.name, *point] for track, point in zip(tracks, points.tolist(), strict=True))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
