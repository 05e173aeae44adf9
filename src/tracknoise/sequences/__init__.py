"""Image sequences of known geometry: one file a format, and the registry that knows them by name."""
