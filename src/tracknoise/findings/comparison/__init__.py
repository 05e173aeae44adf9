"""Two runs on the same scenes: what changed, paired by scene, by how much, and whether it became worse or better."""
