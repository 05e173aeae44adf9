"""The paper's own experiments: its claims, replication, differences from it, the DTU data and a light stage."""
