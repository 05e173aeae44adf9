"""Data sets of nerfstudio: see docs/formats/nerfstudio.md."""
