"""What drawing a result takes: the time around the solution that can be switched off."""

from impactfem.scene import Scene, Solid

# Processor time [s] on a 2-core machine: loading Matplotlib, then 4 to 6 pictures, a film of 60
# frames, the report. Measured on shipped scenes of every kind: pictures 0.6 to 1.2, film 0.3 to
# 0.8 (solids up to 1.6), report 0.1 to 0.3.
_LOADING, _PICTURES, _FILM, _FILM_OF_SOLID, _REPORT = 0.8, 0.9, 0.6, 1.6, 0.2


def drawing_seconds(scene: Scene) -> float:
    """Time that pictures, film and report of a scene take [s], as far as it asks for them."""
    wanted = scene.output
    film = _FILM_OF_SOLID if isinstance(scene.bodies[0], Solid) else _FILM
    parts = wanted.pictures * _PICTURES + wanted.film * film + wanted.report * _REPORT
    return round(parts + _LOADING, 2) if parts else 0.0
