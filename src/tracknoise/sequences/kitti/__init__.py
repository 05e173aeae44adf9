"""KITTI raw data (Geiger et al., IJRR 2013) with the depth of KITTI's depth completion: see docs/kitti.md."""
