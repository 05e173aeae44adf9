"""Effects of cameras and of faults of the truth on what is measured, each alone at three sizes."""
