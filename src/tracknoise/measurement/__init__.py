"""One sequence in, tables out: a single pass over the images, and the error of each observation."""
