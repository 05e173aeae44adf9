"""Recordings whose images, depths and poses have times of their own: their order, association and interpolation."""
