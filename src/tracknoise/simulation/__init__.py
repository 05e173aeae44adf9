"""Synthetic worlds, camera motions, light and the renderer. Images, depth and poses are exactly synchronised."""
