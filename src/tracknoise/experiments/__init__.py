"""Experiments: settings, presets, running, analysis and self-test."""
