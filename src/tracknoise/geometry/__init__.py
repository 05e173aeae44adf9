"""Cameras, poses and depth maps: arrays in, arrays out; no tables, no files.

Pixels: an integer coordinate is a pixel's centre, u to the right, v down, float64.
Camera frame: x right, y down, z forward; depth is z in metres, never range.
"""
