"""A robot under the inputs of a recording, with any laws switched on."""

from .as_recorded import (
    AsRecorded,
    as_recorded,
    drawn_for,
    foreign_joints,
    in_format,
    misspelt_joints,
    unnamed_positions,
)
from .model_file import CorrectedModel, Known, effect_named, read_model, write_model
from .posterior import Posterior, PosteriorValue
from .prediction import Agreement, Prediction, compare, idle_effects, inputs_of, simulate, trajectory_of
from .simulator import Memory, Run, Simulator
from .stations import seen_from_stations

__all__ = ["CorrectedModel"]
