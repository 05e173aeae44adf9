"""Files of tracks that other front ends write: one module per format, and the checks that all formats share."""
