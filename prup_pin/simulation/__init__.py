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

__all__ = [
    "Agreement",
    "AsRecorded",
    "CorrectedModel",
    "Known",
    "Memory",
    "Posterior",
    "PosteriorValue",
    "Prediction",
    "Run",
    "Simulator",
    "as_recorded",
    "compare",
    "drawn_for",
    "effect_named",
    "foreign_joints",
    "idle_effects",
    "in_format",
    "inputs_of",
    "misspelt_joints",
    "read_model",
    "seen_from_stations",
    "simulate",
    "trajectory_of",
    "unnamed_positions",
    "write_model",
]
