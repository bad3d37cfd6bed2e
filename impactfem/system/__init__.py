"""What time schemes see of a body: mass, stiffness, loads, supports."""
