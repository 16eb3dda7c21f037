"""Kinds of mechanism and drives of a request, checked against its motion."""

from __future__ import annotations

from typing import NamedTuple, get_args

from linkage_atlas.arguments import kinds_among, one_of
from linkage_atlas.geometry import KindName
from linkage_atlas.motions import Motion
from synthesis.errors import FieldError
from synthesis.guides import Driver, Kind
from synthesis.limits import FORMS, Limits
from synthesis.poses import Poses
from synthesis.target import Samples

MECHANISMS = get_args(KindName)
DRIVERS = tuple(driver.value for driver in Driver)
_DRIVEN: dict[Driver, tuple[Kind, ...]] = {
    Driver.CRANK: (Kind.FOUR_BAR, Kind.SLIDER_CRANK, Kind.SWINGING_BLOCK),
    Driver.SLIDER: (Kind.SLIDER_CRANK, Kind.RAIL_SLOT, Kind.TWO_RAILS),
    Driver.CYLINDER: (Kind.SWINGING_BLOCK, Kind.RAIL_SLOT, Kind.TWO_SLOTS),
    Driver.HINGE: (Kind.SWINGING_BLOCK, Kind.RAIL_SLOT, Kind.TWO_SLOTS),
}


class Kinds(NamedTuple):
    """Kinds of mechanism and, optionally, their drive."""

    kinds: tuple[Kind, ...] = (Kind.FOUR_BAR,)
    driver: Driver | None = None

    @property
    def only_four_bars(self) -> bool:
        """True if the request is about four-bars only."""
        return self.kinds == (Kind.FOUR_BAR,)

    @property
    def sliders(self) -> list[Kind]:
        """The kinds that have a rail or a slot."""
        return [kind for kind in self.kinds if kind is not Kind.FOUR_BAR]

    @property
    def four_bars(self) -> bool:
        """True if four-bars are searched, which only a crank drives."""
        return Kind.FOUR_BAR in self.kinds and self.driver in (None, Driver.CRANK)

    @property
    def only_a_hinge_turns(self) -> bool:
        """True if a hinge is the only drive of these kinds that can turn fully."""
        with_crank = self.driver in (None, Driver.CRANK) and set(self.kinds) & set(_DRIVEN[Driver.CRANK])
        return not with_crank


def read_kinds(mechanisms: object, driver: object, motion: Motion) -> Kinds:
    """Read the kinds of mechanism and check them against the motion.

    Raises
    ------
    FieldError
        If a kind or the driver is unknown, or cannot make such a motion.
    """
    names = ("four_bar",) if mechanisms is None else mechanisms
    names = (names,) if isinstance(names, str) and names != "all" else names
    requested = tuple(map(Kind, kinds_among(names, MECHANISMS)))
    kinds = Kinds(requested, None if driver is None else Driver(one_of("driver", driver, DRIVERS)))
    _check(kinds, motion)
    return kinds


def _check(kinds: Kinds, motion: Motion) -> None:
    """Raise FieldError if none of the kinds has a drive that makes the motion."""
    samples, driver = motion.samples, kinds.driver
    if kinds.only_four_bars and driver not in (None, Driver.CRANK):
        message = f"a four-bar is driven by its crank; choose `mechanisms` that a {driver} can drive"
        raise FieldError("/driver", message)
    drivers, needed = tuple(Driver), "; add such a kind to `mechanisms`"
    if motion.travel is not None:
        drivers, needed = (Driver.SLIDER, Driver.CYLINDER), ", which `travel` drives; or give 'all'"
    elif not motion.free:
        drivers, needed = (Driver.CRANK,), ", but crank angles are given; give `travel`, or `timing` 'free'"
    elif samples.closed:
        drivers, needed = (Driver.CRANK, Driver.HINGE), " that turns fully, which a closed path requires"
    words = " or ".join(drivers)
    if driver is not None and driver not in drivers:
        raise FieldError("/driver", f"must be a {words}{needed}; it is a {driver}")
    # the hinge of a rail and a slot cannot pass the rail's direction
    turning = set(kinds.kinds) - ({Kind.RAIL_SLOT} if samples.closed else set())
    if not any(kind in _DRIVEN[known] for known in ((driver,) if driver else drivers) for kind in turning):
        field = "mechanisms" if driver is None else "driver"
        raise FieldError(f"/{field}", f"none of these kinds has a {driver or words}{needed}")
    four_bars = kinds.four_bars and motion.travel is None  # travel does not drive a four-bar
    if not four_bars and not has_poses(samples) and not is_path(motion):
        field = "rotation" if samples.rotation is None else "position"
        raise FieldError(
            f"/{field}",
            "must be left out for this motion: linkages with sliders need rotation and position at two or more samples",
        )


def check_no_slider_limits(limits: Limits) -> None:
    """Raise FieldError for limits of sliders in a request for four-bars."""
    for name, form in FORMS.items():
        if form.concerns == "sliders" and getattr(limits, name) is not None:
            message = "applies to sliders, which four-bars do not have; choose other `mechanisms`"
            raise FieldError(f"/limits/{name}", message)


def has_poses(samples: Samples) -> bool:
    """Return whether rotation and position are given together at two samples or more."""
    if samples.rotation is None or samples.position is None:
        return False
    return as_poses(samples).full.size >= 2


def is_path(motion: Motion) -> bool:
    """Return whether positions are given, with free rotations and without the travel of a slider."""
    return motion.travel is None and motion.samples.position is not None and not has_poses(motion.samples)


def as_poses(samples: Samples) -> Poses:
    """Return samples without their crank angles."""
    if isinstance(samples, Poses):
        return samples
    return Poses(
        samples.rotation,
        samples.position,
        length_scale=samples.length_scale,
        rotation_weights=samples.rotation_weights,
        position_weights=samples.position_weights,
    )
