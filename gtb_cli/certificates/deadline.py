"""How long proofs may take."""

import math
import time

from gtb_cli.errors import ToleranceError


class Uncertified(ToleranceError):
    """Cells cannot be certified, or take too long to."""


class Deadline:
    """Some seconds of the processor, from now on."""

    def __init__(self, seconds: float = math.inf) -> None:
        self.end = time.process_time() + seconds

    def refuse_late(self) -> None:
        """Raise `Uncertified` once they have passed."""
        if time.process_time() > self.end:
            raise Uncertified("takes too long to certify")
