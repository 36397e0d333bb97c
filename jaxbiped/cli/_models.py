"""`jaxbiped models`: what can be modelled, and what it costs."""

import dataclasses

from jaxbiped._parameter_declaration import parameter_infos
from jaxbiped._progress import stage
from jaxbiped._types import JsonObject
from jaxbiped.cli._report import Report, table
from jaxbiped.cli.commands._models import Models
from jaxbiped.dynamics._state import state_type
from jaxbiped.measure._operation_counts import operation_counts
from jaxbiped.scene._ready_scenes import ladder, seed_scene
from jaxbiped.scene._scene import RigidScene, Scene
from jaxbiped.scene.actuation._abstract_actuator import AbstractActuator
from jaxbiped.scene.actuation._catalogue import ACTUATORS
from jaxbiped.scene.laws import AbstractBristleLaw, AbstractFrictionLaw, AbstractNormalLaw
from jaxbiped.scene.laws._catalogue import (
    FRICTION_LAWS,
    NORMAL_LAWS,
    friction_law_like,
    normal_law_like,
)

_SEED_NORMAL = dict(K=1e6, c=1e7, n=1.5, mass=2.0)
_SEED_FRICTION = dict(mu_static=0.5, mu_kinetic=0.4, v0=1e-4, xi=1000.0)


def run(options: Models) -> int:
    """Runs the command; returns the exit code."""
    seed = seed_scene()
    with stage("counting the operations of every law"):
        numbers = {
            "normal": [
                _law(name, dataclasses.replace(seed, normal=law), law)
                for name in NORMAL_LAWS
                for law in [normal_law_like(name, **_SEED_NORMAL)]
            ],
            "friction": [
                _law(name, dataclasses.replace(seed, friction=law), law)
                for name in FRICTION_LAWS
                for law in [friction_law_like(name, **_SEED_FRICTION)]
            ],
            "actuation": [_actuator(name, kind) for name, kind in ACTUATORS.items()],
            "rungs": [_rung(name, scene) for name, scene in ladder(seed).items()],
        }
    report = Report(options.json)
    _print(report, numbers)
    report.finish(numbers)
    return 0


def _law(
    name: str, scene: Scene, law: AbstractNormalLaw | AbstractFrictionLaw | AbstractBristleLaw
) -> JsonObject:
    """A law that stands in the seed's scene, with the value of each parameter there."""
    return {
        "name": name,
        "class": type(law).__name__,
        "parameters": {
            name: {"value": float(getattr(law, name)), "unit": info.quantity.unit_in_text}
            for name, info in parameter_infos(law).items()
            if getattr(law, name) is not None
        },
        "operations": sum(operation_counts(scene).values()),
    }


def _actuator(name: str, kind: type[AbstractActuator]) -> JsonObject:
    """An actuator with the units of its parameters."""
    infos = parameter_infos(kind)
    units = {name: info.quantity.unit_in_text for name, info in infos.items()}
    return {"name": name, "class": kind.__name__, "units": units}


def _rung(name: str, scene: Scene | RigidScene) -> JsonObject:
    return {
        "name": name,
        "states": len(state_type(scene)._fields),
        "operations": sum(operation_counts(scene).values()),
    }


def _print(report: Report, numbers: JsonObject) -> None:
    for kind in ("normal", "friction"):
        rows = [
            (law["name"], str(law["operations"]), _format(law["parameters"]))
            for law in numbers[kind]
        ]
        width = max(len(row[0]) for row in rows)
        report.say(f"{'--' + kind:<{width}}  operations  parameters that resemble the seed's law")
        for name, operations, parameters in rows:
            report.say(f"{name:<{width}}  {operations:>10}  {parameters}")
        report.say()
    width = max(len(part["name"]) for part in numbers["actuation"]) + 2
    report.say(f"{'actuator':<{width}}  parameters")
    for part in numbers["actuation"]:
        units = ", ".join(f"{name} [{unit}]" for name, unit in part["units"].items())
        report.say(f"--{part['name']:<{width - 2}}  {units}")
    report.say()
    rungs = [(r["name"], str(r["states"]), str(r["operations"])) for r in numbers["rungs"]]
    report.say(table(("rung", "states", "operations"), rows=rungs, most=len(rungs)))
    report.say("operations: of one evaluation of the vector field, equal ones shared")


def _format(parameters: JsonObject) -> str:
    if not parameters:
        return "none"
    return ", ".join(
        f"{name} {entry['value']:.4g}" + (f" {entry['unit']}" if entry["unit"] != "–" else "")
        for name, entry in parameters.items()
    )
