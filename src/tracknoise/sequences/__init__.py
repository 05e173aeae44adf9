"""Image sequences of known geometry: one file per format, and the registry that knows them by name."""
