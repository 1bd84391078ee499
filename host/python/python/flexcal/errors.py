"""What can go wrong, by kind. Every exception carries the message of the library and its advice on what to do.

======================  ==============================================================  =====================
exception               meaning                                                         exit code of `host`
======================  ==============================================================  =====================
`UsageError`            what was asked for does not exist or must not happen            2
`DeviceError`           a file could not be opened or read                              3
`DataError`             the data was read and cannot be used                            4
`NoConvergenceError`    the solver ended without an answer                              5
`InternalError`         a fault of the program                                          1
======================  ==============================================================  =====================
"""

from __future__ import annotations

__all__ = [
    "DataError",
    "DeviceError",
    "FlexcalError",
    "InternalError",
    "NoConvergenceError",
    "UntrustedResult",
    "UsageError",
]


class FlexcalError(Exception):
    """Base of all exceptions of this package.

    Attributes
    ----------
    message : str
        What is wrong, with the number or name that was wrong.
    advice : str or None
        What to do about it.
    """

    def __init__(self, message: str, advice: str | None = None) -> None:
        super().__init__(message, advice)
        self.message = message
        self.advice = advice

    def __str__(self) -> str:
        return self.message if self.advice is None else f"{self.message}\n  help: {self.advice}"


class UsageError(FlexcalError, ValueError):
    """What was asked for does not exist or must not happen."""


class DeviceError(FlexcalError, OSError):
    """A file could not be opened or read."""


class DataError(FlexcalError, ValueError):
    """The data was read and cannot be used."""


class NoConvergenceError(FlexcalError, ArithmeticError):
    """The solver ended without an answer."""


class InternalError(FlexcalError, RuntimeError):
    """A fault of the program."""


class UntrustedResult(UserWarning):
    """There is a result, and it should not be used as it stands: the model does not fit, or the search did not end."""
