"""`jaxbiped models`: what can be modelled, and what it costs."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import jaxbiped as jb
from jaxbiped._files import JsonObject
from jaxbiped._progress import stage
from jaxbiped._quantity import ParameterInfo
from jaxbiped.cli import _options as options
from jaxbiped.cli._report import Report, columns
from jaxbiped.cli._scene_options import MATCHED, SEED
from jaxbiped.cli._walkers import WALKERS, NamedWalker
from jaxbiped.models import MODELS

_WALKER = {
    "--walker": "{0[0][name]}",
    "states": "{0[0][states]}",
    "operations": "{0[0][operations]}",
    "bodies": "{0[1]}",
    "what it is": "{0[0][words]}",
}
_RUNG = {"rung": "{0[name]}", "states": "{0[states]}", "operations": "{0[operations]}"}


class Models(options.Command):
    """List walkers, laws of contact and the ladder of models, with parameters, units and cost."""

    json: options.JsonPath = None
    """File for the same in JSON; - prints only the JSON."""

    def run(self) -> int:
        from jaxbiped._parameter_declaration import parameter_infos

        seed = jb.seed_scene()
        with stage("counting the operations of every law"):
            numbers: JsonObject = {kind: _laws(seed, kind) for kind in MATCHED}
            numbers["walkers"] = [_walker(seed, name, each) for name, each in WALKERS.items()]
            numbers["actuation"] = [
                {"name": name, "class": kind.__name__, "units": _units(parameter_infos(kind))}
                for name, kind in jb.actuation.ACTUATORS.items()
            ]
            rungs = jb.ladder(seed).items()
            numbers["rungs"] = [{"name": name, **_size(scene)} for name, scene in rungs]
        report = Report(self.json)
        _print(report, numbers)
        report.finish(numbers)
        return 0


def _walker(seed: "jb.Scene", name: str, named: NamedWalker) -> JsonObject:
    """A named walker in its own scene or the seed's, with its parameters."""
    own: Any = MODELS[name].make() if name in MODELS else seed
    scene = dataclasses.replace(own, walker=named.make(seed.walker))
    others = jb.parameter_values(dataclasses.replace(scene, walker=seed.walker))
    others = {each: x for each, x in others.items() if each not in jb.parameter_values(seed.walker)}
    units = jb.parameter_quantities(scene)
    return {
        "name": name,
        "words": named.words,
        "bodies": list(scene.mechanism.structure.bodies),
        **_size(scene),
        "parameters": {
            each: {"value": float(x), "unit": units[each].unit_in_text}
            for each, x in jb.parameter_values(scene).items()
            if each not in others
        },
    }


def _size(scene: Any) -> dict[str, int]:

    return {"states": len(scene.state_type._fields), "operations": _operations(scene)}


def _units(infos: Mapping[str, ParameterInfo]) -> dict[str, str]:
    return {name: info.quantity.unit_in_text for name, info in infos.items()}


def _operations(scene: Any) -> int:
    return sum(jb.measure.operation_counts(scene).values())


def _laws(seed: "jb.Scene", kind: str) -> list[JsonObject]:
    """The laws of a kind, each in the seed's scene with the values of its parameters there."""
    from jaxbiped._parameter_declaration import parameter_infos

    matched: dict[str, Any] = {name: SEED[name].default for name in MATCHED[kind]}
    if kind == "normal":
        matched["mass"] = 2.0 * SEED["m"].default
    found = []
    for name in getattr(jb.laws, f"{kind.upper()}_LAWS"):
        law = getattr(jb.laws, f"{kind}_law_like")(name, **matched)
        parameters = {
            each: {"value": float(getattr(law, each)), "unit": unit}
            for each, unit in _units(parameter_infos(law)).items()
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


def _print(report: Report, numbers: JsonObject) -> None:
    walkers = [(each, ", ".join(each["bodies"])) for each in numbers["walkers"]]
    report.say(columns(_WALKER, walkers))
    for each in numbers["walkers"]:
        report.say(f"parameters of {each['name']}: {_values(each['parameters'])}")
    report.say()
    for kind in MATCHED:
        width = max(len(law["name"]) for law in numbers[kind])
        report.say(f"{'--' + kind:<{width}}  operations  parameters that resemble the seed's law")
        for law in numbers[kind]:
            values = _values(law["parameters"])
            report.say(f"{law['name']:<{width}}  {law['operations']:>10}  {values}")
        report.say()
    width = max(len(part["name"]) for part in numbers["actuation"]) + 2
    report.say(f"{'actuator':<{width}}  parameters")
    for part in numbers["actuation"]:
        units = ", ".join(f"{name} [{unit}]" for name, unit in part["units"].items())
        report.say(f"--{part['name']:<{width - 2}}  {units}")
    report.say("", columns(_RUNG, numbers["rungs"]))
    report.say("operations: of one evaluation of the vector field, equal ones shared")


def _values(parameters: JsonObject) -> str:
    """Parameters with their values and units, in a line."""
    told = (
        f"{name} {each['value']:.4g} {each['unit']}".removesuffix(" –")
        for name, each in parameters.items()
    )
    return ", ".join(told) or "none"
