"""How errors grow with age: white noise, random walk, drift."""
