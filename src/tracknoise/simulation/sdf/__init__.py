"""Worlds and models in Gazebo's format (SDF), as far as a camera sees them."""
