"""Public names as guides write them, and the namespaces that they lie in."""

import dataclasses
import types

import jaxbiped as jb


def namespaces():
    """Modules that the top level's map lists, by the names that guides give them."""
    listed = {f"jb.{name}": getattr(jb, name) for name in jb.__all__}
    return {name: each for name, each in listed.items() if isinstance(each, types.ModuleType)}


def find(name):
    """What `jb.a.b` names; of a field of a class, its declaration. AttributeError for nothing."""
    thing = jb
    for part in name.split(".")[1:]:
        fields = {f.name: f for f in dataclasses.fields(thing)} if _has_fields(thing) else {}
        thing = fields[part] if part in fields else getattr(thing, part)
    return thing


def is_there(name):
    """Whether `jb.a.b` names anything."""
    try:
        find(name)
    except AttributeError:
        return False
    return True


def _has_fields(thing):
    return isinstance(thing, type) and dataclasses.is_dataclass(thing)
