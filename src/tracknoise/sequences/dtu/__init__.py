"""DTU Point Features: objects on a light stage, photographed from an arc of positions, and scanned from one of them."""
