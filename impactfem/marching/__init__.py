"""Time marching: schemes as data and compiled loops over the layers."""
