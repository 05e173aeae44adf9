"""A light stage: objects are photographed from an arc of positions, with one LED at a time."""
