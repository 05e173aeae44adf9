"""Statistical inference whose sampling unit is the scene: arrays in, arrays out. It knows no other room."""
