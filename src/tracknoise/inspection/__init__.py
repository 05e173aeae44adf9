"""Check whether a recording can be measured: its files, its clock, and whether images, poses and depths agree."""
