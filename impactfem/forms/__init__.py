"""Weak forms in UFL."""
