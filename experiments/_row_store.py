"""Store of rows: a line of JSON for each, by its key, so that a run that was cut off goes on."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any


class RowStore:
    """Rows by key, in the order in which they came: those that a file holds, and new ones.

    Args:
        path: the file; None keeps nothing.
        writer: what rows depend on beside their keys: those of another writer do not count.
    """

    def __init__(self, path: Path | None, **writer: Any) -> None:
        self._path, self._writer = path, writer
        self.rows: dict[str, Any] = {}
        for line in path.read_text().splitlines() if path and path.exists() else ():
            try:
                entry = json.loads(line)
            except json.JSONDecodeError:
                continue  # cut off while it was written
            if entry.get("writer") == writer:
                self.rows[entry["key"]] = entry["row"]

    def row(self, key: str, make: Callable[[], Any]) -> Any:
        """The row of a key, made where there is none yet."""
        if key not in self.rows:
            self.rows[key] = make()
            if self._path is not None:
                self._path.parent.mkdir(parents=True, exist_ok=True)
                entry = {"key": key, "writer": self._writer, "row": self.rows[key]}
                with self._path.open("a") as lines:
                    lines.write(json.dumps(entry) + "\n")
        return self.rows[key]
