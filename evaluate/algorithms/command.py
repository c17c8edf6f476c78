"""Any other flow algorithm: a command that reads two pictures and writes a flow file."""

from __future__ import annotations

import shlex
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from string import Formatter

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError
from scene.flow_files import SUFFIXES, read_flow
from scene.images import write_raw

_FIELDS = ("image0", "image1", "out")


@dataclass(frozen=True)
class FlowCommand:
    """A command line with `{image0}`, `{image1}` and `{out}` in it, run once per pair without a shell.

    Attributes
    ----------
    template : str
        `python raft.py --left {image0} --right {image1} --output {out}`
    suffix : str
        Format of the file that the command writes, as in `read_flow`.

    Raises
    ------
    InputError
        If a place is missing or unknown, or the suffix names no format of flow.
    """

    template: str
    suffix: str = ".flo"

    def __post_init__(self) -> None:
        try:
            found = {name for _, name, _, _ in Formatter().parse(self.template) if name is not None}
            shlex.split(self.template)
        except ValueError as error:
            raise InputError("be a command line", got=self.template, key="--flow-command", remedy=f"{error}.") from error
        if found != set(_FIELDS):
            raise InputError("have the places {image0}, {image1} and {out}", got=self.template, key="--flow-command")
        if self.suffix not in SUFFIXES:
            raise InputError(f"be one of {', '.join(SUFFIXES)}", got=self.suffix, key="--flow-format")

    def __call__(self, image0: NDArray, image1: NDArray) -> NDArray[np.float32]:
        """Return the flow that the command writes; pictures are handed over as PNG, floats as EXR.

        Raises
        ------
        InputError
            If the command cannot be started, fails, or writes no flow of the pictures' size.
        """
        with tempfile.TemporaryDirectory(prefix="meniscus-flow-") as name:
            folder = Path(name)
            suffix = ".exr" if image0.dtype.kind == "f" else ".png"
            places = {"image0": folder / f"0{suffix}", "image1": folder / f"1{suffix}", "out": folder / f"flow{self.suffix}"}
            write_raw(places["image0"], image0)
            write_raw(places["image1"], image1)
            words = [word.format(**{k: str(v) for k, v in places.items()}) for word in shlex.split(self.template)]
            try:
                done = subprocess.run(words, capture_output=True, text=True, check=False)
            except OSError as error:
                raise InputError("be a command that can be started", got=words[0], key="--flow-command") from error
            if done.returncode != 0:
                said = (done.stderr or done.stdout).strip().splitlines()
                got = f"exit code {done.returncode}: {said[-1] if said else 'no message'}"
                raise InputError("succeed", got=got, key="--flow-command")
            if not places["out"].is_file():
                raise InputError("write its flow to {out}", got="no file", key="--flow-command")
            try:
                flow = read_flow(places["out"])
            except InputError as error:
                raise InputError(f"write a flow that {error.must}", got=error.got, key="--flow-command") from error
        if flow.size != image0.shape[:2]:
            raise InputError(f"write a flow of {image0.shape[:2]}", got=flow.size, key="--flow-command")
        return flow.flow
