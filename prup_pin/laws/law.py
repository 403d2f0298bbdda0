"""The contract of a law: one piece of physics that a simulation may have left out.

A law acts at a place, with a few parameters. What it does is a few deeds: a module's value is another, a module deforms
beyond its own law, an actuator stands elsewhere, a joint resists, a sensor reports something else (`deeds/`). A law
knows nothing of recordings, fits or other laws; several laws compose by acting one after the other.

To add one: a final class in a file of its own, and one line in `laws/__init__.py`.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Protocol

from ..errors import InputError, UnknownNameError
from ..mechanism import Changes, Mechanism
from ..parameters import Quantity
from .deeds import Deed, Felt, Solved
from .drawn import Drawn, against_load, against_motion
from .inputs import Inputs
from .setup import Setup


class Sharing(Protocol):
    """Recordings that share a sensor, by their places, and its tolerances by kind; `label` names one that is alone."""

    @property
    def label(self) -> str: ...
    @property
    def sources(self) -> tuple[int, ...]: ...
    @property
    def tolerances(self) -> Mapping[str, float]: ...


class Place(NamedTuple):
    """Where a law acts: a module or sensor by name, and which of its motions ('radial', 'axial', …; '' for all)."""

    name: str
    aspect: str = ""

    def __str__(self) -> str:
        return f"{self.name} ({self.aspect})" if self.aspect else self.name


class Law(ABC):
    """One piece of physics, with one optional method for each channel: `deeds` for poses, `efforts_per` of `EffortLaw`.

    Final subclasses are listed in `laws.LAWS` and `laws.efforts.EFFORT_LAWS`. What a diagnosis must know of a law is
    data of the law: it asks for no law's name or class.
    """

    #: The word of the diagnosis' vocabulary.
    physics: ClassVar[str]
    #: One sentence for people.
    summary: ClassVar[str]
    source: ClassVar[str] = ""
    #: What to do about it, one short sentence for a mechanic; {place} stands for where.
    remedy: ClassVar[str] = ""
    #: Its parameters with units and physical bounds. Defaults are where a fit starts.
    quantities: ClassVar[tuple[Quantity, ...]]
    #: Values at which it changes nothing, whatever the others are. They may lie on or beyond the bounds.
    neutral: ClassVar[Mapping[str, float]]
    #: True where it acts on the efforts of a robot in motion, False where it acts on poses.
    of_efforts: ClassVar[bool] = False
    #: Aspect of its places, where several laws share one word.
    variant: ClassVar[str] = ""
    #: What it cannot act without: the columns of 'temperature', 'speed' or 'wrench', 'gravity' of whatever source, or
    #: the robot's own 'weight' under a gravity that no column tells.
    needs: ClassVar[tuple[str, ...]] = ()
    #: How far its positive parameters usually lie from where a fit starts, as a standard deviation of logarithms.
    spread: ClassVar[float] = 2.0
    #: True where that is known beforehand of positive parameters that are 1 where a fit starts: they are fitted so.
    known: ClassVar[bool] = False
    #: In units of chi squared: how much better it must fit than an explanation that is there anyway.
    cost: ClassVar[float] = 0.0
    #: The load within which it turns over, as a gap does that closes: data hardly tell how far below them it is, and a
    #: step of a fit leads over it only where it is large.
    closes_within: ClassVar[str] = ""
    #: Sizes of parameters up to which it is what all such parts have, however well they are made: no finding where the
    #: noise is larger than what it does.
    unremarkable: ClassVar[Mapping[str, float]] = {}
    #: False for what goes on in a recording and tells nothing of another one.
    lasts: ClassVar[bool] = True
    #: True where parameters that are not given stand at their defaults.
    partial: ClassVar[bool] = False
    #: Parameters that stand at their defaults where they are not given.
    optional: ClassVar[tuple[str, ...]] = ()
    #: Kinds of modules where it is most often found; decides between places that data cannot tell apart.
    likely: ClassVar[tuple[str, ...]] = ()
    #: Size of its first parameter at which it is strong: data that could not show even that could not show the law.
    #: None: where a fit starts.
    strong: ClassVar[float | None] = None
    #: What it is called by people who look for it, beside its word: 'play, clearance'.
    called: ClassVar[str] = ""
    #: True where it is the robot's own weight: every robot has it, and a simulated recording may lack it.
    weighs: ClassVar[bool] = False
    #: False where no kind of tolerance covers it, though one covers other laws of the same word.
    toleranced: ClassVar[bool] = True
    #: True where it is how stiff a joint or a machine element is.
    of_stiffness: ClassVar[bool] = False
    #: What all its places are called together where one cause may act at all of them, whatever their names: one clock.
    all_places: ClassVar[str] = ""
    #: True where like places of the robot share one value of each parameter.
    shared: ClassVar[bool] = False
    #: True where it has one parameter for each of several places.
    for_each: ClassVar[bool] = False
    #: The sensor that is off, of those in `recordings.SENSORS`: recordings may have one for themselves.
    sensor: ClassVar[str] = ""
    #: The recordings in which alone it acts, where that is not all.
    group: Sharing | None = None
    #: True where it is all that acts in a simulation before anything is looked for, at values that may be others.
    is_all_that_acts: ClassVar[bool] = False
    #: The effect that was found before and in whose place it stands, where it does.
    instead_of: Effect | None = None

    @abstractmethod
    def places(self, mechanism: Mechanism) -> Sequence[Place]:
        """Return where on this robot the law can act."""

    def is_named(self, place: Place) -> bool:
        """Return whether a place is one of this law, of all that share its word, as far as its name tells."""
        return self.variant == place.aspect

    def deeds(self, place: Place, values: Mapping[str, float], setup: Setup) -> Iterable[Deed]:
        """Return what the law does to poses. `setup` is the simulation as the laws before it left it; it is only read.

        Nothing, of a law that shows in the efforts of a motion alone.
        """
        return ()

    def meanwhile(self, values: Mapping[str, float], mechanism: Mechanism, elapsed: float) -> Effect | None:
        """Return what another recording finds of what went on in one: as it was `elapsed` [s] after that began.

        None where that tells nothing of another recording, and of what lasts.
        """
        return None

    def written(self, place: Place, values: Mapping[str, float], setup: Setup, changes: Changes) -> Sequence[str]:
        """Write into a robot file's changes what a file can say of it; return what is left out, in words.

        setup: the simulation as the laws before it left it, on a recording without samples.
        """
        own = Changes(setup.mechanism)
        left = [deed.redraw(own) for deed in self.deeds(place, values, setup)]
        if None in left or not left:
            return (self.statement(place, values, setup.mechanism),)
        changes.add(own)
        return tuple(dict.fromkeys(text for text in left if text))

    def outline(self, place: Place, mechanism: Mechanism) -> tuple[Deed, ...]:
        """Return its deeds where a fit starts, on a recording without samples: their kinds and places."""
        nothing = Setup.nominal(mechanism, Inputs.empty(len(mechanism.actuated)))
        return tuple(self.deeds(place, self.starts(place, mechanism)[0], nothing))

    def drawn(self, place: Place, at: Solved) -> Drawn | None:
        """Return what its effect is drawn against; None where no single variable drives it.

        By its deeds: what resists a joint against the joint's motion, what acts through one module against the load of
        that module's motion.
        """
        deeds = self.outline(place, at.setup.mechanism)
        for joint in (deed.resisted_joint for deed in deeds):
            if joint is not None:
                return against_motion(at, joint)
        modules = {deed.only_module for deed in deeds}
        module = modules.pop() if len(modules) == 1 else None
        if module is None:
            return None
        return against_load(at, module, ASPECTS.get(place.aspect, slice(None)), any(deed.memory for deed in deeds))

    def shows_in(self, inputs: Inputs, place: Place, mechanism: Mechanism) -> bool:
        """Return whether these inputs could show it at a place, beyond what it `needs`."""
        return True

    def quantities_at(self, place: Place, mechanism: Mechanism) -> tuple[Quantity, ...]:
        """Return the parameters at a place, with units and starts that fit it."""
        return self.quantities

    def seen_at(self, place: Place, mechanism: Mechanism, felt: Felt, interval: float) -> tuple[Quantity, ...]:
        """Return the parameters with bounds and defaults of a fit to data in which the place `felt` that.

        interval: between samples [s]. Starts are moved as the defaults are.
        """
        return self.quantities_at(place, mechanism)

    def starts(self, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        """Return parameter values from which a fit starts; several where it may have several minima."""
        return [{quantity.name: float(quantity.default) for quantity in self.quantities_at(place, mechanism)}]  # type: ignore[arg-type]

    def starts_in(self, inputs: Inputs, place: Place, mechanism: Mechanism) -> Sequence[Mapping[str, float]]:
        """Return further values from which a fit to a recording of these inputs starts, where its samples ask for them.

        Many may be given: all are tried at the sizes that leave least, and only the best are fitted.
        """
        return ()

    def usual_at(self, place: Place, mechanism: Mechanism) -> Mapping[str, tuple[float, float]]:
        """Return mean and standard deviation of what is usual, by parameter that may be negative.

        Of those left out it is zero, and a multiple of where a fit starts.
        """
        return {}

    def neutral_at(self, place: Place, mechanism: Mechanism) -> Mapping[str, float]:
        """Return values of all parameters at which the law changes nothing."""
        return {**self.starts(place, mechanism)[0], **self.neutral}

    def magnified(self, value: float, times: float) -> float:
        """Return the value of the first parameter at which the law does so many times as much as at `value`.

        To first order, and in proportion unless a law says otherwise.
        """
        return times * value

    def multiple(self, value: float, of: float) -> float:
        """Return how many times as much as at `of` the law does at `value`: the inverse of `magnified`."""
        return value / of

    def same_places(self, place: Place, mechanism: Mechanism) -> Sequence[str]:
        """Return other parts to which one and the same effect could be ascribed just as well."""
        return ()

    def apart(self, place: Place, mechanism: Mechanism) -> Mapping[str, Place]:
        """Return where a law of the same word has a parameter alone, by parameter: of a law at many places at once."""
        return {}

    def statement(self, place: Place, values: Mapping[str, float], mechanism: Mechanism) -> str:
        """Return one sentence that a machine builder understands."""
        return f"{self.summary} at {place}"

    def told(
        self,
        place: Place,
        values: Mapping[str, float],
        intervals: Mapping[str, tuple[float, float]],
        mechanism: Mechanism,
    ) -> str:
        """Return the same of fitted values with their 95 % intervals: what may be nothing need not be told."""
        return self.statement(place, values, mechanism)

    def advice(self, place: Place, values: Mapping[str, float]) -> str:
        """Return what to do about it, in one short sentence; nothing where nobody knows."""
        return self.remedy.format(place=place.name)

    def misdeclared(self) -> Iterator[str]:
        """Yield in words what laws of its kind declare beside these, and it so that it cannot be used."""
        yield from ()


def is_untold(quantity: Quantity, interval: tuple[float, float]) -> bool:
    """Return whether an interval holds all that a quantity of either sign may be."""
    return min(interval) <= quantity.lower < 0 < quantity.upper <= max(interval)


def told_of(
    quantities: Sequence[Quantity], values: Mapping[str, float], intervals: Mapping[str, tuple[float, float]]
) -> Mapping[str, float]:
    """Return the values without those that are not told; all where none is."""
    untold = {item.name for item in quantities if item.name in intervals and is_untold(item, intervals[item.name])}
    return {name: value for name, value in values.items() if name not in untold} or values


class OffTheDrawing(Law):
    """A part is not where the drawing has it, by lengths of which what data do not tell is not told."""

    physics = "geometric_offset"
    cost = 3.0
    neutral: ClassVar = {}

    def neutral_at(self, place: Place, mechanism: Mechanism) -> Mapping[str, float]:
        return {quantity.name: 0.0 for quantity in self.quantities_at(place, mechanism)}

    def told(
        self,
        place: Place,
        values: Mapping[str, float],
        intervals: Mapping[str, tuple[float, float]],
        mechanism: Mechanism,
    ) -> str:
        return self.statement(place, told_of(self.quantities_at(place, mechanism), values, intervals), mechanism)


@dataclass(frozen=True)
class Effect:
    """A law at a place with values: a piece of physics added to a simulation."""

    law: Law
    place: Place
    values: Mapping[str, float]

    def deeds(self, setup: Setup) -> tuple[Deed, ...]:
        """Return what the law does to a setup, which is left as it is."""
        return tuple(self.law.deeds(self.place, self.values, setup))

    def statement(self, mechanism: Mechanism) -> str:
        """Return one sentence that a machine builder understands."""
        return self.law.statement(self.place, self.values, mechanism)

    @property
    def is_unremarkable(self) -> bool:
        """True where it is no more than all such parts have."""
        sizes = self.law.unremarkable
        return bool(sizes) and all(abs(self.values[name]) <= size for name, size in sizes.items())

    def checked(self, mechanism: Mechanism) -> Effect:
        """Return self, or raise UnknownNameError, ParameterError for a place or values that do not fit the robot."""
        places = list(self.law.places(mechanism))
        if self.place not in places:
            hint = "" if places else f"This robot has no place for {self.law.physics}."
            known = [str(place) for place in places]
            raise UnknownNameError(f"place of {self.law.physics}", str(self.place), known, hint)
        quantities = {quantity.name: quantity for quantity in self.law.quantities_at(self.place, mechanism)}
        for name in self.values:
            if name not in quantities:
                raise UnknownNameError(f"parameter of {self.law.physics}", name, list(quantities))
        missing = [name for name in quantities if name not in self.values and name not in self.law.optional]
        if missing and not self.law.partial:
            raise InputError(f"{self.law.physics} at {self.place}: no value for {', '.join(missing)}")
        for name, value in self.values.items():
            quantities[name].check(value, f"{self.law.physics} at {self.place}")
        return self


def defects(law: Law) -> Iterator[str]:
    """Yield in words what a law does not declare, or declares so that it cannot be used: all but what it computes."""
    for name in ("physics", "summary"):
        if not (isinstance(text := getattr(law, name, None), str) and text.strip()):
            yield f"{name} is {text!r}; expected a text"
    physics = getattr(law, "physics", "")
    if isinstance(physics, str) and physics and not re.fullmatch(r"[a-z][a-z0-9_]*", physics):
        yield f"physics is {physics!r}; expected a word of lower-case letters, digits and _"
    quantities: Any = getattr(law, "quantities", None)
    own = type(law)
    by_place = own.quantities_at is not Law.quantities_at
    some = isinstance(quantities, tuple) and bool(quantities or by_place)
    if not some or not all(isinstance(item, Quantity) for item in quantities):
        yield f"quantities is {quantities!r}; expected a tuple of Quantity(name, unit, description, start, ...)"
        return
    yield from (text for quantity in quantities for text in quantity.defects())
    names = {quantity.name for quantity in quantities}
    neutral = getattr(law, "neutral", {})
    some = bool(neutral) or own.neutral_at is not Law.neutral_at
    if not some or not isinstance(neutral, Mapping) or not all(isinstance(x, float | int) for x in neutral.values()):
        yield f"neutral is {neutral!r}; expected values at which it changes nothing, {{'name': 0.0}}"
    elif unknown := [name for name in neutral if names and name not in names]:
        yield f"neutral names {', '.join(unknown)}; its quantities are {', '.join(names)}"
    yield from law.misdeclared()


#: Load components of each motion of a joint module.
ASPECTS: Mapping[str, slice] = {
    "radial": slice(0, 2),
    "axial": slice(2, 3),
    "tilting": slice(3, 5),
    "rotational": slice(5, 6),
}
