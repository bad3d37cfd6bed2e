"""Exact solutions of scenes, and the errors of motions against them."""
