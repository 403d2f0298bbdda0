"""What people type about recordings and corrected models: of which robot, written how, within which tolerances, with
which effects: 'physics@place[:aspect] name=value …'."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import typer

from .. import loading
from ..errors import InputError, PrupPinError, RecordingFileError, UnknownNameError, folder_holds, nearest_names
from ..files import as_path, is_file, is_path
from ..laws import Effect, Law, Place
from ..mechanism import Mechanism
from ..numbers import number, some
from ..recordings import ARM, TYPICAL, Recording, Tolerances, convention_of, joints_of, read_recording, read_tolerances
from ..recordings.table import ROBOT
from ..robot import Robot
from ..simulation import CorrectedModel, foreign_joints, misspelt_joints, read_model, unnamed_positions
from ..simulation.model_file import law_named, place_named
from ..views.text import terminal
from .options import ConventionOption, Reading, RecordingFiles, RobotOption, SetParameters, TolerancesOption, changes_of
from .typed import dimension_of, parse_quantity


def robot_read(
    reading: Reading,
    robot: str | None,
    model: CorrectedModel | None,
    named: Callable[[], str],
    settings: Sequence[str] | None,
) -> tuple[str, Robot, loading.Reading]:
    """Return a robot's name, it with parameters changed as typed, and how it was read.

    The one that is typed, else a corrected model's, of whose file what is typed wins, else the one `named`.
    """
    if robot is not None or model is None:
        name = robot or named()
        return name, *reading.changed(name, settings)
    typed = {name: value for name, value in vars(reading.understood()).items() if value}
    loaded = reading.checked(replace(model.read, **typed).load(model.robot))
    return model.robot, loaded.with_parameters(changes_of(loaded, settings or ())), model.read


def modelled(
    reading: Reading,
    model: CorrectedModel | None,
    robot: str | None,
    named: Callable[[], str],
    effects: Sequence[str] | None,
    settings: Sequence[str] | None,
) -> tuple[str, Robot, list[Effect]]:
    """Return name and robot, as `robot_read` does, and all effects: the model's, and those that are typed."""
    name, loaded, _ = robot_read(reading, robot, model, named, settings)
    typed = [parse_effect(text, loaded.mechanism) for text in effects or ()]
    return name, loaded, [*(model.effects if model else ()), *typed]


def refuse_unanswered(count: int, what: str, reasons: Mapping[str, str]) -> None:
    """Raise PrupPinError, with the reasons, where no row has what was asked for: an empty table helps nobody."""
    told = "\n".join(f"  {word}: {text}" for word, text in reasons.items())
    raise PrupPinError(f"none of {count} rows has {what}\n{told}")


def model_typed(path: Path) -> CorrectedModel:
    """Return the corrected model of a file; on stderr it is told what whoever uses it must know."""
    model = read_model(path)
    if model.caution:
        _note(f"'{path.name}': {model.caution}")
    return model


def robot_beside(named: str | None, source: Path) -> str:
    """Return the robot that a file names, as it was read: a path is beside that file, or in the working folder."""
    if named is None:
        raise InputError(f"which robot? '{source}' does not say; give --robot, for example --robot 3prup")
    if is_path(named) and not as_path(named).exists():
        told = source.with_suffix(".json") if source.suffix.lower() == ".csv" else source
        raise InputError(
            f"'{told}' names the robot '{named}': there is no such file beside it, nor in the working folder. "
            f"Correct it there, or give --robot.{folder_holds(source.parent, '.urdf', '.xml')}"
        )
    return named


def recording_typed(path: Path, robot: str | None, conventions: Sequence[str] | None) -> Recording:
    """Return the recording of a file, written as was typed; what an error advises to type has the robot typed."""
    try:
        read = read_recording(path)
    except RecordingFileError as error:
        if robot is None or not error.advice:
            raise
        advice = error.advice.replace(f"--robot {ROBOT}", f"--robot {shlex.quote(robot)}")
        raise RecordingFileError(path, error.problems, advice) from None
    for text in read.misspelt:
        _note(text)
    return with_conventions(read, conventions)


