"""Modules that stand elsewhere now: their old names work for one release, with a warning that says the new one."""

from __future__ import annotations

import sys
import warnings
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType

#: Old module -> new one, both without the package's name.
MOVED: dict[str, str] = {
    "cli.answering": "cli.one_pose",
    "cli.calibrating": "cli.bench_tests",
    "cli.catalogue": "cli.robot_files",
    "cli.checking": "cli.robot_files",
    "cli.compensating": "cli.many_poses",
    "cli.diagnosing": "cli.bench_tests",
    "cli.examples": "cli.robot_files",
    "cli.importing": "cli.bench_tests",
    "cli.pages": "cli.one_pose",
    "cli.processes": "cli.progress",
    "cli.question": "cli.options",
    "cli.simulating": "cli.bench_tests",
    "cli.sweeping": "cli.many_poses",
    "cli.typed_effect": "cli.recorded",
    "diagnosis.asked": "diagnosis.prepare",
    "diagnosis.before": "diagnosis.prospects",
    "diagnosis.by_recording": "diagnosis.diagnosis",
    "diagnosis.compete": "diagnosis.search",
    "diagnosis.contest": "diagnosis.search",
    "diagnosis.detectable": "diagnosis.identify",
    "diagnosis.efforts.advice": "diagnosis.efforts.verdict",
    "diagnosis.efforts.at_rest": "diagnosis.efforts.with_poses",
    "diagnosis.efforts.beside": "diagnosis.efforts.evidence",
    "diagnosis.efforts.bodies": "diagnosis.efforts.bayes_factors",
    "diagnosis.efforts.changing": "diagnosis.efforts.unexplained",
    "diagnosis.efforts.chosen": "diagnosis.efforts.problem",
    "diagnosis.efforts.columns": "diagnosis.efforts.problem",
    "diagnosis.efforts.combinations": "diagnosis.efforts.inertial",
    "diagnosis.efforts.consistent": "diagnosis.efforts.inertial",
    "diagnosis.efforts.curves": "diagnosis.efforts.residuals",
    "diagnosis.efforts.detectable": "diagnosis.efforts.identify",
    "diagnosis.efforts.effects": "diagnosis.efforts.verdict",
    "diagnosis.efforts.gather": "diagnosis.efforts.prepare",
    "diagnosis.efforts.judge": "diagnosis.efforts.propose",
    "diagnosis.efforts.likelier": "diagnosis.efforts.bayes_factors",
    "diagnosis.efforts.merged": "diagnosis.efforts.with_poses",
    "diagnosis.efforts.normal": "diagnosis.efforts.problem",
    "diagnosis.efforts.outcome": "diagnosis.efforts.final_state",
    "diagnosis.efforts.plausible": "diagnosis.efforts.belongs",
    "diagnosis.efforts.relief": "diagnosis.efforts.search",
    "diagnosis.efforts.rivals": "diagnosis.efforts.identify",
    "diagnosis.efforts.stretches": "diagnosis.efforts.outliers",
    "diagnosis.efforts.unknown": "diagnosis.efforts.unexplained",
    "diagnosis.efforts.width": "diagnosis.efforts.nuisance",
    "diagnosis.fit": "diagnosis.problem",
    "diagnosis.held_out": "diagnosis.evidence",
    "diagnosis.limits": "errors",
    "diagnosis.local_curve": "diagnosis.locate",
    "diagnosis.misjudged": "diagnosis.evidence",
    "diagnosis.plausible": "diagnosis.prepare",
    "diagnosis.recovered": "diagnosis.locate",
    "diagnosis.screening": "diagnosis.search",
    "diagnosis.selection": "diagnosis.search",
    "diagnosis.sensor_noise": "diagnosis.noise",
    "diagnosis.separation": "diagnosis.identify",
    "diagnosis.whiteness": "diagnosis.noise",
    "imports.beside": "imports.motion",
    "imports.by_unit": "imports.columns",
    "imports.carriers": "imports.motion",
    "imports.clocks": "imports.motion",
    "imports.joint_columns": "imports.columns",
    "imports.map_file": "imports.map",
    "imports.map_text": "imports.guess",
    "imports.matlab_elements": "imports.matlab",
    "imports.named": "imports.map",
    "imports.pose_columns": "imports.columns",
    "imports.stamps": "imports.text_table",
    "imports.time_column": "imports.columns",
    "imports.weight": "imports.unit_by_numbers",
    "imports.whole_turns": "imports.unit_by_numbers",
    "imports.words": "imports.units",
    "imports.wrench_columns": "imports.columns",
    "imports.yaml_keys": "imports.map",
    "laws.loop_places": "laws.joint_places",
    "life.answers": "life.kept",
    "recordings.remarks": "recordings.reader",
    "recordings.thinning": "recordings.table",
    "mechanism.extension_writer": "mechanism.writer",
    "mechanism.beam_ends": "mechanism.checks",
    "mechanism.coupling": "mechanism.joints",
    "mechanism.links": "mechanism.frames",
    "mechanism.mesh_paths": "mechanism.xml_file",
    "mechanism.plain_urdf": "mechanism.writer",
    "mechanism.yielding": "mechanism.joints",
    "imports.nameless": "imports.motion",
    "views.drawing.scene_figure": "views.drawing.figures",
    "views.meshcat.server": "views.meshcat.view",
    "mechanism.joint_types": "mechanism.sidecar",
    "mechanism.lengths": "mechanism.frames",
    "mechanism.inertial": "mechanism.urdf",
    "recordings.tool_path": "recordings.recording",
    "views.drawing.drawing": "views.drawing.plotting",
    "views.drawing.effort_figures": "views.drawing.diagnosis_figures",
    "views.drawing.ellipsoid": "views.drawing.figures",
    "views.drawing.fleet_figures": "views.drawing.life_figures",
    "views.drawing.path_figures": "views.drawing.sweep_figures",
    "views.meshcat.boundary": "views.meshcat.view",
    "views.notebook": "views.report",
    "views.report.diagnosis_json": "views.report.as_json",
    "views.report.fleet_files": "views.report.life_files",
    "views.report.levers": "review",
    "views.scene.boundary": "views.scene.workspace",
    "views.scene.shapes": "views.scene.scene",
    "views.text.answer_text": "views.text.one_pose",
    "views.text.calibration_text": "views.text.bench_tests",
    "views.text.check_text": "views.text.robot_files",
    "views.text.compensation_text": "views.text.many_poses",
    "views.text.diagnosis_text": "views.text.bench_tests",
    "views.text.effect_options": "cli.recorded",
    "views.text.exported": "views.text.bench_tests",
    "views.text.fleet_words": "views.text.life_words",
    "views.text.import_text": "views.text.bench_tests",
    "views.text.joints": "views.text.values",
    "views.text.law_text": "views.text.robot_files",
    "views.text.prospects_text": "views.text.robot_files",
    "views.text.quantities": "cli.typed",
    "views.text.robot_text": "views.text.robot_files",
    "views.text.sensitivity_text": "views.text.one_pose",
    "views.text.simulation_text": "views.text.bench_tests",
    "views.text.since_words": "views.text.diagnosis_words",
    "views.text.sweep_text": "views.text.many_poses",
    "views.text.tables": "views.text.answer",
}


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
