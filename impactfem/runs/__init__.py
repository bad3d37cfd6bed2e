"""From a plan to a motion, its error and its figures, one module for each kind of body."""
