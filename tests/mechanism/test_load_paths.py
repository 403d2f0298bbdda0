"""A beam must lie where its joint's load passes: tied to another link, it would give another K without a word."""

import re
from pathlib import Path

import pytest

import prup_pin
from prup_pin import load
from prup_pin.errors import RobotFileError
from tests.mechanism.test_bad_files import refusal

EXAMPLES = Path(prup_pin.__file__).parent.parent / "examples"
FIVE_BAR = (EXAMPLES / "five_bar.urdf").read_text()


def changed(tmp_path, old, new, text=FIVE_BAR):
    assert old in text
    path = tmp_path / "robot.urdf"
    path.write_text(text.replace(old, new))
    return path


def beams():
    return re.findall(r'<module name="([^"]+)" type="beam" joint="([^"]+)" root="([^"]+)" tip="([^"]+)"', FIVE_BAR)


def test_beams_of_all_examples_are_where_they_belong():
    count = 0
    for path in (*EXAMPLES.glob("*.urdf"), "3prup"):
        mechanism = load(path).mechanism
        for module in mechanism.modules:
            if module.root is not None:
                count += 1
                assert mechanism.load_paths.carries(module.joint, module.root.joint, module.frame.joint)
    assert count > 20


@pytest.mark.parametrize("end", ["root", "tip"])
def test_an_end_on_another_leg_is_refused(tmp_path, end):
    (name, joint, root, tip), *_, (_, _, other_root, other_tip) = beams()
    old = f'name="{name}" type="beam" joint="{joint}" root="{root}" tip="{tip}"'
    wrong = {"root": (other_tip, tip), "tip": (root, other_tip)}[end]
    path = changed(tmp_path, old, f'name="{name}" type="beam" joint="{joint}" root="{wrong[0]}" tip="{wrong[1]}"')
    text = refusal(path)
    assert f"module '{name}': a beam from '{wrong[0]}' to '{wrong[1]}'" in text
    assert "correct joint, root or tip" in text
    assert re.search(r"robot\.urdf:\d+: module", text)
    assert other_root


def test_a_beam_across_a_passive_joint_is_refused(tmp_path):
    (name, joint, root, tip), (_, _, _, beyond), *_ = beams()
    old = f'name="{name}" type="beam" joint="{joint}" root="{root}" tip="{tip}"'
    path = changed(tmp_path, old, old.replace(f'tip="{tip}"', f'tip="{beyond}"'))
    assert "spans the passive joint" in refusal(path) or "does not lie where" in refusal(path)


@pytest.mark.parametrize("swapped", [True, False], ids=["root and tip swapped", "rooted one joint too early"])
def test_a_beam_whose_end_another_joint_turns_away_is_refused(tmp_path, swapped):
    """Drawn right at home, both gave another C at every other pose."""
    (first, joint, root, tip), (second, _, _, end), *_ = beams()
    if swapped:
        path = changed(tmp_path, f'root="{root}" tip="{tip}"', f'root="{tip}" tip="{root}"')
        name, turning = first, joint
    else:
        path = changed(tmp_path, f'root="{tip}" tip="{end}"', f'root="{root}" tip="{end}"')
        name, turning = second, beams()[1][1]
    assert f"module '{name}': a beam from" in refusal(path)
    assert f"spans joint '{turning}', which turns one end away" in refusal(path)


def test_a_joints_own_name_as_an_end_is_told_what_to_name_instead(tmp_path):
    (_, _, root, tip), *_ = beams()
    text = refusal(changed(tmp_path, f'root="{root}" tip="{tip}"', f'root="{root}" tip="left_hinge_at_elbow"'))
    assert "'left_hinge_at_elbow' turns with it: fix a link to 'left_arm' at that place, and name that" in text


def test_loops_and_modules_are_told_in_one_report(tmp_path):
    (name, *_), *_ = beams()
    loop = re.search(r'<loop name="[^"]+" frame1="([^"]+)"', FIVE_BAR)
    text = FIVE_BAR.replace(loop[0], loop[0].replace(loop[1], "nowhere"))
    line = re.search(rf'<module name="{name}".*?<parameter name="([a-z_]+)" value="[^"]+"', text, re.S)
    text = text.replace(line[0], re.sub(r'value="[^"]+"$', 'value="-1"', line[0]))
    path = tmp_path / "robot.urdf"
    path.write_text(text)
    with pytest.raises(RobotFileError) as error:
        load(path)
    told = [problem.message for problem in error.value.problems]
    assert any("no frame named 'nowhere'" in message for message in told)
    assert any(f"{name}.{line[1]}" in message for message in told)
