"""Where each feature really was: anchored in the world at its first frame, projected into all others."""
