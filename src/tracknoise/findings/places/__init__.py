"""Errors by place, with intervals: cells of the image, speeds of the image, and surroundings of features."""
