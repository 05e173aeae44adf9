"""What the visual-inertial odometry Basalt makes of exported noise."""
