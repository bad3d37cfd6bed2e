"""What drawing a result takes: the time around the solution that can be switched off."""

from impactfem.scene import Scene

# Processor time [s] on a 2-core machine: loading Matplotlib, then 4 to 6 pictures, a film of 60
# frames, the report. Measured on shipped scenes of every kind: pictures 0.6 to 1.2, film 0.3 to
# 0.8 (solids up to 1.6), report 0.1 to 0.3.
_LOADING, _PICTURES, _FILM, _FILM_OF_SOLID, _REPORT = 0.3, 0.9, 0.6, 1.6, 0.2

_CHEAP = 1.0
"""Seconds that a film may take without being asked for, however short the solution is."""


def choose_film(scene: Scene, seconds: float | None) -> tuple[bool, str]:
    """Whether to film a motion, and why: if asked, or else where it is cheap.

    Args:
        scene: The scene.
        seconds: Time of its solution [s]; None if not known beforehand.
    """
    if scene.output.film is not None:
        return scene.output.film, "as asked"
    cost, most = _film_seconds(scene), max(seconds or 0.0, _CHEAP)
    if cost <= most:
        return True, f"cheap: about {cost:g} s, at most the time of the solution or {_CHEAP:g} s"
    return False, (
        f"no: about {cost:g} s, more than the solution takes and than {_CHEAP:g} s; "
        "output.film = true or impactfem plot writes it"
    )


def drawing_seconds(scene: Scene, *, film: bool) -> float:
    """Time that pictures, film and report of a scene take [s], as far as they are made."""
    wanted = scene.output
    parts = wanted.pictures * _PICTURES + film * _film_seconds(scene) + wanted.report * _REPORT
    return round(parts + _LOADING, 2) if parts else 0.0


def _film_seconds(scene: Scene) -> float:
    return _FILM_OF_SOLID if scene.solids else _FILM
