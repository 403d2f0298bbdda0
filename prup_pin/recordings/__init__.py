"""Recordings of bench tests: the table in memory, its files, and the plan of a test."""

from .plan import (
    ActuatorPose,
    LoadProgramme,
    RandomPoses,
    TaskPose,
    TestPlan,
    add_noise,
    read_plan,
    write_plan,
)
from .problems import KeyProblem, TableProblem
from .reader import read_recording, read_tolerances
from .recording import Noise, Recording
from .suspicions import suspicions
from .tolerances import KINDS_OF_TOLERANCE, TYPICAL, KindOfTolerance, Tolerances
from .writer import write_prediction, write_recording

__all__ = [
    "KINDS_OF_TOLERANCE",
    "TYPICAL",
    "ActuatorPose",
    "KeyProblem",
    "KindOfTolerance",
    "LoadProgramme",
    "Noise",
    "RandomPoses",
    "Recording",
    "TableProblem",
    "TaskPose",
    "TestPlan",
    "Tolerances",
    "add_noise",
    "read_plan",
    "read_recording",
    "read_tolerances",
    "suspicions",
    "write_plan",
    "write_prediction",
    "write_recording",
]