def note_foreign_joints(recordings: Sequence[Recording], robot: Robot) -> None:
    """Say, before anything else, which joints of recordings their robot does not have; of none at all others refuse."""
    for recording in recordings:
        refused = dict(misspelt_joints(recording, robot.mechanism))  # of which more will be said
        foreign = [name for name in foreign_joints(recording, robot.mechanism) if name not in refused]
        if foreign and len(foreign) < len({*recording.positions, *recording.efforts}):
            own, lacking = unnamed_positions(recording, robot.mechanism)
            renamed = f"rename {', '.join(own)}, where that is {', '.join(lacking)}, which has no column"
            _note(
                f"'{recording.path}' has columns of {', '.join(some(foreign))}, which '{robot.name}' has no "
                f"joint{'s' if len(foreign) > 1 else ''} of: not used. Is it a log of another robot?"
                + f" Else {renamed}"
                * bool(own)
            )


def of_the_robot(recording: Recording, named: str, robot: Robot, is_said: str = "--robot is") -> Recording:
    """Return the recording, with a remark where it says that it is of another robot than the one named so."""
    own = recording.robot
    if own is None or not {Path(own).name, Path(own).stem}.isdisjoint({Path(named).name, Path(named).stem, robot.name}):
        return recording
    told = f"The recording says that it is of '{own}', {is_said} '{named}'."
    return replace(recording, remarks=(*recording.remarks, told))


def _note(text: str) -> None:
    typer.echo(terminal.error_text(f"Note: {text}", terminal.console(stderr=True).width), err=True)


@dataclass(frozen=True)
class Bench:
    """The options that every command takes about recordings of one device: which, of which robot, written how."""

    recordings: RecordingFiles
    robot: RobotOption = None
    tolerances: TolerancesOption = None
    convention: ConventionOption = None
    set_parameters: SetParameters = None
    reading: Reading = field(default_factory=Reading)

    def understood(self, earlier: CorrectedModel | None = None) -> tuple[list[Recording], str, Robot, loading.Reading]:
        """Return the recordings, the robot's name, the robot, and how it was read; of an earlier model, its robot.

        What is typed wins over the model, and over what the recordings say.
        """
        of_model = None if earlier is None else earlier.robot
        read = [
            _with_tolerances(recording_typed(path, self.robot or of_model, self.convention), self.tolerances)
            for path in self.recordings
        ]
        first = next((recording for recording in read if recording.robot is not None), read[0])
        named, loaded, understood = robot_read(
            self.reading, self.robot, earlier, lambda: robot_beside(first.robot, Path(first.path)), self.set_parameters
        )
        note_foreign_joints(read, loaded)
        said = "--robot is" if self.robot else "the earlier model is of" if earlier else "they are taken for"
        return [of_the_robot(each, named, loaded, said) for each in read], named, loaded, understood


def with_conventions(recording: Recording, typed: Sequence[str] | None) -> Recording:
    """Return the recording written as was typed, COLUMNS=WORD each; without any as it is."""
    if not typed:
        return recording
    found = []
    for text in typed:
        columns, equals, said = text.partition("=")
        if not equals:
            raise InputError(f"--convention {text}: expected COLUMNS=WORD, for example wrench=reaction")
        try:
            found.append(convention_of(columns.strip(), said.strip(), joints_of(recording)))
        except InputError as error:
            raise InputError(f"--convention {text}: {error}") from None
    return replace(recording, conventions=tuple(found))


def tolerances_named(name: str) -> Tolerances:
    """Return the tolerances of that name or file."""
    named = {"typical": TYPICAL, "arm": ARM, "none": Tolerances()}
    if name in named:
        return named[name]
    if ("=" in name or name[:1].isdigit()) and not is_file(Path(name)):
        pairs = [part.partition("=") for part in (name if "=" in name else f"stiffness={name}").split(",")]
        inside = ", ".join(f'"{key.strip()}": {value.strip().replace("%", "e-2") or "0.1"}' for key, _, value in pairs)
        raise InputError(
            f"--tolerances '{name}': expected typical, arm, none or a JSON file. Write {{{inside}}} into a file "
            "tolerances.json, and --tolerances tolerances.json"
        )
    if not Path(name).suffix and not is_file(Path(name)):
        near = nearest_names(name, list(named))
        raise InputError(f"--tolerances '{name}': expected typical, arm, none or a JSON file. {near}")
    return read_tolerances(name)


