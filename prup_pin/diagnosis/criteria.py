"""Every number that the diagnosis was tuned with, each once, each with its reason.

First what decides anywhere: chances and odds, shares, sizes. Then what a computation may cost and how exact it is. Last
what is known of robots, sensors and people, by the question where it counts. Numbers of one equation stand where they
are used.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from .chances import normal_isf

# == what decides: chances and odds ====================================================================================

#: Chance that anything of a whole library is accepted where nothing is there; that of anything one of many tests says.
FALSE_ALARM: Final = 0.01
#: Chance of calling pure noise a structure, over all tests of one residual.
STRUCTURE_CHANCE: Final = 1e-4
#: Standard deviations by which a residual of noise alone exceeds 1 less than once in 10^4 recordings.
CHANCE_DEVIATIONS: Final = normal_isf(STRUCTURE_CHANCE)
#: Standard errors over blocks that a saving must have, and deviations beyond which a number is clipped.
SURE: Final = normal_isf(FALSE_ALARM / 2)
#: A parameter farther than this many tolerances from the robot file is a finding, or farther where chance takes one of
#: so many parameters there; nor is a kind's tolerance declared wrong by more: what is farther off is something else.
#: So many times the noise is no noise any more.
BEYOND: Final = 3.0
#: A number so many standard deviations off is gross: normal numbers never are.
OUTLIER: Final = 6.0
#: Alternatives whose chi squared, or -2 log of the odds, is larger by less than this cannot be told apart.
INDISTINCT: Final = 13.0
#: Difference in chi squared beyond which more would not make a pair of explanations any clearer: so many INDISTINCT
#: leave one of them indistinct once in three hundred.
CERTAIN: Final = 4 * INDISTINCT
#: Chi squared, or -2 log of the odds, that a parameter must earn: a little more than the usual information criteria
#: ask, for a large library. So much, too, costs a tolerance of a kind that was declared wrong, must another kind of
#: thing be likelier to take a law's place, must a plan tell; and so much worse may the robot's own weight make a
#: calibration and still be taken to act, as it does on every real robot.
PARAMETER_COST: Final = 8.0
#: A lead in chi squared that decides nothing else: a likely place has it before one that data cannot tell from it, a
#: rival takes a term's place with more, so that two equals do not swap for ever, and what first order misjudges by less
#: is not simulated.
LEAD: Final = 1.0
#: Chi squared by which the robot's own weight must show to be told, and be likelier where nothing else loads the robot.
WEIGHT_SHOWS: Final = 2 * INDISTINCT

# == what decides: shares ==============================================================================================

#: Share of the held-out squared residual that a law must remove, or of its own gain by which another one is as good:
#: less cries wolf on clean recordings, may be a trace of what the rigid model and its filters leave, and is of no use.
#: A curve of no law that takes less than this share of what laws do at its joint is what every real joint has beyond
#: any. Poses are measured better than this share of what they were seen to move; loads that differ by less are one
#: load, repeated; and where the drawing, each module as soft as suits, leaves no more of what loads move, they are as
#: they are written.
GAIN: Final = 0.02
#: Share below which nobody minds: of what a law takes away, what a curve does in its place, or a body that cannot exist
#: does more than one that can, before the law only imitates it; of a joint's effort, friction is no better known; of
#: what is left of the joints in which a law acts where the drawing is taken to hold but for a few laws, gears that
#: yield leave a trace; of what is left in all, what a curve of no law takes away is not told.
NO_MATTER: Final = 0.05
#: So small a share is little: what may be left of what is explained; numbers of all that may be gross, before they
#: scatter more widely than their middle half says; distances of all reach that are no other machine's; a step of its
#: own uncertainty; of held-out squares what weights may do to a trace of the filters.
LITTLE: Final = 0.1
#: More than this share is most.
MOST: Final = 0.5
#: Places, laws, parameters, and variables that a deformation may follow, that take away at least this share of the
#: squares that the best one does, or of each other's, cannot be told from it.
ALIKE: Final = 0.95
#: Where one curve takes less than this share of what a deformation of its own at each sample does, it is no curve.
FOLLOWED: Final = 0.85
#: Share that is left where something leaves far less: of a log, as read otherwise, since faults of any size change
#: single parts and rarely bring a drastic change so near to the drawing; of efforts at rest without the robot's weight,
#: which are tared; and units of single drives save as much, or else a gain or two are laws of their joints.
#: Efforts of which more is left are strange: columns may be meant otherwise; a curve of no law that
#: takes more of what is left at its own joint is unknown physics; and no more of all numbers are gross.
FAR_LESS: Final = 1 / 3
#: A law beside what is unknown is doubtful that takes less than so many times what is left: it may imitate it.
IMITATED: Final = 100.0
#: What makes some sense leaves less than this share, and less than this share for each column that is read otherwise:
#: one of several that are wrong saves less. Efforts follow those of the rigid robot where shapes are so much alike.
MOSTLY: Final = 0.8
#: What leaves so many times as much as the best does is as good; what leaves more than so many times the noise lacks
#: something: of efforts, and while parameters are calibrated, whose last digits are not looked for then. Efforts that
#: are fewer or more times the rigid robot's are in another unit: masses are known to tens of per cent.
AS_GOOD: Final = 1.5
#: So many times as much is another thing: noise declared that is larger than repeats show, residuals in an interval
#: beside all others, positions beyond a joint's limits, a module that is softer than drawn, masses; what joints leave
#: that share one robot, of what they do with masses of their own; efforts after a correction that only took the robot
#: away; and of efforts whose noise is not declared, what is new in less than a tenth of its power from one sample to
#: the next, though nothing foretells it.
MUCH: Final = 3.0

# == what decides: sizes ===============================================================================================

#: Nearly the same: declared noise is rarely known better, and a residual of so many times the noise may be noise; a
#: finding without which no more would be left is told after what is unknown; units of single drives differ by more.
NEARLY: Final = 1.10
#: Roughly the same: where a law takes away all but GAIN, a slightly rough one is still the right one up to this many
#: times the noise, beside toleranced parameters that shift the load at which a gap closes or a joint slides; drives are
#: in one unit where most are so near to the usual one, whatever the tool holds.
ROUGHLY: Final = 1.25
#: What varies or acts by less does not [N, N m, m, rad, K, s]; nor is less than this share of anything something.
NOTHING: Final = 1e-6
#: A parameter whose usual change moves the whole residual by less than this share of the noise is not seen, nor one in
#: a combination of which it is less; nor is a preference for smooth curves, so weak beside what the data say; loads
#: below this share of their span are none; and first-order changes may misjudge a rival by this share of the effect.
UNSEEN: Final = 1e-3
#: Offsets and the like are rarely this many times larger than where a fit starts.
USUAL_MULTIPLE: Final = 30.0
#: ... but where they are, they may be so by far: of a square that is larger than this the logarithm counts.
TAIL: Final = 4.0
#: Freedom of Student's t, with which numbers far off weigh little while nothing is known: few, since some may be gross.
FREEDOM: Final = 3.0


def chance_bound(count: int) -> float:
    """Return how many times the noise the root mean square of `count` numbers of pure noise may be."""
    return 1 + CHANCE_DEVIATIONS * float(np.sqrt(0.5 / max(count, 1)))


def clean_bound(count: int) -> float:
    """Return the residual, in multiples of the noise, above which something is missing."""
    return max(NEARLY, chance_bound(count))


def beyond_tolerance(count: int) -> float:
    """Return how many tolerances off a parameter must be to be a finding, one of `count` that may be off."""
    return max(BEYOND, normal_isf(FALSE_ALARM / (2 * max(count, 1))))


def trusted(squares: np.ndarray) -> np.ndarray:
    """Return weights of three numbers that are off by these squares together, in multiples of their variance."""
    return (FREEDOM + 3) / (FREEDOM + squares)


# == what a computation may cost =======================================================================================
# Counted, never timed: the same recording is searched equally far on every machine.

#: More samples than this sharpen nothing that a law is chosen by, and are thinned: to whole blocks, or inside blocks
#: where fewer than FOLDS of them were left, which say too little of geometry.
MOST_SAMPLES: Final = 1200
#: Blocks of time, or pieces of a recording, whose residuals are independent of each other: fewer agree by accident.
BLOCKS: Final = 40
#: Parts into which blocks fall; each is left out once.
FOLDS: Final = 8
#: Fewer blocks than this cannot judge one another: of poses, pieces of them in time are then held out.
FEWEST_BLOCKS: Final = 4
#: Fewest samples in a block, or that follow another one in the same pose, and postures of which each is on its own.
FEWEST_IN_BLOCK, FEWEST_POSTURES = 12, 2
#: So often the signs of the residual's pieces are flipped to see what chance removes.
FLIPS: Final = 400
#: Each further effect makes the others harder to tell apart; beyond these the rest is called unknown.
MOST_TERMS: Final = 4
#: Fits through the whole simulation after which no further law is looked for: twice what two effects took, so that it
#: ends what would not end well, and nothing else; and laws of efforts.
MOST_FITS: Final = 60
#: ... where it only matters whether a law or two explain all that is left: what one effect and its rivals took.
FEW_FITS: Final = MOST_FITS // 4
#: Candidates that are simulated before a round, a term's place or a merger is given up; those that are tried to first
#: order, or on held-out blocks.
MOST_SIMULATED: Final = 6
TRIED: Final = 24
#: Rounds in which parameters and variances settle, each by the whole simulation; those in which hardly anything moves
#: any more; and steps that cost next to nothing.
ROUNDS: Final = 12
FEW_ROUNDS: Final = 3
ITERATIONS: Final = 60

# == how exact it is ===================================================================================================

#: Share below which a number is rounding.
ROUNDING: Final = 1e-9
#: Share of a parameter's tolerance or unit by which the simulation is differentiated.
STEP: Final = 1e-3
#: Logarithms beyond this are no numbers any more; intervals end there.
WIDEST_LOGARITHM: Final = 50.0
#: Farthest that a logarithm is moved at a time: a slope is trusted for no more.
WIDEST_STEP: Final = 2.0
#: What is left of a unit column beside those that are there, squared, below which it adds nothing of its own.
EFFORT_INDISTINCT = 1e-4
#: What is left of a unit column beside the others, squared, below which the motion does not tell it from them.
EFFORT_TOLD = 1e-8
#: Order of the whitening filters, and the white noise that is there in any case, as a share of a residual's power.
AR_ORDER, AR_FLOOR = 6, 0.01
#: A step that gains less chi squared than this changes nothing that is told; explanations that differ by less at all
#: poses and loads weighed are one and the same.
SETTLED: Final = 0.05
#: ... nor, where the mean squared residual exceeds AS_GOOD, one that gains less than UNSEEN of what exceeds it.
#: A step that does not help is shortened down to this share.
CALIBRATION_STEP: Final = 0.01
#: Logarithm by which a parameter may be off that may take what it likes: a stiffness may be a twentieth then, or so,
#: and robots that hang in threads take long to balance. A frame may stand anywhere.
FREELY: Final = 3.0

# == what is known of sensors ==========================================================================================

#: Fewer numbers tell no scatter, nor how a log is written: those of eight repeats of a position.
FEWEST_NUMBERS: Final = 2 * FEWEST_IN_BLOCK
#: What a good sensor has, where nothing is declared and nothing repeats [m, rad].
USUAL_POSITION_NOISE: Final = 1e-6
USUAL_ROTATION_NOISE: Final = 5e-6
#: Noise that every bench is better than, six columns [m, rad]: weights of positions against rotations.
COARSE: Final = (*3 * (USUAL_POSITION_NOISE / LITTLE,), *3 * (USUAL_ROTATION_NOISE / LITTLE,))
#: Runs without which it is not asked whether the pose sensor stands elsewhere in each, unless that is declared; drives
#: of which some show what one thing does to all; outlier intervals, beyond which such a thing is the robot's own.
FEWEST_OF_KIND: Final = 3
#: More than LITTLE of all numbers may be gross where the nearest of them is so many times as far off as the farthest of
#: the others: no law leaves that gap.
APART: Final = 20.0

# == is the log written as it says, and does it belong to the robot? ===================================================

#: Below this share of the robot's reach, and this angle, poses are the drawn ones as far as a convention can tell.
CONVENTION_FINE: Final = 3e-4
#: A sensor's frame up to this angle [rad], and this share of the reach, is nearly the base's.
CONVENTION_NEAR: Final = 0.05
#: A robot smaller than this is compared as if it were so large [m].
LEAST_REACH: Final = 0.1
#: A frame's tolerance beyond which its sensor stands anywhere [m], a turn counted at this lever [m]; and a target's.
OPEN_FRAME: Final = 0.05
LEVER: Final = 1.0
OPEN_TARGET: Final = LITTLE * OPEN_FRAME
#: Points without which no rigid motion is told, that must leave less than most of the distance to be taken.
FEWEST_REGISTERED: Final = 6
#: Orientations farther apart than this are no deflections either [rad]; by so much a base is tilted to tell weight.
TURNED: Final = 0.2
#: How far the logarithms of gains scatter about their middle; and robot files' masses about the true ones where nothing
#: is declared: drawings lack motors, or are of another make.
EFFORT_GAINS, EFFORT_MASSES = 1.0, 0.3

# == what is known of bodies ===========================================================================================

#: How likely it is that the tool holds a body, beside any link's being another than drawn; that a body of the robot
#: file is not there, of those. Of a link that is another: that it is so anyhow, and not in proportion or by its centre,
#: one as likely as the other: what fits neither and could be a body of its own is one sooner.
BODY_HELD, BODY_MISSING, LINK_ANYHOW = 0.5, 0.1, 0.01
LINK_KNOWN: Final = (1 - LINK_ANYHOW) / 2
#: A body that a tool holds: its mass as a share of the robot's, and its radii of gyration as shares of a link's length,
#: each with the standard deviation of its logarithm; the centre is a link's length off the tool.
HELD_MASS, HELD_RADIUS, HELD_SKEW = (0.05, 1.5), (0.25, 0.7), 0.15
#: Share by which something is off where it may be anything at all: a link's mass, inertia and centre (of its radius of
#: gyration); how soft a module is, while conventions compete.
ANYHOW = 0.5

# == what people read ==================================================================================================

#: Names, lines or readings that a sentence lists.
MOST_LISTED: Final = 5
#: Combinations of inertial parameters that a finding lists: the surest, no more than a person reads.
MOST_COMBINATIONS = 16
#: Laws of more parameters have no single size to tell.
MOST_PARAMETERS_TOLD: Final = 2
#: Knots of a recovered curve, means on each side of no load, and samples in each: enough for a gap with its two edges,
#: few enough for 40 samples and for a person.
KNOTS: Final = 7
#: Changes of a position, of a load or of all of a way below this share of their range are a tremor.
TREMOR: Final = 0.01

# == the next experiment ===============================================================================================

#: Explanations that it is to separate: the best ones.
MOST_PAIRS: Final = 10
#: Poses of the plan: what a bench test can do in an hour; twice as many where some pair needs more, and their cycles of
#: loads so often: as long as a first recording. Poses and mixed loads that are weighed.
PLANNED_POSES: Final = 4
MOST_PLANNED_POSES: Final = 2 * PLANNED_POSES
MOST_REPEATED: Final = 6
WEIGHED_POSES, WEIGHED_LOADS = 3 * PLANNED_POSES, 2 * PLANNED_POSES
#: Where no plan found tells a pair apart for certain, so often so many further poses and loads are weighed: anywhere,
#: and near the best ones, for a gap that just closes shows in few of them.
DEEPER_SEARCHES: Final = 2
DEEPER_CANDIDATES: Final = WEIGHED_POSES * WEIGHED_LOADS
#: Poses may lie outside the recorded ones by this share of their span, or by this much where they hardly vary [m, rad].
WIDER: Final = 0.25
LEAST_WIDER: Final = 0.02
#: Loads of the plan where the recording had smaller ones or none [N, N m].
LEAST_FORCE: Final = 50.0
LEAST_MOMENT: Final = 10.0
