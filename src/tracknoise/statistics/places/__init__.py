"""Errors by where and how features move: places in the image, speed, parallax, depth edges."""
