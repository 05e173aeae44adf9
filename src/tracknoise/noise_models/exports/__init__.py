"""The noise of a model in the syntax of estimators: what to write, where, and what it makes right."""
