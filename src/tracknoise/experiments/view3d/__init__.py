"""One sequence of a run in space: images, tracks with their errors, true points and the path of the camera."""
