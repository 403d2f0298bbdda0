"""The contract of a deed: one thing that a law does to a simulation, and all that anybody has to know of it.

A deed says how it enters the equilibrium, what it does to first order about a solved one, through which module alone
it acts if there is one, and how long it remembers. Deeds of one kind act together: two dry joints balance each other,
two changed values of one module are one other module.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from ...errors import InputError
from ...loaded import Chain, Conditions, Equilibria, FirstOrder
from ...mechanism import Changes
from ...spatial import Array

if TYPE_CHECKING:
    from ..setup import Setup

#: How long a deed remembers: while the actuators stand still, or for a whole run.
BLOCK, RUN = "block", "run"
#: Histories agree with the equilibria where they move by less than this, in their own units.
AGREED = 1e-7


@dataclass(frozen=True)
class Moment:
    """When samples were taken: time (n,) [s], labels of their blocks (n,) and of their runs (n,)."""

    time: Array
    blocks: np.ndarray
    runs: np.ndarray

    @property
    def begins(self) -> np.ndarray:
        """Which sample is the first of each one's block, (n,)."""
        return np.maximum.accumulate(np.where(np.diff(self.blocks, prepend=-1) != 0, np.arange(len(self.blocks)), 0))


@dataclass(frozen=True)
class Solved:
    """A solved simulation of n samples, about which deeds tell their first-order effect.

    samples (n,) are the inputs' rows that were solved; `plain` is the robot without changed values, at the same
    lengths; `lengths` are the robot file's; `histories` by kind what followed the deeds that remember. `displaced`: how
    far (n,) what changes moves the joints that resist in `setup`, by their places, while they resist as they do there.
    """

    setup: Setup
    first: FirstOrder
    samples: np.ndarray
    moment: Moment
    plain: Chain
    lengths: Mapping[str, float]
    histories: Mapping[type[Deed], History]
    displaced: Mapping[int, Array] = field(default_factory=dict)


class Felt(NamedTuple):
    """What a place felt in a recording: its largest load [N or N m], and how stiff the robot holds it [N/m or N m/rad].

    Zero of what is not known.
    """

    load: float = 0.0
    stiffness: float = 0.0


class History(ABC):
    """What deeds of one kind remember while the samples are followed in time, round by round.

    All samples are solved at once with what is held so far; then the histories are followed with the equilibria, and
    both are repeated until nothing moves any more.
    """

    @abstractmethod
    def begin(self, found: Equilibria) -> None:
        """Hold at first what is held at equilibria of the same samples in which a similar history was followed.

        Only how many rounds it takes depends on it: a history may as well begin with nothing.
        """

    @abstractmethod
    def act(self, now: Conditions) -> Conditions:
        """Return the conditions with what is held so far."""

    @abstractmethod
    def follow(self, found: Equilibria) -> float:
        """Follow the history with new equilibria; return by how much it moved; less than `AGREED` is nothing."""

    @property
    @abstractmethod
    def after(self) -> Any:
        """What is remembered after the last sample."""


class Deed(ABC):
    """One thing that a law does. Final subclasses are listed in `deeds.DEEDS`."""

    #: BLOCK, RUN, or nothing.
    memory: ClassVar[str] = ""
    #: What moves as a whole by it, of 'base' and 'tool'; '' where nothing does.
    moves_whole: ClassVar[str] = ""
    #: True where it loads the robot or lets it give way: joints move by it from where they stand unloaded.
    displaces_joints: ClassVar[bool] = False

    @property
    def only_module(self) -> str | None:
        """The module through whose deformation alone it acts; None where it acts otherwise too."""
        return None

    @property
    def only_actuator(self) -> int | None:
        """The actuator, by its place among them, that alone it has stand elsewhere; None where it does otherwise."""
        return None

    @property
    def is_proportional(self) -> bool:
        """True where what it does is in proportion to one of its numbers, to first order."""
        return not self.memory

    @property
    def resisted_joint(self) -> str | None:
        """The joint that it resists; None where it resists none."""
        return None

    def within(self, rows: np.ndarray) -> Deed:
        """Return the same deed at some samples (N,) alone, for what a sensor does while it is set up in one way.

        Raises InputError for what is the robot's, at whatever sample.
        """
        raise InputError(f"{type(self).__name__} acts on the robot, in all recordings alike")

    def felt(self, at: Solved) -> Felt:
        """Return what its place felt in a simulation in which it does not act; nothing where nothing bounds it."""
        return Felt()

    @abstractmethod
    def enter(self, setup: Setup) -> None:
        """Write what it does into the setup of the simulation."""

    def redraw(self, changes: Changes) -> str | None:
        """Write what it does into a robot file's changes, and return in words what of it a file leaves out, '' if none.

        None where no robot file can say it: nothing is written then.
        """
        return None

    @classmethod
    def changes(cls, setup: Setup, at: Solved) -> Iterator[Array]:
        """Yield the parts of what deeds of this kind do to what is watched, each (n, R), from the solved setup on."""
        yield from ()

    @classmethod
    def first_order(cls, setup: Setup, at: Solved) -> Array | None:
        """Return what is watched (n, R) from the solved setup to another one, by deeds of this kind; None: nothing."""
        total: Array | None = None
        for change in cls.changes(setup, at):
            total = change if total is None else total + change
        return total

    @classmethod
    def history(cls, setup: Setup, samples: np.ndarray, chain: Chain, before: Any) -> History | None:
        """Return what follows deeds of this kind through samples (n,) of the setup; None where nothing remembers.

        `before` is what a history remembered `after` the samples before these, or None.
        """
        return None
