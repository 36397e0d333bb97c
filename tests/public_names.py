"""Look-up of public names as guides write them."""

import dataclasses

import jaxbiped as jb


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
