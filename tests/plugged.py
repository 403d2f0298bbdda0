"""Files and packages that bring something, as tests write them."""

from pathlib import Path
from textwrap import dedent

#: A law of efforts by which a joint's position, cubed, pulls back.
HOSE = dedent('''
    """A hose that is hardly felt about the middle of the travel."""
    from prup_pin.laws.efforts.effort_law import DrivenEffortLaw, in_units
    from prup_pin.parameters import Quantity


    class Hose(DrivenEffortLaw):
        """tau = c q^3."""

        physics = "pulling_hose"
        summary = "a hose that pulls with the cube of the position"
        remedy = "lead the hose at {place} in a wider loop"
        linear = ("cubic",)
        against = "position"
        quantities = (Quantity("cubic", "N m/rad^3", "effort per position cubed", 1.0, False, -1e9, 1e9),)
        neutral = {"cubic": 0.0}

        def quantities_at(self, place, mechanism):
            return in_units(self.quantities, ["N/m^3" if mechanism.joint(place.name).slides else "N m/rad^3"])

        def efforts_per(self, place, values, at):
            return at.along(place.name, at.position(place.name) ** 3)[..., None]


    LAWS = [Hose]
''')


def install(folder: Path, name: str, version: str, points: dict[str, dict[str, str]], modules: dict[str, str]) -> None:
    """Let `folder`, once it is on Python's path, hold an installed package with entry points: as pip leaves it."""
    about = folder / f"{name.replace('-', '_')}-{version}.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
    lines = [
        f"[{group}]\n" + "".join(f"{key} = {value}\n" for key, value in of.items()) for group, of in points.items()
    ]
    (about / "entry_points.txt").write_text("\n".join(lines))
    for module, text in modules.items():
        (folder / f"{module}.py").write_text(text)
