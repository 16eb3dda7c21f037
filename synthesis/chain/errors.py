"""Why a chain, a track or a slot is refused: the faults, their sentences, and the request's field that each one names."""

from __future__ import annotations

from enum import StrEnum

from synthesis.errors import FieldError


class ChordFault(StrEnum):
    """Why a link does not fit; the value is the sentence that the user reads."""

    NO_POINT = "no point of the track ahead is one pitch away"
    REVERSAL = "the pitch is too long for the track's bends: a pin would jump or run back while the chain moves on"
    AMBIGUOUS = "a link stands square to the track, so that the pitch does not determine the pin's place"


class ChordError(FieldError):
    """A pin for which there is no next pin.

    Parameters
    ----------
    fault : ChordFault
        What is wrong.
    position : float
        Arc length of the pin from the start of the track.
    """

    def __init__(self, fault: ChordFault, position: float) -> None:
        message = f"{fault.value} (pin at {position:.6g} along the track)"
        super().__init__("/pitch", message, constraint=fault.name.lower(), amount=position)
        self.fault = fault


class TrackError(FieldError):
    """Segments that make no closed tangent track.

    Parameters
    ----------
    message : str
        What was found and what was wanted.
    segment : int
        The segment at fault.
    amount : float
        The size of the fault: a gap, an angle, a length or a number of turns.
    """

    def __init__(self, message: str, segment: int, amount: float) -> None:
        super().__init__(f"/segments/{segment}", message, constraint="closed_tangent_track", amount=amount)
        self.segment = segment


class NotClosing(FieldError):
    """A chain so much too short or too long for its track that another number of links closes.

    Parameters
    ----------
    links, nearest_links : int
        Number of links of the chain, and the nearest number that does close.
    missing : float
        Length that the chain lacks at its worst phase; negative: its excess.
    where : str
        Completes the sentence: on which track, or on which of a family of tracks.
    """

    def __init__(self, links: int, nearest_links: int, missing: float, where: str) -> None:
        verb, word, length = "does not close", "in excess", {"excess_length": -missing}
        if missing > 0:
            verb, word, length = "would be stretched", "missing", {"missing_length": missing}
        super().__init__(
            "/links",
            f"a chain of {links} links {verb} {where}: {abs(missing):.6g} of length is {word}; "
            f"{nearest_links} links close",
            constraint="closure",
            amount=abs(missing),
            nearest_links=nearest_links,
            **length,
        )


def check_link_fits(field: str, pitch: float, radius: float) -> None:
    """Raise `FieldError` for an arc whose diameter is no longer than a link."""
    if not pitch < 2 * radius * (1 - 1e-9):
        raise FieldError(
            field,
            f"a link does not fit on an arc of radius {radius:.6g}; more than {pitch / 2:.6g} is wanted",
            constraint="link_on_arc",
            amount=pitch / 2 - radius,
        )
