"""Contact laws by what they are between, with name patterns replaced by the names they match."""

from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cached_property, lru_cache

from impactfem.scene.contacts import Contact

type Side = tuple[str, tuple[str, ...] | None]
"""Name of a body and its surfaces; None for all that may touch."""

type Both = frozenset[str]
"""Names of a body and of what it meets, without surfaces."""


@lru_cache(maxsize=1 << 14)
def side_of(name: str) -> Side:
    """Read "ball" or "ball/skin"."""
    body, slash, surface = name.partition("/")
    return body, (surface,) if slash else None


def sides_of(contact: Contact) -> Both:
    """Names of what a law is between."""
    return frozenset(side_of(name)[0] for name in contact.between)


def default_name(one: str, two: str) -> str:
    """Name of a pair that has none: "ball/skin" and "floor" are "ball_skin.floor"."""
    return f"{one}.{two}".replace("/", "_")


def name_of(contact: Contact) -> str:
    """Name of the pair in columns and messages."""
    return contact.name or default_name(*contact.between)


def is_pattern(name: str) -> bool:
    """Whether a name of ``between`` stands for several."""
    return "*" in name or "?" in name


@dataclass(frozen=True)
class Laws:
    """The contact laws of a scene, each of two names.

    Attributes:
        each: The laws; those of a pattern stand in its place.
        origin: Place of each in the scene's ``[[contact]]``.
        of: Laws of two names: several where they are of different surfaces.
        partners: What a body or obstacle may meet, by its name, in the order of the laws.
        bodies: Names of the bodies.
    """

    each: tuple[Contact, ...]
    origin: tuple[int, ...]
    of: Mapping[Both, Sequence[Contact]]
    partners: Mapping[str, Collection[str]]
    bodies: Collection[str]

    @cached_property
    def between_bodies(self) -> Sequence[tuple[str, Side, Side]]:
        """Names of the pairs of bodies, and these."""
        found, known = [], set(self.bodies)
        for entry in self.each:
            one, two = (side_of(name) for name in entry.between)
            if one[0] in known and two[0] in known:
                found.append((name_of(entry), one, two))
        return found

    @staticmethod
    @lru_cache(maxsize=1)
    def among(
        contacts: tuple[Contact, ...],
        bodies: tuple[str, ...],
        obstacles: tuple[str, ...],
        held: tuple[Both, ...],
    ) -> "Laws":
        """Find them; the last ones are kept, for the same scene with other settings.

        A pattern stands for all pairs that it matches and that no law names, no pattern before it
        matches and no joint holds together.

        Args:
            contacts: As the scene has them.
            bodies: Names of its bodies.
            obstacles: Names of its obstacles.
            held: Bodies that joints hold together.
        """
        plain = [not any(map(is_pattern, entry.between)) for entry in contacts]
        taken = {sides_of(entry) for entry, named in zip(contacts, plain, strict=True) if named}
        taken |= set(held)
        each, origin, moving = [], [], set(bodies)
        for index, (entry, named) in enumerate(zip(contacts, plain, strict=True)):
            found = [entry]
            if not named:
                first, second = (
                    [name for name in (*bodies, *obstacles) if fnmatchcase(name, pattern)]
                    for pattern in entry.between
                )
                found = []
                for one in first:
                    moves = one in moving
                    for two in second:
                        if one != two and (moves or two in moving):
                            both = frozenset((one, two))
                            if both not in taken:
                                taken.add(both)
                                found.append(_between(entry, one, two))
            each += found
            origin += [index] * len(found)
        of: dict[Both, list[Contact]] = defaultdict(list)
        partners: dict[str, dict[str, None]] = defaultdict(dict)
        for entry in each:
            (one, _), (two, _) = map(side_of, entry.between)
            of[frozenset((one, two))].append(entry)
            partners[one][two] = partners[two][one] = None
        return Laws(tuple(each), tuple(origin), dict(of), dict(partners), bodies)


def _between(contact: Contact, one: str, two: str) -> Contact:
    """The same law between two others; not checked again, as there may be 1e5 of them."""
    found = object.__new__(type(contact))
    found.__dict__.update(contact.__dict__, between=(one, two))
    return found
