"""The package's only exception."""

from __future__ import annotations


class SastrugiError(Exception):
    """A failure, with the message that the program prints.

    `code` is the exit code that the program would use: 1 failed, 2 bad usage or study, 65 input data missing or unusable, 75 interrupted or
    retryable.

    >>> import sastrugi
    >>> try:
    ...     sastrugi.Heightfield.read("no-such.tif")
    ... except sastrugi.SastrugiError as error:
    ...     print(error, error.code)
    no-such.tif: no such file 65
    """

    def __init__(self, message: str, code: int = 1) -> None:
        super().__init__(message, code)
        self.message = message
        self.code = code

    def __str__(self) -> str:
        return self.message
