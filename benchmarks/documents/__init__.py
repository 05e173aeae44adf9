"""What the documentation shows, made again: outputs, figures and screenshots."""
