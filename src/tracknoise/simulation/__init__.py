"""Synthetic worlds, motions, light and the renderer; stands in for a simulator, exactly synchronised."""
