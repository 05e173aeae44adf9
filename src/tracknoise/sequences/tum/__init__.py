"""Recordings in the format of the TUM RGB-D benchmark (Sturm et al., IROS 2012): see docs/formats/tum.md."""
