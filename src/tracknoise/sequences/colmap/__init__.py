"""Reconstructions of COLMAP: see docs/formats/colmap.md."""
