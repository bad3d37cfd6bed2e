"""Solution of the whole time interval at once, on a space-time mesh."""
