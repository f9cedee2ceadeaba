"""The errors of this package: one root, and a leaf for each thing a caller can act on."""


class GtbError(Exception):
    """Root of all errors raised on purpose; its text is one clear message for a person."""


class SpecError(GtbError, ValueError):
    """A spec file or one of its values is wrong; the message holds one line per error."""


class DomainError(GtbError, ValueError):
    """Knots without a proper convex hull, arrays of the wrong shape, or parameters outside the domain."""


class ExportError(GtbError, RuntimeError):
    """A mesh cannot be written in the format, or to the place, that was asked for."""


class ToleranceError(GtbError, RuntimeError):
    """A requested accuracy was not reached within the limits given."""


class RequirementError(GtbError, RuntimeError):
    """What was made is right, but does not have a property that was required of it."""
