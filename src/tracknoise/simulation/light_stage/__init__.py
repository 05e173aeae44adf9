"""A stage on which objects are photographed from an arc of positions, in the light of one LED after the other."""
