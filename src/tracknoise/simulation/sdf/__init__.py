"""Worlds and models in Gazebo's format (SDF): the visible parts."""
