"""Whether the instrument itself is right: known errors through the whole measurement."""
