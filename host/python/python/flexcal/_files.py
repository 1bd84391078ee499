"""Files that appear whole, and are never overwritten unasked."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from .errors import UsageError

__all__ = ["write_new"]


def write_new(path: str | os.PathLike[str], data: bytes, force: bool) -> Path:
    """Writes `data` to `path`; the name appears when all of it is there."""
    path = Path(path)
    exists = UsageError(f"{path} exists already, and nothing was overwritten", "choose another name, or pass force=True")
    if not force and (path.exists() or path.is_symlink()):
        raise exists
    handle, part = tempfile.mkstemp(prefix=".flexcal-", suffix=".part", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(part, 0o666 & ~umask)
        if force:
            os.replace(part, path)
        else:
            os.link(part, path)  # fails where the name has appeared meanwhile
    except FileExistsError:
        raise exists from None
    finally:
        if os.path.exists(part):
            os.unlink(part)
    return path
