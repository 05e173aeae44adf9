"""What an estimator needs: the noise of windows of tracks, named by what it makes right."""
