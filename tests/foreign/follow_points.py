"""A tracker of points by the folder protocol of the VOT challenge, as somebody else would write one."""

from pathlib import Path

import cv2
import numpy as np


def main() -> None:
    images = [cv2.imread(path, cv2.IMREAD_GRAYSCALE) for path in Path("frames_color.txt").read_text().split()]
    for query in Path().glob("query_*.txt"):
        first, position = query.read_text().split()
        point, lines = np.float32([[float(x) for x in position.split(",")]]), ["0"] * int(first)
        lines.append(position)
        for before, image in zip(images[int(first) :], images[int(first) + 1 :], strict=False):
            found = np.zeros((1, 1))
            if lines[-1] != "0":
                point, found, _ = cv2.calcOpticalFlowPyrLK(before, image, point, None)
            inside = found[0, 0] and 0 <= point[0, 0] < image.shape[1] and 0 <= point[0, 1] < image.shape[0]
            lines.append(f"{point[0, 0]},{point[0, 1]}" if inside else "0")
        Path(query.name.replace("query", "output")).write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
