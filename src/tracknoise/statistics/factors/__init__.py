"""Effects of factors by the paper's yardstick."""
