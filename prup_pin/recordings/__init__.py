"""Recordings of bench tests: the table in memory, its files, and the plan of a test."""

from .beside import read_tolerances
from .conventions import GROUPS, WORDS, Convention, Drawn, convention_of, joints_of, read_as, written_as
from .plan import ActuatorPose, LoadProgramme, RandomPoses, TaskPose, TestPlan, add_noise, read_plan, write_plan
from .problems import KeyProblem, TableProblem
from .reader import read_path, read_recording, robot_named_beside
from .recording import Noise, Recording, ToolPath
from .suspicions import suspicions
from .together import Group, Source, Together
from .tolerances import ARM, KINDS_OF_TOLERANCE, SENSORS, TYPICAL, KindOfTolerance, Tolerances
from .writer import write_prediction, write_recording

# What pages name; the rest is for other rooms.
__all__ = ["Recording", "Tolerances", "read_plan", "read_recording", "suspicions", "write_recording"]
