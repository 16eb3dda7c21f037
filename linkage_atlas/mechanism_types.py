"""Kinds of mechanism and drives of a request, checked against its motion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, get_args

from linkage_atlas.arguments import kinds_among, one_of
from linkage_atlas.geometry import KindName
from linkage_atlas.motions import Motion
from synthesis.errors import FieldError
from synthesis.guided.by_crank import BY_CRANK
from synthesis.guides import Driver, Kind
from synthesis.limits import FORMS, Limits
from synthesis.poses import Poses
from synthesis.target import Samples, Target

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
    def by_crank(self) -> list[Kind]:
        """The kinds with a rail or a slot that a crank drives."""
        return [kind for kind in self.sliders if kind in BY_CRANK and self.driver in (None, Driver.CRANK)]

    @property
    def only_a_hinge_turns(self) -> bool:
        """True if a hinge is the only drive of these kinds that can turn fully."""
        return not self.four_bars and not self.by_crank

    def driven_by(self, drivers: Sequence[Driver]) -> bool:
        """Return whether one of these drivers drives one of the kinds."""
        return any(kind in _DRIVEN[driver] for driver in drivers for kind in self.kinds)


def read_kinds(mechanisms: object, driver: object, motion: Motion) -> Kinds:
    """Read the kinds of mechanism and check them against the motion.

    Raises
    ------
    FieldError
        If a kind or the driver is unknown, or cannot make such a motion.
    """
    names = ("four_bar",) if mechanisms is None else mechanisms
    names = (names,) if isinstance(names, str) and names != "all" else names
    kinds = Kinds(
        tuple(map(Kind, kinds_among(names, MECHANISMS))),
        None if driver is None else Driver(one_of("driver", driver, DRIVERS)),
    )
    _check(kinds, motion)
    return kinds


def _check(kinds: Kinds, motion: Motion) -> None:
    driver = kinds.driver
    if kinds.only_four_bars and driver not in (None, Driver.CRANK):
        message = f"a four-bar is driven by its crank; choose `mechanisms` that a {driver} can drive"
        raise FieldError("/driver", message)
    if driver in (Driver.SLIDER, Driver.CYLINDER, Driver.HINGE) and not kinds.driven_by((driver,)):
        raise FieldError("/driver", f"none of the requested kinds has a {driver}; add such a kind to `mechanisms`")
    if is_closed(motion.samples) and driver in (Driver.SLIDER, Driver.CYLINDER):
        message = f"a {driver} would have to reverse: a closed path needs a drive that turns fully"
        raise FieldError("/driver", message)
    if is_closed(motion.samples) and not kinds.four_bars and not set(kinds.kinds) & _turning_fully(driver):
        raise FieldError(
            "/mechanisms", "none of these kinds has a drive that turns fully, which a closed path requires"
        )
    if motion.travel is not None:
        _check_travel(kinds)
    elif not motion.free:
        _check_crank_angles(kinds)
    timed = isinstance(motion.samples, Target) and motion.samples.position is not None
    if timed and any(kind in kinds.kinds for kind in BY_CRANK):
        return
    four_bars = kinds.four_bars and motion.travel is None  # travel does not drive a four-bar
    if not four_bars and not has_poses(motion.samples) and not is_path(motion):
        field = "rotation" if motion.samples.rotation is None else "position"
        raise FieldError(
            f"/{field}",
            "must be left out for this motion: linkages with sliders need rotation and position at two or more samples",
        )


def _check_travel(kinds: Kinds) -> None:
    """Raise FieldError for kinds that no travel can drive."""
    if kinds.only_four_bars:
        raise FieldError(
            "/mechanisms", "must contain a kind with a slider or cylinder, which `travel` drives; or give 'all'"
        )
    if kinds.driver not in (None, Driver.SLIDER, Driver.CYLINDER):
        raise FieldError("/driver", f"travel drives sliders and cylinders, not a {kinds.driver}")
    if not kinds.driven_by((Driver.SLIDER, Driver.CYLINDER)):
        raise FieldError(
            "/mechanisms", "none of these kinds is driven by a slider or cylinder, which `travel` requires"
        )


def _check_crank_angles(kinds: Kinds) -> None:
    """Raise FieldError for kinds that no crank drives."""
    if kinds.driver not in (None, Driver.CRANK):
        message = f"crank angles drive a crank, not a {kinds.driver}: give `travel`, or `timing` 'free'"
        raise FieldError("/driver", message)
    if not kinds.driven_by((Driver.CRANK,)):
        message = "none of these kinds has a crank, but crank angles are given; give `travel`, or `timing` 'free'"
        raise FieldError("/mechanisms", message)


def check_no_slider_limits(limits: Limits) -> None:
    """Raise FieldError for limits of sliders in a request for four-bars."""
    for name, form in FORMS.items():
        if form.concerns == "sliders" and getattr(limits, name) is not None:
            message = "applies to sliders, which four-bars do not have; choose other `mechanisms`"
            raise FieldError(f"/limits/{name}", message)


def _turning_fully(driver: Driver | None) -> set[Kind]:
    """Return the kinds with a drive that can turn fully; the hinge of a rail and a slot cannot pass the rail's direction."""
    drivers = (Driver.CRANK, Driver.HINGE) if driver is None else (driver,)
    return {kind for turning in drivers for kind in _DRIVEN[turning] if turning.turns} - {Kind.RAIL_SLOT}


def is_closed(samples: Samples) -> bool:
    """Return whether the path leads from the last sample to the first."""
    return isinstance(samples, Poses) and samples.closed


def has_poses(samples: Samples) -> bool:
    """Return whether rotation and position are given together at two samples or more."""
    if samples.rotation is None or samples.position is None:
        return False
    return as_poses(samples).full.size >= 2


def is_path(motion: Motion) -> bool:
    """Return whether positions are given, with free rotations and free timing."""
    free = isinstance(motion.samples, Poses) and motion.travel is None
    return free and motion.samples.position is not None and not has_poses(motion.samples)


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
