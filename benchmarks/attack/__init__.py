"""Attacks on tracknoise: damaged inputs, kills, signals, byte flips in run folders, and unusual names."""
