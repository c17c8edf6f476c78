"""The one kind of error that a user's input can cause, worded the same way everywhere."""

from __future__ import annotations

from pathlib import Path


class InputError(ValueError):
    """Something the user gave cannot be used; the message says where, what, and what to do.

    Reads `FILE: KEY must MUST, got GOT. REMEDY`, where each part that does not apply is left out.

    Parameters
    ----------
    must : str
        The condition that failed, after the word "must": `"be a rigid pose"`.
    got : object, optional
        The offending value, shortened if it is long.
    file : path, optional
        File or folder as the user named it.
    key : str, optional
        Argument, option or JSON path at fault, as the user typed it: `frames[3].camera.fx`.
    remedy : str, optional
        One sentence in the imperative.
    """

    def __init__(
        self, must: str, *, got: object = None, file: str | Path | None = None, key: str | None = None, remedy: str = ""
    ) -> None:
        self.must, self.got, self.file, self.key, self.remedy = must, got, file, key, remedy
        super().__init__(self._message())

    def _message(self) -> str:
        where = f"{self.file}: " if self.file is not None else ""
        subject = f"{self.key} " if self.key else ("it " if self.file is not None else "")
        got = "" if self.got is None else f", got {_shorten(self.got)}"
        remedy = f" {self.remedy}" if self.remedy else ""
        return f"{where}{subject}must {self.must}{got}.{remedy}"

    def at(self, *, file: str | Path | None = None, key: str | None = None) -> InputError:
        """Return the same error with the place filled in where it is still unknown."""
        return InputError(
            self.must,
            got=self.got,
            file=self.file if self.file is not None else file,
            key=self.key if self.key is not None else key,
            remedy=self.remedy,
        )

    def __reduce__(self) -> tuple[object, ...]:
        # An exception is pickled by its message, which is not what the constructor takes; worker processes need this.
        return _rebuild, (self.must, self.got, self.file, self.key, self.remedy)


def _rebuild(must: str, got: object, file: str | Path | None, key: str | None, remedy: str) -> InputError:
    return InputError(must, got=got, file=file, key=key, remedy=remedy)


def _shorten(value: object, limit: int = 120) -> str:
    text = " ".join(str(value).split()) or repr(value)
    return text if len(text) <= limit else text[: limit - 1] + "…"
