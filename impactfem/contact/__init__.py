"""Contact conditions and the solvers that find where they are active."""
