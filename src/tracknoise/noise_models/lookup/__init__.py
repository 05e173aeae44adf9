"""Tables of noise by tracker, speed and motion, and how well they predict scenes that were left out."""
