"""`jaxbiped models`: what can be modelled, and what it costs."""

import dataclasses
from typing import TYPE_CHECKING, Any

import jaxbiped as jb
from jaxbiped._progress import stage
from jaxbiped.cli import _options as options
from jaxbiped.cli._report import Report, columns
from jaxbiped.cli._scene_options import MATCHED, SEED

if TYPE_CHECKING:
    from jaxbiped._types import JsonObject

_RUNG = {"rung": "{0[name]}", "states": "{0[states]}", "operations": "{0[operations]}"}


class Models(options.Command):
    """List the laws of contact and the ladder of models, with parameters, units and cost."""

    json: options.JsonPath = None
    """File for the same in JSON; - prints only that."""

    def run(self) -> int:
        """Runs the command; returns the exit code."""
        from jaxbiped._parameter_declaration import parameter_infos
        from jaxbiped.dynamics._state import state_type

        seed = jb.seed_scene()
        with stage("counting the operations of every law"):
            numbers: JsonObject = {kind: _laws(seed, kind) for kind in MATCHED}
            numbers["actuation"] = [
                {
                    "name": name,
                    "class": kind.__name__,
                    "units": {
                        each: info.quantity.unit_in_text
                        for each, info in parameter_infos(kind).items()
                    },
                }
                for name, kind in jb.actuation.ACTUATORS.items()
            ]
            numbers["rungs"] = [
                {
                    "name": name,
                    "states": len(state_type(scene)._fields),
                    "operations": _operations(scene),
                }
                for name, scene in jb.ladder(seed).items()
            ]
        report = Report(self.json)
        _print(report, numbers)
        report.finish(numbers)
        return 0


def _operations(scene: Any) -> int:
    return sum(jb.measure.operation_counts(scene).values())


def _laws(seed: "jb.Scene", kind: str) -> "list[JsonObject]":
    """The laws of a kind, each in the seed's scene with the values of its parameters there."""
    from jaxbiped._parameter_declaration import parameter_infos

    matched: dict[str, Any] = {name: SEED[name].default for name in MATCHED[kind]}
    if kind == "normal":
        matched["mass"] = 2.0 * SEED["m"].default
    found = []
    for name in getattr(jb.laws, f"{kind.upper()}_LAWS"):
        law = getattr(jb.laws, f"{kind}_law_like")(name, **matched)
        parameters = {
            each: {"value": float(getattr(law, each)), "unit": info.quantity.unit_in_text}
            for each, info in parameter_infos(law).items()
            if getattr(law, each) is not None
        }
        found.append(
            {
                "name": name,
                "class": type(law).__name__,
                "parameters": parameters,
                "operations": _operations(dataclasses.replace(seed, **{kind: law})),
            }
        )
    return found


def _print(report: Report, numbers: "JsonObject") -> None:
    for kind in MATCHED:
        width = max(len(law["name"]) for law in numbers[kind])
        report.say(f"{'--' + kind:<{width}}  operations  parameters that resemble the seed's law")
        for law in numbers[kind]:
            values = ", ".join(
                f"{name} {each['value']:.4g} {each['unit']}".removesuffix(" –")
                for name, each in law["parameters"].items()
            )
            report.say(f"{law['name']:<{width}}  {law['operations']:>10}  {values or 'none'}")
        report.say()
    width = max(len(part["name"]) for part in numbers["actuation"]) + 2
    report.say(f"{'actuator':<{width}}  parameters")
    for part in numbers["actuation"]:
        units = ", ".join(f"{name} [{unit}]" for name, unit in part["units"].items())
        report.say(f"--{part['name']:<{width - 2}}  {units}")
    report.say("", columns(_RUNG, numbers["rungs"]))
    report.say("operations: of one evaluation of the vector field, equal ones shared")
