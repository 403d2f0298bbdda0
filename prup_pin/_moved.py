"""Modules that stand elsewhere now: their old names work for one release, with a warning that says the new one."""

from __future__ import annotations

import sys
import warnings
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType

#: Where modules stand now -> where they stood before, without the package's name.
_STOOD: dict[str, str] = {
    "cli.bench_tests": "cli.calibrating cli.diagnosing cli.importing cli.simulating",
    "cli.many_poses": "cli.compensating cli.sweeping",
    "cli.one_pose": "cli.answering cli.pages",
    "cli.options": "cli.question",
    "cli.recorded": "cli.typed_effect views.text.effect_options",
    "cli.robot_files": "cli.catalogue cli.checking cli.examples",
    "cli.typed": "views.text.quantities",
    "diagnosis.diagnosis": "diagnosis.by_recording",
    "diagnosis.efforts.bayes_factors": "diagnosis.efforts.bodies diagnosis.efforts.likelier",
    "diagnosis.efforts.belongs": "diagnosis.efforts.plausible",
    "diagnosis.efforts.evidence": "diagnosis.efforts.beside",
    "diagnosis.efforts.final_state": "diagnosis.efforts.outcome",
    "diagnosis.efforts.identify": "diagnosis.efforts.detectable diagnosis.efforts.rivals",
    "diagnosis.efforts.inertial": "diagnosis.efforts.combinations diagnosis.efforts.consistent",
    "diagnosis.efforts.nuisance": "diagnosis.efforts.width",
    "diagnosis.efforts.outliers": "diagnosis.efforts.stretches",
    "diagnosis.efforts.prepare": "diagnosis.efforts.gather",
    "diagnosis.efforts.problem": "diagnosis.efforts.chosen diagnosis.efforts.columns diagnosis.efforts.normal",
    "diagnosis.efforts.propose": "diagnosis.efforts.judge",
    "diagnosis.efforts.residuals": "diagnosis.efforts.curves",
    "diagnosis.efforts.search": "diagnosis.efforts.relief",
    "diagnosis.efforts.unexplained": "diagnosis.efforts.changing diagnosis.efforts.unknown",
    "diagnosis.efforts.verdict": "diagnosis.efforts.advice diagnosis.efforts.effects",
    "diagnosis.efforts.with_poses": "diagnosis.efforts.at_rest diagnosis.efforts.merged",
    "diagnosis.evidence": "diagnosis.held_out diagnosis.misjudged",
    "diagnosis.identify": "diagnosis.detectable diagnosis.separation",
    "diagnosis.locate": "diagnosis.local_curve diagnosis.recovered",
    "diagnosis.noise": "diagnosis.sensor_noise diagnosis.whiteness",
    "diagnosis.prepare": "diagnosis.asked diagnosis.plausible",
    "diagnosis.problem": "diagnosis.fit",
    "diagnosis.prospects": "diagnosis.before",
    "diagnosis.search": "diagnosis.compete diagnosis.contest diagnosis.screening diagnosis.selection",
    "errors": "diagnosis.limits",
    "imports.columns": (
        "imports.by_unit imports.joint_columns imports.pose_columns imports.time_column imports.wrench_columns"
    ),
    "imports.guess": "imports.map_text",
    "imports.map": "imports.map_file imports.named imports.yaml_keys",
    "imports.matlab": "imports.matlab_elements",
    "imports.motion": "imports.beside imports.carriers imports.clocks imports.nameless",
    "imports.text_table": "imports.stamps",
    "imports.unit_by_numbers": "imports.weight imports.whole_turns",
    "imports.units": "imports.words",
    "laws.joint_places": "laws.loop_places",
    "life.kept": "life.answers",
    "mechanism.checks": "mechanism.beam_ends",
    "mechanism.frames": "mechanism.lengths mechanism.links",
    "mechanism.joints": "mechanism.coupling mechanism.yielding",
    "mechanism.sidecar": "mechanism.joint_types",
    "mechanism.urdf": "mechanism.inertial",
    "mechanism.writer": "mechanism.extension_writer mechanism.plain_urdf",
    "mechanism.xml_file": "mechanism.mesh_paths",
    "recordings.reader": "recordings.remarks",
    "recordings.recording": "recordings.tool_path",
    "recordings.table": "recordings.thinning",
    "review": "views.report.levers",
    "sweep.running": "cli.processes",
    "views.drawing.diagnosis_figures": "views.drawing.effort_figures",
    "views.drawing.figures": "views.drawing.ellipsoid views.drawing.scene_figure",
    "views.drawing.life_figures": "views.drawing.fleet_figures",
    "views.drawing.plotting": "views.drawing.drawing",
    "views.drawing.sweep_figures": "views.drawing.path_figures",
    "views.meshcat.view": "views.meshcat.boundary views.meshcat.server",
    "views.report": "views.notebook",
    "views.report.as_json": "views.report.diagnosis_json",
    "views.report.life_files": "views.report.fleet_files",
    "views.scene.scene": "views.scene.shapes",
    "views.scene.workspace": "views.scene.boundary",
    "views.text.answer": "views.text.tables",
    "views.text.bench_tests": (
        "views.text.calibration_text views.text.diagnosis_text views.text.exported views.text.import_text "
        "views.text.simulation_text"
    ),
    "views.text.diagnosis_words": "views.text.since_words",
    "views.text.life_words": "views.text.fleet_words",
    "views.text.many_poses": "views.text.compensation_text views.text.sweep_text",
    "views.text.one_pose": "views.text.answer_text views.text.sensitivity_text",
    "views.text.robot_files": (
        "views.text.check_text views.text.law_text views.text.prospects_text views.text.robot_text"
    ),
    "views.text.values": "views.text.joints",
    "sweep.engine": "sweep.status",
    "loaded.state": "loaded.rigid_samples",
    "loaded.module_laws": "loaded.values",
    "life.change_points": "life.likelihood",
    "kernel.rank": "kernel.regular",
    "export.export": "export.bodies",
    "sensitivity.sensitivity": "sensitivity.redrawn sensitivity.by_value",
}
#: Old module -> new one.
MOVED = {old: new for new, before in _STOOD.items() for old in before.split()}


class Moved:
    """Finds a moved module by its old name: what is imported is the new one."""

    def find_spec(self, fullname: str, path: object = None, target: object = None) -> ModuleSpec | None:
        package, _, name = fullname.partition(".")
        known = package == __package__ and name in MOVED
        return ModuleSpec(fullname, self) if known else None  # type: ignore[arg-type]  # no Loader by its class

    def create_module(self, spec: ModuleSpec) -> None:
        """Leave it to Python to make a module, which `exec_module` replaces."""

    def exec_module(self, module: ModuleType) -> None:
        old = module.__name__
        new = f"{__package__}.{MOVED[old.partition('.')[2]]}"
        warnings.warn(f"{old} is {new} now; the old name goes with the next release", DeprecationWarning, stacklevel=2)
        sys.modules[old] = import_module(new)
