"""Bags of ROS 1 and ROS 2: see docs/formats/rosbag.md."""
