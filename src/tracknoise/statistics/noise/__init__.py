"""What noise models are fitted to: windows of tracks, and products of errors."""
