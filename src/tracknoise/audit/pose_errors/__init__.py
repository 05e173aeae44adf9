"""Errors of the poses of single frames, measured by all tracks of the frame."""
