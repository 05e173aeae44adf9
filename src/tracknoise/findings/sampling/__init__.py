"""How sure a number is: what is left out or resampled, and corrections for asking often."""
