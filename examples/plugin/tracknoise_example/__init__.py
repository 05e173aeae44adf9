"""A tracker and a reader for tracknoise."""
