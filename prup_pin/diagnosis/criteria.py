"""Every number that the diagnosis was tuned with, by the question that it decides, each with its reason.

Numbers of one equation, and what keeps a division from zero, stand where they are used.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from .chances import normal_isf

# -- is what is left noise? --------------------------------------------------------------------------------------------

#: Declared noise is rarely known better than this: a residual of so many times the noise may be noise.
NOISE_LIKE: Final = 1.10
#: Standard deviations by which a residual of noise alone exceeds 1 less than once in 10^4 recordings.
CHANCE_DEVIATIONS: Final = 4.0
#: Chance of calling pure noise a structure, over all tests of one residual.
STRUCTURE_CHANCE: Final = 1e-4
#: Pieces of a recording, or poses, that tell a structure from noise by signs: fewer agree by accident.
FEWEST_PIECES: Final = 40
#: ... or samples that follow another one in the same pose. With fewer of both a residual larger than a declared noise
#: is not called noise.
FEWEST_FOLLOWERS: Final = 12
#: Where a law takes away all but this share, a slightly rough law is still the right one, beside toleranced parameters
#: that shift the load at which a gap closes or a joint slides ...
ROUGH_SHARE: Final = 0.02
#: ... up to this many times the noise.
ROUGH: Final = 1.25
#: Share of what poses were seen to move that may be left where nothing tells the noise but what is left: a pose sensor
#: is better than this.
POSE_UNTOLD: Final = 0.02
#: Declared noise this many times what repeats show hides effects, and is told.
MUCH_LARGER: Final = 3.0


def chance_bound(count: int) -> float:
    """Return how many times the noise the root mean square of `count` numbers of pure noise may be."""
    return 1 + CHANCE_DEVIATIONS * float(np.sqrt(0.5 / max(count, 1)))


def clean_bound(count: int) -> float:
    """Return the residual, in multiples of the noise, above which something is missing."""
    return max(NOISE_LIKE, chance_bound(count))


#: What varies or acts by less does not [N, N m, m, rad, K, s].
NOTHING: Final = 1e-6

# -- what is the noise? ------------------------------------------------------------------------------------------------

#: Wrenches of one block that differ by less than this share of the largest are one load, repeated.
SAME_LOAD: Final = 0.02
#: Fewer numbers tell no scatter: those of eight repeats of a position.
FEWEST_NUMBERS: Final = 24
#: Numbers farther out than this many standard deviations are outliers.
CLIP: Final = 2.5
#: What a good sensor has, where nothing is declared and nothing repeats [m, rad].
USUAL_POSITION_NOISE: Final = 1e-6
USUAL_ROTATION_NOISE: Final = 5e-6

# -- which samples, which laws? ----------------------------------------------------------------------------------------

#: More samples than this sharpen nothing that a law is chosen by, and are thinned: to whole blocks, or inside blocks
#: where fewer than FOLDS of them were left, which say too little of geometry.
MOST_SAMPLES: Final = 1200
#: Below this change of temperature growth hides in the noise of a thermometer [K].
LEAST_WARMING: Final = 0.2

# -- does a law enter? -------------------------------------------------------------------------------------------------

#: Chance that anything of the whole library is accepted on a clean recording.
FALSE_ALARM: Final = 0.01
#: Share of the held-out squared residual that a law must remove: less than this cried wolf on clean recordings.
LEAST_GAIN: Final = 0.01
#: Parts into which blocks fall for that; each is left out once.
FOLDS: Final = 7
#: Fewer blocks than this leave too little to fit; pieces of them in time are then held out.
FEWEST_FOR_FOLDS: Final = 5
#: So often the signs of the residual's pieces are flipped to see what chance removes.
FLIPS: Final = 200

# -- what does a law cost? ---------------------------------------------------------------------------------------------

#: Chi squared that a parameter must earn: a little more than the usual information criteria ask, for a large library.
PARAMETER_COST: Final = 8.0
#: Offsets and the like are rarely this many times larger than where a fit starts.
USUAL_MULTIPLE: Final = 30.0
#: ... but where they are, they may be so by far: of a square that is larger than this the logarithm counts.
TAIL: Final = 4.0
#: Alternatives whose chi squared is larger by less than this cannot be told apart.
INDISTINCT: Final = 13.0
#: Alternatives within this many times INDISTINCT are worth an experiment that separates them; those that cost so much
#: more by values that are unusual are none.
WORTH_SEPARATING: Final = 3
#: ... so many of them: the plan is for the best ones.
MOST_PAIRS: Final = 10

# -- how far is the search driven? -------------------------------------------------------------------------------------

#: Each further effect makes the others harder to tell apart; beyond these the rest is called unknown.
MOST_TERMS: Final = 4
#: First-order changes may misjudge a rival's chi squared by this share of the effect's.
CURVATURE: Final = 1.5e-3
#: Candidates that are simulated before a round, a term's place or a merger is given up.
MOST_SIMULATED: Final = 6
#: A lead in chi squared that decides nothing else: a likely place has it before one that data cannot tell from it, a
#: rival takes a term's place with more, so that two equals do not swap for ever, and what first order misjudges by less
#: is not simulated.
LEAD: Final = 1.0
#: Rivals that change the pose in directions this close to parallel, and chi squared alike, are tried once.
PARALLEL: Final = 1e-6

# -- what may a search cost? -------------------------------------------------------------------------------------------
# Counted, never timed: the same recording is searched equally far on every machine.

#: Fits through the whole simulation after which no further law is looked for: twice what two effects took, so that it
#: ends what would not end well, and nothing else.
MOST_FITS: Final = 60
#: ... where it only matters whether a law or two explain all that is left: what one effect and its rivals took.
FEW_FITS: Final = 15

# -- where does it sit? ------------------------------------------------------------------------------------------------

#: Places, and variables that a deformation may follow, that take away at least this share of what the best one does
#: cannot be told from it.
ALIKE: Final = 0.95
#: Knots of a recovered curve: enough for a gap with its two edges, few enough for 40 samples.
KNOTS: Final = 7
#: Preference for smooth curves, as a share of what the data say: too weak to be seen, enough where there are none.
SMOOTH: Final = 1e-3
#: A deformation that reaches the tool this much less than the best one is not seen.
NOT_REACHING: Final = 1e-6

# -- what is drawn? ----------------------------------------------------------------------------------------------------

#: Means on each side of no load, and samples in each: a curve with bands that a person can read.
MOST_BINS: Final = 8
SAMPLES_A_BIN: Final = 6
#: Loads below this share of their span are none.
NO_LOAD: Final = 2e-3

# -- is a law an imitation? --------------------------------------------------------------------------------------------

#: A law is doubtful that gains less than so many times what is left.
IMITATED: Final = 100.0

# -- how sure is a value? ----------------------------------------------------------------------------------------------

#: A parameter whose usual change moves the whole residual by less than this share of the noise is not seen.
UNSEEN: Final = 1e-3
#: Logarithms beyond this are no numbers any more; intervals end there.
WIDEST_LOGARITHM: Final = 50.0

# -- what could these data not have shown? -----------------------------------------------------------------------------

#: Laws of more parameters have no single size to tell.
MOST_PARAMETERS_TOLD: Final = 2

# -- what does a deformation follow that no law explains? --------------------------------------------------------------

#: Changes of a position or load below this share of their range are no way that it came.
TREMOR: Final = 0.01

# -- what would tell more? ---------------------------------------------------------------------------------------------

#: Poses and mixed loads that are weighed, and poses of the plan: what a bench test can do in an hour.
WEIGHED_POSES: Final = 12
WEIGHED_LOADS: Final = 8
PLANNED_POSES: Final = 4
#: ... as many as this where some pair needs more, and their cycles of loads so often: as long as a first recording.
MOST_PLANNED_POSES: Final = 8
MOST_REPEATED: Final = 6
#: Poses are come to across this share of a joint's range, where what is unknown depends on the side.
APPROACHED_FROM: Final = 0.05
#: A plan is proposed from this on, in chi squared: twice the noise of what it compares.
WORTH_DOING: Final = 4.0
#: Where no plan found tells a pair apart for certain, so often so many further poses and loads are weighed: anywhere,
#: and near the best ones, for a gap that just closes shows in few of them.
DEEPER_SEARCHES: Final = 2
DEEPER_CANDIDATES: Final = 96
#: ... unless all poses and loads weighed differ by less than this, in chi squared: the two are one and the same.
NOWHERE_APART: Final = 0.01
#: What else might tell such a pair apart is simulated: loads so many times as large, the base tilted by so much [rad].
LARGER_LOADS: Final = 3.0
TILTED_BASE: Final = 0.2
#: Difference in chi squared beyond which more would not make a pair of explanations any clearer: so many INDISTINCT
#: leave one of them indistinct once in three hundred.
CERTAIN: Final = 4 * INDISTINCT
#: Poses may lie outside the recorded ones by this share of their span, or by this much where they hardly vary [m, rad].
WIDER: Final = 0.25
LEAST_WIDER: Final = 0.02
#: Loads of the plan where the recording had smaller ones or none [N, N m].
LEAST_FORCE: Final = 50.0
LEAST_MOMENT: Final = 10.0

# -- is the log written as it says? ------------------------------------------------------------------------------------

#: Share (RMS) of what a log leaves as it is written, that it may leave as read otherwise for that to be told. Faults
#: of any size change single parts, and rarely bring a drastic change so near to the drawing.
CONVENTION_LEAVES: Final = 1 / 3
#: Readings that leave no more than so many times what the best one does are as good.
CONVENTION_AS_GOOD: Final = 1.5
#: Below this share of the robot's reach, and this angle, poses are the drawn ones as far as a convention can tell.
CONVENTION_FINE: Final = 3e-4
#: A sensor's frame up to this angle [rad], and this share of the reach, is nearly the base's.
CONVENTION_NEAR: Final = 0.05
#: Loads are asked where the drawing, each module as soft as suits, leaves more of what they move than this share.
CONVENTION_SHOWN: Final = 0.03
#: Standard deviation of how much softer a module is than drawn, while conventions compete.
CONVENTION_SOFTER: Final = 0.5
#: ... and so many times at most: a unit is not everything made softer.
CONVENTION_SOFTEST: Final = 3.0

# -- does the recording belong to the robot? ---------------------------------------------------------------------------

#: Positions farther apart than this share of the robot's reach are neither deflections nor errors of a calibration.
FAR: Final = 0.1
#: ... and, where these are declared, so many tolerances of markers, zeros and links.
ALLOWED_TOLERANCES: Final = 4.0
#: A robot smaller than this is compared as if it were so large [m].
LEAST_REACH: Final = 0.1
#: A frame's tolerance beyond which its sensor stands anywhere [m], a turn counted at this lever [m]; and a target's.
OPEN_FRAME: Final = 0.05
LEVER: Final = 1.0
OPEN_TARGET: Final = 5e-3
#: Points without which no rigid motion is told, and the share of the distance that it must leave to be taken.
FEWEST_REGISTERED: Final = 6
REGISTERED: Final = 0.5
#: Orientations farther apart than this are no deflections either [rad].
TURNED: Final = 0.2
#: Noise that every bench is better than [m, rad]: weights of positions against rotations.
COARSE: Final = (1e-5, 1e-5, 1e-5, 5e-5, 5e-5, 5e-5)
#: Cosine below which measured gravity is the opposite of the robot file's.
UPSIDE_DOWN: Final = -0.9

# -- calibration within tolerances -------------------------------------------------------------------------------------

#: Gauss-Newton steps: tolerances are up to a hundred times the noise, and four or five steps settle them.
CALIBRATION_ROUNDS: Final = 12
#: ... and fewer where they decide no more than how weight acts.
FEW_CALIBRATION_ROUNDS: Final = 3
#: ... each followed by this many at most with the same derivatives, which cost several times what a step does.
CALIBRATION_CHORDS: Final = 3
#: A step that gains less chi squared than this changes nothing that is told.
SETTLED: Final = 0.05
#: ... nor, where the mean squared residual exceeds this, one that gains less than this share of what exceeds it.
MUCH_LEFT: Final = 1.5
SETTLED_SHARE: Final = 1e-3
#: A step that does not help is shortened down to this share.
CALIBRATION_STEP: Final = 0.01
#: Cosine of two parameters' changes beyond which they are told only together.
TWINS: Final = 0.995
#: A parameter farther than this many tolerances from the robot file is a finding, or farther where chance takes one of
#: so many parameters there; nor is a kind's tolerance declared wrong by more: what is farther off is something else.
BEYOND: Final = 3.0
#: Chi squared by which the robot's own weight may make a calibration worse and still be taken to act, as it does on
#: every real robot: what noise does to it once in two hundred times; and by which weight beside a payload must be
#: likelier ...
WEIGHT_ACTS: Final = 8.0
#: ... or where nothing else loads the robot, and by which it must show to be told: three deviations and more.
WEIGHT_SHOWS: Final = 25.0
#: ... and after the first step: with or without weight, what is this many times worse is not followed to its end.
FAR_BEHIND: Final = 4.0
#: Logarithm by which a parameter may be off that may take what it likes: a stiffness may be a twentieth then, or so,
#: and robots that hang in threads take long to balance. A frame may stand anywhere.
FREELY: Final = 3.0
#: ... nor what is this many times worse when its own first derivatives lead no further.
NOT_BEHIND: Final = 1.5
#: Tolerances by which a parameter may move before the simulation is differentiated anew.
STALE: Final = 0.5
#: -2 log of the odds that a kind's tolerance was declared wrong: one in some ninety.
RESCALING_COST: Final = 9.0


def beyond_tolerance(count: int) -> float:
    """Return how many tolerances off a parameter must be to be a finding, one of `count` that may be off."""
    return max(BEYOND, normal_isf(FALSE_ALARM / (2 * max(count, 1))))


# -- efforts -----------------------------------------------------------------------------------------------------------

#: Blocks of time whose residuals are taken to be independent of each other; fewer where they would be too short.
EFFORT_BLOCKS = 40
#: Fewest kept samples in a block; and postures at rest, of which each is on its own.
FEWEST_IN_BLOCK, FEWEST_POSTURES = 12, 2
#: Folds of blocks that are held out in turn.
EFFORT_FOLDS = 8
#: Turned residuals that chance is judged by, and the share of them that may look as good as what is accepted.
EFFORT_FLIPS, EFFORT_CHANCE = 400, 0.01
#: Share of the held-out squares that a law must save: below, what it says would not be of use, and may be a trace of
#: what the rigid model and its filters leave.
EFFORT_GAIN = 0.02
#: The same where the drawing is taken to hold but for a few laws: one of them accuses a part, and is not to be a trace
#: of gears that yield by a part of the noise.
EFFORT_GAIN_ALONE = 0.05
#: Standard errors over blocks that a saving must have.
EFFORT_SURE = 2.5
#: What is left of a unit column beside those that are there, squared, below which it adds nothing of its own.
EFFORT_INDISTINCT = 1e-4
MOST_EFFORT_TERMS = 60
#: Share of the squared strain of parameters beyond tolerance that one law must take off to stand for them.
EFFORT_RELIEF = 0.5
#: Columns that follow from what is known are made anew where what is left has fallen below this share of what it was.
EFFORT_STALE = 0.5
#: What is left of a unit column of inertial parameters beside the others, squared, below which the motion does not tell
#: it from them.
EFFORT_TOLD = 1e-8
#: Combinations of inertial parameters that a finding lists: the surest, no more than a person reads.
MOST_COMBINATIONS = 16
#: Order of the whitening filters, and the white noise that is there in any case, as a share of a residual's power.
AR_ORDER, AR_FLOOR = 6, 0.01
#: Share of the held-out squares by which plain weights must be better than whitened ones: less than this, a law that is
#: a trace of the filters may save, and whitening knows more of noise.
EFFORT_PLAINLY = 0.1
#: Share of what is left that a curve of no law must take away, held out, to be told as unknown: of all joints, or of
#: its own.
EFFORT_CURVE_GAIN, EFFORT_CURVE_OWN = 0.05, 0.3
#: Share of what all links together take away that one body alone must, to be told beside.
EFFORT_ALONE = 0.5
#: ... and the share of what the laws take away there: less is what every real joint has beyond any law.
EFFORT_MATERIAL = 0.005
#: Of one sample's noise, what a law must add to some joint's effort to be told: gears that yield add a part of it.
EFFORT_MATTERS = 0.5
#: A law at the same joint imitates such a curve where the curve saves more than this share of what the law does.
EFFORT_IMITATED = 0.03
#: Multiple of the declared noise beyond which what is left is not noise.
EFFORT_LOUD = 1.5
#: Multiple of the noise from which samples are looked at as an event that is none of the robot's own, that from which
#: one is told, and how many times it is what is left elsewhere. Most of the samples, and most events: what comes more
#: often is the robot's own.
EFFORT_EVENT_LOUD, EFFORT_EVENT, EFFORT_EVENT_APART = 6.0, 12.0, 3.0
MOST_IN_EFFORT_EVENTS, MOST_EFFORT_EVENTS = 0.1, 3
#: Share of the efforts, of all or of a joint, that may be left where no noise was declared, and nothing be missing; and
#: the multiple of one sample's noise beyond which more than that is none: it would be new in less than a sixteenth of
#: its power from sample to sample, though nothing foretells it.
EFFORT_UNTOLD, EFFORT_NO_NOISE = 0.1, 4.0
#: ... and the share that the drawing leaves beyond which a correction that leaves so much only took the robot away.
EFFORT_FOREIGN = 2.0
#: Share of a joint's effort below which what is left there is no matter, whatever it follows: friction is no better
#: known.
EFFORT_NO_MATTER = 0.05
#: Blocks of time below which none can be judged by the others.
FEWEST_EFFORT_BLOCKS = 4
#: Another place or law is as good where it loses less than so many standard errors over blocks, or than this share
#: of the gain while that is no more than such a part of what is left.
EFFORT_ALIKE, EFFORT_CLASS, EFFORT_AS_LITTLE = 2.0, 0.02, 0.5
#: Logarithm of the odds by which another law must be the likelier one to take a law's place, where it is another kind
#: of thing; and by which the less likely is still told as what may be meant.
EFFORT_LIKELIER, EFFORT_UNLIKELY = 3.0, 7.0
#: How likely it is that the tool holds a body, beside any link's being another than drawn; that a body of the robot
#: file is not there, of those. Of a link that is another: heavier or lighter in proportion, its centre elsewhere, or
#: anything at all: what fits neither and could be a body of its own is one sooner.
BODY_HELD, BODY_MISSING = 0.5, 0.1
LINK_IN_PROPORTION, LINK_SHIFTED, LINK_ANYHOW = 0.495, 0.495, 0.01
#: A body that a tool holds: its mass as a share of the robot's, and its radii of gyration as shares of a link's length,
#: each with the standard deviation of its logarithm; the centre is a link's length off the tool.
HELD_MASS, HELD_RADIUS, HELD_SKEW = (0.05, 1.5), (0.25, 0.7), 0.15
#: Share by which a link's mass, inertia and centre (of its radius of gyration) are off where they are anything at all.
ANYHOW = 0.5
#: Share of the efforts beyond which columns may be meant otherwise: one of seven joints whose sign is turned round
#: leaves more. What another reading must leave of that, and of all; and samples below which nothing is said.
EFFORT_STRANGE, EFFORT_MEANT, EFFORT_FEWEST = 0.35, 0.5, 50
#: ... or a third of what is left, where that makes some sense of the efforts.
EFFORT_SENSE: Final = 0.75
#: What each column that is read otherwise must leave of what was left before: one of several that are wrong saves less.
EFFORT_STEP = 0.85
#: Efforts follow those of the rigid robot where their shapes are so much alike. They are suspected to be in another
#: unit where they are so many times larger or smaller at most joints and right at none, for masses may be off as well.
EFFORT_FOLLOWS, EFFORT_APART, EFFORT_RIGHT = 0.8, 1.4, 1.12
#: Drives report in units of their own where free gains save this share of the held-out squares, and at least two of
#: them are so many times beside the others; one alone is a law of its joint. With them the joints, sharing one robot,
#: may leave so many times what each leaves with masses of its own: more is no matter of units.
EFFORT_GAINS_SAVE, EFFORT_GAINS_APART, EFFORT_GAINS_LEAVE = 0.2, 1.1, 2.0
#: How far the logarithms of gains scatter about their middle; and robot files' masses about the true ones where nothing
#: is declared: drawings lack motors, or are of another make.
EFFORT_GAINS, EFFORT_MASSES = 1.0, 0.3
#: Efforts at rest of which so little is left without the robot's weight, as a share of what is left with it, are tared.
EFFORT_TARED = 0.25
#: Efforts of all drives that are so many times the rigid robot's, or fewer, are in another unit: masses are known to
#: tens of per cent. They are in one unit where this share of the drives is no farther than that from the usual one.
EFFORT_UNIT, EFFORT_UNIT_SHARE, EFFORT_OF_A_UNIT = 1.6, 0.6, 1.2
#: Multiples of a joint's limits beyond which its position is not the joint's.
FAR_BEYOND: Final = 3.0

# -- everything off at once --------------------------------------------------------------------------------------------

#: Steps of the whole simulation in which spreads are found; a step below this share of its own uncertainty is the last.
SPREAD_ROUNDS: Final = 12
SPREAD_SETTLED: Final = 0.1
#: Runs without which it is not asked whether the pose sensor stands elsewhere in each, unless that is declared.
FEWEST_STATIONS: Final = 3
#: Freedom of Student's t, with which numbers far off weigh little while nothing is known: few, since some may be gross.
SPREAD_FREEDOM: Final = 3.0


def trusted(squares: np.ndarray) -> np.ndarray:
    """Return weights of three numbers that are off by these squares together, in multiples of their variance."""
    return (SPREAD_FREEDOM + 3) / (SPREAD_FREEDOM + squares)


#: Outliers are those of a load that nobody recorded where that is likelier than errors of a sensor by this logarithm.
LOAD_LIKELIER: Final = 5.0
#: A number so many standard deviations off, by the middle half of all, is gross and left out: normal numbers never are.
OUTLIER: Final = 6.0
#: ... unless they are more than this share: then numbers scatter more widely than their middle half says, and those are
#: gross that lie so far off by all the others ...
MOST_OUTLIERS: Final = 0.1
#: ... but for up to so many where the nearest of them is so many times as far off as the farthest of the others: no law
#: leaves that gap.
MOST_APART: Final = 0.3
APART: Final = 20.0
#: Kinds are taken to be wider than declared where all but this share of what is left is explained by it: what else may
#: be missing is then looked for beside them, and not in their place.
EXPLAINED: Final = 0.1
