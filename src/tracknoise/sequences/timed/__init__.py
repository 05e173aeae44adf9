"""Recordings whose images, depths and poses have times of their own: association, and readers of such formats."""
