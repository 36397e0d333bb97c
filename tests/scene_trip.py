"""The trip of a scene through the package: which files it enters in one call of a door.

    python -m tests.scene_trip [-v]

Each door is called in a process of its own in which nothing is compiled yet, so that all that
traces a program of the scene is on its way. A file is entered when a function of it is called from
another file with a scene among its arguments. A climb is an entry into a file that lies above the
caller's: one that imports it, directly or not. An entry into a file that was entered before is a
return.
"""

import json
import os
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import jaxbiped as jb
from jaxbiped.scene._scene import AbstractScene
from tests.import_graph import imports_of

ROOT = Path(jb.__file__).parent
DOORS = {
    "simulate": lambda: jb.simulate(jb.seed_scene(), jb.seed_state(), duration=0.1, save="end"),
    "find_gait": lambda: jb.find_gait(jb.seed_scene(slope=0.02)),
    "labelling": lambda: jb.labelling(jb.seed_scene(slope=0.02)),
}


def imports():
    """The files of the package that each file of it imports."""
    found = {}
    for path in sorted(ROOT.rglob("*.py")):
        names = (name.split(".") for name in imports_of(path))
        paths = (ROOT.parent.joinpath(*name).with_suffix(".py") for name in names)
        found[str(path)] = {str(each) for each in paths if each.exists()}
    return found


def above(graph):
    """The files that each file lies above."""
    known = {}

    def of(path, open_):
        if path not in known:
            below = set()
            for each in graph.get(path, ()):
                if each not in open_:
                    below |= {each} | of(each, open_ | {each})
            known[path] = below
        return known[path]

    return {path: of(path, {path}) for path in graph}


class Trip:
    """Entries of a scene into files while something runs."""

    def __init__(self):
        self.entries = []

    def watch(self, frame, event, _):
        if event != "call" or frame.f_back is None:
            return
        here, there = frame.f_back.f_code.co_filename, frame.f_code.co_filename
        if here == there or not there.startswith(str(ROOT)) or not here.startswith(str(ROOT)):
            return
        code = frame.f_code
        given = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
        if any(isinstance(frame.f_locals.get(name), AbstractScene) for name in given):
            self.entries.append((here, there))

    def run(self, door):
        threading.setprofile(self.watch)
        sys.setprofile(self.watch)
        try:
            door()
        finally:
            sys.setprofile(None)
            threading.setprofile(None)

    def counts(self, below):
        """Files entered, climbs and returns."""
        seen, returns, climbs = set(), 0, 0
        for here, there in dict.fromkeys(self.entries):
            climbs += here in below.get(there, ())
            returns += there in seen
            seen.add(there)
        return len(seen), climbs, returns


def trip_through(name):
    """The entries of a scene through a door, in a process with nothing compiled or kept."""
    with tempfile.TemporaryDirectory() as nothing_kept:
        place = os.environ | {"JAXBIPED_CACHE": nothing_kept}
        command = [sys.executable, "-m", "tests.scene_trip", name]
        told = subprocess.run(command, env=place, check=True, capture_output=True, text=True)
    trip = Trip()
    trip.entries = [tuple(entry) for entry in json.loads(told.stdout)]
    return trip


def main():
    below = above(imports())
    print(f"{'door':12s} files climbs returns")
    for name in DOORS:
        trip = trip_through(name)
        files, climbs, returns = trip.counts(below)
        print(f"{name:12s} {files:5d} {climbs:6d} {returns:7d}")
        if "-v" in sys.argv:
            for here, there in dict.fromkeys(trip.entries):
                print("   ", *(str(Path(each).relative_to(ROOT)) for each in (here, there)))


if __name__ == "__main__":
    if sys.argv[-1] in DOORS:
        own = Trip()
        own.run(DOORS[sys.argv[-1]])
        print(json.dumps(own.entries))
    else:
        main()
