"""Recordings in the ASL layout of EuRoC MAV (Burri et al., IJRR 2016) and TUM-VI: see docs/formats/euroc.md."""
