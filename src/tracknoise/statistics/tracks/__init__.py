"""What becomes of tracks: how long they live, how they end, and which are outliers."""
