"""`diagnose`: from a robot and a recording to a verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from threadpoolctl import threadpool_limits

from ..dynamics import is_standing
from ..errors import InputError, limits_heard, postures_beyond
from ..laws import MOVABLE
from ..recordings import Recording
from ..robot import Robot
from ..simulation import CorrectedModel, as_recorded
from ..simulation.needs import taking_part
from .account import Account, beside_laws, searched, with_first_law, without_laws, without_load
from .candidates import Candidate
from .chances import chi2_isf
from .conventions import read_logs
from .criteria import AS_GOOD, FALSE_ALARM, FEW_FITS, FEW_ROUNDS, LITTLE, MOST
from .diagnosis import Diagnosis, by_recording
from .efforts import diagnose_efforts
from .efforts.with_poses import (
    check_measured,
    diagnosis_of_efforts,
    has_efforts,
    has_poses,
    joined,
    together_in_time,
    with_efforts_at_rest,
    without_dead_efforts,
)
from .moved_sensor import moment_of_move
from .prepare import AsDrawn, Tell, drawn_problem, silent
from .propose_strain import strain_judged, strain_proposals
from .since import Earlier
from .spread import Spread
from .unexplained import final_state
from .verdict import verdict_of


def _only_forward(tell: Tell) -> Tell:
    """Return a `tell` whose share never goes back."""
    highest = 0.0

    def told(stage: str, share: float) -> None:
        nonlocal highest
        highest = max(highest, share)
        tell(stage, highest)

    return told


def diagnose(
    robot: Robot,
    recording: Recording | Sequence[Recording],
    *,
    against: CorrectedModel | None = None,
    propose: bool | Sequence[str] = False,
    tell: Tell = silent,
) -> Diagnosis:
    """Return what a recording, or several of one device, say that the simulation of `robot` left out.

    One that is written otherwise than it says (signs, units, orders, frames) is read as it seems to be meant, and that
    is the first finding.

    Each has its own noise, and where it says so its own sensors (`Recording.own_sensors`). `tell(stage, share)` hears
    how far it is. against: the corrected model of an earlier diagnosis of poses of this robot; then the simulation is
    that model, what its test knew is known, and the verdict says what has changed since (`Diagnosis.since`).

    propose: look for formulas where something is unknown (`Diagnosis.proposals`), or at these joints.

    Raises InputError where nothing was measured, where a recording does not belong to this robot at all (units, frames,
    another machine) or is given twice, or the earlier model is of another robot, does not say what it knows or was
    changed by hand;
    UnknownNameError where a recording lacks the actuators' positions.
    """
    # With several threads the last digits of a product may differ from run to run, and a close race with them.
    with threadpool_limits(1, user_api="blas"), limits_heard() as heard:
        tell = _only_forward(tell)
        tell("how the log is written", 0.0)
        earlier = None
        given = [recording] if isinstance(recording, Recording) else list(recording)
        check_measured(robot, given)
        given, dead, columns = without_dead_efforts(given, robot.mechanism)
        if against is not None:
            earlier = Earlier.of(against, robot, given)
            given = [earlier.as_compared(item) for item in given]
        logs = read_logs(robot, given)
        if earlier is None:
            found = logs.before(_of_channels(robot, logs.recordings, tell, propose))
        else:
            found = logs.before(_changed(robot, logs.recordings, earlier, tell))
    remarks = (*taking_part(robot.mechanism), *found.remarks, *postures_beyond(heard))
    premises, unused = (*dead, *found.premises), (*columns, *found.unused_columns)
    return replace(found, remarks=tuple(dict.fromkeys(remarks)), premises=premises, unused_columns=unused)


def _of_channels(robot: Robot, given: Sequence[Recording], tell: Tell, propose: bool | Sequence[str]) -> Diagnosis:
    """Return the diagnosis of what was recorded: poses and markers, efforts, or both."""
    mechanism = robot.mechanism
    if not given or not has_efforts(given, mechanism):
        return _diagnosed(robot, given, tell, propose)
    poses = [item.with_measurements(efforts={}) for item in given] if has_poses(given, mechanism) else []
    positions = [name for name in mechanism.actuated if name in given[0].positions]
    if poses and is_standing(given[0], positions):
        return with_efforts_at_rest(_diagnosed(robot, poses, tell, propose), robot, given)
    adapted = as_recorded(robot, given)
    efforts = diagnose_efforts(adapted.robot, together_in_time(given, adapted.robot.mechanism), tell, propose=propose)
    if not poses:
        found = diagnosis_of_efforts(efforts, given, mechanism)
        return replace(found, remarks=(*adapted.remarks, *found.remarks))
    return joined(_diagnosed(robot, poses, tell, propose), efforts)


def _changed(robot: Robot, recordings: Sequence[Recording], earlier: Earlier, tell: Tell) -> Diagnosis:
    """Return what has changed since an earlier test, by poses. Raises InputError where there are efforts alone."""
    if has_efforts(recordings, robot.mechanism) and not has_poses(recordings, robot.mechanism):
        raise InputError(
            "only efforts were recorded (columns tau.<joint>), and what has changed since an earlier test is told by "
            "poses alone so far: record where the tool or markers are (columns p.x … r.z), or diagnose this recording "
            "by itself, without an earlier model, and compare the two"
        )
    drawn = drawn_problem(robot, recordings, tell, earlier)
    return _told(without_load(drawn) or searched(without_laws(drawn.prepared(), tell), tell), tell)


def _diagnosed(
    robot: Robot, recordings: Sequence[Recording], tell: Tell, propose: bool | Sequence[str] = False
) -> Diagnosis:
    """Return the diagnosis of poses and markers by the account of them that leaves noise, if one does.

    Most robots under load lack a law or two and no more; on one that nobody has calibrated everything is off.
    """
    drawn = drawn_problem(robot, recordings, tell)
    refused = without_load(drawn)
    if refused is not None:
        return _told(refused, tell)
    if drawn.is_loaded:
        found = _under_loads(drawn, tell)
        if not (found.is_clean and found.problem.noise == drawn.problem.noise):
            found = _without_gross_errors(drawn, found, tell)
    else:  # nothing but weight loads it: what is off all over is asked first
        found = searched(_all_over(drawn, tell, drawn.spread) or without_laws(drawn.prepared(drawn.spread), tell), tell)
    spread = found.prepared.spread
    if spread is not None and spread.outliers:
        found = _with_outliers(drawn, found, spread, tell)
    few = spread is not None and spread.of_few and not found.prepared.kinds
    if few and (not found.is_clean or found.problem.noise.source == "residual"):
        # the few places were not to be found, or what they leave was taken for noise
        again = _all_over(drawn, tell)
        found = found if again is None else _cleaner(found, searched(again, tell))
    return _told(_with_moved_sensor(found, tell), tell, propose)


def _told(found: Account, tell: Tell, propose: bool | Sequence[str] = False) -> Diagnosis:
    """Return the diagnosis of what was found."""
    prepared, problem, selection, labels = found.prepared, found.problem, found.selection, found.labels
    tell("the verdict", 0.9)
    final = final_state(problem, selection, prepared, labels, tell, found.doubt)
    diagnosis = verdict_of(problem, selection, final, prepared, labels, tell)
    seen = diagnosis.residuals
    residuals = None if seen is None else (seen.before, seen.after, seen.exists)
    told = by_recording(prepared.together, problem.noise, diagnosis.samples, residuals)
    proposed = tuple(strain_proposals(problem, final, labels)) if propose else ()
    judged = tuple(strain_judged(problem, final))
    return replace(diagnosis, recordings=told, own_by_run=prepared.together.by_run, proposals=proposed, judged=judged)


# -- accounts of one recording -----------------------------------------------------------------------------------------


def _under_loads(drawn: AsDrawn, tell: Tell) -> Account:
    """Return the account of a loaded robot: whatever is off all over, where few laws do not do.

    Few laws that leave no more than the noise that was declared are the answer. Where they do not, or would do with a
    larger noise, what is off all over is asked, and beside the first law, which may hide it; before them where that
    explains more, and one law more leaves far more than noise.
    """
    begun = with_first_law(drawn.prepared(), tell)
    over = whole = None
    asked = begun.is_far_from_clean
    if asked:
        over = _all_over(drawn, tell) or _beside(drawn, begun, tell)
        many = over is not None and over.prepared.spread is not None and not over.prepared.spread.of_few
        if over is not None and many and _explains_more(over, begun) and not begun.lacks_few_laws:
            whole = searched(over, tell)
            if whole.is_clean:
                return whole
    few = searched(begun, tell, FEW_FITS)
    if few.is_clean and few.problem.noise == begun.problem.noise:
        return few
    over = over if asked else _all_over(drawn, tell)
    if over is not None:
        whole = whole or searched(over, tell)
        if not whole.is_clean:  # a large fault may hide what is off all over, and has come to light among few laws
            beside = _beside(drawn, few, tell)
            whole = whole if beside is None else _cleaner(whole, searched(beside, tell))
        if _explains_more(whole, few):
            return whole
    return few if few.selection.fits <= FEW_FITS else searched(few, tell)


def _all_over(drawn: AsDrawn, tell: Tell, spread: Spread | None = None) -> Account | None:
    """Return what the first law leaves beside all that is off all over; None where nothing is.

    spread: what is off, where it was asked otherwise than by what few laws could explain as well.
    """
    if spread is None:
        spread = drawn.spread and drawn.spread.all_over()
    prepared = drawn.prepared(spread)
    if not prepared.kinds:
        return None
    begun = with_first_law(prepared, tell)
    for _ in range(FEW_ROUNDS):
        again = _beside(drawn, begun, tell)
        if again is None:
            break
        begun = again
    return begun


def _beside(drawn: AsDrawn, begun: Account, tell: Tell) -> Account | None:
    """Return what an account's laws leave beside what is off all over, asked while they act; None where nothing is.

    A law that no kind stands for is noise to the kinds. Where these were asked already, they are told anew only where
    less is left for noise, by more than chance.
    """
    terms, before = begun.selection.last.terms, begun.prepared.spread
    effects = begun.selection.last.effects
    spread = drawn.spread_beside(effects) if terms else None
    if spread is None:
        return None
    if before is not None:
        most = chi2_isf(FALSE_ALARM / len(begun.prepared.library), sum(term.candidate.size for term in terms))
        if spread.minus_2_log_noise >= before.minus_2_log_noise - most:
            return None
    prepared = drawn.prepared(spread.all_over(), effects)
    return beside_laws(prepared, terms, tell) if prepared.kinds else None


def _without_gross_errors(drawn: AsDrawn, found: Account, tell: Tell) -> Account:
    """Return the account without what no sample but a few bears out beside the laws found, where that leaves noise."""
    for fewer in drawn.without_gross_errors(found.selection.last):
        again = _cleaner(found, _under_loads(fewer, tell))
        if again is not found:
            return again
    return found


def _with_outliers(drawn: AsDrawn, found: Account, spread: Spread, tell: Tell) -> Account:
    """Return the account of all that was measured, where that explains outliers: what does so says that they are none.

    Those that came again while nothing moved are asked by any law, others by one that shows beside all that is off.
    """
    every = drawn.spread
    assert every is not None
    every = (every.all_over() if found.prepared.kinds else every).with_all(drawn.problem.stack.exists)
    if spread.repeated(found.prepared.inputs.blocks):
        return _cleaner(found, searched(without_laws(drawn.prepared(every), tell), tell))
    begun = _all_over(drawn, tell, every)
    if begun is None or not begun.selection.last.terms:
        return found
    return _cleaner(found, searched(begun, tell))


def _with_moved_sensor(found: Account, tell: Tell) -> Account:
    """Return the account with what was moved while it measured, where that leaves noise and else more."""
    prepared, problem = found.prepared, found.problem
    if found.is_clean or found.doubt is not None or prepared.together.several:
        return found
    mechanism = problem.simulator.robot.mechanism
    tried: set[frozenset[str]] = set()
    for fit in (found.selection.last, problem.first):
        movable = [(law, law(0.0)) for law in MOVABLE]
        asked = [(law, always) for law, always in movable if always.places(mechanism)]
        moments = [(law, moment_of_move(problem, fit, found.labels, always)) for law, always in asked]
        moved = [law(moment) for law, moment in moments if moment is not None]
        added = [Candidate(law, place, mechanism) for law in moved for place in law.places(mechanism)]
        names = frozenset(candidate.name for candidate in added)
        if not names or names in tried:
            continue
        tried.add(names)
        library = [*prepared.library, *added]
        again = _cleaner(found, searched(without_laws(replace(prepared, library=library), tell), tell))
        if again is not found:
            return again
    return found


def _explains_more(again: Account, few: Account) -> bool:
    """Return True where what is off all over leaves a small part of what few laws do, or noise where they leave more.

    By the noise beside what is off all over, which may be known from nothing else; and only where blocks that were held
    out are near it too: many parameters follow a few poses, and foretell no other.
    """
    (left, _), (before, may_be_noise) = again.by_noise(again.noise), few.by_noise(again.noise)
    foretold = again.is_clean and left < AS_GOOD**2 * again.size
    return left < (1.0 if foretold and not may_be_noise else LITTLE) * before


def _cleaner(found: Account, again: Account) -> Account:
    """Return another account if it leaves noise alone, of more that was measured or by more than what was found."""
    more = len(again.prepared.outliers) < MOST * len(found.prepared.outliers)
    return again if again.is_clean and (not found.is_clean or more or _explains_more(again, found)) else found
