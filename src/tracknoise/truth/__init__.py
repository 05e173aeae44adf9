"""True positions of observed features, their visibility and, where a kind of truth knows it, their uncertainty."""
