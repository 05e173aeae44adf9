"""How fast the parts are and how true the whole is; nothing here asserts a time."""
