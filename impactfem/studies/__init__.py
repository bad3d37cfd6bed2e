"""Studies over many runs: errors against time, and the board of hard cases."""
