"""The board of hard cases: scenes that break methods, and what each must keep there."""