def _with_tolerances(recording: Recording, name: str | None) -> Recording:
    """Return the recording with the tolerances of that name or file; without a name as it is."""
    if name is None:
        return recording
    wanted, declared = tolerances_named(name), recording.tolerances.declared
    remarks = recording.remarks
    if declared and wanted != recording.tolerances:
        remarks = (*remarks, f"The declared tolerances of {', '.join(declared)} give way to --tolerances {name}.")
    return replace(recording, tolerances=wanted, remarks=remarks)


# -- effects ----------------------------------------------------------------------------------------------------------


_FORM = re.compile(r"\s*(?P<physics>[^@\s]+)@(?P<place>[^@=]*?)(?P<values>(?:\s+[^\s=]+=\S+)*)\s*")
_EXPECTED = "expected 'physics@place[:aspect] name=value …', for example 'backlash@leg2/ball_nut half_gap=30um …'"


def parse_effect(text: str, mechanism: Mechanism) -> Effect:
    """Return an effect on this robot; values are SI, or carry a unit. Raises InputError with what was expected."""
    match = _FORM.fullmatch(text)
    if match is None:
        raise InputError(f"--effect '{text}': {_EXPECTED}; `prup-pin laws` lists them")
    physics, typed = match["physics"], match["place"].strip()
    try:
        law_named(physics)
        place = _place(physics, typed, mechanism)
        law = law_named(physics, place, mechanism)
        quantities = {quantity.name: quantity for quantity in law.quantities_at(place, mechanism)}
        values: dict[str, float] = {}
        for assignment in match["values"].split():
            key, _, value = assignment.partition("=")
            if key not in quantities:
                raise UnknownNameError(f"parameter of {physics}", key, list(quantities))
            if key in values:
                raise InputError(f"{key} is given twice")
            unit = quantities[key].unit
            values[key] = parse_quantity(value, dimension_of(unit), "--effect", text, text.index(assignment), unit)
        left_out = _neutral_beside(values, law, place, mechanism)
        if left_out:
            taken = ", ".join(f"{key} = {number(value)}" for key, value in left_out.items())
            typer.echo(f"--effect {physics}@{typed}: not given, so without effect: {taken}", err=True)
        values |= left_out
        missing = [item for item in quantities.values() if item.name not in {*values, *law.optional}]
        if missing:
            usual = law.starts(place, mechanism)[0]
            listed = ", ".join(
                f"{item.name} ({item.expected()}; a fit starts at {number(usual[item.name])})" for item in missing
            )
            raise InputError(f"missing {listed}")
        return Effect(law, place, values).checked(mechanism)
    except InputError as error:
        message = str(error)
        raise InputError(message if message.startswith("--effect") else f"--effect '{text}': {message}") from None


def _neutral_beside(values: Mapping[str, float], law: Law, place: Place, mechanism: Mechanism) -> dict[str, float]:
    """Return the parameters that were not typed and change nothing at a value, beside one of their kind that was."""
    starts, neutral = law.starts(place, mechanism)[0], law.neutral_at(place, mechanism)
    kind = {
        item.name: neutral[item.name]
        for item in law.quantities_at(place, mechanism)
        if neutral[item.name] != starts[item.name] and item.lowest <= neutral[item.name] <= item.upper
    }
    beside = not values.keys().isdisjoint(kind)
    return {name: value for name, value in kind.items() if beside and name not in {*values, *law.optional}}


def _place(physics: str, typed: str, mechanism: Mechanism) -> Place:
    """Return the place 'leg1/R_lambda:tilting'; names of a robot may hold a colon themselves."""
    try:
        return place_named(physics, typed, "", mechanism)
    except InputError:
        name, colon, aspect = typed.rpartition(":")
        if not colon:
            raise
        return place_named(physics, name.strip(), aspect.strip(), mechanism)
